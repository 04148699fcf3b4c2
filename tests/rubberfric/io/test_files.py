"""CSV tables and scenes in TOML and HDF5: contents, and one line for every fault."""

import copy
import functools
import os

import h5py
import jax
import numpy as np
import pytest
from support.folders import DATA
from support.refusals import refused
from support.scenes.examples import EXAMPLES, examples, same

import rubberfric as rf
from rubberfric.base.objects.physical import PhysicalObject, kinds, leaves_of
from rubberfric.io.files import load_result, read_computable, read_scene_file, save_result
from rubberfric.io.hdf5 import read_object, write_object
from rubberfric.io.results import Conditions, Result
from rubberfric.io.tables import read_directions, read_table
from rubberfric.io.text_tables.writing import write_table
from rubberfric.io.toml import scene_texts
from rubberfric.theory.structure import Solution

SCENE_FILES = sorted(path for path in DATA.glob("*.toml") if not path.stem.endswith("_fit"))


# --- CSV tables


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


def test_tables_without_meaning_in_si(tmp_path):
    path = tmp_path / "table.csv"
    assert "T = '-280': must be > 0 K" in refused(path, lambda: table(tmp_path, "T\nC\n-280\n", ("T",)))
    assert "finite in SI" in refused(path, lambda: table(tmp_path, "log10_v\nlog10(m/s)\n400\n", ("v",)))
    assert "finite in SI" in refused(path, lambda: table(tmp_path, "E_stor\nGPa\n1e305\n", ("E_stor",)))
    assert "must be > 0" in refused(path, lambda: table(tmp_path, "C\num^4\n1e-310\n", ("C",)))


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


# --- TOML


def full_scene():
    """A scene file with every class and every key, as Python tables."""
    wlf = {"kind": "wlf", "C1": 8.0, "C2": 100.0, "T_ref": 293.15}
    arrhenius = {"kind": "arrhenius", "energy": 0.97, "T_ref": 293.15}
    prony = {"kind": "prony", "E_inf": 1e6, "E": [1e6, 2e6], "tau": [1e-3, 1.0], "poisson": 0.5, "shift": wlf}
    road = {"kind": "self_affine", "q0": 1e2, "qr": 1e3, "q1": 1e5, "hurst": 0.8, "h_rms": 1e-4}
    table = {"kind": "table", "file": "shift.csv", "T_ref": 293.15}
    modulus = {"kind": "tabulated", "file": "modulus.csv", "poisson": 0.4, "outside": "hold", "shift": table}
    spectrum = {"kind": "tabulated", "file": "spectrum.csv", "normalisation": "C"}
    return {
        "title": "Everything",
        "gamma": 0.45,
        "area_correction": True,
        "lower": {"material": prony, "spectrum": road, "layer": {"thickness": 1e-3, "base": "frictionless"}},
        "upper": {"material": modulus, "spectrum": spectrum},
        "shear": {"tau_f0": 6.5e6, "c": 0.1, "v0": 6e-3, "shift": arrhenius},
        "run": {"velocity": [1e-3, 1.0], "pressure": 1e5, "temperature": [283.15, 293.15]},
    }


