"""Tables as instruments and other programs write them: names, units, separators, preambles."""

import numpy as np
import pytest
from support.exports import put
from support.folders import REFERENCE
from support.refusals import refused

import rubberfric as rf
from fitting import FrictionData, ModulusData, SpectrumData, read
from rubberfric.io.tables import read_table

TWO_PI = 2 * np.pi
STEPS = REFERENCE / "exports" / "steps" / "ta_trios.txt"


def holds(data, omega, storage, loss, temperature=None):
    """The numbers of ModulusData, to rounding."""
    assert isinstance(data, ModulusData)
    for found, wanted in ((data.omega, omega), (data.storage, storage), (data.loss, loss)):
        np.testing.assert_allclose(found, wanted, rtol=1e-14)
    if temperature is None:
        assert data.temperature is None
    else:
        np.testing.assert_allclose(data.temperature, temperature, rtol=1e-14)


# --- pyvisco: headers as its examples have them


RAW = """f,E_stor,E_loss,T,Set
Hz, MPa, MPa, C, -
0.1,8097.2,93.07,-49.96,0
100,9228.6,407.02,-49.99,0
0.1,8438.9,87.13,-42.49,1
"""
MASTER = """omega,f,E_stor,E_loss,E_comp,tan_del,t,E_relax
rad/s,Hz,MPa,MPa,MPa,-,s,MPa
0.6283185,0.1,8097.2,93.07,8097.73,0.0115,10,8000
6.283185,1,8200.5,95.1,8201.05,0.0116,1,8100
"""


def test_master_curve_with_all_its_columns(tmp_path):
    """omega and f say the same; tan_del and E_comp are not needed, t and E_relax not known."""
    path = put(tmp_path, MASTER)
    holds(read(path), [0.6283185, 6.283185], [8097.2e6, 8200.5e6], [93.07e6, 95.1e6])
    assert set(rf.io.read_columns(path)) == {"omega", "E_stor", "E_loss"}
    path = put(tmp_path, MASTER.replace("6.283185,1,", "6.283185,2,"))
    assert "columns 'omega' and 'f': both hold omega: must be only one" in refused(path, lambda: read(path))


def test_shear_moduli_need_a_poisson_ratio(tmp_path):
    path = put(tmp_path, "f,G_stor,G_loss\nHz,MPa,MPa\n1,2,0.5\n10,3,0.7\n")
    message = refused(path, lambda: read(path))
    assert (
        "G_stor, G_loss are of shear: poisson must be given (0.5 for rubber), because E = 2 (1 + poisson) G"
        in message
    )
    holds(read(path, poisson=0.45), [TWO_PI, 10 * TWO_PI], [5.8e6, 8.7e6], [1.45e6, 2.03e6])
    assert "poisson = 50.0: must be between 0.0 and" in refused(path, lambda: read(path, poisson=50))
    assert "poisson = nan: must be finite" in refused(path, lambda: read(path, poisson=np.nan))
    young = put(tmp_path, "f,E_stor,E_loss\nHz,MPa,MPa\n1,2,0.5\n", "young.csv")
    assert "poisson = 0.5: must not be given" in refused(young, lambda: read(young, poisson=0.5))


def test_shift_factors_as_logarithms(tmp_path):
    """Falling temperatures are turned round; in a scene file, too."""
    put(tmp_path, "T,log_aT\nC, -\n25,-4.08\n-5,0\n-50,12.75\n", "aT.csv")
    table = read_table(tmp_path / "aT.csv", ("T", "aT"))
    np.testing.assert_allclose(table["T"], [223.15, 268.15, 298.15])
    np.testing.assert_allclose(table["aT"], 10 ** np.array([12.75, 0, -4.08]), rtol=1e-13)


