"""Files of measured data: round trips of every kind, units, and one line for every fault."""

import dataclasses
import os

import h5py
import numpy as np
import pytest
from support.exports import put
from support.refusals import one_line, refused
from support.scenes.measured import GOOD, KINDS, absolute, equal, good

from fitting.data.files import read, read_group, write
from fitting.data.kinds import AreaData, FrictionData, ModulusData, SpectrumData
from rubberfric.io.tables import COLUMNS


def examples():
    """Each kind with unknown, relative and absolute errors, with awkward numbers."""
    rng = np.random.default_rng(0)
    for cls in KINDS:
        rough = {name: values * rng.uniform(0.9, 1.0, 2) for name, values in GOOD[cls].items()}
        yield cls(**rough)
        yield cls(**rough | {"temperature": None} if "temperature" in rough else rough, name="µ (20 °C), 5 %")
        yield cls(**rough, relative=rng.uniform(0.01, 0.1, 2))
        yield cls(**rough, **{name: rng.uniform(1e-3, 1e-2, 2) for name in cls.sigmas}, name="name")
    yield FrictionData([-1.0, 0.0], [-0.5, 0.0], 0.1, 1e5)
    yield FrictionData(1e9, 0.5, pressure=1e-9, temperature=1.0, check_units=False)


@pytest.mark.parametrize("data", list(examples()), ids=lambda data: data.quantity)
def test_files_keep_every_bit(data, tmp_path):
    data.write(tmp_path / "data.h5")
    equal(data, read(tmp_path / "data.h5"))
    data.write(str(tmp_path / "data.csv"))
    again = read(str(tmp_path / "data.csv"), check_units=False)
    assert again.name == ""
    equal(dataclasses.replace(data, name="", check_units=False), again)
    first = (tmp_path / "data.csv").read_text(encoding="utf-8").splitlines()[0]
    assert not data.name or first == f"# {data.name}"
    assert sorted(os.listdir(tmp_path)) == ["data.csv", "data.h5"]


@pytest.mark.parametrize("cls", [ModulusData, SpectrumData])
def test_body_in_files(cls, tmp_path):
    data = good(cls, body="upper", name="name")
    write(tmp_path / "data.h5", data)
    equal(data, read(tmp_path / "data.h5"))
    assert "body = 'lower': must not be given; the file has it" in one_line(
        lambda: read(tmp_path / "data.h5", body="lower")
    )
    write(tmp_path / "data.csv", data)
    assert (tmp_path / "data.csv").read_text().startswith("# name\n# of the upper body\n")
    assert read(tmp_path / "data.csv").body is None
    again = read(tmp_path / "data.csv", body="upper")
    equal(dataclasses.replace(data, name=""), again)


def test_columns_are_in_the_units_of_the_fields():
    for cls in KINDS:
        numeric = {field.name for field in dataclasses.fields(cls)} - {"name", "body", "history"}
        assert set(cls.fields()) == numeric
        for about in cls.fields().values():
            assert next(iter(COLUMNS[about.column].units)) == about.unit
            assert COLUMNS[about.column].name == about.column


def test_units_of_a_table(tmp_path):
    data = read(put(tmp_path, "log10_v,mu,relative_sigma,p,T\nlog10(mm/s),-,%,MPa,C\n0,0.5,3,0.15,20\n"))
    equal(data, FrictionData(1e-3, 0.5, pressure=0.15e6, temperature=293.15, relative=0.03))
    data = read(put(tmp_path, "v,A_over_A0,sigma,p\num/s,-,-,kPa\n2,0.5,0.01,150\n2,0.4,0.01,150\n"))
    equal(data, AreaData([2e-6, 2e-6], [0.5, 0.4], 0.01, 0.15e6))
    # Spellings of other programs are known here, too.
    data = read(put(tmp_path, "v,mu,p,T\nmm/sec,-,N/mm2,degC\n1,0.5,0.15,20\n"))
    equal(data, FrictionData(1e-3, 0.5, pressure=0.15e6, temperature=293.15))
    data = read(put(tmp_path, "v,mu,sigma,p\nm/s,%,%,MPa\n1,50,3,0.15\n"))
    equal(data, FrictionData(1.0, 0.5, sigma=0.03, pressure=0.15e6))
    data = read(put(tmp_path, "f,E_stor,E_loss,sigma_stor,sigma_loss\nHz,MPa,MPa,kPa,GPa\n2,4,3,20,0.001\n"))
    equal(data, ModulusData(4 * np.pi, 4e6, 3e6, 2e4, 1e6))
    data = read(put(tmp_path, "q,C,sigma_C\n1/mm,um^4,mm^4\n2,4,0.5\n1,3,0.5\n"), normalisation="C")
    equal(data, SpectrumData([2e3, 1e3], np.array([4.0, 3.0]) * 1e-24, 5e-13))