def as_toml(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {as_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


@pytest.fixture
def folder(tmp_path):
    """A folder with the curves of `full_scene`."""
    (tmp_path / "modulus.csv").write_text("f,E_stor,E_loss\nHz,MPa,kPa\n1e-3,1,100\n1,2,200\n1e3,3,100\n")
    (tmp_path / "shift.csv").write_text("T,aT\nC,-\n0,10\n20,1\n40,0.1\n")
    (tmp_path / "spectrum.csv").write_text("q,C\n1/mm,um^4\n0.1,1e12\n1,1e9\n")
    return tmp_path


def write_scene(folder, content):
    path = folder / "scene.toml"
    path.write_text(
        "".join(f"{key} = {as_toml(value)}\n" for key, value in content.items()), encoding="utf-8"
    )
    return path


def coated_scene():
    """A scene file with a coating in place of the slab."""
    base = {"kind": "prony", "E_inf": 1e6, "E": [1e6], "tau": [1e-3], "poisson": 0.3}
    return put(full_scene(), "lower.layer", {"kind": "coating", "thickness": 1e-3, "base": base})


def put(content, key, value):
    """A copy of a scene file's content with one key path set, or removed if the value is `...`."""
    content = copy.deepcopy(content)
    *parents, last = key.split(".")
    table = content
    for name in parents:
        table = table[name]
    if value is ...:
        del table[last]
    else:
        table[last] = value
    return content


def test_every_key_of_a_scene_file(folder):
    scene, conditions, title = read_scene_file(write_scene(folder, full_scene()))
    expected = rf.Scene(
        lower=rf.Body(
            rf.Prony(1e6, [1e6, 2e6], [1e-3, 1.0], 0.5, rf.WLF(8.0, 100.0, 293.15)),
            rf.SelfAffine(1e2, 1e3, 1e5, 0.8, 1e-4),
            rf.Slab(1e-3, "frictionless"),
        ),
        upper=rf.Body(
            rf.TabulatedModulus(
                2 * np.pi * np.array([1e-3, 1.0, 1e3]),
                1e6 * np.array([1.0, 2.0, 3.0]),
                1e3 * np.array([100.0, 200.0, 100.0]),
                0.4,
                rf.TabulatedShift([273.15, 293.15, 313.15], [10.0, 1.0, 0.1], 293.15),
                "hold",
            ),
            rf.TabulatedSpectrum([1e2, 1e3], 1e-24 * np.array([1e12, 1e9])),
        ),
        gamma=0.45,
        area_correction=True,
        shear=rf.ContactShear(6.5e6, 0.1, 6e-3, rf.Arrhenius(0.97, 293.15)),
    )
    same(scene, expected)
    assert title == "Everything"
    np.testing.assert_array_equal(conditions.velocity, [1e-3, 1.0])
    np.testing.assert_array_equal(conditions.pressure, [1e5])
    np.testing.assert_array_equal(conditions.temperature, [283.15, 293.15])


@pytest.mark.parametrize("spectrum", ["upper", "directions"])
def test_the_cut_of_a_table(folder, spectrum):
    """q0 and q1 [1/m] with a file, by key path and in a notebook's table."""
    content = full_scene() if spectrum == "upper" else put(full_scene(), "upper.spectrum", DIRECTIONS)
    (folder / "directions.csv").write_text(directions())
    cut = put(put(content, "upper.spectrum.q0", 150), "upper.spectrum.q1", 900.5)
    scene, _, _ = read_scene_file(write_scene(folder, cut))
    assert (scene.upper.spectrum.q0, scene.upper.spectrum.q1) == (150.0, 900.5)
    whole, _, _ = read_scene_file(write_scene(folder, content))
    same(whole.replace({"upper.spectrum.q0": 150.0, "upper.spectrum.q1": 900.5}), scene)
    assert "upper.spectrum.q1" in scene._repr_html_() and "900.5" in scene._repr_html_()
    assert "upper.spectrum.q1" not in whole._repr_html_()
    path = write_scene(folder, put(content, "upper.spectrum.q1", 1000.5))
    with pytest.raises(ValueError, match=r"upper\.spectrum: \w+\.q1 = 1000\.5: must lie within the table"):
        read_scene_file(path)


def test_coatings(folder):
    scene, _, _ = read_scene_file(write_scene(folder, coated_scene()))
    same(scene.lower.layer, rf.Coating(1e-3, rf.Prony(1e6, [1e6], [1e-3], 0.3)))


def test_a_relaxing_shear(folder):
    shift = {"kind": "arrhenius", "energy": 1.0, "T_ref": 300.0}
    numbers = {"G_inf": 1e6, "G": [1e8, 1e6], "tau": [1e-6, 1.0], "bulk": 2e9}
    content = put(full_scene(), "upper.material", {"kind": "prony_shear", "shift": shift} | numbers)
    scene, _, _ = read_scene_file(write_scene(folder, content))
    same(scene.upper.material, rf.PronyShear(**numbers, shift=rf.Arrhenius(1.0, 300.0)))


SPECTRUM = {"kind": "self_affine", "q0": 1e2, "qr": 1e3, "q1": 1e5, "hurst": 0.8, "h_rms": 1e-4}
STRETCHED = {"kind": "anisotropic", "base": SPECTRUM, "ratio": 2.0, "angle": 0.3, "harmonics": 32}
DIRECTIONS = {
    "kind": "tabulated_anisotropic",
    "file": "directions.csv",
    "normalisation": "C_iso",
    "angle": -0.2,
}


def test_anisotropic_spectra(folder):
    content = put(put(full_scene(), "lower.spectrum", STRETCHED), "upper.spectrum", DIRECTIONS)
    (folder / "directions.csv").write_text(directions())
    scene = rf.load_scene(write_scene(folder, content))
    base = rf.SelfAffine(1e2, 1e3, 1e5, 0.8, 1e-4)
    same(scene.lower.spectrum, rf.Anisotropic(base, 2.0, 0.3, 32))
    assert scene.lower.spectrum.harmonics == 32
    C = np.array([[1.0, 2.0, 3.0, 4.0, 5.0], [6.0, 7.0, 8.0, 9.0, 10.0]]) * 1e-24 / (2 * np.pi) ** 2
    np.testing.assert_allclose(scene.upper.spectrum.C, C, rtol=1e-14)
    np.testing.assert_allclose(scene.upper.spectrum.q, [1e2, 1e3], rtol=1e-14)
    assert scene.upper.spectrum.angle == -0.2
    # Defaults, and C0 for the height of the base.
    C0 = float(rf.power_spectrum(base, 500.0))
    short = {k: v for k, v in SPECTRUM.items() if k != "h_rms"} | {"C0": C0}
    scene = rf.load_scene(
        write_scene(folder, put(content, "lower.spectrum", put(put(STRETCHED, "base", short), "angle", ...)))
    )
    assert (scene.lower.spectrum.angle, scene.lower.spectrum.harmonics) == (0.0, 32)
    np.testing.assert_allclose(scene.lower.spectrum.base.h_rms, 1e-4, rtol=1e-12)


def directions(unit="deg", q=("0.1", "1"), step=36.0, order=slice(None)):
    """A long table of five directions, phi or phi_deg."""
    name = "phi_deg" if unit == "deg" else "phi"
    rows = [f"{q[i // 5]},{i % 5 * step!r},{i + 1}\n" for i in range(10)]
    return f"q,{name},C\n1/mm,{unit},um^4\n" + "".join(rows[order])


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


SOFTENING = "strain,storage_factor,loss_factor\n%,-,-\n1,1,1\n10,0.7,1.1\n100,0.4,0.6\n"


def test_softening_and_heating(folder):
    (folder / "softening.csv").write_text(SOFTENING)
    numbers = {"density": 1.2e3, "heat_capacity": 1.6e3, "conductivity": 0.23, "radius": 1e-3}
    content = put(full_scene(), "softening", {"file": "softening.csv", "factor": 1.2})
    content = put(content, "heating", numbers | {"shear_at": "background", "branch": "falling"})
    scene = rf.load_scene(write_scene(folder, content))
    table = [1e-2 * np.array([1.0, 10.0, 100.0]), [1.0, 0.7, 0.4], [1.0, 1.1, 0.6]]
    same(scene.softening, rf.Softening(*table, 1.2))
    same(scene.heating, rf.Heating(**numbers, shear_at="background", branch="falling"))
    assert scene.heating.area_fraction is None
    (folder / "softening.csv").write_text(SOFTENING.replace("10,0.7", "0.1,0.7"))
    path = write_scene(folder, content)
    assert "line 4: strain = 0.1 after 1: must increase" in refused(
        folder / "softening.csv", lambda: rf.load_scene(path)
    )


def test_defaults_are_those_of_the_classes(folder):
    content = full_scene()
    for key in ("title", "gamma", "area_correction", "run", "upper.spectrum", "lower.layer.base", "shear"):
        content = put(content, key, ...)
    content = put(content, "upper.material", {"kind": "elastic", "young": 1_000_000, "poisson": 0})
    scene, conditions, title = read_scene_file(write_scene(folder, content))
    assert (scene.gamma, scene.area_correction, scene.lower.layer.base) == (0.5, False, "bonded")
    assert (scene.upper.material.young, scene.upper.spectrum, conditions, title) == (1e6, None, None, "")
    assert scene.shear is None


def test_other_ways_to_say_it(folder):
    """C0 for h_rms, C_iso for C, an Arrhenius shift, logarithmic velocities."""
    C0 = float(rf.power_spectrum(rf.SelfAffine(1e2, 1e3, 1e5, 0.8, 1e-4), 500.0))
    content = put(put(full_scene(), "lower.spectrum.h_rms", ...), "lower.spectrum.C0", C0)
    content = put(content, "upper.spectrum.normalisation", "C_iso")
    content = put(content, "lower.material.shift", {"kind": "arrhenius", "energy": 1.0, "T_ref": 293.15})
    content = put(content, "run.velocity", {"from": 1e-6, "to": 1e2, "points": 9})
    scene, conditions, _ = read_scene_file(write_scene(folder, content))
    np.testing.assert_allclose(scene.lower.spectrum.h_rms, 1e-4, rtol=1e-12)
    np.testing.assert_allclose(scene.upper.spectrum.C, 1e-24 * np.array([1e12, 1e9]) / (2 * np.pi) ** 2)
    assert scene.lower.material.shift.energy == 1.0
    np.testing.assert_allclose(conditions.velocity, 10.0 ** np.arange(-6, 3), rtol=1e-13)


def key_paths(content, above=""):
    for name, value in content.items():
        yield above + name
        if isinstance(value, dict):
            yield from key_paths(value, f"{above}{name}.")


OPTIONAL = {"title", "gamma", "area_correction", "run", "poisson", "shift", "spectrum", "layer", "base"}
OPTIONAL |= {"outside", "temperature", "shear"}


@pytest.mark.parametrize("key", list(key_paths(full_scene())))
def test_every_key_refuses_wrong_values(folder, key):
    content = full_scene()
    last = key.split(".")[-1]
    wrong = [{"x": 1}, [[1.0]], [], "nonsense", float("nan"), -1.0, float("inf"), -1, [1.0, float("nan")]]
    if last == "title":
        wrong = [1.0, True, [], {}, "two\\nlines"]
    elif last == "velocity":
        wrong.remove(-1.0)
        wrong.remove(-1)
    if last != "area_correction":
        wrong += [True, [True, False]]
    for value in wrong:
        path = write_scene(folder, put(content, key, value))
        message = refused(path, lambda path=path: rf.load_scene(path))
        assert last in message, (value, message)
    # an unknown key, and a missing key
    path = write_scene(folder, put(content, key + "x", 1.0))
    assert f"{key}x: unknown key; " in refused(path, lambda: rf.load_scene(path))
    path = write_scene(folder, put(content, key, ...))
    if last in OPTIONAL:
        rf.load_scene(path)
    else:
        assert f"{key}" in refused(path, lambda: rf.load_scene(path))


HEATED = {"density": 1.2e3, "heat_capacity": 1.6e3, "conductivity": 0.23, "radius": 1e-3}
SHEAR = {"kind": "prony_shear", "G_inf": 1e6, "G": [1e8, 1e6], "tau": [1e-6, 1.0], "bulk": 2e9}
SCENES = {
    "full": full_scene(),
    "coated": put(coated_scene(), "upper.material", SHEAR),
    "anisotropic": put(put(full_scene(), "lower.spectrum", STRETCHED), "upper.spectrum", DIRECTIONS),
    "heated": put(put(full_scene(), "softening", {"file": "softening.csv"}), "heating", HEATED),
}
# Scene: a key, a wrong value, and the message, which names the file, the key, the value and the rule.
# Rules of constructors are in tests/rubberfric/base/test_objects.py; here one of each depth shows its key.
FAULTS = {
    "full": [
        ("lower.materail", {}, "lower.materail: unknown key; did you mean 'material'? must be one of"),
        ("lower.spectrum.q1", 500.0, "lower.spectrum: SelfAffine.q1 = 500.0: must be >= qr = 1000.0"),
        ("lower.spectrum.C0", 1e-9, "lower.spectrum.C0 = 1e-09: must not be given with h_rms"),
        ("lower.material.E", [1e6, -1.0], "lower.material: Prony.E[1] = -1.0: must be >= 0"),
        ("lower.material.E", [1e6, "2"], "lower.material.E[1] = '2': must be a number"),
        ("lower.material.E_inf", 10**400, "lower.material.E_inf"),
        ("lower.material.kind", "pronny", "lower.material.kind = 'pronny': did you mean 'prony'? must be"),
        ("lower.spectrum", "rough", "lower.spectrum = 'rough': must be a table"),
        ("upper.spectrum.normalisation", "psd", 'must be "C" (h_rms^2 = 2 pi int q C dq), "C_iso"'),
        ("upper.spectrum.hurst", 0.8, "upper.spectrum.hurst = 0.8: must be absent; "),
        ("upper.spectrum.normalisation", ..., "upper.spectrum.normalisation is missing: must be"),
        ("upper.spectrum.file", "no.csv", "upper.spectrum.file = 'no.csv': "),
        ("upper.material.shift.T_ref", 500.0, "upper.material.shift: TabulatedShift.T_ref = 500.0: must be"),
        ("shear", {}, "shear.tau_f0: is missing; must be given"),
        ("shear.kind", "bell", "shear.kind = 'bell': must be one of contact_shear"),
        ("run.velocity", {"from": 0, "to": 1, "points": 2}, "run.velocity.from = 0.0: must be > 0"),
        ("run.velocity", {"from": 1, "to": 1, "points": 2}, "run.velocity.to = 1.0: must be > from = 1"),
        ("run.velocity", {"from": 1, "to": 2, "points": 1}, "run.velocity.points = 1: must be an integer"),
        ("run.velocity", {"from": 1, "to": 2}, "run.velocity.points: is missing; must be given"),
        ("run.velocity", {"from": [1], "to": 2, "points": 2}, "run.velocity.from = [1.0]: must be"),
        ("run.pressure", [1e5, 0], "run.pressure[1] = 0.0: must be > 0"),
        ("run.temperature", 150.0, "run.temperature[0] = 150.0: must be > 193.15 K, the pole of the WLF law"),
        ("run.temperature", 320.0, "run.temperature[0] = 320.0: must be inside the table"),
    ],
    "coated": [
        ("lower.layer.base", "bonded", "lower.layer.base = 'bonded': must be a table"),
        ("lower.layer.base", {"kind": "rigid"}, "use Slab"),
        ("lower.layer.base.tau", [-1.0], "lower.layer.base: Prony.tau[0] = -1.0: must be > 0"),
        ("lower.layer.kind", "slap", "lower.layer.kind = 'slap': did you mean 'slab'?"),
        ("lower.layer.thickness", ..., "lower.layer.thickness: is missing"),
    ],
    "anisotropic": [
        ("lower.spectrum.base", ..., "lower.spectrum.base: is missing; must be given"),
        ("lower.spectrum.base", "road", "lower.spectrum.base = 'road': must be a table"),
        ("lower.spectrum.base.kind", ..., "lower.spectrum.base.kind: is missing; must be given"),
        ("lower.spectrum.base.kind", "elastic", "lower.spectrum.base.kind = 'elastic': must be one of"),
        ("lower.spectrum.base.h", 1.0, "lower.spectrum.base.h: unknown key"),
        ("lower.spectrum.ratio", ..., "lower.spectrum.ratio: is missing"),
        ("lower.spectrum.angle", "x", "lower.spectrum.angle = 'x': must be a number"),
        ("upper.spectrum.file", ..., "upper.spectrum.file is missing: must be the name of a CSV file"),
        ("upper.spectrum.normalisation", ..., "upper.spectrum.normalisation is missing: must be"),
        ("upper.spectrum.normalisation", "C_1D", 'normalisation = \'C_1D\': must be "C" or "C_iso" for'),
        ("upper.spectrum.hurst", 0.8, "upper.spectrum.hurst: unknown key; must be one of"),
        ("upper.spectrum.C", 0.8, "upper.spectrum.C: unknown key; must be one of"),
        ("softening", {"file": "softening.csv"}, "Scene.softening: not together with anisotropic roughness"),
    ],
    "heated": [
        ("softening.file", ..., "softening.file is missing: must be the name of a CSV file"),
        ("softening.strain", [0.1], "softening.strain: unknown key; "),
        ("softening.kind", "payne", "softening.kind: unknown key; "),
        ("heating.density", ..., "heating.density: is missing; must be given"),
    ],
}


@pytest.mark.parametrize(
    ("scene", "key", "value", "message"),
    [(scene, *fault) for scene, faults in FAULTS.items() for fault in faults],
)
def test_message_names_file_key_value_and_rule(folder, scene, key, value, message):
    (folder / "directions.csv").write_text(directions())
    (folder / "softening.csv").write_text(SOFTENING)
    path = write_scene(folder, put(SCENES[scene], key, value))
    assert message in refused(path, lambda: rf.load_scene(path))


def test_two_rigid_bodies_and_useless_temperature(folder):
    content = put(full_scene(), "upper.material", {"kind": "rigid"})
    path = write_scene(folder, put(content, "lower", {"material": {"kind": "rigid"}}))
    assert "both Rigid; one of the solids must deform" in refused(path, lambda: rf.load_scene(path))
    content = put(put(content, "lower.material.shift", ...), "shear.shift", ...)
    path = write_scene(folder, content)
    assert "run.temperature = 283.15: must be absent" in refused(path, lambda: rf.load_scene(path))


def test_faulty_curves_are_named_themselves(folder):
    path = write_scene(folder, full_scene())
    (folder / "modulus.csv").write_text("f,E_stor,E_loss\nHz,MPa,kPa\n1e-3,1,100\n1,2,-200\n")
    assert "line 4: E_loss = '-200'" in refused(folder / "modulus.csv", lambda: rf.load_scene(path))
    (folder / "modulus.csv").write_text("f,E_stor,E_loss\nHz,MPa,kPa\n1e-3,1,100\n")
    assert "must have at least 2" in refused(path, lambda: rf.load_scene(path))


def test_files_that_are_no_scenes(tmp_path):
    path = tmp_path / "scene.toml"
    assert "No such file" in refused(path, lambda: rf.load_scene(path))
    for content in (b"gamma = ", b"\xff", b"gamma = 1" + b"0" * 5000, b"x = " + b"[" * 100_000):
        path.write_bytes(content)
        refused(path, lambda: rf.load_scene(path))
    path.write_bytes(b"")
    assert "lower: is missing" in refused(path, lambda: rf.load_scene(path))
    assert "must be .toml or .h5" in refused(tmp_path / "x.json", lambda: rf.load_scene(tmp_path / "x.json"))
    assert "suffix ''" in refused(tmp_path, lambda: rf.load_scene(str(tmp_path)))


AT = Conditions(np.array([1e-3, 1.0]), np.array([1e5]), None)


def read_back(folder, scene, conditions, title=""):
    """The scene file that `scene_texts` writes."""
    for name, text in scene_texts(scene, conditions, title).items():
        (folder / name).write_text(text, encoding="utf-8")
    return read_scene_file(folder / "scene.toml")


@pytest.mark.parametrize("path", SCENE_FILES, ids=lambda path: path.stem)
def test_scenes_of_the_data_folder(path, tmp_path):
    scene, conditions, title = found = read_scene_file(path)
    assert conditions.velocity.size > 1
    assert title
    rf.save_scene(tmp_path / "scene.h5", scene)
    same(scene, rf.load_scene(tmp_path / "scene.h5"))
    rf.save_scene(tmp_path / f"{path.stem}.toml", scene)
    same(scene, rf.load_scene(tmp_path / f"{path.stem}.toml"))
    again = read_back(tmp_path, *found)
    same(again[:2], found[:2])
    assert again.title == title


def test_other_kinds(tmp_path):
    wlf = rf.WLF(8.86, 101.6, 293.15, vertical=rf.Entropic(6e-4))
    directions = rf.TabulatedAnisotropic([1e2, 1e3, 1e4], 1e-20 * np.arange(1.0, 16.0).reshape(3, 5), 0.3)
    shear = rf.PronyShear(1e6, [1e8, 1e6], [1e-6, 1.0], 2e9, rf.Arrhenius(1.0, 300.0))
    smooth = rf.Body(rf.TabulatedModulus([1.0, 10.0], [1e6, 2e6], [1e5, 2e5], 0.49, wlf, "hold", 0.2))
    scene = rf.Scene(rf.Body(shear, directions), smooth, area_correction=True)
    same(read_back(tmp_path, scene, AT, 'a "b" \\ c')[0], scene)
    assert read_scene_file(tmp_path / "scene.toml")[2] == 'a "b" \\ c'


@pytest.mark.parametrize("adhesion", [rf.Adhesion(0.02), rf.Adhesion(3e-3, limit="long", range=1.7e-9)])
def test_adhesion_of_either_limit(adhesion, tmp_path):
    spectrum = rf.SelfAffine(1e5, 1e6, 1e8, 0.8, 2e-9)
    scene = rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(2e6, 0.5)), adhesion=adhesion)
    found = read_back(tmp_path, scene, AT)[0]
    same(found, scene)
    assert found.adhesion.limit == adhesion.limit