QUOTED = (
    '"f";"E\'";"E\'\'";"|E*|";"tan delta";"T"\n"Hz";"MPa";"MPa";"MPa";"-";"°C"\n0,1;8,1;,9;8,2;1,1e-1;20,1\n'
)
GERMAN = (
    "Frequenz;Speichermodul;Verlustmodul;Temperatur\nHz;N/mm²;N/mm²;°C\n0,1;8,97;1,23;20,0\n1;9,9;1,5;20\n"
)
FRENCH = "Fréquence [Hz]\tModule de conservation [MPa]\tFacteur de perte [-]\n0.1\t8.97\t0.1\n1\t9.9\t0.2\n"
# Text, options of read, and f [Hz], E' [MPa], E'' [MPa], T [°C].
MEASURED = {
    "temperatures": (
        RAW,
        {},
        [0.1, 100, 0.1],
        [8097.2, 9228.6, 8438.9],
        [93.07, 407.02, 87.13],
        [-49.96, -49.99, -42.49],
    ),
    "set values": ("f_set,T_set,E_stor,E_loss\nHz,C,MPa,MPa\n1,20,5,1\n", {}, [1], [5], [1], [20]),
    "both": (
        "f_set,f,T_set,T,E_stor,E_loss\nHz,Hz,C,C,MPa,MPa\n1,1.5,20,20.5,5,1\n",
        {},
        [1.5],
        [5],
        [1],
        [20.5],
    ),
    "quotes": (QUOTED, {}, [0.1], [8.1], [0.9], [20.1]),
    "German": (GERMAN, {}, [0.1, 1], [8.97, 9.9], [1.23, 1.5], [20, 20]),
    "French": (FRENCH, {}, [0.1, 1], [8.97, 9.9], [0.897, 1.98], None),
}


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
@pytest.mark.parametrize("name", MEASURED)
def test_moduli(tmp_path, name, encoding):
    text, options, f, storage, loss, temperature = MEASURED[name]
    kelvin = None if temperature is None else np.array(temperature) + 273.15
    found = read(put(tmp_path, text.encode(encoding)), **options)
    holds(found, TWO_PI * np.array(f), 1e6 * np.array(storage), 1e6 * np.array(loss), kelvin)


# --- exports of instruments


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "utf-16"])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_decimal_commas_in_any_encoding(tmp_path, encoding, ends):
    """Tabs, a preamble and two steps; `test_steps_at_several_temperatures` reads the text with points."""
    lines = STEPS.read_text("utf-8").splitlines()
    commas = ends.join(line.replace(".", ",") if line[:1].isdigit() else line for line in lines) + ends
    plain, data = read(STEPS), read(put(tmp_path, commas.encode(encoding), "sweep.tsv"))
    holds(data, plain.omega, plain.storage, plain.loss, plain.temperature)


@pytest.mark.parametrize(
    "names",
    [
        "E' [MPa];E'' [MPa]",
        "E\u00b4 (MPa);E\u00b4\u00b4 (MPa)",
        "E\u2019 (N/mm²);E\u201d (N/mm²)",
        "Storage Modulus [MPa];LOSS MODULUS [MPa]",
        "log10(E') [log10(MPa)];log E'' [MPa]",
    ],
)
def test_spellings(tmp_path, names):
    numbers = "0.5;-0.25" if names.startswith("log") else f"{10**0.5!r};{10**-0.25!r}"
    path = put(tmp_path, f"Frequency (Hz);{names};note\n2;{numbers};good\n")
    holds(read(path), [2 * TWO_PI], [10**6.5], [10**5.75])


@pytest.mark.parametrize(
    "title", ["Strain (%)", "Oscillation strain [%]", "Dehnung [%]", "Déformation (%)", "strain [%]"]
)
def test_strain_sweeps(tmp_path, title):
    path = put(tmp_path, f"{title};Storage modulus (MPa);Loss modulus (MPa)\n0.1;8;1\n2;6;0.9\n")
    sweep = rf.io.read_table(path, ["strain", "E_stor", "E_loss"])
    np.testing.assert_allclose([*sweep.values()], [[1e-3, 0.02], [8e6, 6e6], [1e6, 0.9e6]], rtol=1e-15)


def test_a_storage_modulus_is_a_shear_modulus_beside_a_poisson_ratio():
    """A rheometer and a tension clamp write the same words."""
    plain, data = read(STEPS), read(STEPS, poisson=0.5)
    holds(data, plain.omega, 3 * plain.storage, 3 * plain.loss, plain.temperature)


