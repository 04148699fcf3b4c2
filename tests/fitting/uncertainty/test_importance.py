"""Weighted draws about a minimum against exact posteriors, normal and bent; their places and tails."""

import numpy as np
import pytest
import scipy
from support.scenes.fits import PLAIN, SCENE

import fitting
import rubberfric as rf
from fitting.uncertainty.importance import Proposal, effective, log_weights, places, tail_index


def weighted(fit, count, seed=0):
    """Draws x (count, size) and ln w (count,) of a fit."""
    proposal = Proposal.of(fit.x[None], fit.uncertainty.spread[None])
    x = proposal.draws(count, np.random.default_rng(seed))
    targets = type(fit.problem.targets)(*(np.asarray(a)[None] for a in fit.problem.targets))
    return x, log_weights(fit.problem, targets, proposal, x)


def test_of_a_linear_problem_weights_make_the_normal_posterior():
    """ln C = 2 ln h + ... with a Gaussian prior of ln h: Student's draws, four degrees of freedom."""
    q = np.geomspace(2e3, 2e4, 7)
    data = fitting.SpectrumData(q, np.full(7, 1e-14), relative=0.4)
    path = "lower.spectrum.h_rms"
    fit = fitting.fit(SCENE, data, {path: fitting.Positive()}, prior={path: fitting.Gaussian(5e-4, 1e-4)})
    x, weight = weighted(fit, 40_000)
    deviation = 1 / np.sqrt(1 / 0.2**2 + 7 * (2 / 0.4) ** 2)
    z = np.random.default_rng(0).standard_t(4, 40_000) * np.sqrt(2)
    assert x.shape == (1, 40_000, 1)
    np.testing.assert_allclose(np.abs(x[0, :, 0] - fit.x[0]), deviation * np.abs(z), rtol=1e-6, atol=1e-12)
    expected = 2.5 * np.log1p(0.5 * z**2 / 4) - 0.5 * z**2
    off = weight[0] - expected
    # The fit ends 1e-7 of its deviation or less from the minimum, and draws lie up to 14 away.
    assert np.ptp(off[expected > -100]) < 1e-5
    own = np.exp(weight[0] - weight.max())
    own /= own.sum()
    moved = (x[0, :, 0] - fit.x[0]) / deviation
    np.testing.assert_allclose([own @ moved, own @ moved**2], [0, 1], atol=0.02)
    assert effective(weight)[0] > 25_000 and tail_index(weight)[0] < 0


def test_of_a_bent_posterior_against_quadrature():
    """ln tau near its loss peak: E' and E" written out again, and their posterior integrated on a grid."""
    omega, path = np.array([1e3]), "upper.material.tau[1]"
    E = np.asarray(rf.complex_modulus(PLAIN, omega))
    data = fitting.ModulusData(omega, 1.2 * E.real, 0.8 * E.imag, relative=0.2)
    fit = fitting.fit(SCENE, data, {path: fitting.Positive()}, prior={path: fitting.Gaussian(1e-3, 9e-4)})
    x, weight = weighted(fit, 40_000)
    grid = np.linspace(-16, 2, 20_001)
    terms = 1j * omega[:, None] * np.exp(grid)
    found = PLAIN.E_inf + PLAIN.E[0] * 1j * (omega[:, None] * 1e-5) / (1 + 1j * omega[:, None] * 1e-5)
    found = np.asarray(found) + np.asarray(PLAIN.E[1]) * terms / (1 + terms)
    off = np.log(found.real / data.storage[:, None]) ** 2 + np.log(found.imag / data.loss[:, None]) ** 2
    density = np.exp(-0.5 * off.sum(0) / 0.2**2 - 0.5 * (grid - np.log(1e-3)) ** 2 / 0.9**2)
    below = scipy.integrate.cumulative_trapezoid(density, grid, initial=0)
    below /= below[-1]
    own = np.exp(weight[0] - weight.max())
    at = np.interp([0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98], below, grid)
    shares = [own[x[0, :, 0] < edge].sum() / own.sum() for edge in at]
    exact = np.interp(at, grid, below)
    worth = float(effective(weight)[0])
    assert worth > 10_000
    np.testing.assert_allclose(shares, exact, atol=2 / np.sqrt(worth))
    normal = scipy.special.ndtr((at - fit.x[0]) / fit.uncertainty.deviation[0])
    assert np.abs(normal - exact).max() > 10 / np.sqrt(worth)


@pytest.mark.parametrize(("centre", "width"), [(0.0, 1.0), (2.0, 3.0), (-1.0, 0.5)])
def test_the_place_of_a_truth_is_uniform_however_few_and_poor_the_draws(centre, width):
    """Truths of an exponential distribution among three draws of a normal one."""
    random = np.random.default_rng(1)
    fits = 20_000
    draws = centre + width * random.standard_normal((fits, 3, 1))
    x = np.concatenate([draws, random.exponential(size=(fits, 1, 1))], 1)
    with np.errstate(over="ignore"):
        weight = np.where(x > 0, -x + 0.5 * ((x - centre) / width) ** 2, -np.inf)[..., 0]
    assert scipy.stats.kstest(places(x, weight, random)[:, 0], "uniform").pvalue > 1e-3
    # With equal weights it is the rank of a truth that is not a draw.
    ranks = places(x, np.zeros((fits, 4)), random)[:, 0]
    np.testing.assert_array_equal(np.floor(4 * ranks), (x[:, :3, 0] < x[:, 3]).sum(1))
    assert scipy.stats.kstest(ranks, "uniform").pvalue < 1e-3


def test_tails_of_weights():
    random = np.random.default_rng(2)
    for shape in (0.1, 0.5, 0.9):
        weights = scipy.stats.genpareto(shape).rvs((8, 20_000), random_state=random)
        assert abs(tail_index(np.log(weights)).mean() - shape) < 0.05
    # A bounded distribution has none.
    assert (tail_index(np.log(random.random((4, 20_000)))) < 0).all()
    np.testing.assert_allclose(effective(np.log([[1.0, 1.0, 2.0]])), 16 / 6)


@pytest.mark.parametrize("count", [40, 101, 3000])
def test_tails_of_weights_are_those_of_arviz(count):
    array_stats = pytest.importorskip("arviz_stats.base").array_stats
    random = np.random.default_rng(count)
    log_weight = np.array([[0.3], [1.0], [5.0]]) * random.standard_normal((3, count))
    _, expected = array_stats.psislw(-log_weight)
    np.testing.assert_allclose(tail_index(log_weight), expected, rtol=1e-9)
