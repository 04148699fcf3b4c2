"""Solvers: the minima of other programs, from near and far, alone and side by side."""

import functools

import jax
import numpy as np
import pytest
from support.jacobians import functions, scipy_minimum
from support.scenes import fit_problems, fits
from support.scenes.fits import E_INF, E
from support.scenes.fits import FOUR as SCENE

import rubberfric as rf
from fitting import Positive, fit
from fitting.solvers.evaluation import costs_at
from fitting.solvers.first_order import LBFGS, Adam
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import CONVERGED, INTERRUPTED, LOSS_WIDTHS, OUT_OF_STEPS, PERFECT
from fitting.solvers.problem import make_problem
from fitting.solvers.runs import run_fits

LM = LevenbergMarquardt()
OMEGA = np.logspace(-2, 7, 20)


def modulus_data(seed=0, omega=OMEGA):
    return fits.modulus_data(fits.FOUR_TERMS, omega, seed=seed)


@functools.cache
def master(loss="linear"):
    """A modulus: 40 values, 5 free parameters; with one outlier in twenty if the loss is robust."""
    of = fit_problems.problem("moduli" if loss == "linear" else "moduli with outliers")
    return make_problem(of.scene, [of.data], of.free, loss=loss)


def test_fits_side_by_side_end_as_alone():
    problem = master()
    starts = problem.start + 0.4 * np.random.default_rng(2).standard_normal((6, problem.start.size))
    together = run_fits(LM, problem, starts)
    np.testing.assert_array_equal(together.status, CONVERGED)
    np.testing.assert_allclose(together.cost, together.cost[0], rtol=1e-8)
    alone = run_fits(LM, problem, starts[3:4]).row(0)
    assert (alone.nfev, alone.njev) == (together.nfev[3], together.njev[3])
    np.testing.assert_allclose(alone.x, together.x[3], rtol=1e-10)
    held = problem.targets._replace(moving=np.array([1.0, 0.0, 1.0, 1.0, 1.0]))
    end = run_fits(LM, problem._replace(targets=held), starts[:1]).row(0)
    assert end.status == CONVERGED and end.x[1] == starts[0, 1] and end.nfev <= together.nfev[0] + 2


# --- against other programs


@pytest.mark.parametrize("loss", list(LOSS_WIDTHS))
def test_minimum_of_every_loss_is_that_of_scipy(loss):
    problem = master(loss)
    assert (problem.structure.loss, problem.numbers.width) == (loss, LOSS_WIDTHS[loss])
    theirs = scipy_minimum(problem, problem.start)
    ours = run_fits(LevenbergMarquardt(tolerance=1e-12), problem, problem.start[None]).row(0)
    assert ours.status == CONVERGED
    assert float(ours.cost) == pytest.approx(theirs.cost, rel=1e-8)
    # A cost that is 1e-9 of itself too high is this far from the minimum.
    off = np.sqrt(2e-9 * theirs.cost)
    jacobian = np.asarray(functions(problem)[1](theirs.x)[1])
    deviations = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    np.testing.assert_array_less(np.abs(ours.x - theirs.x) / deviations, off)


@pytest.mark.parametrize(
    ("solver", "loss"),
    [(LBFGS(), "linear"), (Adam(), "linear"), (Adam(), "cauchy")],
    ids=["lbfgs", "adam", "adam-cauchy"],
)
@pytest.mark.slow
def test_first_order_methods_reach_the_same_minimum(solver, loss):
    problem = master(loss)
    ours = run_fits(LM, problem, problem.start[None]).row(0)
    other = run_fits(solver, problem, (problem.start + 0.5)[None]).row(0)
    assert other.status == CONVERGED
    assert float(other.cost) == pytest.approx(float(ours.cost), rel=1e-5)
    assert other.njev > 3 * ours.njev


def test_a_fit_that_starts_at_its_minimum_stays_there():
    exact = np.asarray(rf.complex_modulus(SCENE.upper.material, OMEGA))
    measured = np.log([*exact.real, *exact.imag])
    problem = master()._replace(targets=master().targets._replace(measured=measured))
    end = run_fits(LM, problem, problem.start[None]).row(0)
    assert end.status == PERFECT and end.njev <= 1
    np.testing.assert_allclose(end.x, problem.start, atol=1e-12)
    first = run_fits(LM, master(), master().start[None]).row(0)
    again = run_fits(LM, master(), first.x[None]).row(0)
    assert again.status == CONVERGED and again.cost <= first.cost
    np.testing.assert_allclose(again.x, first.x, atol=1e-4)


# --- side by side


