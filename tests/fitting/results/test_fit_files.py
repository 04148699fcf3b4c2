"""Files of fits: faults, and failures while writing. `test_every_fit.py` has the round trips."""

import dataclasses
import re

import h5py
import jax
import numpy as np
import pytest
from support.scenes import fits
from support.scenes.fit_problems import OMEGA, REPORTED, RUBBER, same
from support.scenes.fits import E

import fitting
from fitting.results.hdf5 import GROUPS, save
from fitting.solvers.objective import INTERRUPTED


@pytest.mark.parametrize(("element", "x"), [(-1, 50.0), (0, 800.0)])
def test_a_fitted_scene_that_no_constructor_accepts_is_left_out(quick, tmp_path, element, x):
    """gamma = 5, which is refused at once, and E = inf, which is found deep inside."""
    moved = quick.x.copy()
    moved[element] = x
    save(tmp_path / "fit.h5", dataclasses.replace(quick, x=moved))
    with h5py.File(tmp_path / "fit.h5") as file:
        assert "scene" not in file
    assert fitting.FitResult.load(tmp_path / "fit.h5").values[element] == (5.0 if element else np.inf)


@pytest.mark.slow
def test_single_precision_stays(tmp_path):
    scene = jax.tree.map(lambda leaf: np.asarray(leaf, np.float32), REPORTED)
    data = fits.modulus_data(RUBBER, OMEGA, 0.03)
    result = fitting.fit(scene, data, {E: fitting.Positive()}, max_steps=2)
    assert result.scene.upper.material.tau.dtype == result.problem.targets.error.dtype == np.float32
    result.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert same(again.scene, result.scene)
    assert same(again.problem.targets, result.problem.targets)
    assert same(again.values, result.values)


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_earlier_file_survives_a_failure(quick, tmp_path, monkeypatch, failure):
    path = tmp_path / "fit.h5"
    quick.save(path)
    before = path.read_bytes()

    def fail(*_):
        raise failure

    monkeypatch.setattr("fitting.results.hdf5._write_minima", fail)
    with pytest.raises(type(failure)):
        quick.save(path)
    assert path.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["fit.h5"]


def drop(name):
    return lambda file: file.__delitem__(name)


def attribute(group, **values):
    return lambda file: file[group].attrs.update(values)


def replace(name, values, units="-"):
    def change(file):
        del file[name]
        file[name] = values
        file[name].attrs["units"] = units

    return change


BAD = {
    "newer": (attribute("/", format_version=2), "format_version = 2: must be 1"),
    "foreign": (attribute("/", format="rubberfric scene"), "format = 'rubberfric scene': must be"),
    "status": (attribute("/", status=99), "status = 99: must be one of 0, 1, "),
    "cost": (attribute("/", cost="low"), "attribute cost = 'low': must be of type float"),
    "loss": (attribute("/", loss="hubert"), "loss = 'hubert': did you mean 'huber'? must be one of linear"),
    "extra": (attribute("/", colour="red"), "attribute 'colour' is unknown"),
    "x": (replace("parameters/x", [1.0]), "/parameters/x has shape (1,): must be (4,)"),
    "names": (replace("parameters/names", ["a", "b", "c", "d"]), "/parameters/names: must list the"),
    "no names": (replace("parameters/names", [1.0]), "/parameters/names: is missing; must be a dataset of"),
    "covariance": (drop("uncertainty/covariance"), "/uncertainty/covariance: is missing; must be a dataset"),
    "rank": (lambda file: file["uncertainty"].attrs.__delitem__("rank"), "attribute rank = None: must be"),
    "count": (replace("minima/count", [1.5]), "/minima/count: must be 1 integers"),
    "estimated": (replace("estimated", [1.0, 2.0]), "/estimated has shape (2,): must be (1,)"),
    "rule": (attribute("free/0", rule="Positiv"), "/free/0: rule = 'Positiv': did you mean 'Positive'?"),
    "no rule": (attribute("free/1", low=1.0), "/free/1: attribute 'low' is unknown"),
    "scale": (attribute("free/1", scale=-1.0), "/free/1: Free: scale = -1.0: must be a number > 0"),
    "path": (attribute("free/0", path="upper.material.F"), "'upper.material.F': unknown key path; did you"),
    "no path": (lambda file: file["free/0"].attrs.__delitem__("path"), "must be a key path like"),
    "numbers": (lambda file: file.move("free/0", "free/2"), "/free/0: is missing; must be a group"),
    "data": (attribute("data/0", kind="mass"), "/data/0: kind = 'mass': must be one of friction, area"),
    "order": (attribute("quadrature", order=1), "Quadrature.order = 1"),
    **{name: (drop(name), f"/{name}: is missing; must be a group") for name in GROUPS},
}


@pytest.mark.parametrize("which", BAD)
def test_damaged_files(quick, tmp_path, which):
    change, message = BAD[which]
    path = tmp_path / "fit.h5"
    quick.save(path)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        fitting.FitResult.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_files_that_are_none(quick, tmp_path):
    for name, said in (("fit.hdf", "'.hdf': must be .h5"), ("no/fit.h5", "does not exist"), (".", "''")):
        with pytest.raises(ValueError, match=said):
            quick.save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []
    path = tmp_path / "fit.h5"
    with pytest.raises(ValueError, match=r"fit\.h5: cannot be read: No such file"):
        fitting.FitResult.load(path)
    quick.save(path)
    whole = path.read_bytes()
    for length in (0, 100, len(whole) // 2, len(whole) - 100):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r"fit\.h5: must be a whole HDF5 file"):
            fitting.FitResult.load(path)


def test_interrupted_fits_are_stored_as_such(quick, tmp_path):
    dataclasses.replace(quick, status=INTERRUPTED, cost=np.inf).save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert not again.success
    assert again.message == "interrupted: these are the best values so far"
    assert again.cost == np.inf