FRICTION = "v,mu\nm/s,-\n1,0.5\n"


MODULUS = "f,E_stor,E_loss\nHz,Pa,Pa\n1,1e6,1e5\n"


SPECTRUM = "q,C\n1/m,m^4\n1e3,1e-12\n"


def test_what_a_file_lacks(tmp_path):
    data = read(put(tmp_path, FRICTION), pressure=1e5, temperature=300.0, relative=0.1)
    equal(data, FrictionData(1.0, 0.5, pressure=1e5, temperature=300.0, relative=0.1))
    data = read(put(tmp_path, MODULUS), temperature=300.0, relative=0.1, body="upper")
    equal(data, ModulusData(2 * np.pi, 1e6, 1e5, temperature=300.0, relative=0.1, body="upper"))
    data = FrictionData(1.0, 0.5, pressure=1e5)
    data.write(tmp_path / "data.h5")
    again = read(tmp_path / "data.h5", temperature=300.0, relative=0.1)
    equal(again, dataclasses.replace(data, temperature=300.0, relative=0.1))


ALL_KINDS = (
    "must be the columns of one kind of data: friction has v or log10_v, mu, p; "
    "area has v or log10_v, A_over_A0, p; modulus has omega or f, E_stor, E_loss; "
    "spectrum has q or log10_q, C or log10_C"
)


ABSENT = "must not be given; "


@pytest.mark.parametrize(
    ("text", "given", "expected"),
    [
        ("v,mue\nm/s,-\n1,0.5\n", {}, f"columns v, mue: 'mue': did you mean 'mu'? {ALL_KINDS}"),
        ("T,aT\nK,-\n300,1\n", {}, f"columns T, aT: {ALL_KINDS}"),
        ("v,mu,A_over_A0\nm/s,-,-\n1,0.5,0.1\n", {}, f"columns v, mu, A_over_A0: {ALL_KINDS}"),
        ("v,mu,E_loss\nm/s,-,Pa\n1,0.5,1e5\n", {}, "line 1: column 'E_loss': must be one of"),
        ("v,mu,sigma_C\nm/s,-,m^4\n1,0.5,1e5\n", {}, "line 1: column 'sigma_C': did you mean 'sigma'?"),
        ("mu,p\n-,Pa\n0.5,1e5\n", {}, "no column v or log10_v: the table must have one"),
        ("v,mu,p,T\nm/s,-,MPa,K\n1,0.5,1,20\n", {}, "FrictionData.temperature[0] = 20.0: must be >= 100 K"),
        (FRICTION, {}, "no column p: add it to the table, or give pressure=... [Pa]"),
        (FRICTION, {"pressure": 0.1}, "FrictionData.pressure = 0.1: must be >= 1 Pa; is it in MPa"),
        (FRICTION, {"pressure": 1e5, "body": "upper"}, f"body = 'upper': {ABSENT}friction data have none"),
        (MODULUS, {"pressure": 1e5}, f"pressure = 100000.0: {ABSENT}modulus data have none"),
        (
            SPECTRUM,
            {"temperature": 300.0, "normalisation": "C"},
            f"temperature = 300.0: {ABSENT}spectrum data have none",
        ),
        (
            SPECTRUM,
            {"temperature": np.ones((2, 2)), "normalisation": "C"},
            f"{ABSENT}spectrum data have none",
        ),
        (
            "v,mu,p,sigma\nm/s,-,Pa,%\n1,0.5,1e5,3\n",
            {},
            "column sigma: unit '%': must be -, because sigma is not relative",
        ),
        ("v,mu,p\nm/s,-,Pa\n1,0.5,1e5\n", {"pressure": 1e5}, f"pressure = 100000.0: {ABSENT}the file has it"),
        (
            "f,E_stor,E_loss,T\nHz,Pa,Pa,C\n1,1e6,1e5,20\n",
            {"temperature": 300},
            f"temperature = 300: {ABSENT}the file has it",
        ),
        (
            "q,C,relative_sigma\n1/m,m^4,%\n1e3,1e-12,5\n",
            {"relative": 0.1, "normalisation": "C"},
            f"relative = 0.1: {ABSENT}the file has it",
        ),
    ],
)
def test_faulty_tables(tmp_path, text, given, expected):
    path = put(tmp_path, text)
    assert expected in refused(path, lambda: read(path, **given))


@pytest.mark.parametrize("name", ["data.docx", "data", "data.toml"])
def test_other_suffixes(tmp_path, name):
    path = tmp_path / name
    assert "must be .csv, .txt, .tsv, .dat, .xlsx or .h5" in refused(path, lambda: read(path))
    assert "must be .csv or .h5" in refused(path, lambda: good(FrictionData).write(path))


