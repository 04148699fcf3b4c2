"""Our own CSV tables: units, layout, tables over q and phi, and one line for every fault."""

import os

import numpy as np
import pytest
from support.refusals import refused
from support.scenes.scene_files import directions

from rubberfric.io.tables import read_directions, read_table
from rubberfric.io.text_tables.writing import write_table


def table(folder, text, wanted=("omega", "E_stor", "E_loss"), **options):
    path = folder / "table.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path, wanted, **options)


# Column: quantity in SI, and values in SI of numbers with units.
UNITS = {
    "omega": ("omega", {"2 rad/s": 2.0}),
    "f": ("omega", {"2 Hz": 4 * np.pi, "120 rpm": 4 * np.pi, "2 kHz": 4e3 * np.pi, "2 MHz": 4e6 * np.pi}),
    "E_stor": ("E_stor", {"2 Pa": 2.0, "2 kPa": 2e3}),
    "E_loss": ("E_loss", {"2 MPa": 2e6, "2 GPa": 2e9}),
    "q": ("q", {"2 1/m": 2.0, "2 1/cm": 200.0, "2 1/mm": 2e3, "2 1/um": 2e6}),
    "C": ("C", {"2e-20 m^4": 2e-20, "2 cm^4": 2e-8, "2 mm^4": 2e-12, "2 um^4": 2e-24}),
    "T": ("T", {"293.15 K": 293.15, "-20 C": 253.15}),
    "aT": ("aT", {"0.5 -": 0.5}),
    "v": ("v", {"-2 m/s": -2.0, "2 mm/s": 2e-3, "2 um/s": 2e-6, "2 nm/s": 2e-9, "2 mph": 0.89408}),
    "p": ("p", {"2 hPa": 200.0, "2 atm": 202650.0, "2 kgf/cm2": 196133.0}),
    "phi": ("phi", {"-2 rad": -2.0}),
    "phi_deg": ("phi", {"90 deg": np.pi / 2}),
    "log10_v": ("v", {"-5 log10(m/s)": 1e-5, "-5 log10(mm/s)": 1e-8, "0 log10(um/s)": 1e-6}),
    "mu": ("mu", {"-0.1 -": -0.1}),
    "sigma": ("sigma", {"0.1 -": 0.1}),
}


@pytest.mark.parametrize("name", UNITS)
def test_name_and_unit_determine_the_conversion(tmp_path, name):
    wanted, values = UNITS[name]
    for given, expected in values.items():
        value, unit = given.split()
        columns = table(tmp_path, f"{name}\n{unit}\n{value}\n", (wanted,))
        np.testing.assert_allclose(columns[wanted], [expected], rtol=4e-16)
        assert list(columns) == [wanted]


def test_layout_of_a_table_is_free(tmp_path):
    text = '\ufeff# measured\r\n\r\n f , "E_stor",E_loss\r\nHz,Pa,Pa\r\n# data\r\n1,2,3\r\n 2 ,3,4\r\n\r\n'
    columns = table(tmp_path, text)
    np.testing.assert_array_equal(columns["omega"], 2 * np.pi * np.array([1.0, 2.0]))
    np.testing.assert_array_equal(columns["E_loss"], [3.0, 4.0])


def test_optional_columns_and_order(tmp_path):
    text = "v,mu,sigma\nm/s,-,-\n2,0.5,0.1\n1,0.6,0.1\n"
    columns = table(tmp_path, text, ("v", "mu"), optional=("sigma",), increasing=False)
    np.testing.assert_array_equal(columns["v"], [2.0, 1.0])
    assert set(table(tmp_path, "v,mu\nm/s,-\n1,2\n", ("v", "mu"), optional=("sigma",))) == {"v", "mu"}


HEAD = "f,E_stor,E_loss\nHz,Pa,Pa\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has 0 rows: must have a name row, a unit row and data"),
        (HEAD, "has 2 rows: must have"),
        (HEAD + "1,2,nan\n", "line 3: E_loss = 'nan': must be finite"),
        (HEAD + "1,2,inf\n", "line 3: E_loss = 'inf': must be finite"),
        (HEAD + "1,2,3\n2,-3,4\n", "line 4: E_stor = '-3': must be > 0"),
        (HEAD + "1,0,3\n", "line 3: E_stor = '0': must be > 0"),
        (HEAD + "# note\n\n1,2,\n", "line 5: E_loss = '': must be a number"),
        (HEAD + "1,2,1_0\n", "line 3: E_loss = '1_0': must be a number"),
        (HEAD + "1,2,3 MPa\n", "line 3: E_loss = '3 MPa': must be a number"),
        (HEAD + "1,2\n", "line 3: has 2 fields: must have 3"),
        (HEAD + "1,2,3,4\n", "line 3: has 4 fields: must have 3"),
        (HEAD + '1,2,"3\n', "line 3: is not CSV"),
        (HEAD + "2,2,3\n1,2,3\n", "line 4: f = 1 after 2: must increase strictly"),
        (HEAD + "1,2,3\n1,2,3\n", "line 4: f = 1 after 1: must increase strictly"),
        ("f,E_stor,E_loss\nHz,Pa\n1,2,3\n", "line 2: has 2 fields: must have 3"),
        (
            "f,E_stor,E_loss\nHz,Pa,torr\n1,2,3\n",
            "line 2: column E_loss: unit 'torr': must be one of Pa, kPa",
        ),
        ("f,E_stor,E_loss\nrad/s,Pa,Pa\n1,2,3\n", "column f: unit 'rad/s': must be one of Hz, kHz, MHz"),
        ("f,E_stor,E_los\nHz,Pa,Pa\n1,2,3\n", "line 1: column 'E_los': did you mean 'E_loss'? must be one"),
        ("f,E_stor,q\nHz,Pa,1/m\n1,2,3\n", "column 'q': must be one of omega, f, E_stor, E_loss"),
        ("f,E_stor\nHz,Pa\n1,2\n", "line 1: no column E_loss: the table must have one"),
        ("E_stor,E_loss\nPa,Pa\n1,2\n", "line 1: no column omega or f: the table must have one"),
        ("f,omega,E_stor,E_loss\nHz,rad/s,Pa,Pa\n1,2,3,4\n", "column 'omega': omega is given twice"),
        ("f,E_stor,E_loss,\nHz,Pa,Pa,\n1,2,3,\n", "column ''"),
        (HEAD.encode() + b"1,2,\xff\n", "cannot be read as text"),
    ],
)
def test_faulty_tables(tmp_path, text, message):
    assert message in refused(tmp_path / "table.csv", lambda: table(tmp_path, text))


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("T", "T\nC\n-280\n", "T = '-280': must be > 0 K"),
        ("v", "log10_v\nlog10(m/s)\n400\n", "finite in SI"),
        ("E_stor", "E_stor\nGPa\n1e305\n", "finite in SI"),
        ("C", "C\num^4\n1e-310\n", "must be > 0"),
    ],
)
def test_numbers_without_meaning_in_si(tmp_path, name, text, message):
    assert message in refused(tmp_path / "table.csv", lambda: table(tmp_path, text, (name,)))


