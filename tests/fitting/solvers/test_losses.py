"""Losses of robust fits: the formulas in 60 digits, efficiency, error bars.

`test_least_squares.py` compares costs with those of SciPy.
"""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from scipy.stats import norm, t
from support.scenes.bars import BOTH, DRY_FREE, VELOCITY, modulus_data
from support.scenes.fit_problems import DRY
from support.scenes.fits import FAST as QUADRATURE
from support.scenes.fits import THREE as SCENE

from fitting import FrictionData, fit
from fitting.solvers import objective as losses
from fitting.solvers.objective import LOSS_WIDTHS, normal_means
from fitting.solvers.problem import make_problem
from fitting.uncertainty.covariance import uncertainty

LOSSES = tuple(LOSS_WIDTHS)
RESIDUALS = np.concatenate([[0.0], np.logspace(-8, 4, 37), -np.logspace(-3, 3, 7)])


rho, factors = (jax.jit(function, static_argnums=0) for function in (losses.rho, losses.factors))


def textbook(loss, width):
    """rho as a function of z0 = r^2, in mpmath."""
    width2 = mpmath.mpf(width) ** 2
    return {
        "linear": lambda s: s,
        "huber": lambda s: s if s <= width2 else width2 * (2 * mpmath.sqrt(s / width2) - 1),
        "soft_l1": lambda s: 2 * width2 * (mpmath.sqrt(1 + s / width2) - 1),
        "cauchy": lambda s: width2 * mpmath.log(1 + s / width2),
    }[loss]


@pytest.mark.parametrize("loss", LOSSES)
@pytest.mark.parametrize("width", [0.3, 1.0, 4.0])
def test_values_and_derivatives_of_the_losses(loss, width):
    residual = np.array([1e-6, 1e-3, 0.1, 0.2, 0.9, 1.2, 3.0, 5.0, 40.0, 1e4, 1e8])
    with mpmath.workdps(60):
        exact = textbook(loss, width)
        expected = [
            [
                float(mpmath.diff(exact, mpmath.mpf(r) ** 2, n, h=mpmath.mpf(r) ** 2 * mpmath.mpf("1e-12")))
                for r in residual
            ]
            if n
            else [float(exact(mpmath.mpf(r) ** 2)) for r in residual]
            for n in range(3)
        ]
    for found, exact, tolerance in zip(
        rho(loss, width, jnp.asarray(residual)), expected, (1e-14, 1e-10, 1e-10), strict=True
    ):
        np.testing.assert_allclose(found, exact, rtol=tolerance, atol=1e-30)


@pytest.mark.parametrize("loss", LOSSES)
def test_factors_give_the_gradient_and_a_positive_curvature(loss):
    width = LOSS_WIDTHS[loss]
    first, second = factors(loss, width, jnp.asarray(RESIDUALS))
    slope = jax.jit(jax.vmap(jax.grad(lambda r: 0.5 * rho(loss, width, r)[0])))(jnp.asarray(RESIDUALS))
    # d(rho / 2) / dr = r rho': rows times both factors.
    np.testing.assert_allclose(RESIDUALS * first * second, slope, rtol=1e-13, atol=1e-300)
    assert np.all(np.asarray(second) > 0)
    curvature = jax.jit(jax.vmap(jax.grad(jax.grad(lambda r: 0.5 * rho(loss, width, r)[0]))))(
        jnp.asarray(RESIDUALS)
    )
    convex = np.asarray(curvature) > 0.2 * np.asarray(first * second)
    np.testing.assert_allclose(np.asarray(second)[convex] ** 2, curvature[convex], rtol=1e-10)


@pytest.mark.parametrize("loss", LOSSES)
@pytest.mark.parametrize("width", [1e-2, 1.0, 10.0])
def test_no_residual_breaks_a_loss(loss, width):
    residual = jnp.asarray([0.0, -0.0, 1e-200, 1e150, -1e150, width, -width])
    for part in (*rho(loss, width, residual), *factors(loss, width, residual)):
        assert np.isfinite(part).all()
    value, first, _ = rho(loss, width, residual)
    assert value[0] == 0 and first[0] == 1
    gradient = jax.jit(jax.vmap(jax.grad(lambda r: rho(loss, width, r)[0])))(residual)
    assert np.isfinite(gradient).all() and gradient[0] == 0


@pytest.mark.parametrize("loss", LOSSES)
def test_means_over_normal_residuals(loss):
    width = LOSS_WIDTHS[loss]
    psi = jax.grad(lambda r: 0.5 * rho(loss, width, r)[0])
    drawn = jnp.asarray(norm.ppf((np.arange(100_000) + 0.5) / 100_000))
    slope, bend = jax.vmap(psi)(drawn), jax.vmap(jax.grad(psi))(drawn)
    curvature = np.maximum(bend, 0.1 * slope / drawn)
    np.testing.assert_allclose(normal_means(loss, width), (np.mean(slope**2), np.mean(curvature)), rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("loss", [loss for loss in LOSSES if loss != "linear"])
def test_widths_make_gaussian_data_95_percent_efficient(loss):
    """(E psi')^2 / E psi^2 of a location estimate, by quadrature over the normal distribution."""
    r = jnp.linspace(-12, 12, 200_001)
    weight = np.exp(-0.5 * np.asarray(r) ** 2)
    weight /= weight.sum()
    slope = jax.grad(lambda r: 0.5 * rho(loss, LOSS_WIDTHS[loss], r)[0])
    psi, bend = np.asarray(jax.vmap(slope)(r)), np.asarray(jax.vmap(jax.grad(slope))(r))
    assert np.sum(weight * bend) ** 2 / np.sum(weight * psi**2) == pytest.approx(0.95, abs=1e-3)


@pytest.mark.slow
def test_a_robust_scatter_is_not_that_of_the_outliers():
    data = modulus_data(noise=0.03, omega=np.logspace(-1, 7, 60), given=False)
    measured = data.measured.copy()
    measured[::20] *= 5.0
    struck = data.replaced(measured)
    assert fit(SCENE, struck, BOTH).estimated[0] > 0.2
    robust = fit(SCENE, struck, BOTH, loss="cauchy")
    assert robust.estimated[0] == pytest.approx(0.03, rel=0.25)
    # The median of |r| has the efficiency of [Rousseeuw & Croux, JASA 88 (1993) 1273].
    quarter = norm.ppf(0.75)
    efficiency = 8 * (quarter * norm.pdf(quarter)) ** 2
    low, high = robust.interval(0.95)
    q = t.ppf(0.975, robust.freedom * efficiency)
    np.testing.assert_allclose(np.log(high / low), 2 * q * robust.uncertainty.deviation, rtol=1e-4)


def test_robust_error_bars_of_few_points_are_withheld_with_a_reason():
    """Each direction is known to better than a factor e, their sum in tau_f0 is not."""
    data = FrictionData(
        VELOCITY[[0, 3, 8, 11]],
        np.exp([-2.36698859, 0.77516245, -0.53305407, -2.50681706]),
        pressure=1e5,
        relative=[0.25707941, 0.78190658, 0.49738595, 3.12469569],
        check_units=False,
    )
    problem = make_problem(DRY, [data], DRY_FREE, loss="cauchy", quadrature=QUADRATURE)
    known = uncertainty(problem, problem.start)
    assert known.withheld and set(known.withheld.values()) == {"not identified, see direction 1"}
    assert len(known.unidentified) == 1
