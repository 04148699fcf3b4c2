"""Rows that cannot be read: each is named with its line, or left out with a warning, and none vanishes."""

import warnings

import numpy as np
import pytest
from support.exports import book, put
from support.refusals import refused

import fitting
import rubberfric as rf

# Title line of an export.
TITLES = "v [m/s],mu,p [Pa],T [K]\n"
# Title and unit lines of our own files.
OWN = "v,mu,p,T\nm/s,-,Pa,K\n"
GOOD = ["0.01,0.6,2e5,293", "0.02,0.7,2e5,293"]
# Rows in place of 0.015,0.65,2e5,293.
BAD = [
    '"0.015,0.65,2e5,293"',
    '"0.015,0.65,2e5,293',
    '"0.015,0.65",2e5,293',
    "'0.015','0.65','2e5','293'",
    "0.015;0.65;2e5;293",
    "0.015;x;2e5;293",
    "0.015\t0.65\t2e5\t293",
    "0.015|0.65|2e5|293",
    "0.015 0.65 2e5 293",
    "0,015;0,65;200000;293",
    "#N/A,0.65,2e5,293",
    "#DIV/0!,0.65,2e5,293",
    "#WERT!,0.65,2e5,293",
    "#####,0.65,2e5,293",
    "#N/A,#N/A,#N/A,#N/A",
    "abc,0.65,2e5,293",
    ",0.65,2e5,293",
    "NaN,0.65,2e5,293",
    "inf,0.65,2e5,293",
    "0.015 m/s,0.65,2e5,293",
    "0.015,--,2e5,293",
    "0.015,0.65,2e5,#REF!",
    "x,0.65,2e5",
    "err,0.65",
    "0.015,0.65,2e5",
    "0.015,0.65,2e5,293,7",
    "0.015," + "x" * 140_000 + ",2e5,293",  # longer than a field of the csv module
    "Mean,0.65,2e5,293",
]


@pytest.mark.parametrize("head", [TITLES, OWN], ids=["export", "own"])
@pytest.mark.parametrize("row", BAD, ids=lambda row: row[:24])
def test_a_row_that_cannot_be_read_is_named_or_left_out(tmp_path, head, row):
    path = put(tmp_path, head + "\n".join([GOOD[0], row, GOOD[1]]) + "\n")
    line = head.count("\n") + 2
    message = refused(path, lambda: fitting.read(path))
    assert f": line {line}: " in message and message.endswith('bad_rows="drop" leaves out such rows')
    assert len(message) < 500
    with pytest.warns(UserWarning, match=f"1 of 3 rows have bad values and are left out: line {line}$"):
        data = fitting.read(path, bad_rows="drop")
    np.testing.assert_array_equal([data.velocity, data.friction], [[0.01, 0.02], [0.6, 0.7]])


@pytest.mark.parametrize("row", ['"0.01,0.6,2e5,293"', "#N/A,#N/A,#N/A,#N/A", "#N/A,0.6,2e5,293"])
def test_a_bad_row_below_the_titles_is_no_row_of_units(tmp_path, row):
    path = put(tmp_path, TITLES + "\n".join([row, *GOOD]) + "\n")
    assert "line 2: " in refused(path, lambda: fitting.read(path))


@pytest.mark.parametrize("row", ["#N/A 0.65", '"0.015,0.65"', "x,0.65", "0.015;0.65;3"])
def test_rows_of_a_table_without_titles(tmp_path, row):
    path = put(tmp_path, f"# a note\n0.01 0.6\n{row}\n0.02 0.7\n")
    columns = ["v [m/s]", "mu [-]"]
    assert "line 3: " in refused(path, lambda: fitting.read(path, columns=columns, pressure=1e5))
    path = put(tmp_path, "a,0.01,0.6\nb,0.02,0.7\n")  # the first column is not read
    data = fitting.read(path, columns=["-", *columns], pressure=1e5)
    np.testing.assert_array_equal(data.friction, [0.6, 0.7])


@pytest.mark.parametrize("sign", ["0.015;0.65;2;20", "1.000,5;0,65;2;20"])
def test_another_decimal_sign_in_one_row(tmp_path, sign):
    text = f"v [m/s];mu;p [bar];T [°C]\n0,01;0,6;2;20\n{sign}\n0,02;0,7;2;20\n"
    path = put(tmp_path, text)
    assert "has a decimal point, others a comma" in refused(path, lambda: fitting.read(path))
    with pytest.warns(UserWarning, match="line 3$"):
        assert len(fitting.read(path, bad_rows="drop")) == 2