def test_nothing_is_written_of_what_cannot_be(tmp_path):
    for name in ("data.csv", "data.h5"):
        path = tmp_path / name
        assert "No such file" in refused(path, lambda path=path: read(path))
        expected = "data = 1.0: must be one of FrictionData, AreaData, ModulusData, SpectrumData"
        assert expected in refused(path, lambda path=path: write(path, 1.0))
        missing = tmp_path / "no" / name
        refused(missing, lambda path=missing: write(path, good(AreaData)))
    path = tmp_path / "data.csv"
    noisy = absolute(ModulusData).replaced([1e6, 2e6, -3.0, 1e5])
    assert "E_loss[0] = -3.0: must be > 0" in refused(path, lambda: noisy.write(path))
    assert os.listdir(tmp_path) == []
    noisy.write(tmp_path / "data.h5")
    equal(noisy, read(tmp_path / "data.h5"))


def test_several_in_one_file(tmp_path):
    sets = list(examples())
    with h5py.File(tmp_path / "fit.h5", "w") as file:
        for i, data in enumerate(sets):
            data.write_group(file.create_group(f"data/{i}"))
    with h5py.File(tmp_path / "fit.h5") as file:
        for i, data in enumerate(sets):
            equal(data, read_group(file[f"data/{i}"]))


def test_file_says_what_it_holds(tmp_path):
    path = tmp_path / "data.h5"
    absolute(ModulusData, body="upper", name="rubber").write(path)
    with h5py.File(path) as file:
        assert (file.attrs["format"], file.attrs["format_version"]) == ("rubberfric data", 1)
        assert dict(file["data"].attrs) == {"kind": "modulus", "name": "rubber", "body": "upper"}
        units = {name: values.attrs["units"] for name, values in file["data"].items()}
    assert (units.pop("omega"), units.pop("temperature")) == ("rad/s", "K")
    assert units == dict.fromkeys(("storage", "loss", "sigma_storage", "sigma_loss"), "Pa")


def dataset(name, values, units):
    def change(file):
        if name in file["data"]:
            del file["data"][name]
        file["data"][name] = values
        file["data"][name].attrs["units"] = units

    return change


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda f: f.attrs.create("format", "rubberfric scene"), "must be 'rubberfric data'"),
        (lambda f: f.__delitem__("data"), "/data: is missing; must be a group"),
        (lambda f: f.create_group("more"), "/more: unknown field; "),
        (lambda f: f["data"].attrs.create("kind", "frictions"), "/data: kind = 'frictions': did you mean"),
        (lambda f: f["data"].attrs.__delitem__("kind"), "/data: kind = None: must be one of friction, area"),
        (lambda f: f["data"].attrs.create("kind", [1, 2]), "/data: kind = "),
        (lambda f: f["data"].attrs.create("kind", "spectrum"), "/data/friction: unknown field"),
        (lambda f: f["data"].attrs.create("body", "lower"), "/data: attribute 'body' is unknown"),
        (lambda f: f["data"].attrs.create("name", 1), "/data: FrictionData.name = 1: must be text"),
        (lambda f: f["data"].__delitem__("pressure"), "/data/pressure: is missing; must be a dataset"),
        (dataset("pressure", 0.1, "MPa"), "/data/pressure: units = 'MPa': must be 'Pa'"),
        (dataset("pressure", -0.1, "Pa"), "/data: FrictionData.pressure = -0.1: must be > 0"),
        (dataset("sigma_C", 0.1, "m^4"), "/data/sigma_C: unknown field; did you mean 'sigma'?"),
    ],
)
def test_faulty_hdf5(tmp_path, change, expected):
    path = tmp_path / "data.h5"
    good(FrictionData).write(path)
    with h5py.File(path, "r+") as file:
        change(file)
    assert expected in refused(path, lambda: read(path))


def test_what_is_no_data(tmp_path):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "rubberfric data", "format_version": 1})
        file["data"] = 1.0
    assert "/data: must be a group, not a dataset" in refused(path, lambda: read(path))


def test_a_table_of_two_measured_quantities(tmp_path):
    """The text of an established program, of which `kind` selects a quantity."""
    text = "log10_v,mu_visc,A_over_A0\nlog10(m/s),-,-\n-4,0.9,0.018\n-3,1.55,0.031\n"
    path = put(tmp_path, text)
    assert "; or give kind" in refused(path, lambda: read(path, pressure=0.3e6))
    for kind, measured in (("friction", [0.9, 1.55]), ("area", [0.018, 0.031])):
        data = read(path, kind=kind, pressure=3e5)
        np.testing.assert_allclose(data.velocity, [1e-4, 1e-3], rtol=1e-14)
        np.testing.assert_array_equal(data.measured, measured)
