"""Solvers: the minima of other programs, from near and far, alone and side by side."""

import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import optimistix
import pytest
from scipy.optimize import least_squares
from support.jacobians import residuals_and_jacobian
from support.scenes.fits import FAST as QUADRATURE
from support.scenes.fits import ROAD, E

import rubberfric as rf
from fitting import AreaData, Bounded, Free, FrictionData, ModulusData, Positive, Smooth, fit
from fitting.parameters.variables import free_parameters
from fitting.solvers.evaluation import costs_at
from fitting.solvers.first_order import LBFGS, Adam
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import CONVERGED, INTERRUPTED, LOSS_WIDTHS, NOT_FINITE, OUT_OF_STEPS, PERFECT
from fitting.solvers.problem import make_problem
from fitting.solvers.residuals import residuals
from fitting.solvers.runs import run_fits
from fitting.solvers.search import random_starts
from rubberfric.scene.scene import cast

LM = LevenbergMarquardt()
MODULI = [5e8, 5e7, 8e6, 2e6]  # [Pa]
TAU = [1e-7, 1e-5, 1e-3, 1e-1]  # [s]
SCENE = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, MODULI, TAU)))
FREE = {E: Positive(), "lower.spectrum.hurst": Bounded(0.3, 1.0)}
VELOCITY = np.logspace(-4, 1, 24)
OMEGA = np.logspace(-2, 7, 20)


def noise(count, seed=0):
    return np.exp(0.02 * np.random.default_rng(seed).standard_normal(count))


@functools.cache
def friction():
    return np.asarray(rf.friction(SCENE, VELOCITY, 1e5, quadrature=QUADRATURE))


def friction_data(seed=0):
    return FrictionData(VELOCITY, friction() * noise(24, seed), pressure=1e5, relative=0.02)


def modulus_data(seed=0, omega=OMEGA, relative=0.02):
    exact = np.asarray(rf.complex_modulus(SCENE.upper.material, omega))
    measured = np.concatenate([exact.real, exact.imag]) * noise(2 * omega.size, seed)
    return ModulusData(omega, *np.split(measured, 2), relative=relative)


@functools.cache
def curve():
    """Friction: 24 points, 5 free parameters."""
    return make_problem(SCENE, [friction_data()], FREE, quadrature=QUADRATURE)


@functools.cache
def master(loss="linear"):
    """A modulus: 40 values, 5 free parameters; with one outlier in twenty if the loss is robust."""
    data = modulus_data()
    if loss != "linear":
        data = data.replaced(np.where(np.arange(40) % 20 == 7, 3.0, 1.0) * data.measured)
    return make_problem(SCENE, [data], {E: Positive(), "upper.material.E_inf": Positive()}, loss=loss)


def with_data(problem, measured):
    return problem._replace(targets=problem.targets._replace(measured=np.log(measured)))


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


def best(problem, starts, solver=LM):
    """The lowest end of fits from the rows of `starts`, four side by side."""
    starts = np.atleast_2d(starts)
    starts = np.concatenate([starts, np.tile(problem.start, (max(0, 4 - len(starts)), 1))])
    runs = run_fits(solver, problem, starts)
    return runs.row(int(np.argmin(runs.cost)))


_rows = jax.jit(residuals, static_argnums=0)
_both = jax.jit(residuals_and_jacobian, static_argnums=0)


def other_program(problem):
    """Residuals, and them with their Jacobian, as plain functions of x."""
    at = (problem.structure, problem.numbers, problem.targets)
    return functools.partial(_rows, *at), functools.partial(_both, *at)


def deviations(problem, x):
    """Standard deviations of x for least squares."""
    jacobian = np.asarray(other_program(problem)[1](jnp.asarray(x))[1])
    return np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))


# --- against other programs


