"""Priors and robust losses: additional rows, and weights of residuals."""

import dataclasses
import functools

import numpy as np
import pytest
from support.jacobians import functions, prior_rows
from support.scenes.fits import ROAD, E

import rubberfric as rf
from fitting import Bounded, Correlated, Free, Gaussian, ModulusData, Positive, Smooth, Sum, Tied, fit
from fitting.solvers.objective import LOSS_WIDTHS
from fitting.solvers.problem import make_problem
from fitting.solvers.residuals import loss_of

TAU = np.array([1e-7, 1e-4, 1e-5, 1e-1])  # neither in order nor evenly spaced
MODULI = np.array([5e8, 8e6, 5e7, 2e6])
RUBBER = rf.Prony(3e6, MODULI, TAU)
SCENE = rf.Scene(ROAD, rf.Body(RUBBER))


rows = functools.partial(prior_rows, SCENE)


# --- Gaussian priors


def test_gaussian_prior_is_gaussian_in_the_coordinate_of_its_rule():
    mean, sigma = 4e6, 5e5
    found = rows({"upper.material.E_inf": Positive()}, {"upper.material.E_inf": Gaussian(mean, sigma)})
    np.testing.assert_allclose(found, [np.log(3e6 / mean) / (sigma / mean)], rtol=1e-13)
    low, high, mean, sigma = 0.3, 1.0, 0.7, 0.05
    free = {"lower.spectrum.hurst": Bounded(low, high)}
    found = rows(free, {"lower.spectrum.hurst": Gaussian(mean, sigma)})

    def logit(value):
        return np.log((value - low) / (high - value))

    slope = (high - low) / ((mean - low) * (high - mean))  # d logit / d value
    np.testing.assert_allclose(found, [(logit(0.8) - logit(mean)) / (sigma * slope)], rtol=1e-13)
    free = {"upper.material.E_inf": Free(scale=7.0)}
    found = rows(free, {"upper.material.E_inf": Gaussian(-2e6, 4e6)})
    np.testing.assert_allclose(found, [(3e6 + 2e6) / 4e6], rtol=1e-13)


def test_one_mean_and_error_for_each_element_are_as_many_priors():
    means, sigmas = 1.1 * MODULI, MODULI * [0.1, 0.2, 0.3, 0.4]
    found = rows({E: Positive()}, {E: Gaussian(means, sigmas)})
    np.testing.assert_allclose(found, np.log(1 / 1.1) / (sigmas / means), rtol=1e-12)
    np.testing.assert_allclose(rows({E: Positive()}, {E: Gaussian(list(means), 1e6)})[0], found[0] * 50)
    assert Gaussian(means, sigmas) == Gaussian(tuple(means), list(sigmas)) != Gaussian(means, 1.0)
    assert len({Gaussian(means, 1.0), Gaussian(means, 1.0)}) == 1


@pytest.mark.parametrize(
    ("rule", "mean"), [(Positive(), 4e6), (Bounded(1e6, 9e6), 4e6), (Free(), 4e6), (Free(scale=3.0), 0.0)]
)
def test_gaussian_prior_is_one_sigma_off_at_mean_plus_sigma(rule, mean):
    """To first order: the width is in the unit of the parameter."""
    sigma = 10.0
    free = {"upper.material.E_inf": dataclasses.replace(rule, start=mean + sigma)}
    found = rows(free, {"upper.material.E_inf": Gaussian(mean, sigma)})
    np.testing.assert_allclose(found, [1.0], rtol=1e-5)


def test_gaussian_prior_counts_for_every_element_and_only_for_its_own():
    free = {"gamma": Bounded(0.0, 1.0), E + "[1:]": Positive(), "upper.material.E_inf": Positive()}
    prior = {E + "[1:]": Gaussian(1e7, 1e6), "gamma": Gaussian(0.5, 0.1)}
    found = rows(free, prior)
    np.testing.assert_allclose(found[:3], np.log(MODULI[1:] / 1e7) / 0.1, rtol=1e-13)
    np.testing.assert_allclose(found[3], 0.0, atol=1e-14)
    moved = rows(free, prior, shift=np.array([0, 0.5, 0, 0, 9.0]))
    np.testing.assert_allclose(moved - found, [5.0, 0, 0, 0], atol=1e-13)


