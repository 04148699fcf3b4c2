"""Round trips: TOML and HDF5 files give back the numbers, types and options that were written."""

import functools
import os

import h5py
import jax
import numpy as np
import pytest
from problems import ROAD, SHIFTED_TREAD
from support.folders import DATA
from support.scenes.examples import EXAMPLES, examples, same
from support.scenes.results import result

import rubberfric as rf
from rubberfric.base.objects.physical import PhysicalObject, kinds, leaves_of
from rubberfric.io.files import load_result, read_scene_file, save_result
from rubberfric.io.hdf5 import read_object, write_object
from rubberfric.io.results import Conditions, Result
from rubberfric.io.toml import scene_texts
from rubberfric.materials.material import Material
from rubberfric.materials.shifts import Shift, VerticalShift
from rubberfric.materials.slab import Layer
from rubberfric.roughness.spectra import Spectrum
from rubberfric.scene.patch import PressureShape

ON_ROAD = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(SHIFTED_TREAD))
# Key path of an object of a class in this scene.
PLACES = {
    rf.Rigid: "lower.material",
    Material: "upper.material",
    Spectrum: "upper.spectrum",
    Layer: "upper.layer",
    Shift: "upper.material.shift",
    VerticalShift: "upper.material.shift.vertical",
    rf.ThermalProperties: "upper.thermal",
    rf.Body: "upper",
    rf.ContactShear: "shear",
    rf.Patch: "patch",
    rf.Softening: "softening",
    rf.Adhesion: "adhesion",
    rf.Correlation: "correlation",
    rf.Heating: "heating",
}


def in_scene(thing):
    """A scene with the object."""
    if isinstance(thing, rf.Scene):
        return thing
    if isinstance(thing, PressureShape):
        return ON_ROAD.replace(patch=rf.Patch(0.1, 0.2, 5e7, thing))
    scene = ON_ROAD
    if isinstance(thing, rf.Correlation):
        scene = ON_ROAD.replace({"upper.spectrum": ROAD.replace(hurst=0.7)})
    path = next(path for cls, path in PLACES.items() if isinstance(thing, cls))
    return scene.replace({path: thing})


DRAWN = rf.TabulatedAnisotropic([1e2, 1e3, 1e4], 1e-20 * np.arange(1.0, 16.0).reshape(3, 5), 0.3)
MOVED = rf.TabulatedModulus(
    [1.0, 10.0],
    [1e6, 2e6],
    [1e5, 2e5],
    0.49,
    rf.WLF(8.86, 101.6, 293.15, vertical=rf.Entropic(6e-4)),
    "hold",
    0.2,
)
# One scene with an object of each class, the scenes of `data`, and options that no example has.
SCENES = {
    **{name: functools.partial(in_scene, thing) for name, thing in EXAMPLES.items()},
    **{
        path.stem: functools.partial(rf.load_scene, path)
        for path in sorted(DATA.glob("*.toml"))
        if not path.stem.endswith("_fit")
    },
    "short range": lambda: in_scene(rf.Adhesion(0.02)),
    "directions": lambda: rf.Scene(
        rf.Body(EXAMPLES["PronyShear"], DRAWN), rf.Body(MOVED), area_correction=True
    ),
    "boundary elements": lambda: ON_ROAD.replace(contact_model="boundary_elements"),
}


@pytest.mark.parametrize("suffix", ["toml", "h5"])
@pytest.mark.parametrize("name", SCENES)
def test_a_saved_scene_is_the_same_scene(name, suffix, tmp_path):
    scene, path = SCENES[name](), tmp_path / f"scene.{suffix}"
    rf.save_scene(path, scene)
    same(rf.load_scene(path), scene)


@pytest.mark.parametrize("name", ["tread_on_asphalt", "heated_tread_on_asphalt"])
def test_conditions_and_titles_of_scene_files(name, tmp_path):
    scene, conditions, title = read_scene_file(DATA / f"{name}.toml")
    assert conditions.velocity.size > 1 and title
    for name_in_file in (title, 'a "b" \\ c'):
        for name, text in scene_texts(scene, conditions, name_in_file).items():
            (tmp_path / name).write_text(text, encoding="utf-8")
        again = read_scene_file(tmp_path / "scene.toml")
        same(again[:2], (scene, conditions))
        assert again.title == name_in_file


def test_what_is_hardly_in_si_is_accepted_again(tmp_path):
    with pytest.warns(rf.UnitWarning):
        scene = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(rf.Elastic(10.0, 0.5)))
    rf.save_scene(tmp_path / "scene.toml", scene)
    same(rf.load_scene(tmp_path / "scene.toml"), scene)
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


# --- results


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
    ratios = ("area", "friction", "viscoelastic_friction", "shear_friction")
    expected = {"velocity": "m/s", "pressure": "Pa", "temperature": "K", "separation": "m"}
    assert units == expected | dict.fromkeys(ratios, "-")


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
