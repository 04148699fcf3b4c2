"""Arguments that are too many, too large, or no numbers, and strict promotion of dtypes."""

import itertools
import re
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from problems import PROBLEMS, RIGID, ROAD, SHIFTED_TREAD, TREAD, scene
from support.cases.stored import as_arrays
from support.scenes.examples import EXAMPLES

import fitting
import rubberfric as rf
from rubberfric.base import forget, physical

SCENE = scene((TREAD,), (RIGID, ROAD))
TABLE = rf.TabulatedSpectrum([100.0, 1e3, 3e4], [1e-9, 1e-12, 1e-18])
COARSE = rf.Quadrature(order=6, panels=3, graded=2, ratio=5.0, angular_order=6)
MANY = {"velocity": np.ones(100_000), "pressure": np.full((100_000, 1), 1e5)}

HUGE = {
    "friction": lambda c: rf.friction(SCENE, **c),
    "contact_area": lambda c: rf.contact_area(SCENE, **c),
    "separation": lambda c: rf.separation(SCENE, **c),
    "solve": lambda c: rf.solve(SCENE, **c),
    "profile": lambda c: rf.analysis.profile(SCENE, **c),
    "separation_profile": lambda c: rf.analysis.separation_profile(SCENE, **c),
    "stress_distribution": lambda c: rf.analysis.stress_distribution(SCENE, 1e6, **c),
    "contact_stiffness": lambda c: rf.analysis.contact_stiffness(SCENE, **c),
    "dissipated_power": lambda c: rf.analysis.dissipated_power(SCENE, **c),
    "accuracy": lambda c: rf.analysis.accuracy(SCENE, **c),
    "sensitivity": lambda c: fitting.sensitivity(SCENE, **c, parameters="gamma"),
    "complex_modulus": lambda c: rf.complex_modulus(SHIFTED_TREAD, c["velocity"], c["pressure"] / 300),
    "jit": lambda c: jax.jit(lambda v: rf.friction(SCENE, v, c["pressure"]))(c["velocity"]),
    "eval_shape": lambda c: jax.eval_shape(lambda: rf.friction(SCENE, **c)),
}


@pytest.mark.parametrize("name", HUGE)
def test_more_points_than_memory_holds(name):
    with pytest.raises(ValueError, match=r"\(100000, 100000\) with 1e\+10 points: must be at most 5e\+07"):
        HUGE[name](MANY)


def test_points_times_other_numbers():
    stresses = np.ones((10_000, 1, 1))
    with pytest.raises(ValueError, match=r"stress .* with 1e\+08 points: must be at most"):
        rf.analysis.stress_distribution(SCENE, stresses, np.ones(100), np.full((100, 1), 1e5))
    with pytest.raises(ValueError, match=r"the conditions and q broadcast .* with 1e\+08 points"):
        rf.analysis.profile(SCENE, np.ones(10_000), 1e5, q=np.geomspace(1e2, 1e4, 10_000))


def test_conditions_beyond_the_range_of_floating_point_numbers():
    # Area and friction are proportional to a light load, and the separation is linear in its logarithm.
    loads = np.array([1e-100, 1e-50, 1.0])
    light = rf.solve(SCENE, 0.1, loads, quadrature=COARSE)
    np.testing.assert_allclose(light.area / loads, light.area[2], rtol=1e-5)
    np.testing.assert_allclose(light.friction, light.friction[2], rtol=1e-5)
    np.testing.assert_allclose(np.diff(light.separation), np.diff(light.separation)[0], rtol=1e-5)
    for pressure in (1e-101, 1e-150, [1e5, 1e-300]):
        with pytest.raises(ValueError, match=r"^pressure(\[1\])? = 1e-\d+: must be >= 1e-100 Pa$"):
            rf.friction(SCENE, 0.1, pressure)
    for velocity in (1e101, -1e300):
        with pytest.raises(ValueError, match=r"^velocity = -?1e\+\d+: must be between -1e100 and 1e100 m/s$"):
            rf.friction(SCENE, velocity, 1e5)
    single = as_arrays(SCENE, np.float32)
    with pytest.raises(ValueError, match=r"^pressure = 1e-15: must be >= 1e-7 Pa in float32; use float64$"):
        rf.friction(single, 0.1, 1e-15)
    with pytest.raises(ValueError, match=r"^velocity = 1e\+20: must be between .* in float32; use float64$"):
        rf.friction(single, 1e20, 1e5)