@pytest.mark.parametrize("loss", list(LOSS_WIDTHS))
def test_minimum_of_every_loss_is_that_of_scipy(loss):
    problem = master(loss)
    plain, both = other_program(problem)
    theirs = least_squares(
        lambda x: np.asarray(plain(x)),
        problem.start,
        lambda x: np.asarray(both(x)[1]),
        loss=loss,
        f_scale=LOSS_WIDTHS[loss],
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-12,
        max_nfev=2000,
    )
    ours = run_fits(LevenbergMarquardt(tolerance=1e-12), problem, problem.start[None]).row(0)
    assert ours.status == CONVERGED
    assert float(ours.cost) == pytest.approx(theirs.cost, rel=1e-8)
    # A cost that is 1e-9 of itself too high is this far from the minimum.
    off = np.sqrt(2e-9 * theirs.cost)
    np.testing.assert_array_less(np.abs(ours.x - theirs.x) / deviations(problem, theirs.x), off)


@pytest.mark.slow
def test_friction_minimum_is_that_of_scipy_and_optimistix():
    problem = curve()
    plain, both = other_program(problem)
    x = problem.start + np.array([1.0, -1.0, 1.0, -1.0, -1.0])
    ours = best(problem, x)
    scipys = least_squares(lambda x: np.asarray(plain(x)), x, lambda x: np.asarray(both(x)[1]), xtol=1e-14)
    # If costs differ only by rounding it may not stop; the result reached is compared.
    theirs = optimistix.least_squares(
        lambda x, _: plain(x),
        optimistix.LevenbergMarquardt(rtol=1e-10, atol=1e-10),
        jnp.asarray(x),
        max_steps=500,
        throw=False,
    ).value
    optimistix_cost = 0.5 * float(jnp.sum(plain(theirs) ** 2))
    assert float(ours.cost) == pytest.approx(scipys.cost, rel=1e-8)
    assert float(ours.cost) == pytest.approx(optimistix_cost, rel=1e-8)
    deviation = deviations(problem, ours.x)
    off = np.sqrt(2e-8 * scipys.cost)
    np.testing.assert_array_less(np.abs(ours.x - scipys.x) / deviation, off)
    np.testing.assert_array_less(np.abs(ours.x - np.asarray(theirs)) / deviation, off)


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


@pytest.mark.parametrize("problem", [curve, master])
def test_jacobian_is_that_of_the_residuals(problem):
    problem = problem()
    plain, both = other_program(problem)
    x = jnp.asarray(problem.start) + 0.1
    rows, jacobian = both(x)
    np.testing.assert_allclose(rows, plain(x), rtol=1e-10, atol=1e-10)
    columns = [(plain(x + h) - plain(x - h)) / 2e-6 for h in 1e-6 * np.eye(x.size)]
    np.testing.assert_allclose(jacobian, np.stack(columns, 1), rtol=1e-5, atol=1e-5 * np.abs(jacobian).max())


# --- from far away


def test_a_fit_that_starts_at_its_minimum_stays_there():
    exact = np.asarray(rf.complex_modulus(SCENE.upper.material, OMEGA))
    problem = with_data(master(), np.concatenate([exact.real, exact.imag]))
    end = run_fits(LM, problem, problem.start[None]).row(0)
    assert end.status == PERFECT and end.njev <= 1
    np.testing.assert_allclose(end.x, problem.start, atol=1e-12)
    first = run_fits(LM, master(), master().start[None]).row(0)
    again = run_fits(LM, master(), first.x[None]).row(0)
    assert again.status == CONVERGED and again.cost <= first.cost
    np.testing.assert_allclose(again.x, first.x, atol=1e-4)


