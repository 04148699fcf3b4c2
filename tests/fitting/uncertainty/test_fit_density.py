"""The log density of a fit: minus its cost, and what samplers need around it."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from support.jacobians import functions
from support.scenes.fits import E_INF, FAST, HURST, E, linear_data, maxwell_columns
from support.scenes.fits import THREE as SCENE

import fitting
import rubberfric as rf
from fitting import Bounded, Free, FrictionData, Gaussian, ModulusData, Positive, fit, log_density
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.problem import make_problem

RUBBER = SCENE.upper.material
OMEGA = np.logspace(-1, 7, 20)


def moduli(E_inf, E, omega=OMEGA):
    """E' and then E'' of a Prony series, by its formula."""
    return maxwell_columns(omega, RUBBER.tau) @ [*E, E_inf]


def drawn(size, scale, seed=0):
    return scale * np.random.default_rng(seed).standard_normal(size)


@pytest.fixture(scope="module")
def modulus():
    """A fit in logarithms, with a prior: not linear in x."""
    values = moduli(3e6, np.asarray(RUBBER.E)) * np.exp(drawn(2 * OMEGA.size, 0.2))
    data = ModulusData(OMEGA, *np.split(values, 2), relative=0.2)
    prior = {E_INF: Gaussian(2e6, 4e5)}
    return fit(SCENE, data, {E: Positive(), E_INF: Positive()}, prior=prior, quadrature=FAST)


def posterior(result, values):
    """Log density of the fit above, every factor from scipy and normalised."""
    data = result.data[0]
    measured = np.concatenate([data.storage, data.loss])
    found = stats.norm.logpdf(np.log(moduli(values[3], values[:3])), np.log(measured), 0.2).sum()
    return found + stats.norm.logpdf(np.log(values[3]), np.log(2e6), 4e5 / 2e6)


def test_it_is_the_posterior_but_for_a_constant(modulus):
    density = log_density(modulus)
    for seed in range(4):
        x = modulus.x + drawn(4, 0.5, seed)
        expected = posterior(modulus, np.exp(x)) - posterior(modulus, modulus.values)
        np.testing.assert_allclose(density(x) - density(modulus.x), expected, rtol=1e-10)
        np.testing.assert_allclose(density.values(x), np.exp(x), rtol=1e-14)


def test_it_is_minus_the_cost_and_level_at_the_fit(modulus):
    density = log_density(modulus)
    np.testing.assert_allclose(density(modulus.x), -modulus.cost, rtol=1e-12)
    assert float(modulus.log_density(modulus.x)) == float(density(modulus.x))
    slope = jax.jit(jax.grad(density))(modulus.x)
    # One standard error away it would be about one; a fit ends where less than its tolerance of
    # the cost is to be won, which is half the square of this.
    won = LevenbergMarquardt().tolerance * modulus.cost
    assert np.abs(slope * modulus.uncertainty.deviation).max() < np.sqrt(2 * won)
    steps = 1e-5 * np.eye(4)
    x = modulus.x + drawn(4, 0.3)
    found = [(density(x + h) - density(x - h)) / 2e-5 for h in steps]
    np.testing.assert_allclose(jax.jit(jax.grad(density))(x), found, rtol=1e-7)
    np.testing.assert_allclose(jax.jit(jax.jacfwd(density))(x), jax.jit(jax.grad(density))(x), rtol=1e-12)


def test_its_curvature_is_the_inverse_covariance_but_for_the_bent_residuals(modulus):
    rows, x = functions(modulus.problem)[0], jnp.asarray(modulus.x)
    curvature = -np.asarray(jax.jit(jax.hessian(log_density(modulus)))(x))
    bent = np.einsum("i,ijk", rows(x), jax.jit(jax.hessian(rows))(x))
    covariance = modulus.covariance / np.outer(modulus.values, modulus.values)  # of ln value
    np.testing.assert_allclose((curvature - bent) @ covariance, np.eye(4), atol=1e-8)
    assert np.abs(bent @ covariance).max() > 1e-3  # the test would see it missing


def other_problem(result, *arguments, **options):
    """A result of another problem, which was never solved."""
    problem = make_problem(SCENE, *arguments, **options, quadrature=FAST)
    return dataclasses.replace(result, problem=problem, x=problem.start)


