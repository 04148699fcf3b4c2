"""Priors of several numbers: smooth vectors of every kind, limits of sums, what another fit knows."""

import jax
import numpy as np
import pytest
import scipy.special
from scipy import stats
from support.jacobians import functions
from support.jacobians import prior_rows as rows
from support.scenes.fits import E_INF, ROAD, E

import fitting
import rubberfric as rf
from fitting import Bounded, Correlated, Free, ModulusData, Positive, Smooth, Sum
from fitting.parameters.correlated import whitener
from fitting.parameters.scenes import path_over, scene_paths
from fitting.solvers.evaluation import residual_rows
from fitting.solvers.problem import make_problem

OMEGA = np.logspace(0, 4, 5)  # [rad/s]
T = np.array([260.0, 275.0, 285.0, 320.0])  # [K]
STRAIN = np.logspace(-3, 0, 4)
TABLE = rf.TabulatedModulus(
    *(OMEGA, 1e6 * OMEGA**0.3, 2e5 * OMEGA**0.4), shift=rf.TabulatedShift(T, [1e4, 30.0, 1.0, 1e-3], 285.0)
)
SPECTRUM = rf.TabulatedSpectrum(np.logspace(2, 5, 4), [1e-12, 3e-16, 1e-19, 1e-24])
SCENE = rf.Scene(
    rf.Body(rf.Rigid(), SPECTRUM),
    rf.Body(TABLE),
    softening=rf.Softening(STRAIN, [1.0, 0.8, 0.5, 0.4], [1.0, 0.9, 0.8, 0.5]),
)
PRONY = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, [5e8, 5e7, 8e6], [1e-7, 1e-5, 1e-3])))
BOTH = f"{E_INF} + {E}"
PARTS = "upper.material.storage[:2] + upper.material.loss[0]"


# --- smooth


def bends(u, y):
    return np.diff(np.diff(np.log(y)) / np.diff(u))


@pytest.mark.parametrize(
    ("path", "u"),
    [
        ("upper.material.storage", np.log10(OMEGA)),
        ("upper.material.loss", np.log10(OMEGA)),
        ("upper.material.shift.aT", T / 10),
        ("lower.spectrum.C", np.log10(SPECTRUM.q)),
        ("softening.storage", np.log10(STRAIN)),
        ("softening.loss", np.log10(STRAIN)),
    ],
)
def test_every_vector_can_be_smooth(path, u):
    y = np.asarray(jax.tree.leaves(SCENE)[scene_paths(SCENE).index(path)], float)
    moved = 0.3 * np.cos(np.arange(y.size))
    found = rows(SCENE, {path: Positive()}, {path: Smooth(0.2)}, moved)
    np.testing.assert_allclose(found, bends(u, y * np.exp(moved)) / 0.2, rtol=1e-9, atol=1e-9)


def test_several_smooth_vectors():
    paths = ["softening.storage", "softening.loss"]
    free = dict.fromkeys(paths, Positive())
    found = rows(SCENE, free, {", ".join(paths): Smooth(0.3)})
    each = [rows(SCENE, free, {path: Smooth(0.3)}) for path in paths]
    np.testing.assert_allclose(found, np.concatenate(each), rtol=1e-12)
    np.testing.assert_allclose(found, rows(SCENE, free, {path: Smooth(0.3) for path in paths}), rtol=1e-12)
    # All vectors except abscissas: a new kind with a vector must declare its abscissa, too.
    for scene in (SCENE, PRONY):
        leaves = dict(zip(scene_paths(scene), jax.tree.leaves(scene), strict=True))
        over = {path: path_over(scene, path) for path, leaf in leaves.items() if np.ndim(leaf)}
        for path, other in over.items():
            assert path in over.values() if other is None else leaves[path].shape == leaves[other].shape
    free = {"softening.loss": Free(start=[1.0, 0.5, -0.1, 0.2])}
    with pytest.raises(ValueError, match=r"starts at -0\.1: must be > 0, because Smooth uses logarithms"):
        rows(SCENE, free, {"softening.loss": Smooth()})