# --- smooth spectra


def by_hand(moduli, tau, sigma):
    """Second differences of ln E over log10 tau, in the order of tau."""
    order = np.argsort(tau)
    slopes = np.diff(np.log(moduli[order])) / np.diff(np.log10(tau[order]))
    return np.diff(slopes) / sigma


@pytest.mark.parametrize("sigma", [1.0, 0.25])
@pytest.mark.parametrize("path", [E, E + "[2]", E + "[:3]"])
def test_smooth_rows(path, sigma):
    found = rows({path: Positive()}, {E: Smooth(sigma)})
    np.testing.assert_allclose(found, by_hand(MODULI, TAU, sigma), rtol=1e-12)


def test_smooth_rows_of_other_parameters():
    free = {E: Positive([1e9 * t**-0.4 for t in TAU])}
    np.testing.assert_allclose(rows(free, {E: Smooth(0.1)}), 0.0, atol=1e-12)
    # The order of the times, too, when they pass each other.
    shift = np.log([1.0, 1e-4, 1.0, 1.0])
    found = rows({E + "[0]": Positive(), "upper.material.tau": Positive()}, {E: Smooth()}, [0.0, *shift])
    np.testing.assert_allclose(found, by_hand(MODULI, TAU * np.exp(shift), 1.0), rtol=1e-12)
    found = rows({E: Positive()}, {E: Smooth(0.5)})
    both = rows({E: Positive(), "gamma": Bounded(0.0, 1.0)}, {"gamma": Gaussian(0.4, 0.1), E: Smooth(0.5)})
    np.testing.assert_allclose(both[1:], found, rtol=1e-13)
    assert both[0] > 0.9


@pytest.mark.parametrize(
    ("prior", "text"),
    [
        ({"gama": Gaussian(0.5, 0.1)}, "'gama': unknown key path; did you mean 'gamma'?"),
        ({"upper.material.tau": Gaussian(1, 1)}, "mean = 1, but the number is fixed at"),
        ({E + "[1]": Gaussian(1e7, 1e6)}, f"the key must be one of the free parameters {E}, gamma"),
        (
            {"upper.material.E_inf": Gaussian(1e7, 1e6)},
            f"the key must be one of the free parameters {E}, gamma",
        ),
        ({E: Gaussian(-1e7, 1e6)}, "mean = -1e+07: must be > 0 for a Positive parameter"),
        ({E: Gaussian([1e7, 2e7], 1e6)}, "mean has 2 numbers: must have 4 or one"),
        ({"gamma": Gaussian(1.0, 0.1)}, "mean = 1: must be inside the parameter's bounds"),
        ({E: 0.3}, f"prior['{E}'] = 0.3: must be Gaussian, Smooth, Sum or Correlated"),
        ({E: Gaussian}, "must be Gaussian, Smooth, Sum or Correlated"),
        ({E + "[1:]": Smooth()}, "Smooth must have the path of a whole vector with an abscissa"),
        ({"gamma": Smooth()}, "Smooth must have the path of a whole vector"),
        ({"upper.material.tau": Smooth()}, "such as E of a Prony series or storage of a table"),
        ({"lower.spectrum.h_rms + lower.spectrum.q1": Sum(high=1.0)}, "must name a free parameter or a sum"),
    ],
)
def test_wrong_priors(prior, text):
    free = {E: Positive(), "gamma": Bounded(0.0, 1.0), "upper.material.E_inf": Tied("gamma")}
    with pytest.raises(ValueError, match="must") as caught:
        rows(free, prior)
    assert text in str(caught.value) and "\n" not in str(caught.value)


