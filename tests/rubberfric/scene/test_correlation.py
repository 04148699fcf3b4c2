"""Correlated roughness of two solids at rest equals the roughness of their difference."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from problems import RIGID, ROAD, TREAD, WORN

import rubberfric as rf

PRESSURE = np.array([1e3, 1e5, 1e7])
QUADRATURE = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0)


def _scene(coherence=None, lower=ROAD, upper=WORN, **options):
    correlation = None if coherence is None else rf.Correlation(coherence)
    bodies = rf.Body(rf.Elastic(5e6, 0.4), lower), rf.Body(TREAD, upper)
    return rf.Scene(*bodies, correlation=correlation, **options)


def _solved(scene):
    found = rf.solve(scene, 0.0, PRESSURE, quadrature=QUADRATURE, quantities=("area", "separation"))
    return np.array([found.area, found.separation])


def test_equal_surfaces_fit_each_other():
    area, separation = _solved(_scene(1.0, upper=ROAD))
    assert np.all(area == 1)
    assert np.all(separation == 0)


@pytest.mark.parametrize(("coherence", "height"), [(-1.0, 3.0), (1.0, 1.0), (0.5, 3.0**0.5)])
def test_heights_of_equal_form_add_as_those_of_the_difference(coherence, height):
    # (2 h - h)^2 = 1, (2 h + h)^2 = 9, and 4 + 1 - 2 . 0.5 . 2 = 3 times one surface.
    found = _solved(_scene(coherence, upper=ROAD.replace(h_rms=2 * ROAD.h_rms)))
    wanted = _solved(_scene(lower=ROAD.replace(h_rms=height * ROAD.h_rms), upper=None))
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_the_derivative_by_a_coherence_of_one_is_finite():
    def area(coherence):
        return rf.contact_area(_scene(0.0).replace("correlation.coherence", coherence), 0.0, 1e5)

    assert np.isfinite(jax.jit(jax.grad(area))(1.0))


def test_what_correlation_does_not_allow_is_refused():
    with pytest.raises(ValueError, match=r"^velocity\[1\] = 1.0: must be 0, because correlated roughness"):
        rf.contact_area(_scene(0.5), [0.0, 1.0], 1e5)
    assert np.isnan(jax.jit(lambda v: rf.contact_area(_scene(0.5), v, 1e5))(1.0))
    with pytest.raises(ValueError, match=r"^Scene.correlation: upper.spectrum is None; both"):
        _scene(0.5, upper=None)
    with pytest.raises(ValueError, match=r"^Scene.correlation: upper.spectrum is anisotropic"):
        _scene(0.5, upper=rf.Anisotropic(ROAD, 2.0))
    with pytest.raises(ValueError, match=r"^scene.correlation: profile is not defined with correlation"):
        rf.analysis.profile(_scene(0.5), 0.0, 1e5)
    assert rf.Scene(rf.Body(RIGID, ROAD), rf.Body(TREAD)).correlation is None


# One-sided difference of fourth order. One side is smooth where the ends of two spectra coincide.
ONE_SIDED = np.array([-25 / 12, 4, -3, 4 / 3, -1 / 4])
STEP = 3e-5  # step of the difference, relative to a number


def _errors_of_derivatives(lower, upper, coherence, quadrature):
    """Return the errors of the derivatives of ln A and ln u by all numbers of a pair and its pressure.

    Errors are differences from ONE_SIDED, divided by the largest derivative. The first axis is forward and
    reverse mode. The numbers of the lower spectrum decrease and all others increase. AD takes the same side,
    because kinks of the lower spectrum come first where kinks coincide.
    """
    scene = _scene(coherence, lower, upper)
    others = (upper, coherence, scene.lower.material, scene.upper.material, 2e4)
    start, rebuilt = ravel_pytree((lower, others))
    sides = np.where(np.arange(start.size) < len(ravel_pytree(lower)[0]), -1.0, 1.0)

    def values(numbers):
        lower, (upper, coherence, first, second, pressure) = rebuilt(numbers)
        spectra = {"lower.spectrum": lower, "upper.spectrum": upper, "correlation.coherence": coherence}
        pair = scene.replace(spectra | {"lower.material": first, "upper.material": second})
        solved = rf.solve(pair, 0.0, pressure, quadrature=quadrature, quantities=("area", "separation"))
        return jnp.log(jnp.stack([solved.area, solved.separation]))

    steps = sides * STEP * np.where(start == 0, 1.0, np.abs(start))
    shifted = start + np.arange(5)[:, None, None] * np.diag(steps)
    expected = np.tensordot(ONE_SIDED, jax.jit(jax.vmap(jax.vmap(values)))(shifted), 1).T
    computed = [jax.jit(mode(values))(start) * steps for mode in (jax.jacfwd, jax.jacrev)]
    return (np.array(computed) - expected) / np.max(np.abs(expected), 1, keepdims=True)


TABLE = rf.TabulatedSpectrum([100.0, 500.0, 3e3, 3.1e4], [1e-11, 1e-13, 3e-16, 2e-20])
KINKS_THAT_COINCIDE = {
    "replica": (ROAD, ROAD, 0.8),
    "rolloffs and ends": (ROAD, ROAD.replace(h_rms=1e-4, hurst=0.7), 0.4),
    "rolloff and begin": (ROAD, rf.SelfAffine(1000.0, 3.1e4, 1e5, 0.7, 1e-4), -0.5),
    "tables": (TABLE, TABLE.replace(C=0.5 * TABLE.C), 0.4),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", KINKS_THAT_COINCIDE)
def test_derivatives_where_kinks_coincide_agree_with_differences(name):
    quadrature = rf.Quadrature(order=10, panels=6, graded=6, ratio=4.5)
    assert np.max(np.abs(_errors_of_derivatives(*KINKS_THAT_COINCIDE[name], quadrature))) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_derivatives_of_random_pairs_with_shared_kinks_agree_with_differences(seed):
    rng = np.random.default_rng(seed)
    kinks = 100.0 * np.cumprod(rng.uniform(2.0, 8.0, 5))

    def spectrum(q):
        if seed % 3:
            return rf.SelfAffine(*q[[0, 1, -1]], rng.uniform(0.3, 1.0), 0.02 * rng.uniform(0.5, 2.0) / q[0])
        return rf.TabulatedSpectrum(q, 1e-3 * rng.uniform(0.3, 1.0, q.size) * q**-4.0)

    lower = spectrum(kinks[:4])
    # The upper spectrum shares all kinks, all but the last, or all but the first.
    upper = spectrum((kinks[:4], kinks[[0, 1, 2, 4]], kinks[1:])[seed // 3 % 3])
    errors = _errors_of_derivatives(lower, upper, rng.uniform(-1.0, 1.0), rf.Quadrature())
    assert np.max(np.abs(errors)) < 1e-7


@pytest.mark.slow
def test_derivatives_by_a_height_of_zero():
    # C = (h_1 - h_2)^2 + 2 (1 - kappa) h_1 h_2 in units of one spectrum, so h decreases by kappa h_2 first.
    def area(height):
        return rf.contact_area(_scene(0.7, ROAD.replace(h_rms=height), ROAD), 0.0, 1e5, quadrature=QUADRATURE)

    def area_alone(height):
        alone = _scene(None, ROAD.replace(h_rms=height), None)
        return rf.contact_area(alone, 0.0, 1e5, quadrature=QUADRATURE)

    expected = -0.7 * jax.grad(area_alone)(ROAD.h_rms)
    assert float(jax.grad(area)(0.0)) == pytest.approx(float(expected), rel=1e-9)
    assert float(jax.jacfwd(area)(0.0)) == pytest.approx(float(expected), rel=1e-9)