@pytest.mark.slow  # starts drawn by the fit reach the lowest minimum
def test_starts_off_by_ten_in_every_modulus_reach_the_same_minimum():
    """All signs of the first three; hurst off by 0.3, or as far as its bound is."""
    problem = curve()
    near = float(best(problem, problem.start).cost)
    starts = []
    for i, signs in enumerate(itertools.product([-1, 1], repeat=3)):
        hurst = 0.5 if i % 2 else 0.99
        shift = np.log(10) * np.array([*signs, (-1) ** (i // 2)])
        starts.append([*(problem.start[:4] + shift), np.log((hurst - 0.3) / (1 - hurst))])
    runs = run_fits(LM, problem, starts)
    assert np.all(runs.status == CONVERGED)
    np.testing.assert_allclose(runs.cost, near, rtol=1e-6)


@pytest.mark.slow
def test_wild_starts_give_numbers():
    """A factor 1e6 off, and any place inside the bounds: perhaps not the minimum, but no NaN."""
    problem = curve()
    rng = np.random.default_rng(2)
    starts = np.concatenate(
        [
            problem.start[:4] + np.log(1e6) * rng.uniform(-1, 1, (12, 4)),
            rng.choice([-30.0, -5.0, 0.0, 5.0, 30.0], (12, 1)),
        ],
        1,
    )
    runs = run_fits(LM, problem, starts)
    assert np.isfinite(runs.x).all() and np.isfinite(runs.cost).all()
    assert NOT_FINITE not in runs.status
    assert np.all(runs.cost[:3] < costs_at(problem, starts[:3]))
    assert np.mean(runs.cost < runs.cost.min() * (1 + 1e-6)) >= 0.5


@pytest.mark.slow
def test_starts_that_are_not_finite_spoil_no_other():
    problem = master()
    starts = np.tile(problem.start, (5, 1))
    starts[1, 2] = np.nan
    starts[3, 0] = 1e4  # exp of it is beyond all numbers
    for solver in (LM, Adam(max_steps=20)):
        runs = run_fits(solver, problem, starts, batch=2)
        assert (runs.status == NOT_FINITE).tolist() == [False, True, False, True, False]
        assert np.isfinite(runs.cost[[0, 2, 4]]).all() and np.isfinite(runs.x[[0, 2, 4]]).all()
        np.testing.assert_allclose(runs.x[[2, 4]], runs.x[[0, 0]], rtol=1e-12)


def test_a_start_that_is_not_finite_does_not_end_a_fit():
    """Negative moduli have no logarithm: the smoothness prior is NaN at some of the random starts."""
    free = {E: Free(scale=1e10)}
    prior = {E: Smooth(3.0)}
    result = fit(SCENE, modulus_data(), free, prior=prior, starts=4)
    problem = result.problem
    starts = random_starts(problem.structure.variables, problem.start, jax.random.key(0), 4)
    assert np.any(np.asarray(starts[1:]) < 0) and sum(m.count for m in result.minima) < 4
    assert result.success and result.redchi < 2


# --- side by side


def lead(targets):
    return jax.tree.map(lambda a: a[None], targets)


def test_the_size_of_a_batch_does_not_change_a_fit():
    problem = master()
    starts = problem.start + np.random.default_rng(0).uniform(-3, 3, (5, 5))
    first, second = (run_fits(LM, problem, starts, batch=n) for n in (1, 3))
    np.testing.assert_allclose(second.cost, first.cost, rtol=1e-12)
    # Products of other sizes round differently, and a fit stops within 1e-5 of its standard errors: maybe a
    # step later.
    np.testing.assert_allclose(second.x, first.x, atol=1e-7)
    np.testing.assert_array_equal(second.status, first.status)
    np.testing.assert_allclose(second.nfev, first.nfev, atol=2)


def test_fits_of_different_data_keep_to_their_own():
    problem = master()
    measured = np.stack([np.log(modulus_data(seed).measured) for seed in range(5)])
    targets = lead(problem.targets)._replace(measured=measured)
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
    free = {E: Positive(1e7), "upper.material.E_inf": Positive()}
    result = fit(SCENE, modulus_data(), free, max_steps=2)
    assert result.status == OUT_OF_STEPS and not result.success
    assert result.message == "not converged: out of steps; raise max_steps"
    assert result.njev == 2
    assert fit(SCENE, modulus_data(), free).success


def test_callback_sees_every_step_and_a_cost_that_never_rises():
    seen = []
    free = {E: Positive(1e7), "upper.material.E_inf": Positive()}
    result = fit(SCENE, modulus_data(), free, callback=lambda step, cost: seen.append((step, cost)))
    steps, costs = zip(*seen, strict=True)
    assert steps == tuple(range(1, result.njev + 1))
    assert all(isinstance(cost, float) for cost in costs)
    assert np.all(np.diff(costs) <= 0) and costs[-1] == result.cost < costs[0]


def test_an_interrupt_leaves_the_best_so_far():
    free = {E: Positive(1e9), "upper.material.E_inf": Positive()}
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


# --- several starts


def one_peak(**options):
    """The loss of two relaxations, and a scene with one: it can be either of them."""
    exact = np.asarray(rf.complex_modulus(rf.Prony(3e6, [4e6, 6e6], [1.0, 1e-5]), OMEGA))
    data = ModulusData(OMEGA, exact.real, exact.imag, np.full(20, 1e12), np.full(20, 1e5))
    scene = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, [5e6], [3e-2])))
    return fit(scene, data, {"upper.material.tau": Positive()}, decades=4.0, **options)