def test_what_is_hardly_in_si_is_accepted_again(tmp_path):
    spectrum = rf.SelfAffine(1e2, 1e3, 1e4, 0.8, 1e-4)
    with pytest.warns(rf.UnitWarning):
        scene = rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(10.0, 0.5)))
    same(read_back(tmp_path, scene, AT)[0], scene)
    assert "plausible = false" in (tmp_path / "scene.toml").read_text()


def test_tabulated_data_are_the_ones_they_were_made_from():
    tables, formulas = (rf.load_scene(DATA / f"{n}.toml") for n in ("tabulated_tread", "tread_on_asphalt"))
    rubber, prony = tables.upper.material, formulas.upper.material
    s = 1j * np.asarray(rubber.omega)[:, None] * np.asarray(prony.tau)
    E = prony.E_inf + np.sum(np.asarray(prony.E) * s / (1 + s), axis=1)
    np.testing.assert_allclose(rubber.storage, E.real, rtol=1e-6)
    np.testing.assert_allclose(rubber.loss, E.imag, rtol=1e-6)
    np.testing.assert_allclose(rf.roughness.moment(tables.lower.spectrum, 0), 0.5e-3**2, rtol=1e-6)
    T = rubber.shift.T
    found, exact = (jax.jit(one.shift.log_factor)(T) for one in (rubber, prony))
    np.testing.assert_allclose(found, exact, atol=2e-6)


