"""Results as data frames and data sets: numbers, units, conditions, and the way back."""

import builtins
import sys

import jax
import numpy as np
import pandas
import pytest
from support.scenes.fits import FAST, ROAD

import fitting
import rubberfric as rf
from rubberfric.base import Labelled, LabelledArrays
from rubberfric.theory.structure import Solution

RUBBER = rf.Prony(3e6, [5e7], [1e-5], shift=rf.WLF(12.0, 150.0, 293.15))
SCENE = rf.Scene(ROAD, rf.Body(RUBBER))
VELOCITY = np.array([1e-3, 0.1, 2.0])  # [m/s]
PRESSURE = np.array([1e5, 2e5])  # [Pa]
TEMPERATURE = np.array([280.0, 293.15])  # [K]
# mu = 1, 2, ... on the grid [temperature, pressure, velocity].
MU = np.arange(1.0, 13.0).reshape(2, 2, 3)
GRID = VELOCITY, PRESSURE[:, None], TEMPERATURE[:, None, None]


@pytest.fixture(scope="module")
def found():
    return rf.friction_map(SCENE, VELOCITY, PRESSURE, TEMPERATURE, quadrature=FAST)


def test_a_frame_of_a_solution():
    solution = Solution(friction=MU, separation=1e-6 * MU)
    frame = solution.to_dataframe(*GRID)
    titles = ["velocity [m/s]", "pressure [Pa]", "temperature [K]", "friction [-]", "separation [m]"]
    assert list(frame) == titles
    for mu, v, p, T in ((1.0, 1e-3, 1e5, 280.0), (6.0, 2.0, 2e5, 280.0), (11.0, 0.1, 2e5, 293.15)):
        row = frame[frame["friction [-]"] == mu].iloc[0]
        np.testing.assert_array_equal(row, [v, p, T, mu, 1e-6 * mu])
    assert list(solution.to_dataframe()) == titles[3:]
    assert Solution(friction=np.float64(0.8)).to_dataframe(0.1, 2e5).values.tolist() == [[0.1, 2e5, 0.8]]


def test_data_of_a_frame_are_the_results(found):
    """A frame of results is data for a fit."""
    data = fitting.read(found.to_dataframe())
    assert data.friction.size == 12
    expected = rf.friction(SCENE, data.velocity, data.pressure, data.temperature, quadrature=FAST)
    np.testing.assert_allclose(data.friction, expected, rtol=1e-9)


def test_a_data_set_of_a_solution():
    pytest.importorskip("xarray")
    data = Solution(friction=MU).to_xarray(*GRID)
    assert data.friction.dims == ("temperature", "pressure", "velocity")
    assert data.friction.sel(velocity=0.1, pressure=2e5, temperature=293.15) == 11.0
    assert [data[name].attrs["units"] for name in ("friction", "velocity")] == ["-", "m/s"]
    # One pressure and no temperature: a curve over velocity.
    curve = Solution(friction=MU[0, 0]).to_xarray(VELOCITY, 2e5)
    assert curve.friction.dims == ("velocity",) and curve.pressure == 2e5
    # Velocities and pressures change together.
    points = Solution(friction=MU[0, 0]).to_xarray(VELOCITY, PRESSURE[[0, 1, 1]])
    assert points.friction.dims == ("point",) and points.pressure.dims == ("point",)
    # Two temperatures, each with its own velocities.
    varying = Solution(friction=MU[:, 0]).to_xarray(
        np.array([VELOCITY, 2 * VELOCITY]), 1e5, TEMPERATURE[:, None]
    )
    assert varying.friction.dims == ("point_0", "point_1") and varying.temperature.dims == ("point_0",)
    assert Solution(friction=np.float64(0.8)).to_xarray(0.1, 2e5).friction == 0.8


def test_a_data_set_of_a_map(found):
    pytest.importorskip("xarray")
    data = found.to_xarray()
    assert data.area.dims == ("temperature", "pressure", "velocity")
    np.testing.assert_array_equal(data.friction, found.solution.friction)
    np.testing.assert_array_equal(data.pressure, PRESSURE)
    again = fitting.read(data[["friction"]])
    np.testing.assert_array_equal(again.friction, np.ravel(found.solution.friction))


def test_a_measured_spectrum():
    """A surface of one wave a sin(8 x), with the mean square height a^2/2 in one bin."""
    n, a = 64, 1e-6
    x = 2 * np.pi * np.arange(n) / n
    measured = rf.roughness.spectrum_of_topography(a * np.sin(8 * x)[:, None] * np.ones(n), x[1], x[1])
    frame = measured.to_dataframe()
    assert list(frame) == ["q [1/m]", "C [m^4]", "relative_sigma [-]", "modes [-]"]
    total = measured.cell * (frame["modes [-]"] * frame["C [m^4]"]).sum()
    assert total == pytest.approx(a**2 / 2, rel=0.02)
    positive = frame[frame["C [m^4]"] > 0]
    data = fitting.read(positive, normalisation="C", check_units=False)
    np.testing.assert_array_equal(data.C, positive["C [m^4]"])
    pytest.importorskip("xarray")
    assert measured.to_xarray().C.dims == ("q",) and measured.to_xarray().q.attrs["units"] == "1/m"
    profile = rf.roughness.spectrum_of_profile(x[1], a * np.sin(8 * x))
    assert list(profile.to_dataframe())[1] == "C_1D [m^3]"


def test_measured_data_there_and_back():
    pytest.importorskip("xarray")
    data = fitting.FrictionData(VELOCITY, [0.5, 0.6, 0.7], pressure=2e5, sigma=0.01, history=("a", "b"))
    for source in (data.to_dataframe(), data.to_xarray()):
        assert source.attrs == {"history": "a\nb"}
        again = fitting.read(source)
        for name in ("velocity", "friction", "pressure", "sigma"):
            np.testing.assert_array_equal(getattr(again, name), getattr(data, name))
    assert data.to_xarray().mu.dims == ("point",) and data.to_xarray().v.attrs["units"] == "m/s"


@pytest.mark.parametrize("library", ["pandas", "xarray"])
def test_a_library_that_is_missing(monkeypatch, library):
    def without(name, *arguments, **options):
        if name == library:
            raise ModuleNotFoundError(f"No module named {name!r}")
        return importing(name, *arguments, **options)

    importing = builtins.__import__
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.setattr(builtins, "__import__", without)
    solution, data = Solution(friction=MU), fitting.FrictionData([1.0], [0.5], pressure=1e5)
    for one in (solution, data):
        call = one.to_dataframe if library == "pandas" else one.to_xarray
        with pytest.raises(
            ImportError, match=f"^{library} is missing: must be installed, with pip install {library}$"
        ):
            call()


def test_wrong_arrays():
    with pytest.raises(
        ValueError, match=r"^shapes differ .*: the conditions must broadcast to the quantities$"
    ):
        Solution(friction=MU).to_dataframe([1.0, 2.0])
    with pytest.raises(ValueError, match="the conditions must broadcast to the quantities"):
        Solution(friction=np.ones(1)).to_dataframe([1.0, 2.0])
    with pytest.raises(ValueError, match="arrays are traced: must be numbers"):
        jax.jit(lambda x: Solution(friction=x).to_dataframe())(1.0)


def test_texts_and_arrays_without_a_unit():
    arrays = LabelledArrays({"name": Labelled(["a", "b"])}, {"x": Labelled([1.0, 2.0], "m")}, ("name",))
    frame = arrays.to_dataframe()
    pandas.testing.assert_frame_equal(frame, pandas.DataFrame({"name": ["a", "b"], "x [m]": [1.0, 2.0]}))