# --- log10 tables, with and without a header


@pytest.mark.parametrize("text", ["# f [Hz],E_stor [MPa]\n1,2\n", "#f E_stor\n1 2\n"])
def test_titles_behind_a_sign_of_comments(tmp_path, text):
    path = put(tmp_path, text, "saved.txt")
    message = refused(path, lambda: read(path))
    assert "a row of names and a row of units (remove the # of the titles in line 1), or name" in message


def test_columns_of_a_file_that_does_not_say(tmp_path):
    path = put(tmp_path, "# frequency, storage, loss\n -3.0  6.5  5.4\n -2.0  6.6  5.5\n", "master.dat")
    message = refused(path, lambda: read(path))
    assert "line 2: begins with numbers: must have a row of names" in message and "columns" in message
    titles = ["log10_f [log10(Hz)]", "log10_E_stor [log10(Pa)]", "log10 E'' [Pa]"]
    data = read(path, columns=titles)
    logs = np.array([[6.5, 6.6], [5.4, 5.5]])
    holds(data, TWO_PI * 10 ** np.array([-3.0, -2.0]), *10**logs)
    table = rf.io.read_columns(path, columns=[titles[0], "-", "-"])
    assert list(table) == ["omega"]
    path = put(tmp_path, "log10_q;log10_C\nlog10(1/m);log10(m^4)\n2;-10\n3;-13\n")
    found = read(path, normalisation="C")
    assert isinstance(found, SpectrumData)
    np.testing.assert_allclose(found.C, [1e-10, 1e-13], rtol=1e-14)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (["f [Hz]", "E_stor [MPa]"], "line 1: has 3 fields: must have 2"),
        (["f [Hz]", "E_stor", "E_loss [MPa]"], "columns: 'E_stor': must be a known name and unit, such as"),
        (["f [Hz]", "E_st [MPa]", "E_loss [MPa]"], "columns: 'E_st [MPa]': must be a known name and unit"),
        ("f", "columns = 'f': must be a list"),
        ([1, 2, 3], "columns = [1, 2, 3]: must be a list"),
        (["f [Hz]", "-", "E_loss [MPa]"], "must be the columns of one kind of data"),
    ],
)
def test_wrong_columns(tmp_path, columns, message):
    path = put(tmp_path, "1 2 3\n2 3 4\n", "master.dat")
    assert message in refused(path, lambda: read(path, columns=columns))


# --- faulty tables


GOOD = "f [Hz];E' [MPa];E'' [MPa]\n1;5;1\n2;6;2\n"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("E'' [MPa]", "E' [MPa]", 'columns "E\' [MPa]" and "E\' [MPa]": both hold E_stor: must be only one'),
        ("' [MPa]", "' [mPa]", "unit 'mPa': must be one of Pa, kPa, MPa, GPa"),
        (" [Hz]", "", "column f: unit '-': must be one of Hz"),
        ("2;6;2", "2;x;2", "line 3: E' [MPa] = 'x': must be a number"),
        ("2;6;2", "x;6;2", "line 3: f [Hz] = 'x': must be a number"),
        ("2;6;2", "2;6,5;2.5", "line 3: '2.5': has a decimal point, others a comma: must all have"),
        ("2;6;2", "2;-6;2", "line 3: E' [MPa] = '-6': must be > 0"),
        ("2;6;2", "E' [MPa];f [Hz]\n5;1", "line 3: has other columns than line 1: a file must have one"),
    ],
)
def test_faulty_exports(tmp_path, old, new, message):
    assert len(read(put(tmp_path, GOOD))) == 4
    path = put(tmp_path, GOOD.replace(old, new))
    assert message in refused(path, lambda: read(path))


def test_a_falling_export_is_turned_and_one_with_equal_entries_refused(tmp_path):
    falling = "f [Hz];E' [MPa];E'' [MPa]\n3;7;3\n2;6;2\n1;5;1\n"
    table = read_table(put(tmp_path, falling), ["omega", "E_stor", "E_loss"])
    np.testing.assert_allclose(table["omega"], TWO_PI * np.array([1.0, 2.0, 3.0]), rtol=1e-14)
    np.testing.assert_array_equal(table["E_stor"], [5e6, 6e6, 7e6])
    path = put(tmp_path, falling.replace("\n2;", "\n3;"))
    message = refused(path, lambda: read_table(path, ["omega", "E_stor", "E_loss"]))
    assert "line 3: f [Hz] = 3 after 3: must increase strictly" in message


