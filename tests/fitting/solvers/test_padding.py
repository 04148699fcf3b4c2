"""Data of another number compile nothing: rows that are added count for nothing."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases.stored import slow_if
from support.counting.compilations import compilations
from support.jacobians import functions, residuals_and_jacobian
from support.scenes.fits import E_INF, FAST, PLAIN, SCENE, E, friction_data

import fitting
import rubberfric as rf
from fitting import Positive
from fitting.solvers.evaluation import residual_rows
from fitting.solvers.objective import LOSS_WIDTHS
from fitting.solvers.problem import make_problem
from fitting.solvers.residuals import cost, loss_of, padded, rounding
from rubberfric.base import recurring_length

FREE = {E: Positive(), E_INF: Positive()}
FIT = {E: Positive(start=[3e7, 5e6]), E_INF: Positive()}


def curve(points, seed=0):
    return friction_data(SCENE, np.geomspace(1e-4, 1.0, points), 2e5, seed=seed)


def modulus(points):
    omega = np.geomspace(1e2, 1e6, points)
    exact = np.asarray(rf.complex_modulus(PLAIN, omega))
    return fitting.ModulusData(omega, exact.real * 1.01, exact.imag * 0.98, relative=0.05)


def test_lengths_recur():
    """There are few lengths, and none is much longer than the data."""
    lengths = [recurring_length(n) for n in range(1, 5001)]
    assert all(length >= n and recurring_length(length) == length for n, length in enumerate(lengths, 1))
    assert all(length <= max(8, 1.5 * n) for n, length in enumerate(lengths, 1))
    assert all(length <= 1.25 * n for n, length in enumerate(lengths, 1) if n > 16)
    assert lengths == sorted(lengths) and len(set(lengths)) < 60
    assert recurring_length(6) == recurring_length(7) == 8


@pytest.mark.slow
@pytest.mark.parametrize("loss", slow_if(lambda loss: loss != "linear", list(LOSS_WIDTHS)))
def test_added_rows_count_for_nothing(loss):
    """For every loss: cost, residuals, their derivatives and weights."""
    problem = make_problem(SCENE, [curve(6), modulus(5)], FREE, loss=loss, quadrature=FAST)
    of = padded(problem)
    assert [block.rows for block in of.structure.blocks] == [(0, 8), (8, 24)]
    x = jnp.asarray(problem.start) + 0.1

    def parts(structure, numbers, targets):
        cost_at = functools.partial(cost, structure, numbers, targets)
        rows, jacobian = residuals_and_jacobian(structure, numbers, targets, x)
        of_rows, of_jacobian = loss_of(structure, numbers).factors(rows)
        return (
            cost_at(x),
            jax.grad(cost_at)(x),
            rounding(structure, targets),
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


@pytest.mark.slow
@pytest.mark.parametrize("loss", ["linear", "cauchy"])
def test_a_fit_is_that_of_its_own_data(loss, monkeypatch):
    """Every number in a report is the same as without the added rows."""
    data = [curve(9), modulus(5)]
    found = fitting.fit(SCENE, data, FIT, loss=loss, quadrature=FAST)
    boot = found.bootstrap(3)
    monkeypatch.setattr("fitting.solvers.residuals.recurring_length", lambda size: size)
    plain = fitting.fit(SCENE, data, FIT, loss=loss, quadrature=FAST)
    assert (found.nfev, found.njev, found.status, found.freedom) == pytest.approx(
        (plain.nfev, plain.njev, plain.status, plain.freedom), rel=1e-9
    )
    for name in ("values", "cost", "chisqr", "redchi", "covariance", "stderr"):
        np.testing.assert_allclose(getattr(found, name), getattr(plain, name), rtol=1e-7)
    np.testing.assert_allclose(boot.values, plain.bootstrap(3).values, rtol=1e-6)
    without = [[line for line in r.report().splitlines() if "time" not in line] for r in (found, plain)]
    assert without[0] == without[1]


@pytest.mark.slow
def test_another_number_of_points_compiles_nothing():
    """7 points, and other ones at 6: fit, error bars and report, without further starts."""
    seven, six = curve(7), curve(6, seed=1)
    with compilations() as compiled:
        fitting.fit(SCENE, seven, FIT, quadrature=FAST, further_time=0.0).report()
        assert any("several" in name for name in compiled)
        compiled.clear()
        fitting.fit(SCENE, six, FIT, quadrature=FAST, further_time=0.0).report()
    assert compiled == []


def on_table(knots, temperatures):
    """A scene of tables of these lengths, and a curve for it."""
    q, T = np.geomspace(1e2, 1e5, knots), np.linspace(273.0, 333.0, temperatures)
    road = rf.TabulatedSpectrum(q, 1e-13 * np.minimum(1, (q / 1e3) ** -3.6))
    shift = rf.TabulatedShift(T, 10 ** (-0.1 * (T - 293.0)), 293.0)
    scene = rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3], shift=shift)))
    v = np.geomspace(1e-4, 1.0, 8)
    mu = np.asarray(rf.friction(scene, v, 2e5, 303.0, quadrature=FAST))
    return scene, fitting.FrictionData(v, mu, pressure=2e5, temperature=303.0, relative=0.02)


@pytest.mark.slow
def test_other_tables_compile_nothing():
    """A road of 14 entries and a shift of 5, then of 13 and 7; each is found again."""
    first, second = on_table(14, 5), on_table(13, 7)
    with compilations() as compiled:
        for scene, data in (first, second):
            compiled.clear()
            result = fitting.fit(scene, data, FIT, quadrature=FAST)
            np.testing.assert_allclose(result.values, [5e7, 8e6, 3e6], rtol=1e-6)
            assert result.scene.lower.spectrum.q.shape == scene.lower.spectrum.q.shape
            assert result.scene.lower.spectrum.q1 is None
    assert compiled == []


@pytest.mark.slow
def test_padded_tables_are_the_same():
    """Values of rows and derivatives; a table with a free number is not padded."""
    scene, data = on_table(13, 5)
    scene = scene.replace("lower.spectrum.q1", 4e4)
    q1 = "lower.spectrum.q1"
    for free in (FIT, FIT | {q1: Positive()}):
        problem = make_problem(scene, [data], free, quadrature=FAST)
        of = padded(problem)
        longer = of.structure.variables.tree.unflatten(of.numbers.constants.leaves)
        assert longer.lower.spectrum.q.size == (13 if q1 in free else 16)
        assert longer.upper.material.shift.T.size == 8
        plain, found = (functions(each)[1](problem.start) for each in (problem, of))
        for one, other in zip(plain, found, strict=True):
            np.testing.assert_allclose(one, of.kept(other), rtol=1e-9, atol=1e-10)