def test_fits_of_different_data_keep_to_their_own():
    problem = master()
    measured = np.stack([np.log(modulus_data(seed).measured) for seed in range(5)])
    targets = jax.tree.map(lambda a: a[None], problem.targets)._replace(measured=measured)
    starts = np.tile(problem.start, (5, 1))
    runs = run_fits(LM, problem, starts, targets, batch=3)
    for i in range(5):
        alone = problem._replace(targets=problem.targets._replace(measured=measured[i]))
        np.testing.assert_allclose(runs.x[i], run_fits(LM, alone, starts[:1]).x[0], rtol=1e-10)
    assert len(np.unique(runs.cost)) == 5


@pytest.mark.parametrize(
    "solver",
    [
        pytest.param(LM, id="lm"),
        pytest.param(LBFGS(), id="lbfgs", marks=pytest.mark.slow),
        pytest.param(Adam(max_steps=300), id="adam", marks=pytest.mark.slow),
    ],
)
def test_parameters_that_may_not_move_stay_exactly(solver):
    problem = master()
    moving = np.array([1.0, 0.0, 1.0, 1.0, 0.0])
    start = problem.start + 0.3
    fixed = problem._replace(targets=problem.targets._replace(moving=moving))
    end = run_fits(solver, fixed, start[None]).row(0)
    assert np.all(end.x[moving == 0] == start[moving == 0])
    assert np.all(np.abs(end.x - start)[moving == 1] > 0.01)
    free = run_fits(LM, problem, start[None]).row(0)
    assert end.cost > 1.1 * free.cost


# --- how a fit ends


def test_out_of_steps():
    free = {E: Positive(1e7), E_INF: Positive()}
    result = fit(SCENE, modulus_data(), free, max_steps=2)
    assert result.status == OUT_OF_STEPS and not result.success
    assert result.message == "not converged: out of steps; raise max_steps"
    assert result.njev == 2
    assert fit(SCENE, modulus_data(), free).success


def test_callback_sees_every_step_and_a_cost_that_never_rises():
    seen = []
    free = {E: Positive(1e7), E_INF: Positive()}
    result = fit(SCENE, modulus_data(), free, callback=lambda step, cost: seen.append((step, cost)))
    steps, costs = zip(*seen, strict=True)
    assert steps == tuple(range(1, result.njev + 1))
    assert all(isinstance(cost, float) for cost in costs)
    assert np.all(np.diff(costs) <= 0) and costs[-1] == result.cost < costs[0]


def test_an_interrupt_leaves_the_best_so_far():
    free = {E: Positive(1e9), E_INF: Positive()}
    problem, seen = make_problem(SCENE, [modulus_data()], free), []

    def interrupt(step, cost):
        seen.append(cost)
        if step == 2:
            raise KeyboardInterrupt

    result = fit(SCENE, modulus_data(), free, callback=interrupt)
    assert result.status == INTERRUPTED and not result.success
    assert result.message.startswith("interrupted") and len(seen) == 2
    whole = fit(SCENE, modulus_data(), free)
    assert 1.001 * whole.cost < result.cost == seen[-1] < costs_at(problem, problem.start[None])[0]
    assert np.isfinite(result.values).all() and np.isfinite(result.redchi)


def test_an_interrupt_of_several_fits_keeps_those_that_are_done():
    problem = master()
    starts = np.tile(problem.start, (6, 1))
    starts[1:] += 3.0

    def interrupt(step, _):
        if step == 5:
            raise KeyboardInterrupt

    runs = run_fits(LM, problem, starts, callback=interrupt, batch=2)
    assert runs.status[0] == CONVERGED and INTERRUPTED in runs.status
    never = ~np.isin(runs.status, (CONVERGED, INTERRUPTED))
    assert never.any() and np.isinf(runs.cost[never]).all()
    np.testing.assert_array_equal(runs.x[never], starts[never])


# --- outliers


@pytest.mark.slow
def test_outliers_move_the_robust_estimate_less_than_its_error_bars():
    omega = np.logspace(-2, 7, 60)
    data = modulus_data(3, omega)
    rng = np.random.default_rng(0)
    struck = rng.choice(120, 6, replace=False)
    measured = data.measured.copy()
    measured[struck] *= 3.0
    free = {E: Positive(), E_INF: Positive()}
    moved = {}
    for loss in ("linear", "cauchy"):
        before, after = (fit(SCENE, d, free, loss=loss) for d in (data, data.replaced(measured)))
        assert before.success and after.success
        moved[loss] = np.max(np.abs(after.x - before.x) / before.uncertainty.deviation)
    assert moved["cauchy"] < 1.0
    assert moved["linear"] > 5.0