@pytest.mark.parametrize("ends", [";", ";;;"])
def test_rows_that_end_with_separators_are_as_without(tmp_path, ends):
    plain, path = read(put(tmp_path, GOOD)), put(tmp_path, GOOD.replace("5;1", f"5;1{ends}"))
    np.testing.assert_array_equal(read(path).storage, plain.storage)


def test_names_without_units(tmp_path):
    path = put(tmp_path, "f;E';E''\n1;5;1\n2;6;2\n")
    assert "has names but no units: must have units in the row below" in refused(path, lambda: read(path))


def test_what_read_cannot_take(tmp_path):
    path = put(tmp_path, "PK", "sweep.ods")
    assert "suffix '.ods': must be .csv, .txt, .tsv, .dat, .xlsx or .h5; save a sheet as .csv" in refused(
        path, lambda: read(path)
    )
    path = put(tmp_path, "v,mu\nm/s,-\n1,0.5\n")
    assert isinstance(read(path, pressure=1e5, kind="friction"), FrictionData)
    assert "none is known" in refused(path, lambda: rf.io.read_columns(put(tmp_path, "a,b\n-,-\n1,2\n")))
    read(path := put(tmp_path, RAW)).write(tmp_path / "data.h5")
    path = tmp_path / "data.h5"
    assert "columns = ['f [Hz]']: must not be given; it is for tables" in refused(
        path, lambda: read(path, columns=["f [Hz]"])
    )


# --- of laboratories elsewhere

GLIDING = "Gleitgeschwindigkeit (mm/s);Reibwert (-);Flächenpressung (N/mm²)\n0,5;0,61;0,2\n5;0,75;0,2\n"
RUBBING = """Vitesse de glissement [mm·s⁻¹],Coefficient de frottement [-],Pression [bar]
0.5,0.61,2
5,0.75,2
"""


@pytest.mark.parametrize("text", [GLIDING, RUBBING])
def test_friction_in_other_languages(tmp_path, text):
    data = read(put(tmp_path, text))
    np.testing.assert_allclose([data.velocity, data.friction], [[5e-4, 5e-3], [0.61, 0.75]])
    np.testing.assert_allclose(data.pressure, [2e5] * 2)


def test_a_spectrum_in_german(tmp_path):
    text = "Wellenvektor [µm⁻¹];C [µm⁴]\n0,1;1e-3\n1;1e-7\n"
    data = read(put(tmp_path, text), normalisation="C")
    np.testing.assert_allclose([data.q, data.C], [[1e5, 1e6], [1e-27, 1e-31]], rtol=1e-13)


@pytest.mark.parametrize("unit", ["rpm", "U/min", "rev/min"])
def test_a_rate_of_rotation_needs_the_radius(tmp_path, unit):
    path = put(tmp_path, f"Speed [{unit}],mu\n10,0.6\n20,0.7\n")
    assert "multiply it by 2 pi r / 60" in refused(path, lambda: read(path, pressure=1e5))


def test_unknown_titles_are_answered_with_columns_filled_in(tmp_path):
    text = "Speed / lap;Reibwert;Kanal 3;Temperatur\n1/min;-;V;°C\n10;0,6;1,1;20\n20;0,7;1,2;20\n"
    path = put(tmp_path, text)
    said = 'columns=["?", "mu [-]", "?", "T [°C]"]'
    assert said in refused(path, lambda: read(path, pressure=1e5))
    named = read(path, pressure=1e5, columns=["v [mm/s]", "mu [-]", "-", "T [C]"])
    np.testing.assert_allclose(named.velocity, [0.01, 0.02])
    path = put(tmp_path, "a,b\n-,-\n1,2\n")
    assert 'for one not read: columns=["?", "?"]' in refused(path, lambda: rf.io.read_columns(path))