def test_smoothing_keeps_a_noisy_table_from_its_ripples():
    """A table of E' from data with 10 % scatter: closer to the truth with the prior than without."""
    truth = np.asarray(TABLE.storage)
    noisy = truth * np.exp(0.1 * np.array([1, -1, 1, -1, 1]))
    data = ModulusData(OMEGA, noisy, np.asarray(TABLE.loss), relative=0.1)
    free = {"upper.material.storage": Positive()}
    off = [
        np.abs(np.log(fitting.fit(SCENE, data, free, prior=prior).values / truth)).max()
        for prior in (None, {"upper.material.storage": Smooth(0.05)})
    ]
    assert off[0] > 0.09 and off[1] < 0.05, off


# --- sums


def test_a_sum_says_nothing_within_its_limits_and_is_half_a_gaussian_beyond():
    total, free = 5.61e8, {E: Positive(), E_INF: Positive()}
    for low, high, expected in (
        (1e8, 6e8, 0.0),
        (None, 5e8, np.log(total / 5e8) / 0.1),
        (6e8, None, np.log(total / 6e8) / 0.1),
        (6e8, 7e8, np.log(total / 6e8) / 0.1),
    ):
        np.testing.assert_allclose(rows(PRONY, free, {BOTH: Sum(low, high, 0.1)}), [expected], rtol=1e-9)
    # Also of what follows another number, or stays.
    found = rows(PRONY, {E_INF: Positive()}, {BOTH: Sum(high=5e8, sigma=0.1)}, 4.0)
    np.testing.assert_allclose(found, np.log((5.58e8 + 3e6 * np.e**4) / 5e8) / 0.1, rtol=1e-9)


def test_a_sum_keeps_the_glassy_modulus_below_its_limit():
    omega = np.logspace(1, 4, 12)  # the fastest term is far beyond
    E_measured = np.asarray(rf.complex_modulus(PRONY.upper.material, omega))
    data = ModulusData(omega, E_measured.real, E_measured.imag, relative=0.2)
    free = {E: Positive([2e9, 5e7, 8e6]), E_INF: Positive()}
    result = fitting.fit(PRONY, data, free, prior={BOTH: Sum(high=3e8, sigma=0.02)})
    assert result.success
    assert 2.9e8 < result.values.sum() < 3.2e8
    assert f"{BOTH}: below 3e+08 Pa within 0.02, fitted" in result.report()


def test_priors_that_may_say_nothing_are_no_data():
    data = ModulusData([1.0], [1e7], [1e6], relative=0.1)
    with pytest.raises(
        ValueError, match="4 free parameters, but only 2 measured values and 0 rows of priors"
    ):
        fitting.fit(PRONY, data, {E: Positive(), E_INF: Positive()}, prior={BOTH: Sum(high=1e9)})


# --- numbers that are known together


C = np.array([[0.04, 0.03, 0.0], [0.03, 0.09, -0.01], [0.0, -0.01, 0.01]])
KNOWN = Correlated((4e6, 0.6, -0.1), C, (0.0, 0.3, -np.inf), (np.inf, 1.0, np.inf))
KEY = f"{E_INF}, lower.spectrum.hurst, {E}[1]"


@pytest.mark.parametrize(
    "rules", [(Positive(), Bounded(0.3, 1.0), Free()), (Free(), Bounded(0.1, 1.2), Free())]
)
def test_correlated_numbers_are_normal_in_their_own_coordinates_whatever_the_rules(rules):
    free = dict(zip((E_INF, "lower.spectrum.hurst", E + "[1]"), rules, strict=True))
    found = rows(PRONY, free, {KEY: KNOWN})
    t = np.array([np.log(3e6 / 4e6), np.log(0.5 / 0.2) - np.log(0.3 / 0.4), 5e7 + 0.1])
    expected = stats.multivariate_normal(np.zeros(3), C).logpdf(t) - stats.multivariate_normal(
        np.zeros(3), C
    ).logpdf(np.zeros(3))
    np.testing.assert_allclose(-0.5 * np.sum(found**2), expected, rtol=1e-9)