# --- HDF5


def objects():
    """One object of every class, with Python numbers and in both precisions, and two special ones."""
    for dtype in (np.float32, np.float64):
        of_dtype = functools.partial(np.array, dtype=dtype)
        yield from examples(of_dtype, of_dtype).values()
    yield from EXAMPLES.values()
    yield rf.SelfAffine.from_C0(1e2, 1e3, 1e5, 0.8, 1e-9)  # a weakly typed array
    yield rf.Adhesion(0.02)  # None


@pytest.mark.parametrize("given", list(objects()), ids=lambda given: type(given).__name__)
def test_hdf5_keeps_every_bit(given, tmp_path):
    with h5py.File(tmp_path / "object.h5", "w") as file:
        write_object(file, "object", given)
        again = read_object(file["object"])
    same(given, again)
    for x, y in zip(jax.tree.leaves(given), jax.tree.leaves(again), strict=True):
        assert isinstance(x, float) == isinstance(y, float) or x.weak_type
        weak = [isinstance(leaf, float) or leaf.weak_type for leaf in (x, y)]
        assert weak[0] == weak[1]


def test_a_saved_scene_replaces_the_old_one(tmp_path):
    path, scene = tmp_path / "scene.h5", EXAMPLES["Scene"]
    for changed in (scene, scene.replace(gamma=0.3)):
        rf.save_scene(path, changed)
        same(changed, rf.load_scene(str(path)))
        assert os.listdir(tmp_path) == ["scene.h5"]


