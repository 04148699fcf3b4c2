"""Exports in the styles of instruments and laboratories: units, labels, spreadsheets, messages."""

import json

import numpy as np
import pytest
from support.exports import book, put
from support.refusals import refused

import fitting
from fitting import read
from rubberfric.io.columns import known_name

HZ = 2 * np.pi  # [rad/s]
PSI = 6894.757293168361  # lbf/in^2 [Pa]
ZERO = 273.15  # 0 °C [K]


def sheets(folder, *rows):
    return book(folder, "book.xlsx", {f"sheet {number}": some for number, some in enumerate(rows)})


# --- titles and units


@pytest.mark.parametrize(
    ("title", "name", "unit"),
    [
        ("E'/MPa", "E_stor", "MPa"),
        ("E'' / MPa", "E_loss", "MPa"),
        ("Temp./°C", "T", "°C"),
        ("Temp., °C", "T", "°C"),
        ("Speichermodul in MPa", "E_stor", "MPa"),
        ("Freq Hz", "f", "Hz"),
        ("Freq", "f", None),
        ("lg(f/Hz)", "log10_f", "Hz"),
        ("A/A0", "A_over_A0", None),
        ("E'/E''", None, None),
        ("Storage modulus (E') [MPa]", "E_stor", "MPa"),
        ("Storage modulus (G') [MPa]", "G_stor", "MPa"),
        ("Temperature (T) / °C", "T", "°C"),
        ("Temperature (C)", "T", "C"),
        ("Storage modulus (E'') [MPa]", None, None),
        ("mu 1", None, None),
        ("Shear modulus (elastic component) (Pa)", "G_stor", "Pa"),
        ("Shear modulus (viscous component) (Pa)", "G_loss", "Pa"),
        ("E'' psi", "E_loss", "psi"),
        ("Temp °F", "T", "°F"),
        ("Time (s)", "t", "s"),
        ("Step time [min]", "t_step", "min"),
        ("side force coefficient [-]", "mu", "-"),
        ("Seitenkraftbeiwert", "mu", None),
        ("Geschwindigkeit [km/h]", "v", "km/h"),
        ("Last [N]", "F_n", "N"),
        ("time (t) / s", "t", "s"),
        ("Zeit in h", "t", "h"),
        ("Relaxation modulus E(t) [MPa]", "E_relax", "MPa"),
        ("Module de perte G'' (Pa)", "G_loss", "Pa"),
        ("Loss modulus E' (Pa)", None, None),
        ("Relaxation modulus (E(t)) [MPa]", "E_relax", "MPa"),
        ("G(t) [Pa]", "G_relax", "Pa"),
        ("Relaxationsmodul/MPa", "E_relax", "MPa"),
        ("Kriechnachgiebigkeit in 1/MPa", "D_creep", "1/MPa"),
        ("J(t) [1/Pa]", "J_creep", "1/Pa"),
        ("T min", None, None),
        ("mu min", None, None),
    ],
)
def test_titles(title, name, unit):
    assert known_name(title) == (name, unit)


def test_titles_in_shear():
    assert known_name("Creep compliance [1/Pa]", "G") == ("J_creep", "1/Pa")
    assert known_name("Relaxation modulus [Pa]", "G") == ("G_relax", "Pa")


UNITS = {  # unit row or units in titles: f, E', E'', T of one point in SI
    "f;E';E'';T\n[Hz];[MPa];[MPa];[°C]\n2;5;1;20": (2 * HZ, 5e6, 1e6, 293.15),
    "Freq;E';E'';T\n(Hz);(psi);(psi);(°F)\n2;700;100;68": (2 * HZ, 700 * PSI, 100 * PSI, 293.15),
    "f [Hz];E' [ksi];E'' [dyn/cm²];T [degF]\n2;1;1e7;-40": (2 * HZ, 1e3 * PSI, 1e6, 233.15),
    "#INSTRUMENT:;DMA\n##Temp./°C;f/Hz;E'/MPa;E''/MPa;dL/µm\n20;2;5;1;7": (2 * HZ, 5e6, 1e6, 293.15),
    "  Index     f      M'      M''     Ts\n  [Hz]   [MPa]   [MPa]   [°C]\n   1   2   5   1   20": (
        *(2 * HZ, 5e6, 1e6, 293.15),
    ),
}


@pytest.mark.parametrize("text", UNITS)
def test_units(tmp_path, text):
    data = read(put(tmp_path, text + "\n"))
    found = [*data.omega, *data.storage, *data.loss, *data.temperature]
    np.testing.assert_allclose(found, UNITS[text], rtol=1e-12)


def test_a_comment_with_two_signs_does_not_turn_a_table_of_the_project_into_an_export(tmp_path):
    path = put(tmp_path, "## f, E_stor and E_loss\nf,E_stor,E_los\nHz,MPa,MPa\n1,5,1\n")
    assert "column 'E_los': did you mean 'E_loss'" in refused(path, lambda: read(path, kind="modulus"))


# --- several runs or temperatures in a row

