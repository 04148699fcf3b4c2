"""Simulation-based calibration: of a fit whose bars are right, and of one whose bars are not."""

import dataclasses
import functools

import numpy as np
import pytest
import scipy
from support.ensembles.checks import refused
from support.scenes.fits import FAST, H_RMS, SCENE

import fitting
from fitting.ensemble import calibration as calibration_module
from fitting.solvers.objective import INTERRUPTED

HEIGHT = {H_RMS: fitting.Gaussian(5e-4, 1e-4)}
PRIOR = {
    **HEIGHT,
    "upper.material.E[0]": fitting.Gaussian(5e7, 1e7),
    "upper.material.E[1]": fitting.Gaussian(8e6, 2e6),
}
FREE = {path: fitting.Positive() for path in PRIOR}
PLAN = fitting.FrictionData(np.geomspace(1e-4, 1e-1, 6), np.ones(6), pressure=1e5, relative=0.03)
# ln C = 2 ln h + ...: the posterior of ln h is known in closed form.
SPECTRUM = fitting.SpectrumData(np.geomspace(2e3, 2e4, 7), np.ones(7), relative=0.4)


def of_places(place, names="a"):
    """Return a calibration whose truths have these places in their posteriors."""
    return fitting.Calibration(tuple(names), place, place, place, place, 0)


@pytest.mark.slow
def test_a_fit_is_calibrated_and_knows_when_it_is_not():
    found = fitting.calibration(SCENE, PLAN, FREE, PRIOR, 100, quadrature=FAST)
    assert found.failed == 0 and found.place.shape == (100, 3)
    assert found.inside().all() and found.identified.all()
    assert ((found.coverage(0.9) > 0.8) & (found.coverage(0.9) < 0.98)).all()
    assert (found.ranks(9) <= 9).all() and len(np.unique(found.ranks(9))) == 10
    # Truths were drawn from the prior, and fits know more than it.
    spread = np.log(found.truth).std(0)
    np.testing.assert_allclose(sorted(spread), sorted([0.2, 0.2, 0.25]), rtol=0.25)
    left = np.log(found.values / found.truth).std(0)
    assert (left < 1.1 * spread).all() and (left < 0.5 * spread).sum() == 2
    text = found.report()
    assert text.count(": calibrated") == 3 and "100 fits, 0 did not converge" in text
    narrow = dataclasses.replace(found, place=scipy.special.ndtr(2 * scipy.special.ndtri(found.place)))
    assert not narrow.inside().any() and narrow.report().count("NOT CALIBRATED") == 3


def test_against_a_linear_problem_in_closed_form():
    """The posterior of ln h is of prior and data, and truths scatter as it says."""
    drawn = fitting.calibration(SCENE, SPECTRUM, {H_RMS: fitting.Positive()}, HEIGHT, 300, on="samples")
    found = drawn.on_normal()
    deviation = 1 / np.sqrt(1 / 0.2**2 + 7 * (2 / 0.4) ** 2)
    np.testing.assert_allclose(found.deviation, deviation, rtol=1e-6)
    off = np.log(found.truth / found.values) / deviation
    np.testing.assert_allclose(found.place, scipy.special.ndtr(off), rtol=1e-6)
    # With 300 draws the standard error of a mean is 0.06, of a standard deviation 0.04.
    assert abs(off.mean()) < 0.2 and 0.87 < off.std() < 1.13
    moved = np.log(found.truth / 5e-4) / 0.2
    assert abs(moved.mean()) < 0.2 and 0.87 < moved.std() < 1.13
    # Data and prior together, not the truth alone.
    shrunk = np.log(found.values / 5e-4)
    np.testing.assert_allclose(shrunk.std(), np.sqrt(0.2**2 - deviation**2), rtol=0.15)
    assert found.failed == 0 and found.inside().all() and found.identified.all()
    # With a hundred draws, of which one in five does not count, the standard error of a share is 0.05.
    away = (drawn.place - found.place)[:, 0]
    assert drawn.inside().all() and abs(away.mean()) < 0.01 and 0.02 < away.std() < 0.05
    assert drawn.effective.min() > 60 and not drawn.doubtful.size and not drawn.doubts()
    assert (drawn.on, found.on) == ("samples", "normal")
    assert "100 draws, " in drawn.report() and "normal approximation" in found.report()


