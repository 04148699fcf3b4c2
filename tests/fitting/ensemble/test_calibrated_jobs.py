"""Four planned fits, a thousand times each: coverage of error bars and posteriors.

    python -m pytest -m slow -s tests/fitting/ensemble/test_calibrated_jobs.py [-k twin]

Each job prints its figures: against the normal approximation that error bars are, and against weighted draws.
Minutes each, most of them for the twin job. It goes on with the parts that are in the folder of
RUBBERFRIC_CALIBRATIONS, if there is one.
"""

import dataclasses
import os
import pickle
import time
from pathlib import Path

import jax
import numpy as np
import pytest
import scipy
from support.ensembles.calibration_jobs import JOBS

import fitting
import rubberfric as rf
from fitting.uncertainty import importance

MEMBERS = 1000  # posteriors of a calibration
# Parts of a calibration that are stored separately.
PARTS = 4
ARRAYS = ("truth", "values", "place", "deviation", "normal", "effective", "tail")


def part_of(name, part, members):
    """A part of a job with its wall time and processor time; from its file, if it was computed before."""
    folder = os.environ.get("RUBBERFRIC_CALIBRATIONS")
    path = folder and Path(folder) / f"{name}_{members}_{part}.pickle"
    if path and path.exists():
        return pickle.loads(path.read_bytes())
    arguments, options = JOBS[name]()
    began, busy = time.perf_counter(), time.process_time()
    found = fitting.calibration(*arguments, members, jax.random.key(part), on="samples", **options)
    result = found, time.perf_counter() - began, time.process_time() - busy
    if path:
        path.write_bytes(pickle.dumps(result))
    return result


def joined(found):
    """One calibration of several."""
    arrays = {name: np.concatenate([getattr(one, name) for one in found]) for name in ARRAYS}
    return dataclasses.replace(found[0], failed=sum(one.failed for one in found), **arrays)


@pytest.mark.slow
@pytest.mark.parametrize("name", JOBS)
# Some of a thousand posteriors have doubtful weights.
@pytest.mark.filterwarnings("ignore:calibration. draws of:RuntimeWarning")
def test_posteriors_hold_the_truth_as_often_as_they_say(name):
    found, wall, busy = zip(*(part_of(name, k, MEMBERS // PARTS) for k in range(PARTS)), strict=True)
    found = joined(found)
    normal = found.on_normal()
    print(f"\n{name}: {sum(wall):.0f} s, {sum(busy):.0f} s of processor")
    print(f"{found.report()}{normal.report()}{found.doubts()}")
    assert found.failed == 0 and found.place.shape[0] == MEMBERS and found.identified.all()
    assert found.inside(0.99).all() and found.doubtful.size <= 0.05 * MEMBERS
    # Error bars a fifth too short are seen.
    short = scipy.special.ndtr(scipy.special.ndtri(normal.place) / 0.8)
    assert not dataclasses.replace(normal, place=short).inside().any()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:calibration. draws of:RuntimeWarning")
def test_draws_see_posteriors_that_are_a_fifth_too_narrow(monkeypatch):
    """The density raised to a power that multiplies every standard deviation by 0.8."""
    arguments, options = JOBS["modulus"]()
    density = importance.density_at
    monkeypatch.setattr(importance, "density_at", lambda *given: density(*given) / 0.8**2)
    importance._densities.clear_cache()
    try:
        found = fitting.calibration(*arguments, MEMBERS, on="samples", **options)
    finally:
        importance._densities.clear_cache()
    print(f"\n{found.report()}")
    assert not found.inside().any()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["shear", "twin"])
def test_draws_are_those_of_a_chain(name):
    """Means and deviations of a bent posterior, by weights and by the No-U-Turn sampler."""
    pytest.importorskip("numpyro")
    (scene, data, free, prior), options = JOBS[name]()
    random = np.random.default_rng(0)
    conditions = data.velocity, data.pressure, data.temperature
    exact = np.asarray(rf.friction(scene, *conditions, **options))
    data = data.replaced(exact * np.exp(0.03 * random.standard_normal(exact.size)))
    fit = fitting.fit(scene, data, free, prior=prior, **options)
    targets = jax.tree.map(lambda a: np.asarray(a)[None], fit.problem.targets)
    proposal = importance.Proposal.of(fit.x[None], fit.uncertainty.spread[None])
    x = proposal.draws(3000, random)
    log_weight = importance.log_weights(fit.problem, targets, proposal, x)
    weight = importance.relative(log_weight)[0] / importance.relative(log_weight).sum()
    z = (x[0] - fit.x) / fit.uncertainty.deviation
    mean = weight @ z
    spread = np.sqrt(weight @ (z - mean) ** 2)
    chains = fit.sample(800, warmup=200, chains=2)
    by_chain = (chains.x.reshape(-1, len(fit.names)) - fit.x) / fit.uncertainty.deviation
    worth = importance.effective(log_weight)[0]
    error = np.sqrt(1 / chains.ess + 1 / worth)
    away = np.abs(mean - by_chain.mean(0))
    print(f"\neffective: {worth:.0f} of 3000 weighted, {chains.ess.min():.0f} of 800 in chains")
    print(f"means {np.abs(mean).max():.3f} deviations off the mode, {away.max():.3f} off those of the chains")
    np.testing.assert_array_less(away / error, 4.0)
    np.testing.assert_array_less(np.abs(np.log(spread / by_chain.std(0))) / error, 4.0)