def test_smooth_needs_a_free_series_of_three_different_times():
    with pytest.raises(ValueError, match="the vector, or some of its elements, must be free"):
        rows({"gamma": Positive()}, {E: Smooth()})
    for moduli, tau in (([1e8, 1e7], [1e-5, 1e-3]), ([1e8, 1e7, 1e6], [1e-5, 1e-3, 1e-3])):
        scene = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, moduli, tau)))
        data = ModulusData([1.0, 2.0], [1e7] * 2, [1e6] * 2)
        with pytest.raises(ValueError, match=r"upper\.material\.tau must have at least three different"):
            fit(scene, data, {E: Positive()}, prior={E: Smooth()})


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Gaussian(np.nan, 1.0), "mean = nan: must be a finite number"),
        (lambda: Gaussian([1.0, np.inf], 1.0), "must be a finite number"),
        (lambda: Gaussian(1.0, [1.0, -1.0]), "must be a finite number > 0"),
        (lambda: Gaussian(1.0, 0.0), "sigma = 0.0: must be a finite number > 0"),
        (lambda: Smooth(0.0), "sigma = 0.0: must be a finite number > 0"),
        (lambda: Sum(high=1.0, sigma=0.0), "sigma = 0.0: must be a finite number > 0"),
        (lambda: Sum(), "must be numbers > 0, at least one of them given"),
        (lambda: Sum(high=-1.0), "must be numbers > 0"),
        (lambda: Sum(2.0, 1.0), "must be low < high"),
        (lambda: Correlated((1.0,), ((1.0, 0.0),), (0.0,), (np.inf,)), "covariance must be numbers of the"),
        (lambda: Correlated((), (), (), ()), "mean must be numbers of the shape"),
        (lambda: Correlated((1.0,), ((0.0,),), (0.0,), (np.inf,)), "> 0 on its diagonal"),
        (lambda: Correlated((-1.0,), ((1.0,),), (0.0,), (np.inf,)), "mean must be finite and between low"),
        (lambda: Correlated((1.0,), ((1.0,),), (-np.inf,), (2.0,)), "high must be inf where low is -inf"),
    ],
)
def test_wrong_numbers(make, text):
    with pytest.raises(ValueError, match="must") as caught:
        make()
    assert text in str(caught.value) and "\n" not in str(caught.value)


# --- what priors do to a fit


def test_a_prior_beside_data_weighs_like_one_more_measurement():
    """A linear problem: the mean weighted with the inverse variances, in closed form."""
    scene = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, [5e7], [1e-3])))
    omega = np.array([1e-2, 1e-1])  # E' = E_inf here, to 1e-8 of it
    storage, sigma = np.array([3.2e6, 2.9e6]), np.array([2e5, 3e5])
    data = ModulusData(omega, storage, [5e2, 5e3], sigma, [1e9, 1e9])
    free = {"upper.material.E_inf": Free()}
    result = fit(scene, data, free, prior={"upper.material.E_inf": Gaussian(2.5e6, 1e5)})
    weights = np.array([*sigma, 1e5]) ** -2
    expected = np.sum(weights * [*storage, 2.5e6]) / np.sum(weights)
    np.testing.assert_allclose(result.values, [expected], rtol=1e-7)
    np.testing.assert_allclose(result.stderr, [np.sum(weights) ** -0.5], rtol=1e-7)
    # The cost counts the prior's square, the sum over the data does not.
    np.testing.assert_allclose(
        2 * result.cost - result.chisqr, ((result.values[0] - 2.5e6) / 1e5) ** 2, rtol=1e-6
    )


def test_robust_losses_leave_priors_quadratic():
    problem = make_problem(
        SCENE,
        [ModulusData([1.0, 2.0], [1e7, 1e7], [1e6, 1e6], relative=0.1)],
        {"upper.material.E_inf": Positive()},
        {"upper.material.E_inf": Gaussian(3e9, 3e7)},
        loss="cauchy",
    )
    found = np.asarray(functions(problem)[0](problem.start))
    assert found[-1] == pytest.approx(np.log(1e-3) / 0.01, rel=1e-12)
    width = LOSS_WIDTHS["cauchy"]
    expected = 0.5 * (width**2 * np.sum(np.log1p((found[:-1] / width) ** 2)) + found[-1] ** 2)
    loss = loss_of(problem.structure, problem.numbers)
    assert float(loss.cost(found)) == pytest.approx(expected, rel=1e-14)