def test_every_leaf_has_units(tmp_path):
    classes = kinds(PhysicalObject)
    assert set(classes) == set(EXAMPLES)
    for cls in classes.values():
        assert all(field.unit for field in leaves_of(cls).values())
    path = tmp_path / "scene.h5"
    rf.save_scene(path, EXAMPLES["Scene"])
    with h5py.File(path) as file:
        assert file.attrs["format"] == "rubberfric scene"
        assert file.attrs["format_version"] == 1
        assert file["scene/lower/material/tau"].attrs["units"] == "s"
        assert file["scene/lower/material"].attrs["kind"] == "Prony"
        assert file["scene/upper/material"].attrs["outside"] == "hold"


def test_saving_writes_nothing_wrong(tmp_path):
    path, scene = tmp_path / "scene.h5", EXAMPLES["Scene"]
    negative = jax.tree.map(lambda x: -x, scene)
    assert "must be" in refused(path, lambda: rf.save_scene(path, negative))
    batch = jax.vmap(lambda i: jax.tree.map(lambda x: x + i, scene))(np.arange(2.0))
    assert "must be" in refused(path, lambda: rf.save_scene(path, batch))
    assert "must be a Scene" in refused(path, lambda: rf.save_scene(path, "scene"))
    assert os.listdir(tmp_path) == []
    rf.save_scene(path, scene)
    before = path.read_bytes()
    refused(path, lambda: rf.save_scene(path, negative))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["scene.h5"]
    for wrong in (tmp_path / "scene.json", tmp_path / "no" / "scene.h5", tmp_path / "scene"):
        refused(wrong, lambda wrong=wrong: rf.save_scene(wrong, scene))
    (tmp_path / "folder.h5").mkdir()
    refused(tmp_path / "folder.h5", lambda: rf.save_scene(tmp_path / "folder.h5", scene))