def test_doubtful_draws_are_named():
    random = np.random.default_rng(1).random((4, 2))
    few, tail = np.array([50.0, 3.0, 60.0, 70.0]), np.array([0.2, 0.3, -np.inf, 1.2])
    found = fitting.Calibration(
        ("a", "b"), random, random, random, random, 0, "samples", random, 2000, few, tail
    )
    assert found.doubtful.tolist() == [1, 3] and "in rows 1, 3: draw more" in found.doubts()
    text = "2000 draws, 55 effective in most and 3 in the worst, tail index 0.25, 2 doubtful"
    assert text in found.report()
    assert not found.on_normal().doubtful.size


def test_envelope_holds_uniform_samples():
    """It rejects about one in a hundred of 400 uniform samples."""
    random = np.random.default_rng(1)
    found = of_places(random.random((200, 400)), map(str, range(400)))
    assert 0.97 <= found.inside(0.99).mean() <= 1.0
    assert 0.84 <= found.inside(0.9).mean() <= 0.95


def test_plot():
    pytest.importorskip("matplotlib")
    random = np.random.default_rng(1).random((50, 2))
    assert len(of_places(random, "ab").plot().lines) == 2
    # If there are many lines, only lines that leave the envelope are named.
    many = np.random.default_rng(1).random((400, 9))
    many[:, 3] **= 2
    ax = of_places(many, "abcdefghi").plot()
    assert len(ax.lines) == 9
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["99 % envelope", "d"]


def test_refusals():
    bare = dataclasses.replace(PLAN, relative=None)
    for data, prior, words, options in (
        (PLAN, HEIGHT, "upper.material.E[0] has no Gaussian prior; every", {}),
        (bare, PRIOR, "have no errors; give errors", {}),
        (PLAN, PRIOR, "on = 'chains': must be one of normal, samples", {"on": "chains"}),
        (PLAN, PRIOR, "draws = 5: must be an integer >= 10", {"draws": 5}),
        (PLAN, PRIOR, "amplitude = None: must be given", {"discrepancy": fitting.Discrepancy(None)}),
        (PLAN, PRIOR, "width = None: must be given", {"discrepancy": fitting.Discrepancy(0.2)}),
    ):
        arguments = SCENE, data, FREE, prior, 10
        refused(functools.partial(fitting.calibration, *arguments, quadrature=FAST, **options), words)


def test_ranks_and_coverage_of_evenly_spaced_places():
    """A truth with the share u of the posterior below it exceeds about u n of n draws."""
    place = (np.arange(100.0)[:, None] + 0.5) / 100
    found = of_places(place)
    np.testing.assert_array_equal(found.ranks(99)[:, 0], np.arange(100))
    np.testing.assert_array_equal(found.ranks(9)[:, 0], np.arange(100) // 10)
    assert [found.coverage(level).item() for level in (0.1, 0.5, 0.9)] == [0.1, 0.5, 0.9]
    assert of_places(np.array([[0.0], [1.0]])).ranks(99).tolist() == [[0], [99]]


@pytest.mark.slow
def test_an_interrupted_calibration_has_the_fits_that_ended(monkeypatch):
    run = calibration_module.run_ensemble

    def interrupted(fits, **options):
        found = run(fits, **options)
        status = np.where(np.arange(len(found)) < 3, found.status, INTERRUPTED)
        return dataclasses.replace(found, status=status)

    monkeypatch.setattr(calibration_module, "run_ensemble", interrupted)
    found = fitting.calibration(SCENE, SPECTRUM, {H_RMS: fitting.Positive()}, HEIGHT, 8)
    assert found.truth.shape == (3, 1) and found.failed == 5