def test_missing_table_and_folder(tmp_path):
    assert "No such file" in refused(tmp_path / "no.csv", lambda: read_table(tmp_path / "no.csv", ("v",)))
    assert "directory" in refused(tmp_path, lambda: read_table(tmp_path, ("v",)))


def test_written_tables_read_back_to_the_last_bit(tmp_path):
    path = tmp_path / "table.csv"
    rng = np.random.default_rng(0)
    columns = {"v": np.sort(10 ** rng.uniform(-300, 300, 20)), "mu": rng.normal(size=20)}
    write_table(path, columns, comment="two\nlines")
    assert path.read_text().startswith("# two\n# lines\nv,mu\nm/s,-\n")
    again = read_table(path, ("v", "mu"))
    for name, values in columns.items():
        np.testing.assert_array_equal(again[name], values)
    before = path.read_bytes()
    assert "must be one of" in refused(path, lambda: write_table(path, {"f": [1.0]}))
    assert "must be one-dimensional" in refused(
        path, lambda: write_table(path, {"v": [1.0], "mu": [1.0, 2.0]})
    )
    assert path.read_bytes() == before
    nowhere = tmp_path / "none" / "table.csv"
    assert "folder" in refused(nowhere, lambda: write_table(nowhere, columns))
    assert os.listdir(tmp_path) == ["table.csv"]


# --- directions


def test_tables_of_directions(tmp_path):
    path = tmp_path / "directions.csv"
    for text in (directions(), directions("rad", step=np.pi / 5), directions(step=36.005)):
        path.write_text(text)
        q, C = read_directions(path)
        np.testing.assert_allclose(q, [1e2, 1e3], rtol=1e-15)
        np.testing.assert_allclose(C, 1e-24 * np.arange(1.0, 11.0).reshape(2, 5), rtol=1e-15)
    # In the form of `write_table`.
    phi = np.tile(np.pi * np.arange(5) / 5, 2)
    write_table(path, {"q": np.repeat(q, 5), "phi": phi, "C": C.ravel()})
    for x, y in zip(read_directions(path), (q, C), strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (directions(order=slice(9)), "q = 1000 1/m has 4 directions: must have 5 like the first"),
        (directions(q=("1", "0.1")), "row 6 of the data: q = 100 1/m, phi = 0 deg: q must increase"),
        (directions(order=slice(None, None, -1)), "row 1 of the data: q = 1000 1/m, phi = 144 deg: phi"),
        (directions(step=36.1), "row 2 of the data: q = 100 1/m, phi = 36.1 deg: phi must be 36 deg"),
        (directions(step=45.0), "phi = 45 deg: phi must be 36 deg because the 5 directions of a q are 0,"),
        (directions("rad"), "phi = 2062.65 deg: phi must be 36 deg"),
        (directions() + "2,0,1\n", "q = 2000 1/m has 1 directions: must have 5"),
        (directions() + "1,180,1\n", "row 11 of the data: q = 1000 1/m, phi = 180 deg: q must increase"),
        (directions().replace("1,36.0,7", "0.2,36.0,7"), "row 7 of the data: q = 200 1/m"),
        (directions().replace(",7\n", ",-7\n"), "line 9: C = '-7': must be > 0"),
        (directions().replace("phi_deg", "phi"), "column phi: unit 'deg': must be one of rad"),
        (directions().replace("phi_deg", "angle"), "column 'angle': must be one of q, log10_q, C"),
        ("q,C\n1/m,m^4\n1,1\n", "no column phi or phi_deg: the table must have one"),
    ],
)
def test_faulty_tables_of_directions(tmp_path, text, message):
    path = tmp_path / "directions.csv"
    path.write_text(text)
    assert message in refused(path, lambda: read_directions(path))