def spoil(path, change):
    """The message on a saved scene after one change to its file."""
    rf.save_scene(path, EXAMPLES["Scene"])
    with h5py.File(path, "r+") as file:
        change(file)
    return refused(path, lambda: rf.load_scene(path))


def attribute(owner, name, value=...):
    """Set an attribute, or delete it."""
    return lambda file: file[owner].attrs.pop(name) if value is ... else file[owner].attrs.create(name, value)


def remove(name):
    return lambda file: file.__delitem__(name)


def replace(name, value, **attributes):
    def change(file):
        kept = dict(file[name].attrs) | attributes
        del file[name]
        file[name] = value
        file[name].attrs.update(kept)

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (attribute("/", "format_version", 2), "format_version = 2: must be 1"),
        (attribute("/", "format_version", "1"), "format_version = '1': must be 1"),
        (attribute("/", "format_version"), "format_version = None: must be 1"),
        (attribute("/", "format", "other"), "format = 'other': must be 'rubberfric scene'"),
        (attribute("/", "format"), "format = None: must be"),
        (remove("scene"), "/scene: is missing"),
        (lambda f: f.create_group("extra"), "/extra: unknown field"),
        (attribute("/", "extra", 1), "attribute 'extra' is unknown"),
        (lambda f: f["scene"].create_group("heat"), "/scene/heat: unknown field; did you mean 'heating'?"),
        (attribute("scene/lower", "x", 1), "/scene/lower: attribute 'x' is unknown"),
        (attribute("scene/lower/material", "kind", "Prony2"), "kind = 'Prony2': did you mean"),
        (attribute("scene", "kind", "Slab"), "/scene"),
        (attribute("scene/lower/material", "kind", "Slab"), "/scene/lower/material/E:"),
        (attribute("scene/lower/material", "kind"), "kind = None: must be one of"),
        (remove("scene/lower/material"), "/scene/lower: Body.material = None: must be"),
        (attribute("scene", "area_correction", 1), "Scene.area_correction = 1: must be one"),
        (attribute("scene", "area_correction"), "attribute area_correction is missing"),
        (attribute("scene/upper/material", "outside", "x"), "TabulatedModulus.outside = 'x'"),
        (replace("scene/lower/layer", 1.0), "/scene/lower/layer: must be a group, not a dataset"),
        (replace("scene/lower/material/tau", [1, 2, 3]), "/scene/lower/material/tau: has type int64"),
        (replace("scene/lower/material/tau", "text"), "/scene/lower/material/tau: has type object"),
        (replace("scene/lower/material/tau", [1.0, 2.0]), "lengths differ (E has 3, tau has 2)"),
        (replace("scene/lower/material/tau", [1.0, -2.0, 3.0]), "Prony.tau[1] = -2.0: must be > 0"),
        (replace("scene/lower/spectrum/q1", 1.0), "SelfAffine.q1 = 1.0: must be >= qr"),
        (replace("scene/gamma", np.nan), "/scene: Scene.gamma = nan"),
        (replace("scene/gamma", 0.5, units="Pa"), "/scene/gamma: units = 'Pa': must be '-'"),
        (attribute("scene/gamma", "units"), "/scene/gamma: units = None: must be '-'"),
    ],
)
def test_faulty_hdf5(tmp_path, change, message):
    assert message in spoil(tmp_path / "scene.h5", change)