def test_several_starts_find_several_minima_and_the_lowest():
    result = one_peak(starts=12)
    assert len(result.minima) >= 2
    costs = [minimum.cost for minimum in result.minima]
    assert np.all(np.diff(costs) > 0) and result.cost == costs[0]
    assert sum(minimum.count for minimum in result.minima) <= 12
    assert max(minimum.count for minimum in result.minima) > 1
    np.testing.assert_allclose(result.values, result.minima[0].values, rtol=1e-12)
    tau = sorted(minimum.values[0] for minimum in result.minima[:2])
    assert tau[0] < 1e-3 < 1e-2 < tau[1]
    # Another start, in addition to the worse one, finds it.
    once = one_peak(further_time=0.0)
    assert len(once.minima) == 1 and once.cost >= result.cost


def test_random_starts_are_uniform_in_their_ranges():
    """Widths of uniform distributions, of ln E over decades, between bounds, and of the scale of a number."""
    free = {E: Positive(), "lower.spectrum.hurst": Bounded(0.3, 1.0), "gamma": Free(0.1)}
    variables, _, x = free_parameters(cast(SCENE, np.float64), free)
    found = np.asarray(random_starts(variables, x, None, 4001, decades=0.5))
    np.testing.assert_array_equal(found[0], x)
    kinds = [group.kind for group in variables.own for _ in range(*group.slot)]
    moved = np.where(np.array(kinds) == "Bounded", 1 / (1 + np.exp(-found)) - 0.5, found - found[0])[1:]
    half = np.array([{"Positive": 0.5 * np.log(10), "Bounded": 0.49, "Free": 1.0}[kind] for kind in kinds])
    assert np.all(np.abs(moved) <= half) and np.all(np.abs(moved).max(0) > 0.99 * half)
    np.testing.assert_allclose(moved.std(0), half / np.sqrt(3), rtol=0.05)
    np.testing.assert_allclose(moved.mean(0) / half, 0, atol=0.05)


def test_several_starts_are_decided_by_their_key():
    one, two = (one_peak(starts=3, key=jax.random.key(5)) for _ in range(2))
    np.testing.assert_array_equal(one.values, two.values)
    assert one.nfev == two.nfev and one.cost == two.cost


# --- outliers


@pytest.mark.slow
def test_outliers_move_the_robust_estimate_less_than_its_error_bars():
    omega = np.logspace(-2, 7, 60)
    data = modulus_data(3, omega)
    rng = np.random.default_rng(0)
    struck = rng.choice(120, 6, replace=False)
    measured = data.measured.copy()
    measured[struck] *= 3.0
    free = {E: Positive(), "upper.material.E_inf": Positive()}
    moved = {}
    for loss in ("linear", "cauchy"):
        before, after = (fit(SCENE, d, free, loss=loss) for d in (data, data.replaced(measured)))
        assert before.success and after.success
        moved[loss] = np.max(np.abs(after.x - before.x) / before.uncertainty.deviation)
    assert moved["cauchy"] < 1.0
    assert moved["linear"] > 5.0


