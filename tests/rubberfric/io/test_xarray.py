"""Result files as other programs read them: named dimensions with coordinates and units."""

import h5py
import numpy as np
import pytest
from problems import RIGID, ROAD, SHIFTED_TREAD, scene
from support.scenes.results import result

import rubberfric as rf
from rubberfric.io.files import load_result, save_result
from rubberfric.io.results import DIMENSIONS

UNITS = {"velocity": "m/s", "pressure": "Pa", "temperature": "K"}


@pytest.fixture(params=[True, False], ids=["temperatures", "no temperature"])
def saved(request, tmp_path):
    """A result and its file."""
    content = result() if request.param else result(temperature=None)
    save_result(tmp_path / "r.h5", content)
    return content, tmp_path / "r.h5"


def is_read_again(path, content):
    again = load_result(path)
    assert (again.conditions.temperature is None) == (content.conditions.temperature is None)
    for name in ("area", "friction", "separation"):
        np.testing.assert_array_equal(getattr(again.solution, name), getattr(content.solution, name))


def test_scales(saved):
    content, path = saved
    with h5py.File(path) as file:
        for name in ("area", "friction", "separation"):
            for axis, dimension in enumerate(DIMENSIONS):
                assert file[name].dims[axis].label == dimension
                (scale,) = file[name].dims[axis].values()
                assert scale == file[dimension] and scale.is_scale
                if (expected := getattr(content.conditions, dimension)) is not None:
                    np.testing.assert_array_equal(scale, expected)
                    assert scale.attrs["units"] == UNITS[dimension]
    is_read_again(path, content)


def test_files_without_scales_are_read(saved):
    """Older files."""
    content, path = saved
    with h5py.File(path, "a") as file:
        for name in ("area", "friction", "separation"):
            for axis in range(3):
                for scale in list(file[name].dims[axis].values()):
                    file[name].dims[axis].detach_scale(scale)
        if content.conditions.temperature is None:
            del file["temperature"]
        for name in file.keys() & set(DIMENSIONS):
            for attribute in ("CLASS", "NAME"):
                del file[name].attrs[attribute]
    is_read_again(path, content)


def test_a_map_written_batch_by_batch(tmp_path, monkeypatch):
    """Its arrays lie in the file in one piece still."""
    path = tmp_path / "map.h5"
    monkeypatch.setattr("rubberfric.analysis.maps.MOST_IN_MEMORY", 1)
    rubber_on_road = scene((RIGID, ROAD), (SHIFTED_TREAD,))
    conditions = ([1e-3, 0.1, 2.0], [1e5, 2e5], [280.0, 293.15])
    found = rf.friction_map(rubber_on_road, *conditions, path=path, block=5, quantities="area")
    np.testing.assert_array_equal(found.solution.area, load_result(path).solution.area)
    with h5py.File(path) as file:
        assert [next(iter(d.values())).name for d in file["area"].dims] == [f"/{name}" for name in DIMENSIONS]


def test_xarray(saved):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    content, path = saved
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data.friction.dims == DIMENSIONS
        assert data.attrs["title"] == "Title µ"
        assert data.separation.attrs["units"] == "m" and data.velocity.attrs["units"] == "m/s"
        assert ("temperature" in data.coords) == (content.conditions.temperature is not None)
        np.testing.assert_array_equal(data.friction, content.solution.friction)
        last = data.friction.sel(velocity=0.1, pressure=2e5).isel(temperature=-1)
        assert last == content.solution.friction[-1, 1, 1]