def test_of_a_linear_problem_it_is_a_gaussian(modulus):
    data = linear_data(RUBBER, OMEGA)
    density = log_density(other_problem(modulus, [data], {E: Free(), E_INF: Free()}))
    scale = np.array([5e7, 8e6, 2e6, 3e6])  # a Free parameter is x times its start
    weighted = maxwell_columns(OMEGA, RUBBER.tau) * scale / data.error[:, None]
    covariance = np.linalg.inv(weighted.T @ weighted)
    mean = covariance @ weighted.T @ (data.measured / data.error)
    at = stats.multivariate_normal(mean, covariance)
    for seed in range(3):
        x = mean + drawn(4, 0.1, seed)
        expected = at.logpdf(x) - at.logpdf(mean)
        np.testing.assert_allclose(density(x) - density(mean), expected, rtol=1e-9)


@pytest.fixture(scope="module")
def mixed(modulus):
    """A problem with rules of every kind; the data do not inform two parameters."""
    free = {E: Positive(), HURST: Bounded(0.3, 1.0), "gamma": Free(scale=0.2)}
    return other_problem(modulus, modulus.data, free)


def test_flat_in_values_counts_their_slopes(mixed):
    in_x, in_values = log_density(mixed), log_density(mixed, flat="values")
    assert in_x.names == mixed.names
    x = mixed.x + drawn(5, 0.2)
    values = in_x.values(x)
    hurst = values[3]
    slopes = np.prod(values[:3]) * (hurst - 0.3) * (1.0 - hurst) / 0.7 * 0.2
    np.testing.assert_allclose(in_values(x) - in_x(x), np.log(slopes), rtol=1e-12)
    # Far out, where the slope itself is 0.
    far = x.copy()
    far[3] = 800.0
    expected = np.log(np.prod(values[:3]) * 0.7 * 0.2) - 800.0
    np.testing.assert_allclose(in_values(far) - in_x(far), expected, rtol=1e-12)
    assert np.isfinite(jax.jit(jax.grad(in_values))(far)).all()


def test_transformations_go_through(mixed):
    density = log_density(mixed, flat="values")
    x = mixed.x + drawn((2, 3, 5), 0.1)
    one_by_one = [[density(row) for row in rows] for rows in x]
    np.testing.assert_allclose(jax.jit(jax.vmap(jax.vmap(density)))(x), one_by_one, rtol=1e-10)
    expected = [[density.values(row) for row in rows] for rows in x]
    np.testing.assert_allclose(density.values(x), expected, rtol=1e-14)


def test_draws_are_scenes_that_predict(modulus):
    v = np.logspace(-5, 1, 8)
    data = FrictionData(v, np.linspace(0.3, 0.6, 8), pressure=3e5, relative=0.03)
    result = other_problem(modulus, [data], {E: Positive(), HURST: Bounded(0.3, 1.0)})
    density = log_density(result)
    x = result.x + drawn(4, 0.1)
    scene = density.scene(x)
    assert float(scene.lower.spectrum.hurst) == pytest.approx(float(density.values(x)[3]), rel=1e-15)
    mu = np.asarray(rf.friction(scene, v, 3e5, quadrature=FAST))
    expected = stats.norm.logpdf(np.log(mu / data.friction), 0.0, 0.03).sum()
    constant = v.size * stats.norm.logpdf(0.0, 0.0, 0.03)
    np.testing.assert_allclose(density(x), expected - constant, rtol=1e-9)


def test_densities_of_loaded_and_robust_fits(modulus, tmp_path):
    modulus.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert float(again.log_density(modulus.x)) == pytest.approx(-modulus.cost, rel=1e-12)
    free, width = {E: Positive()}, 0.5
    result = other_problem(modulus, modulus.data, free, loss="huber", width=width)
    data, E_inf = modulus.data[0], 3e6
    r = np.log(moduli(E_inf, np.asarray(RUBBER.E)) / np.concatenate([data.storage, data.loss])) / 0.2
    rho = np.where(np.abs(r) < width, r**2, 2 * width * np.abs(r) - width**2)
    np.testing.assert_allclose(result.log_density(result.x), -0.5 * rho.sum(), rtol=1e-11)
    with pytest.raises(ValueError, match=r"^flat = 'E': must be one of x, values$"):
        log_density(modulus, flat="E")
