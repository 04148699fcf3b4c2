"""Starts of fits: far from the minimum, not finite, random, and several of them."""

import functools
import itertools

import jax
import numpy as np
import pytest
from support.scenes import fits
from support.scenes.fit_problems import fitted, problem
from support.scenes.fits import FOUR as SCENE
from support.scenes.fits import ROAD, E

import rubberfric as rf
from fitting import Bounded, Free, ModulusData, Positive, Smooth, fit
from fitting.parameters.variables import free_parameters
from fitting.solvers.evaluation import costs_at
from fitting.solvers.first_order import Adam
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import CONVERGED, NOT_FINITE
from fitting.solvers.problem import make_problem
from fitting.solvers.runs import run_fits
from fitting.solvers.search import random_starts
from rubberfric.scene.scene import cast

LM = LevenbergMarquardt()
OMEGA = np.logspace(-2, 7, 20)


@functools.cache
def curve():
    """Friction: 24 points, 5 free parameters."""
    of = problem("friction")
    return make_problem(of.scene, [of.data], of.free, quadrature=fits.FAST)


def best(problem, starts, solver=LM):
    """The lowest end of fits from the rows of `starts`, four side by side."""
    starts = np.atleast_2d(starts)
    starts = np.concatenate([starts, np.tile(problem.start, (max(0, 4 - len(starts)), 1))])
    runs = run_fits(solver, problem, starts)
    return runs.row(int(np.argmin(runs.cost)))


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
    problem = fitted("moduli").problem
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
    result = fit(SCENE, fits.modulus_data(fits.FOUR_TERMS, OMEGA), free, prior=prior, starts=4)
    problem = result.problem
    starts = random_starts(problem.structure.variables, problem.start, jax.random.key(0), 4)
    assert np.any(np.asarray(starts[1:]) < 0) and sum(m.count for m in result.minima) < 4
    assert result.success and result.redchi < 2


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


@pytest.mark.parametrize(("key", "decades"), [(None, 0.5), (jax.random.key(3), 2.0)])
def test_random_starts_are_uniform_in_their_ranges(key, decades):
    """Widths of uniform distributions, of ln E over decades, between bounds, and of the scale of a number."""
    free = {E: Positive(), "lower.spectrum.hurst": Bounded(0.3, 1.0), "gamma": Free(0.1)}
    variables, _, x = free_parameters(cast(SCENE, np.float64), free)
    found = np.asarray(random_starts(variables, x, key, 4001, decades=decades))
    np.testing.assert_array_equal(found[0], x)
    kinds = [group.kind for group in variables.own for _ in range(*group.slot)]
    moved = np.where(np.array(kinds) == "Bounded", 1 / (1 + np.exp(-found)) - 0.5, found - found[0])[1:]
    half = np.array(
        [{"Positive": decades * np.log(10), "Bounded": 0.49, "Free": 1.0}[kind] for kind in kinds]
    )
    assert np.all(np.abs(moved) <= half) and np.all(np.abs(moved).max(0) > 0.99 * half)
    np.testing.assert_allclose(moved.std(0), half / np.sqrt(3), rtol=0.05)
    np.testing.assert_allclose(moved.mean(0) / half, 0, atol=0.05)


def test_several_starts_are_decided_by_their_key():
    first, again, other = (one_peak(starts=3, key=jax.random.key(k)) for k in (5, 5, 6))
    np.testing.assert_array_equal(first.values, again.values)
    assert first.nfev == again.nfev != other.nfev and first.cost == again.cost


def test_random_starts_are_decided_by_their_key():
    variables, _, x = free_parameters(SCENE, {E: Positive(), "gamma": Bounded(0.1, 0.9)})
    one, two, other = (random_starts(variables, x, jax.random.key(k), 4) for k in (1, 1, 2))
    np.testing.assert_array_equal(one, two)
    assert np.all(one[1:] != other[1:])
    assert len({tuple(row) for row in np.asarray(one).tolist()}) == 4
    for count in (1, 2):
        fewer = random_starts(variables, x, jax.random.key(1), count)
        assert fewer.shape == (count, x.size)
        np.testing.assert_array_equal(fewer[0], x)
