"""Result files as other programs read them: named dimensions with coordinates and units."""

import h5py
import numpy as np
import pytest
from support.scenes.fits import ROAD

import rubberfric as rf
from rubberfric.io.files import load_result, save_result
from rubberfric.io.results import DIMENSIONS, Conditions, Result
from rubberfric.theory.structure import Solution

RUBBER = rf.Prony(3e6, [5e7], [1e-5], shift=rf.WLF(12.0, 150.0, 293.15))
SCENE = rf.Scene(ROAD, rf.Body(RUBBER))
VELOCITY = np.array([1e-3, 0.1, 2.0])  # [m/s]
PRESSURE = np.array([1e5, 2e5])  # [Pa]
TEMPERATURE = np.array([280.0, 293.15])  # [K]


def result(temperature):
    """A result file's content with numbers that say where they belong."""
    shape = (1 if temperature is None else temperature.size, PRESSURE.size, VELOCITY.size)
    values = np.arange(np.prod(shape), dtype=float).reshape(shape)
    solution = Solution(area=values / 100, friction=values, separation=values * 1e-6)
    return Result(SCENE, Conditions(VELOCITY, PRESSURE, temperature), solution, rf.Quadrature(), "Map")


@pytest.mark.parametrize("temperature", [None, TEMPERATURE])
def test_scales(temperature, tmp_path):
    path, given = tmp_path / "r.h5", result(temperature)
    save_result(path, given)
    with h5py.File(path) as file:
        for name in ("area", "friction", "separation"):
            for axis, dimension in enumerate(DIMENSIONS):
                assert file[name].dims[axis].label == dimension
                (scale,) = file[name].dims[axis].values()
                assert scale == file[dimension] and scale.is_scale
                if dimension != "temperature" or temperature is not None:
                    np.testing.assert_array_equal(scale, getattr(given.conditions, dimension))
                    assert (
                        scale.attrs["units"]
                        == {"velocity": "m/s", "pressure": "Pa", "temperature": "K"}[dimension]
                    )
    again = load_result(path)
    assert (again.conditions.temperature is None) == (temperature is None)
    for name in ("area", "friction", "separation"):
        np.testing.assert_array_equal(getattr(again.solution, name), getattr(given.solution, name))


@pytest.mark.parametrize("temperature", [None, TEMPERATURE])
def test_files_without_scales_are_read(temperature, tmp_path):
    """Older files."""
    path, given = tmp_path / "r.h5", result(temperature)
    save_result(path, given)
    with h5py.File(path, "a") as file:
        for name in ("area", "friction", "separation"):
            for axis in range(3):
                for scale in list(file[name].dims[axis].values()):
                    file[name].dims[axis].detach_scale(scale)
        if temperature is None:
            del file["temperature"]
        for name in DIMENSIONS:
            for attribute in ("CLASS", "NAME"):
                if name in file:
                    del file[name].attrs[attribute]
    again = load_result(path)
    assert (again.conditions.temperature is None) == (temperature is None)
    np.testing.assert_array_equal(again.solution.friction, given.solution.friction)


def test_a_map_written_batch_by_batch(tmp_path, monkeypatch):
    """Its arrays lie in the file in one piece still."""
    path = tmp_path / "map.h5"
    monkeypatch.setattr("rubberfric.analysis.maps.MOST_IN_MEMORY", 1)
    found = rf.friction_map(SCENE, VELOCITY, PRESSURE, TEMPERATURE, path=path, block=5, quantities="area")
    again = load_result(path)
    np.testing.assert_array_equal(found.solution.area, again.solution.area)
    with h5py.File(path) as file:
        assert [next(iter(d.values())).name for d in file["area"].dims] == [f"/{name}" for name in DIMENSIONS]


@pytest.mark.parametrize("temperature", [None, TEMPERATURE])
def test_xarray(temperature, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path, given = tmp_path / "r.h5", result(temperature)
    save_result(path, given)
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.friction.dims == DIMENSIONS
        assert data.attrs["title"] == "Map"
        assert data.separation.attrs["units"] == "m" and data.velocity.attrs["units"] == "m/s"
        assert ("temperature" in data.coords) == (temperature is not None)
        np.testing.assert_array_equal(data.friction, given.solution.friction)
        found = data.friction.sel(velocity=0.1, pressure=2e5).isel(temperature=-1)
        assert found == given.solution.friction[-1, 1, 1]