def elsewhere(tmp_path, kind):
    """Replace gamma by a number that is stored in another file."""
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = 0.3

    def change(file):
        kept = dict(file["scene/gamma"].attrs)
        del file["scene/gamma"]
        if kind == "external link":
            file["scene/gamma"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "/x")
            return
        if kind == "soft link":
            file["copy"] = 0.3
            file["scene/gamma"] = h5py.SoftLink("/copy")
        elif kind == "virtual":
            layout = h5py.VirtualLayout((1,), float)
            layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (1,))
            file.create_virtual_dataset("scene/gamma", layout)
        else:
            (tmp_path / "raw").write_bytes(np.float64(0.3).tobytes())
            file["scene"].create_dataset("gamma", (1,), float, external=[(str(tmp_path / "raw"), 0, 8)])
        file["scene/gamma"].attrs.update(kept)

    return change


@pytest.mark.parametrize("kind", ["external link", "soft link", "virtual", "external storage"])
def test_hdf5_with_data_in_another_file_is_refused(tmp_path, kind):
    message = spoil(tmp_path / "scene.h5", elsewhere(tmp_path, kind))
    assert "/scene/gamma" in message and "must be in this file" in message


def test_hdf5_scenes_have_a_limit_of_conditions(tmp_path):
    scene = rf.load_scene(DATA / "tread_on_asphalt.toml")
    many = np.linspace(1e-6, 1.0, 100_001)
    conditions = Conditions(many, np.array([1e5]), np.array([293.15]))
    path = tmp_path / "many.h5"
    save_result(path, Result(scene, conditions, Solution(), rf.Quadrature()))
    assert "velocity has 100001 values: must have at most 100000" in refused(
        path, lambda: read_computable(path)
    )


def test_hdf5_datasets_have_a_limit_of_values(tmp_path):
    """Chunks that are not written take no space in a file, and terabytes in memory."""

    def change(file):
        kept = dict(file["scene/lower/material/tau"].attrs)
        del file["scene/lower/material/tau"]
        file["scene/lower/material"].create_dataset("tau", (10**12,), float, chunks=(1000,)).attrs.update(
            kept
        )

    message = spoil(tmp_path / "scene.h5", change)
    assert "/scene/lower/material/tau has 1000000000000 values: must have at most 100000000" in message
    path, saved = tmp_path / "r.h5", result()
    save_result(path, saved)
    with h5py.File(path, "r+") as file:
        del file["area"]
        file.create_dataset("area", (10**12, 2, 3), float, chunks=(1000, 1, 1)).attrs["units"] = "-"
    assert "/area has shape (1000000000000, 2, 3): must be (1, 2, 3)" in refused(
        path, lambda: load_result(path)
    )