NOT_NUMBERS = {
    "pressure = 'abc': must be a number": lambda: rf.tuned(SCENE, "abc"),
    "pressure = None: must be a number": lambda: rf.tuned(SCENE, None),
    "margin = '1': must be a number": lambda: rf.tuned(SCENE, 1e5, margin="1"),
    "margin = None: must be a number": lambda: rf.tuned(SCENE, 1e5, margin=None),
    "scene is a str: must be a Scene": lambda: rf.tuned("scene", 1e5),
    "scene is a NoneType: must be a Scene": lambda: rf.tuned(None, 1e5),
    "pressure = {}: must be a real number": lambda: rf.analysis.default_quadrature(SCENE, {}),
    "rms_slope = '1.3': must be a number": lambda: rf.with_cutoff(ROAD, "1.3"),
    "rms_slope = None: must be a number": lambda: rf.with_cutoff(ROAD, None),
    "rms_slope has shape (2,): must be a scalar": lambda: rf.with_cutoff(ROAD, [1.0, 1.3]),
    "rms_slope = 'x': must be a number": lambda: rf.roughness.cutoff(ROAD, "x"),
    "spectrum is a str: must be SelfAffine": lambda: rf.with_cutoff("road"),
    "spectrum is a NoneType: must be SelfAffine": lambda: rf.with_cutoff(None),
    "spectrum is a DataFrame: must be SelfAffine": lambda: rf.rms_slope(pd.DataFrame({"q": [1.0]})),
    "q = '1e3': must be a number": lambda: rf.rms_slope(ROAD, "1e3"),
    "must be a sequence of real numbers": lambda: rf.roughness.rms_height(ROAD, ["1e3", None]),
    "q = None: must be a number": lambda: rf.power_spectrum(ROAD, None),
    "q = 'x': must be a number": lambda: rf.power_spectrum(ROAD, "x"),
    "q = True: must be a number": lambda: rf.power_spectrum(ROAD, True),
    "omega = None: must be a number": lambda: rf.complex_modulus(TREAD, None),
    "temperature = 'hot': must be a number": lambda: rf.complex_modulus(SHIFTED_TREAD, 1.0, "hot"),
    "temperature = -3.0: must be > 0": lambda: rf.complex_modulus(SHIFTED_TREAD, 1.0, -3.0),
    "material is a Series: must be Elastic": lambda: rf.complex_modulus(pd.Series([1.0]), 1.0),
}


@pytest.mark.parametrize("words", NOT_NUMBERS)
def test_other_objects_are_refused_in_one_line(words):
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        NOT_NUMBERS[words]()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("kind", ["float64", "Float64", "int64", "Int64", "object"])
def test_numbers_in_pandas_objects(kind):
    x = pd.Series([200, 1000, 20000], dtype=kind, index=[5, 7, 9])
    values = np.array(x, float)
    assert rf.tuned(SCENE, 100 * x).quadrature == rf.tuned(SCENE, 100 * values).quadrature
    np.testing.assert_array_equal(rf.rms_slope(ROAD, x), rf.rms_slope(ROAD, values))
    np.testing.assert_array_equal(rf.power_spectrum(ROAD, x), rf.power_spectrum(ROAD, values))
    np.testing.assert_array_equal(rf.complex_modulus(TREAD, x), rf.complex_modulus(TREAD, values))
    frame = pd.DataFrame({"q": x})
    np.testing.assert_array_equal(rf.power_spectrum(ROAD, frame), rf.power_spectrum(ROAD, values[:, None]))


def test_missing_numbers_in_pandas_objects():
    with pytest.raises(ValueError, match=r"q\[1\] = nan: must be finite"):
        rf.rms_slope(ROAD, pd.Series([1e3, None], dtype="Float64"))


class Steel(rf.Elastic):
    """A subclass without the decorator."""