def test_whitening_of_deviations_of_very_different_size():
    size = np.array([1e-9, 1.0, 1e4])
    correlation = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.3], [0.0, 0.3, 1.0]])
    W = whitener(correlation * np.outer(size, size))
    np.testing.assert_allclose(W @ (correlation * np.outer(size, size)) @ W.T, np.eye(3), atol=1e-10)


@pytest.mark.parametrize("count", [1, 2])
def test_held_numbers_are_refused_if_the_prior_makes_them_unlikely(count):
    """A squared distance from the mean that is exceeded with a probability of 0.1 %, in closed form."""
    limit = {1: scipy.special.erfcinv(1e-3) * np.sqrt(2), 2: np.sqrt(-2 * np.log(1e-3))}[count]
    spread = np.array([0.2, 0.3, 0.1])[: count + 1]
    prior = Correlated(
        (5e8, 5e7, 8e6)[: count + 1], np.diag(spread**2), (0.0,) * (count + 1), (np.inf,) * (count + 1)
    )
    path, free = f"{E}[:{count + 1}]", {f"{E}[{count}]": Positive()}

    def scene(distance):
        held = np.array([5e8, 5e7, 8e6])
        held[:count] *= np.exp(distance * spread[:count] / np.sqrt(count))
        return PRONY.replace(upper=rf.Body(rf.Prony(3e6, held, [1e-7, 1e-5, 1e-3])))

    assert rows(scene(0.99 * limit), free, {path: prior}).size == count + 1
    with pytest.raises(ValueError, match="is fixed at"):
        rows(scene(1.01 * limit), free, {path: prior})


def test_numbers_that_are_held_shift_the_others():
    """The conditional mean of a bivariate normal, in closed form."""
    mean, C = np.log([5e8, 5e7]), np.array([[0.04, 0.03], [0.03, 0.09]])
    prior = Correlated((5e8, 5e7), C, (0.0, 0.0), (np.inf, np.inf))
    scene = PRONY.replace(upper=rf.Body(rf.Prony(3e6, [6e8, 5e7, 8e6], [1e-7, 1e-5, 1e-3])))
    data = ModulusData([1.0], [1e7], [1e6], relative=1e6, check_units=False)  # that say nothing
    result = fitting.fit(scene, data, {E + "[1]": Positive()}, prior={E + "[:2]": prior})
    expected = mean[1] + C[1, 0] / C[0, 0] * (np.log(6e8) - mean[0])
    np.testing.assert_allclose(np.log(result.values), [expected], rtol=1e-9)
    variance = C[1, 1] - C[1, 0] ** 2 / C[0, 0]
    np.testing.assert_allclose(result.stderr / result.values, [np.sqrt(variance)], rtol=1e-6)


def test_wrong_keys():
    with pytest.raises(ValueError, match="must name a free parameter, or several separated by commas"):
        rows(PRONY, {"gamma": Positive()}, {KEY: KNOWN})
    with pytest.raises(ValueError, match=r"names 4 numbers, but the prior has 3"):
        rows(PRONY, {E: Positive()}, {f"{KEY}, gamma": KNOWN})


def test_rows_and_their_derivatives_are_those_of_the_padded_problem():
    """Tables that stay are padded when compiled: priors must find their numbers in them."""
    data = ModulusData(OMEGA, np.asarray(TABLE.storage), np.asarray(TABLE.loss), relative=0.1)
    free = {"upper.material.storage": Positive(), "gamma": Bounded(0, 1)}
    key = "gamma, lower.spectrum.C[1], upper.material.shift.aT[1:3]"
    known = Correlated(
        (0.4, 3.1e-16, 29.0, 1.01), np.diag([0.1, 0.01, 0.01, 0.01]) + 0.001, [0] * 4, [1] + [np.inf] * 3
    )
    problem = make_problem(
        SCENE, [data], free, {"upper.material.storage": Smooth(), key: known, PARTS: Sum(high=1e7)}
    )
    plain = functions(problem)[0](problem.start)
    np.testing.assert_allclose(residual_rows(problem, problem.start), plain, rtol=1e-12, atol=1e-12)