NOTES = ["\n\n", "# end\n", "# 0.03,0.9,2e5,293\n", "Operator: A. B.\n", "Samples,3\n", ",,,\n"]
NOTES += ["---,---,---,---\n", "end of the measurement\n", "Date: 01.02.2024\n"]


@pytest.mark.parametrize("note", NOTES)
def test_notes_below_a_table_are_no_rows(tmp_path, note):
    path = put(tmp_path, TITLES + "\n".join(GOOD) + "\n" + note)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(fitting.read(path).velocity, [0.01, 0.02])


def test_preambles_of_later_steps_are_no_rows(tmp_path):
    step = "Frequency\tStorage modulus\tLoss modulus\tNote\nHz\tMPa\tMPa\t\n{}\t5\t1\t\n"
    between = "\n[step]\nSize\t10\t20\nNumber of points\t1\n"
    path = put(tmp_path, step.format(1) + between + step.format(2))
    np.testing.assert_allclose(fitting.read(path).omega, [2 * np.pi, 4 * np.pi])
    path = put(tmp_path, step.format(1) + between + step.format(2).replace("MPa\tMPa", "Pa\tPa"))
    message = refused(path, lambda: fitting.read(path))
    assert "line 9: unit 'Pa' contradicts 'MPa' of column 'Storage modulus'" in message


# --- units in titles and below


@pytest.mark.parametrize(
    ("row", "named"),
    [
        ("mm/s,-,MPa,°C", ("'mm/s'", "'m/s'", "'v [m/s]'")),
        ("m/s,,kPa,K", ("'kPa'", "'Pa'", "'p [Pa]'")),
        ("m/s,-,atm,K", ("'atm'", "'Pa'", "'p [Pa]'")),
        ("[m/s],[-],[Pa],[°C]", ("'[°C]'", "'K'", "'T [K]'")),
    ],
)
def test_a_row_of_units_that_contradicts_the_titles(tmp_path, row, named):
    path = put(tmp_path, TITLES + "\n".join([row, *GOOD]) + "\n")
    message = refused(path, lambda: fitting.read(path))
    assert "line 2: unit " in message and all(text in message for text in named)


@pytest.mark.parametrize(
    "row", ["m/s,-,Pa,K", "m s-1,-,N/m²,Kelvin", "[m/s],[-],[Pa],[K]", "m/s,1,Pa,K", "m/s,,,"]
)
def test_a_row_of_units_that_repeats_the_titles(tmp_path, row):
    path = put(tmp_path, TITLES + "\n".join([row, *GOOD]) + "\n")
    np.testing.assert_array_equal(fitting.read(path).pressure, [2e5, 2e5])


def test_brackets_without_a_unit_contradict_nothing(tmp_path):
    text = "Frequency\tStorage modulus\tLoss modulus\tOscillation strain (cmd)\nHz\tMPa\tMPa\t%\n1\t5\t1\t2\n"
    np.testing.assert_allclose(fitting.read(put(tmp_path, text)).storage, 5e6)


def test_units_of_traces_that_contradict_the_titles(tmp_path):
    path = put(tmp_path, "x [mm];z [mm]\nmm;um\n0;1\n1;2\n")
    assert "unit 'um' below contradicts the title" in refused(path, lambda: rf.io.read_traces(path))


# --- blocks of columns


def test_runs_in_the_row_of_units(tmp_path):
    rows = [
        ["Reibwerte, trocken"],
        ["Geschwindigkeit", "Druck", "Temperatur", "Reibwert", "Reibwert", "Reibwert", "Bemerkung"],
        ["mm/s", "bar", "°C", "Lauf 1", "Lauf 2", "Lauf 3", None],
        [0.1, 3, 23, 0.9, 0.957, None, "Lauf 3 fehlt"],
        [0.5, 3, 23, 1.13, 1.083, 1.032, None],
    ]
    data = fitting.read(book(tmp_path, "table.xlsx", {"rows": rows}))
    np.testing.assert_allclose(data.friction, [0.9, 1.13, 0.957, 1.083, 1.032])
    np.testing.assert_allclose(data.velocity, [1e-4, 5e-4, 1e-4, 5e-4, 5e-4])
    np.testing.assert_allclose(data.pressure, 3e5)
    path = put(tmp_path, "v;mu;mu\nmm/s;0.2 MPa;0.4 MPa\n1;0.5;0.6\n")
    np.testing.assert_allclose(fitting.read(path).pressure, [2e5, 4e5])