def test_a_subclass_without_the_decorator_is_refused():
    with pytest.raises(
        ValueError, match=r"^Steel is a subclass of Elastic without a decorator: write @rubber"
    ):
        Steel(2e11, 0.3)


@pytest.mark.slow
def test_a_subclass_with_the_decorator_equals_its_base():
    class Granite(rf.Elastic):
        """A subclass that adds no field."""

    granite = physical(Granite)
    try:
        found, expected = (
            rf.solve(scene((TREAD,), (cls(5e7, 0.3), ROAD)), 0.1, 1e5) for cls in (granite, rf.Elastic)
        )
        slope = jax.grad(lambda body: rf.contact_area(rf.Scene(rf.Body(TREAD), body), 0.1, 1e5))(
            rf.Body(granite(5e7, 0.3), ROAD)
        )
    finally:
        forget(granite)
    np.testing.assert_allclose(found[:3], expected[:3], rtol=1e-9)
    assert slope.material.young < 0


# A problem of every part.
STRICT = (
    *("rubber", "law", "two rubbers", "correlation", "S in G, contact shear", "heating", "softening"),
    *("short-range adhesion", "long-range adhesion", "slab", "rubber on rubber base", "tabulated modulus"),
    *("tabulated spectrum", "grooves", "table of directions", "shear relaxes"),
)
# Scenes and dtypes of the ordinary run. Tracing the others takes long.
QUICK_TO_TRACE = (
    *(("rubber", np.float32), ("S in G, contact shear", None)),
    *(("tabulated modulus", None), ("tabulated spectrum", None)),
)


@pytest.mark.parametrize(
    ("name", "dtype"),
    [
        pytest.param(*case, marks=[pytest.mark.slow] * (case not in QUICK_TO_TRACE))
        for case in itertools.product(STRICT, (None, np.float32, np.float64))
    ],
)
def test_strict_promotion_of_dtypes(name, dtype):
    problem = PROBLEMS[name]
    given = problem.scene if dtype is None else as_arrays(problem.scene, dtype)
    speeds = (0,) if given.correlation is not None else (1, 0.1, np.array([1, 2]))

    def solved(one, speed):
        return rf.solve(one, speed, 200000, problem.temperature, quadrature=COARSE)

    with jax.numpy_dtype_promotion("strict"):
        for speed in speeds:
            jax.eval_shape(lambda speed=speed: solved(given, speed))
        jax.eval_shape(jax.grad(lambda one: jnp.sum(solved(one, speeds[0]).area)), given)


def test_strict_promotion_of_plain_calls():
    with jax.numpy_dtype_promotion("strict"):
        for one in (SCENE, as_arrays(SCENE, np.float32)):
            assert np.isfinite(rf.friction(one, 1, 200000, quadrature=COARSE))
            assert rf.tuned(one, 200000).quadrature is not None
        assert np.isfinite(jax.grad(lambda v: rf.friction(SCENE, v, 2e5, quadrature=COARSE))(1.0))
        for spectrum in (ROAD, TABLE, as_arrays(ROAD, np.float32)):
            assert rf.rms_slope(rf.with_cutoff(spectrum, 0.01)) == pytest.approx(0.01, rel=1e-5)
            assert rf.power_spectrum(spectrum, [1000, 2000]).shape == (2,)
        for material in (TREAD, SHIFTED_TREAD, EXAMPLES["TabulatedModulus"], rf.Elastic(10**6, 0.5)):
            assert rf.complex_modulus(material, 1).real > 0
            assert rf.complex_modulus(material, np.array([1, 2], np.float32)).shape == (2,)


def test_a_relaxed_modulus_that_the_program_found_is_not_asked_for_its_unit():
    # A fit of a melt, whose moduli fall without a gap, and the rounding error of a file of shares.
    melt = rf.Prony(5.0, 10.0 ** np.arange(1, 9), 10.0 ** -np.arange(1, 9))
    rounded = rf.Prony(1e9 * (1 - np.sum([0.3, 0.6, 0.1])), [3e8, 6e8, 1e8], [1e-6, 1e-4, 1e-2])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for material in (melt, rounded):
            scene((material,), (RIGID, ROAD))
