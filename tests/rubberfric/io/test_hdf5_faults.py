"""One line for every fault of an HDF5 file."""

import os

import h5py
import jax
import numpy as np
import pytest
from support.refusals import refused
from support.scenes.examples import EXAMPLES
from support.scenes.results import result

import rubberfric as rf
from rubberfric.io.files import load_result, read_computable, save_result


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


def saved(path, kind="scene"):
    """Write a scene or a result; return the function that reads it."""
    if kind == "scene":
        rf.save_scene(path, EXAMPLES["Scene"])
        return rf.load_scene
    save_result(path, result(temperature=[283.0]))
    return load_result


def spoil(path, change, kind="scene"):
    """The message on a saved scene or result after one change to its file."""
    read = saved(path, kind)
    with h5py.File(path, "r+") as file:
        change(file)
    return refused(path, lambda: read(path))


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


def huge(name, shape):
    """Chunks that are not written take no space in a file, and terabytes in memory."""

    def change(file):
        kept = dict(file[name].attrs)
        del file[name]
        chunks = (1000,) + (1,) * (len(shape) - 1)
        file.create_dataset(name, shape, float, chunks=chunks).attrs.update(kept)

    return change


# Changes of a saved scene.
SCENE_FAULTS = [
    (attribute("/", "format_version", 2), "format_version = 2: must be 1"),
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
    (
        attribute("scene/upper/material", "kind", np.array(["Prony", "x"], h5py.string_dtype())),
        "/scene/upper/material: kind = array(['Prony', 'x'], dtype=object): must be one of",
    ),
    (
        lambda f: f["scene/upper"].__setitem__("shift", f["scene"]),
        "/scene/upper/shift is a link to another group; the data must be in this group",
    ),
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
    # A table has no E, a Prony series no omega.
    (lambda f: f.create_dataset("scene/upper/material/E", data=1.0), "/E: unknown field"),
    (lambda f: f.create_dataset("scene/lower/material/omega", data=1.0), "/omega: unknown field"),
    (
        huge("scene/lower/material/tau", (10**12,)),
        "/scene/lower/material/tau has 1000000000000 values: must have at most 100000000",
    ),
]
# Changes of a saved result.
RESULT_FAULTS = [
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
    (huge("area", (10**12, 2, 3)), "/area has shape (1000000000000, 2, 3): must be (1, 2, 3)"),
]


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [("scene", *fault) for fault in SCENE_FAULTS] + [("result", *fault) for fault in RESULT_FAULTS],
)
def test_a_changed_file_is_refused_in_one_line(tmp_path, kind, change, message):
    assert message in spoil(tmp_path / "file.h5", change, kind)


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


def test_files_have_a_limit_of_conditions(tmp_path):
    path, many = tmp_path / "many.h5", np.linspace(1e-6, 1.0, 100_001)
    content = result()
    save_result(
        path, content._replace(conditions=content.conditions._replace(velocity=many), solution=rf.Solution())
    )
    message = refused(path, lambda: read_computable(path))
    assert "velocity has 100001 values: must have at most 100000" in message


@pytest.mark.parametrize("name", ["lower/material/E", "lower/material/poisson", "upper/material/omega"])
def test_missing_and_wrong_datasets(tmp_path, name):
    path, name = tmp_path / "s.h5", f"scene/{name}"
    assert f"/{name}: is missing" in spoil(path, remove(name))
    for wrong in (-1.0, np.inf, [[1.0]], "text", np.ones(7)):
        spoil(path, replace(name, wrong))


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


def test_a_scene_file_is_no_result(tmp_path):
    rf.save_scene(tmp_path / "s.h5", EXAMPLES["Scene"])
    assert "no results" in refused(tmp_path / "s.h5", lambda: load_result(tmp_path / "s.h5"))