TWO = ([HZ, 2 * HZ] * 2, [5e6, 6e6, 4e6, 5e6], [1e6, 1e6, 5e5, 5e5], [ZERO + 20] * 2 + [ZERO + 40] * 2)
ROWS = [[1, 5, 1, 1, 4, 0.5], [2, 6, 1, 2, 5, 0.5]]


@pytest.mark.parametrize("titles", ["above", "inside", "moduli", "shared"])
def test_temperatures_beside_each_other(tmp_path, titles):
    names, rows = ["f [Hz]", "E' [MPa]", "E'' [MPa]"], ROWS
    if titles == "above":  # a sheet with merged cells
        head = [["Project 7"], ["T = 20 °C", None, None, "40 °C", None, None], names * 2]
    elif titles == "inside":
        head = [[name.replace(" ", f" {T} °C ") for T in (20, 40) for name in names]]
    elif titles == "moduli":  # labels of moduli only, and an empty column
        cold, warm = (["f [Hz]", f"E' {T} °C [MPa]", f"E'' {T} °C [MPa]"] for T in (20, 40))
        head = [[*cold, None, *warm]]
        rows = [[*row[:3], None, *row[3:]] for row in ROWS]
    else:
        head, rows = [["f/Hz", *(f"{m}({T},0 °C)/MPa" for T in (20, 40) for m in ("E'", "E''"))]], []
        rows = [[row[0], *row[1:3], *row[4:]] for row in ROWS]
    data = read(sheets(tmp_path, head + rows))
    np.testing.assert_allclose([data.omega, data.storage, data.loss, data.temperature], TWO, rtol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "v [mm/s];mu, 0.2 MPa;mu, 0.4 MPa;Note\n1;0.5;0.4;a\n2;0.6;;b\n",
        # a linear friction tester
        "Gleitgeschwindigkeit [mm/s];Reibwert bei 0,2 MPa;Reibwert bei 0,4 MPa\n1;0,5;0,4\n2;0,6;\n",
    ],
)
def test_a_shorter_block_ends_earlier(tmp_path, text):
    data = read(put(tmp_path, text))
    np.testing.assert_allclose(data.velocity, [1e-3, 2e-3, 1e-3])
    np.testing.assert_allclose([data.friction, data.pressure], [[0.5, 0.6, 0.4], [2e5, 2e5, 4e5]])


def test_labels_of_runs_and_frequencies(tmp_path):
    path = put(tmp_path, "v [mm/s];Reibwert Lauf 1;Reibwert Lauf 2\n1;0.5;0.4\n2;0.6;0.7\n")
    data = read(path, pressure=1e5)
    np.testing.assert_allclose(data.friction, [0.5, 0.6, 0.4, 0.7])
    assert data.temperature is None
    path = put(tmp_path, "Temp./°C;E'(1 Hz)/MPa;E''(1 Hz)/MPa\n20;5;1\n40;4;0.5\n")
    data = read(path)
    np.testing.assert_allclose(data.omega, [HZ, HZ])
    np.testing.assert_allclose(data.temperature, [ZERO + 20, ZERO + 40])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "f [Hz];E' [MPa];E'' [MPa];f [Hz];E' [MPa];E'' [MPa]\n1;5;1;1;4;1\n",
            "or write what differs, such as",
        ),
        ("dry;;wet;\nf [Hz];E' [MPa];f [Hz];E' [MPa]\n1;5;1;4\n", "both hold omega: must be only one"),
        ("v [mm/s];mu 20 °C;mu 20 °C\n1;.5;.6\n", "both hold mu"),
        ("v [mm/s];mu -300 °C;mu 20 °C\n1;.5;.6\n", "line 2: label [K] = '-26.85': must be > 0 K"),
        (
            "Temperature;20 °C;;\n;f;E';E''\n;Hz;MPa;MPa\n1;1;5;1\n",
            "column Temperature: unit '-': must be one of K",
        ),
        ("f [Hz];E' [MPa];E'' [MPa];T run 1 [°C];T run 2 [°C]\n1;5;1;20;21\n", None),
        ("f [Hz];E' 20 °C [MPa];E'' 20 °C [MPa];E' 40 °C [Pa];E'' 40 °C [Pa]\n1;5;1;4;1\n", "the same units"),
    ],
)
def test_blocks_that_do_not_say_what_differs(tmp_path, text, message):
    path = put(tmp_path, text)
    if message is None:  # two sensors are no reason to count the moduli twice
        assert read(path).temperature is None
    else:
        assert message in refused(path, lambda: read(path))


# --- spreadsheets

TITLES = ["f [Hz]", "E' [MPa]", "E'' [MPa]"]


@pytest.mark.parametrize("column", range(3))
@pytest.mark.parametrize("cell", [None, "n/a", "#DIV/0!", "#N/A", "x", True, "=B3*0.2"])
def test_cells_that_are_no_numbers(tmp_path, cell, column):
    bad = [2, 6, 1]
    bad[column] = cell
    path = sheets(tmp_path, [TITLES, [1, 5, 1], bad, [3, 7, 1]])
    message = refused(path, lambda: read(path))
    assert f"line 3: {TITLES[column]} = " in message and "must be" in message
    assert ("save the formula's value" in message) == (cell == "=B3*0.2")
    with pytest.warns(UserWarning, match="1 of 3 rows have bad values and are left out: line 3"):
        np.testing.assert_allclose(read(path, bad_rows="drop").storage, [5e6, 7e6])