COMPARED = (
    "#EXPORTTYPE:\tDATA COMPARE\tDATA COMPARE\n#SAMPLE:\tmix A\tmix B\n\n"
    "##Temp./°C\tE'/MPa(10.000 Hz)\tE''/MPa(10.000 Hz)\tE'/MPa(10.000 Hz)\tE''/MPa(10.000 Hz)\n"
    "20.000\t5.18738\t1.38413\t6.22486\t1.79938\n24.000\t4.67940\t1.14082\t5.61528\t1.48306\n"
)


@pytest.mark.parametrize("titles", ["one temperature", "two temperatures"])
def test_samples_beside_each_other(tmp_path, titles):
    second = titles == "two temperatures"
    text = COMPARED
    if second:
        text = text.replace("(10.000 Hz)\tE'/", "(10.000 Hz)\tTemp./°C\tE'/")
        text = text.replace("\t6.2", "\t21.000\t6.2").replace("\t5.6", "\t25.000\t5.6")
    path = put(tmp_path, text)
    message = refused(path, lambda: fitting.read(path))
    assert message.endswith("or choose one with block=1 to 2")
    for block, storage, loss, T in (
        (1, [5.18738e6, 4.67940e6], [1.38413e6, 1.14082e6], [293.15, 297.15]),
        (2, [6.22486e6, 5.61528e6], [1.79938e6, 1.48306e6], [293.15 + second, 297.15 + second]),
    ):
        data = fitting.read(path, block=block)
        np.testing.assert_allclose([data.storage, data.loss, data.temperature], [storage, loss, T])
        np.testing.assert_allclose(data.omega, 20 * np.pi)


def test_numbers_of_blocks_that_do_not_exist(tmp_path):
    path = put(tmp_path, COMPARED)
    for block in (0, 3, "a", True):
        assert "must be a whole number from 1 to 2" in refused(
            path, lambda b=block: fitting.read(path, block=b)
        )
    path = put(tmp_path, TITLES + "\n".join(GOOD) + "\n")
    assert "no columns have equal titles" in refused(path, lambda: fitting.read(path, block=1))


def test_the_frequency_of_a_table_without_frequencies(tmp_path):
    path = put(tmp_path, COMPARED)
    columns = ["T [°C]", "E_stor [MPa]", "E_loss [MPa]", "-", "-"]
    data = fitting.read(path, columns=columns)  # the titles state 10 Hz
    np.testing.assert_allclose(data.omega, [20 * np.pi] * 2)
    np.testing.assert_allclose(data.storage, [5.18738e6, 4.67940e6])
    path = put(tmp_path, "f,E_stor,E_loss\nHz,Pa,Pa\n1,1e6,1e5\n")
    assert "frequency = 2.0: must not be given; the file has it" in refused(
        path, lambda: fitting.read(path, frequency=2.0)
    )
    path = put(tmp_path, TITLES + "\n".join(GOOD) + "\n")
    assert "friction data have none" in refused(path, lambda: fitting.read(path, frequency=2.0))


def test_messages_recommend_what_the_interface_has(tmp_path):
    """Scene files have a key for bad rows, and `read_friction` has no option for them."""
    put(tmp_path, "f,E_stor,E_loss\nHz,MPa,MPa\n1,5,1\n2,x,1\n", "moduli.csv")
    scene = put(
        tmp_path,
        'lower.material = {kind = "rigid"}\nupper.material = {kind = "tabulated", file = "moduli.csv"}\n',
        "scene.toml",
    )
    message = refused(tmp_path / "moduli.csv", lambda: rf.load_scene(scene))
    assert "line 4: E_stor = 'x': must be a number" in message and 'bad_rows="drop"' in message
    scene.write_text(scene.read_text().replace('"moduli.csv"', '"moduli.csv", bad_rows = "drop"'))
    put(tmp_path, "f,E_stor,E_loss\nHz,MPa,MPa\n1,5,1\n2,x,1\n3,6,1\n", "moduli.csv")
    with pytest.warns(UserWarning, match="line 4"):
        np.testing.assert_allclose(rf.load_scene(scene).upper.material.storage, [5e6, 6e6])
    path = put(tmp_path, OWN + "\n".join([*GOOD, "#N/A,0.65,2e5,293"]) + "\n")
    message = refused(path, lambda: rf.io.read_friction(path))
    assert "line 5: " in message and "bad_rows" not in message
