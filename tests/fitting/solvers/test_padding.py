"""Data of another number compile nothing: rows that are added count for nothing."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.counting.compilations import compilations
from support.scenes.fits import E_INF, FAST, PLAIN, ROAD, E

import fitting
import rubberfric as rf
from fitting import Positive
from fitting.solvers.losses import WIDTHS
from fitting.solvers.problem import make_problem
from fitting.solvers.residuals import objective, padded, recurring, residual_rows

SCENE = rf.Scene(ROAD, rf.Body(PLAIN))
FREE = {E: Positive(), E_INF: Positive()}
FIT = {E: Positive(start=[3e7, 5e6]), E_INF: Positive()}


def curve(points, seed=0):
    v = np.geomspace(1e-4, 1.0, points)
    mu = np.asarray(rf.friction(SCENE, v, 2e5, quadrature=FAST))
    noise = np.exp(0.02 * np.random.default_rng(seed).standard_normal(points))
    return fitting.FrictionData(v, mu * noise, pressure=2e5, relative=0.02)


def modulus(points):
    omega = np.geomspace(1e2, 1e6, points)
    exact = np.asarray(rf.complex_modulus(PLAIN, omega))
    return fitting.ModulusData(omega, exact.real * 1.01, exact.imag * 0.98, relative=0.05)


def test_lengths_recur():
    """Few of them, each its own, and never much longer than the data."""
    lengths = [recurring(n) for n in range(1, 5001)]
    assert all(length >= n and recurring(length) == length for n, length in enumerate(lengths, 1))
    assert all(length <= max(8, 1.5 * n) for n, length in enumerate(lengths, 1))
    assert all(length <= 1.125 * n for n, length in enumerate(lengths, 1) if n > 64)
    assert lengths == sorted(lengths) and len(set(lengths)) < 60
    assert recurring(6) == recurring(7) == 8


@pytest.mark.parametrize("loss", list(WIDTHS))
def test_added_rows_count_for_nothing(loss):
    """Of every loss: cost, residuals, their derivatives and what the loss makes of them."""
    problem = make_problem(SCENE, [curve(6), modulus(5)], FREE, loss=loss, quadrature=FAST)
    of = padded(problem)
    assert [block.rows for block in of.structure.blocks] == [(0, 8), (8, 24)]
    x = jnp.asarray(problem.start) + 0.1

    def parts(structure, numbers, targets):
        aim = objective(structure, numbers, targets)
        rows, jacobian = aim.residuals_and_jacobian(x)
        of_rows, of_jacobian = aim.loss.factors(rows)
        return (
            aim.cost(x),
            jax.grad(aim.cost)(x),
            aim.rounding,
            rows,
            rows * of_rows,
            jacobian * of_jacobian[:, None],
        )

    plain = jax.jit(parts, static_argnums=0)(problem.structure, problem.numbers, problem.targets)
    longer = jax.jit(parts, static_argnums=0)(of.structure, of.numbers, of.targets)
    for one, other in zip(plain[:3], longer[:3], strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    added = np.setdiff1d(np.arange(24), of.data)
    for one, other in zip(plain[3:], longer[3:], strict=True):
        np.testing.assert_allclose(one, of.kept(other), rtol=1e-11, atol=1e-12)
        assert added.size == 8 and (np.asarray(other)[added] == 0).all()
    np.testing.assert_allclose(residual_rows(problem, np.asarray(x)), plain[3], rtol=1e-12)


@pytest.mark.parametrize("loss", ["linear", "cauchy"])
def test_a_fit_is_that_of_its_own_data(loss, monkeypatch):
    """Every number that a fit reports is what it is without the added rows."""
    data = [curve(9), modulus(5)]
    found = fitting.fit(SCENE, data, FIT, loss=loss, quadrature=FAST)
    boot = found.bootstrap(3)
    monkeypatch.setattr("fitting.solvers.residuals.recurring", lambda size: size)
    plain = fitting.fit(SCENE, data, FIT, loss=loss, quadrature=FAST)
    assert (found.nfev, found.njev, found.status, found.freedom) == pytest.approx(
        (plain.nfev, plain.njev, plain.status, plain.freedom), rel=1e-9
    )
    for name in ("values", "cost", "chisqr", "redchi", "covariance", "stderr"):
        np.testing.assert_allclose(getattr(found, name), getattr(plain, name), rtol=1e-7)
    np.testing.assert_allclose(boot.values, plain.bootstrap(3).values, rtol=1e-6)
    without = [[line for line in r.report().splitlines() if "time" not in line] for r in (found, plain)]
    assert without[0] == without[1]


def test_another_number_of_points_compiles_nothing():
    """7 points, and other ones at 6: fit, error bars and report."""
    seven, six = curve(7), curve(6, seed=1)
    with compilations() as compiled:
        fitting.fit(SCENE, seven, FIT, quadrature=FAST).report()
        assert any("_step" in name for name in compiled)
        compiled.clear()
        fitting.fit(SCENE, six, FIT, quadrature=FAST).report()
    assert compiled == []