# --- compilation


ROUGH = {f"lower.spectrum.{name}": Positive() for name in ("h_rms", "q1", "qr")}


PRONY = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3])


def area_data(scene):
    v = np.logspace(-4, 1, 12)
    area = np.asarray(rf.solve(scene, v, 5e5, quadrature=QUADRATURE, quantities=("area",)).area)
    noise = np.exp(0.03 * np.random.default_rng(0).standard_normal(v.size))
    return AreaData(v, area * noise, pressure=5e5, relative=0.03, check_units=False)


@pytest.mark.slow
def test_in_full_contact_nothing_is_called_reached():
    """All parameters give full contact. No step lowers the cost, because it is constant."""
    truth = rf.Scene(rf.Body(rf.Rigid(), rf.SelfAffine(1e2, 1e3, 1e5, 0.8, 1e-4)), rf.Body(PRONY))
    data = area_data(truth)
    smooth = truth.replace("lower.spectrum.h_rms", 1e-8)
    flat = fit(smooth, data, ROUGH, quadrature=QUADRATURE, further_time=0.0)
    assert not flat.success and flat.cost > 1e3
    assert "no free parameter changes the data" in flat.message and "starts=8" in flat.message
    assert "NOT REACHED" in flat.report()
    # Less smooth, places around it show a way.
    found = fit(truth.replace("lower.spectrum.h_rms", 3e-7), data, ROUGH, quadrature=QUADRATURE)
    known = fit(truth, data, ROUGH, quadrature=QUADRATURE)
    assert found.success and found.cost == pytest.approx(known.cost, rel=1e-6)


@pytest.mark.slow
def test_a_minimum_far_above_the_data_is_left_for_a_lower_one():
    """A start without a fall leads to a minimum at q1 = qr, and on from there."""
    truth = rf.Scene(rf.Body(rf.Rigid(), rf.SelfAffine(1e2, 1e3, 3e4, 0.8, 5e-4)), rf.Body(PRONY))
    v = np.logspace(-3, 1, 8)
    mu = np.asarray(rf.friction(truth, v, 3e5, quadrature=QUADRATURE))
    noise = np.exp(0.03 * np.random.default_rng(1).standard_normal(v.size))
    data = FrictionData(v, mu * noise, pressure=3e5, relative=0.03)
    free = {name: ROUGH[name] for name in list(ROUGH)[1:]}
    found = fit(truth.replace("lower.spectrum.q1", 1.5e3), data, free, quadrature=QUADRATURE)
    known = fit(truth, data, free, quadrature=QUADRATURE)
    assert found.success and found.cost == pytest.approx(known.cost, rel=1e-6)


@pytest.mark.slow
def test_a_right_minimum_of_a_wrong_scene_stays_one():
    """Data that no parameter explains: places around are looked at, and the claim stays."""
    truth = rf.Scene(rf.Body(rf.Rigid(), rf.SelfAffine(1e2, 1e3, 1e5, 0.8, 1e-4)), rf.Body(PRONY))
    data = area_data(truth)
    off = data.replaced(data.measured * np.where(np.arange(12) % 2, 1.3, 0.8))
    found = fit(truth, off, ROUGH, quadrature=QUADRATURE)
    assert found.success and found.verdict.explains is False
    assert found.further is not None and found.further.count >= 3
    assert found.further.after == found.further.before
    assert "further starts found no lower minimum" in found.report()
    once = fit(truth, off, ROUGH, quadrature=QUADRATURE, further_time=0.0)
    assert once.further is None and "starts=8 looks for a lower minimum" in once.report()