def test_formulas_without_values(tmp_path):
    path = sheets(tmp_path, [TITLES, [1, 5, "=B2*0.2"], [2, 6, "=B3*0.2"]])
    assert "save the formula's value" in refused(path, lambda: read(path, bad_rows="drop"))
    path = sheets(tmp_path, [TITLES, ["=1", "=5", "=B2*0.2"]])
    assert "no sheet has numbers; formulas must have stored values" in refused(path, lambda: read(path))


def test_merged_titles(tmp_path):
    head = [["Frequency", "Modulus", None, "Temp"], [None, "E'", "E''", None], ["Hz", "MPa", "MPa", "°C"]]
    data = read(sheets(tmp_path, [["Sample", "tread"], *head, [1, 5, 1, 20], [2, 6, 1, 20]]))
    np.testing.assert_allclose([data.storage, data.temperature], [[5e6, 6e6], [ZERO + 20] * 2])


def test_a_sheet_for_each_step(tmp_path):
    """The sheet with details of the sample has numbers, too, but no table."""
    details = [["Sample", "tread"], ["Length", 17.5, "mm"], ["Width", 6.1, "mm"], ["Operator", "A. B."]]
    titles = ["Oscillation frequency", "Storage modulus", "Loss modulus", "Tan(delta)", "Temperature"]
    head = [titles, ["Hz", "MPa", "MPa", None, "°C"]]
    steps = [
        [[f"Frequency sweep - {n}"], *head, [1, 5 + n, 1, 0.1, 20 * n], [2, 6 + n, 1, 0.1, 20 * n]]
        for n in (1, 2)
    ]
    other = [["A [mm]", "B [mm]"], [1, 2], [3, 4]]
    path = sheets(tmp_path, details, *steps, other)
    with pytest.warns(UserWarning, match="sheet 1, sheet 2 are read as one table, and not sheet 3; delete"):
        data = read(path)
    np.testing.assert_allclose(data.storage, [6e6, 7e6, 7e6, 8e6])
    np.testing.assert_allclose(data.temperature, [ZERO + 20, ZERO + 20, ZERO + 40, ZERO + 40])
    path = sheets(tmp_path, steps[0], other)
    with pytest.warns(UserWarning, match=r"the sheet sheet 0 is read, and not sheet 1; delete sheets"):
        np.testing.assert_allclose(read(path).storage, [6e6, 7e6])


# --- messages


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("a;E';c;d;e\n1;2;3;4;5;6;7\n2;2;3;4;5;6;7\n", ["?"] * 7),
        ("a;E' [MPa];c\n1;2;3\n1;2;3;4;5\n", ["?", "E_stor [MPa]", "?", "?", "?"]),
        ("E'/MPa;b;note\n1;2;first\n3;4;second\n", ["E_stor [MPa]", "?", "?"]),
        ("##Temp./K;b;c\n1;2;3\n3;4;5\n", ["T [K]", "?", "?"]),
    ],
)
def test_suggested_columns_have_as_many_entries_as_the_widest_row(tmp_path, text, columns):
    path = put(tmp_path, text)
    assert json.loads(refused(path, lambda: read(path)).rpartition("columns=")[2]) == columns


def test_fields_missing_at_the_end_of_columns_that_are_not_read(tmp_path):
    path = put(tmp_path, "a;b;c;d\n1;2;3\n2;3;4;first;second\n")
    titles = [*TITLES, "-", "-"]
    np.testing.assert_allclose(read(path, columns=titles).storage, [2e6, 3e6])
    assert "line 2: has 3 fields: must have 5" in refused(
        path, lambda: read(path, columns=[*titles[:3], "-", "T [K]"])
    )


# --- selection of conditions


def test_selected_temperatures():
    data = fitting.ModulusData([1, 2, 3], [5e6, 6e6, 7e6], [1e6] * 3, temperature=[280, 290, 300], name="a")
    part = data.selected(temperature=(285, None), omega=(1.0, 2.5))
    assert (part.storage, part.temperature, part.name) == ([6e6], [290], "a")
    assert len(data.selected(temperature=(None, 290))) == 4
    for ranges, message in (
        ({"pressure": (1, 2)}, "ModulusData has no pressure: must be one of omega, temperature"),
        ({"omega": (2, 1)}, r"omega = \(2, 1\): must be \(lowest, highest\), with lowest <= highest"),
        ({"omega": 2.0}, r"omega = 2.0: must be \(lowest, highest\)"),
        ({"temperature": (400, 500)}, "in these ranges; must overlap with temperature 280 ... 300"),
    ):
        with pytest.raises(ValueError, match=message):
            data.selected(**ranges)