@pytest.mark.parametrize(
    "name",
    [
        f"{group}/{name}"
        for group in ("lower/material", "upper/material")
        for name in ("E", "omega", "poisson")
    ],
)
def test_missing_and_wrong_datasets(tmp_path, name):
    if name in ("upper/material/E", "lower/material/omega"):
        assert "unknown field" in spoil(
            tmp_path / "s.h5", lambda f: f.create_dataset(f"scene/{name}", data=1.0)
        )
        return
    assert f"/scene/{name}: is missing" in spoil(tmp_path / "s.h5", lambda f: f.__delitem__(f"scene/{name}"))
    for wrong in (-1.0, np.inf, [[1.0]], "text", np.ones(7)):
        spoil(tmp_path / "s.h5", replace(f"scene/{name}", wrong))


def test_truncated_hdf5(tmp_path):
    path = tmp_path / "scene.h5"
    rf.save_scene(path, EXAMPLES["Scene"])
    whole = path.read_bytes()
    for length in (0, 1, 7, 8, 50, 100, 1000, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        assert "must be a whole HDF5 file" in refused(path, lambda: rf.load_scene(path))
    path.write_bytes(b"no HDF5 at all" * 1000)
    assert "must be a whole HDF5 file" in refused(path, lambda: rf.load_scene(path))
    path.unlink()
    assert "No such file" in refused(path, lambda: rf.load_scene(path))


def result():
    conditions = Conditions(np.array([1e-3, 0.1, 1.0]), np.array([1e5, 2e5]), np.array([283.0]))
    values = np.random.default_rng(0).uniform(size=(5, 1, 2, 3))
    return Result(EXAMPLES["Scene"], conditions, rf.Solution(*values), rf.Quadrature(order=20), "Title µ")


def test_result_file_says_what_made_it(tmp_path):
    path, saved = tmp_path / "r.h5", result()
    save_result(path, saved)
    again = load_result(path)
    same(saved.scene, again.scene)
    same(saved.scene, rf.load_scene(path))
    assert (again.quadrature, again.title) == (saved.quadrature, saved.title)
    for x, y in zip((*saved.conditions, *saved.solution), (*again.conditions, *again.solution), strict=True):
        np.testing.assert_array_equal(x, y)
    with h5py.File(path) as file:
        units = {name: file[name].attrs["units"] for name in file if name not in ("scene", "quadrature")}
        assert [dim.label for dim in file["friction"].dims] == ["temperature", "pressure", "velocity"]
    assert units.pop("velocity") == "m/s"
    parts = {"viscoelastic_friction": "-", "shear_friction": "-"}
    assert units == parts | {
        "pressure": "Pa",
        "temperature": "K",
        "area": "-",
        "friction": "-",
        "separation": "m",
    }


def test_result_without_temperature_and_with_one_quantity(tmp_path):
    scene = rf.Scene(rf.Body(rf.Rigid()), rf.Body(rf.Elastic(1e6, 0.5)))
    conditions = Conditions(np.array([1.0]), np.array([1e5]), None)
    solution = rf.Solution(friction=np.zeros((1, 1, 1)))
    save_result(tmp_path / "r.h5", Result(scene, conditions, solution, rf.Quadrature()))
    again = load_result(tmp_path / "r.h5")
    assert again.conditions.temperature is None
    assert again.solution.area is None
    assert again.solution.shear_friction is None
    assert again.solution.friction.shape == (1, 1, 1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (remove("velocity"), "/velocity: is missing"),
        (remove("quadrature"), "/quadrature: is missing"),
        (attribute("quadrature", "order", 1), "Quadrature.order = 1: must be"),
        (attribute("quadrature", "order"), "attribute order is missing"),
        (attribute("quadrature", "x", 1), "attribute 'x' is unknown"),
        (replace("pressure", [1e5, -1.0]), "/pressure[1] = -1.0: must be > 0"),
        (replace("temperature", [100.0]), "/temperature[0] = 100.0: must be"),
        (replace("friction", np.ones(3)), "/friction has shape (3,): must be (1, 2, 3)"),
        (replace("shear_friction", np.ones((1, 2))), "/shear_friction has shape (1, 2): must be (1, 2, 3)"),
        (replace("area", np.ones((1, 2, 3)), units="m^2"), "/area: units = 'm^2': must be '-'"),
    ],
)
def test_faulty_results(tmp_path, change, message):
    path = tmp_path / "r.h5"
    save_result(path, result())
    with h5py.File(path, "r+") as file:
        change(file)
    assert message in refused(path, lambda: load_result(path))


def test_a_scene_file_is_no_result(tmp_path):
    rf.save_scene(tmp_path / "s.h5", EXAMPLES["Scene"])
    assert "no results" in refused(tmp_path / "s.h5", lambda: load_result(tmp_path / "s.h5"))
