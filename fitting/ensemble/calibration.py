r"""Whether error bars are what they say: fits of data drawn from known scenes, the prior's.

Truths theta are drawn from the prior, data from the scenes that they make, and each data set is fitted with
that prior. Where the truth lies in the posterior,

.. math:: u = \Phi\left(\frac{x_\mathrm{true} - \hat x}{\sigma_x}\right)

in the normal approximation of the fit's error bars, is then uniform between 0 and 1, parameter by parameter
[Talts et al., arXiv:1804.06788]. Its empirical distribution is held against an envelope that a uniform one
leaves with a given small probability anywhere [Säilynoja, Bürkner & Vehtari, Stat. Comput. 32 (2022) 32,
arXiv:2103.10522].

The normal approximation can be off by a tenth or two of a standard deviation, of wide priors and of numbers
that trade with each other along a curve, which a thousand fits show. Against the posterior itself stand draws
with weights (`fitting.uncertainty.importance`): the place of the truth among them is uniform where
the fit's posterior is that of the data, however bent it is.
"""

import dataclasses
import functools
import warnings
from collections.abc import Callable, Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
import scipy

import rubberfric as rf
from fitting.data.kinds import as_data_sets
from fitting.data.measured import Measured
from fitting.ensemble.calibration_result import Calibration
from fitting.ensemble.members import NEAR, Members
from fitting.ensemble.run import run_ensemble
from fitting.parameters.constraints import Rule
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.priors.gaussian import GaussianRows
from fitting.parameters.priors.rows import Prior
from fitting.solvers.iterate import succeeded
from fitting.solvers.options import check_options
from fitting.solvers.problem import Problem, Targets, make_problem
from fitting.solvers.residuals import padded, predictions, residuals_and_jacobian
from fitting.uncertainty.discrepancy import check_discrepancy, with_discrepancy
from fitting.uncertainty.importance import effective, guided, log_weights, places, tail_index
from fitting.uncertainty.intervals import drawn_errors
from rubberfric.base import shown

POSTERIORS = ("normal", "samples")
# Draws of which a tail can be seen.
_LEAST = 10


def calibration(
    scene: rf.Scene,
    data_plan: Measured | Sequence[Measured],
    free: Mapping[str, Rule],
    prior: Mapping[str, Prior],
    members: int = 1000,
    key: jax.Array | None = None,
    *,
    on: str = "normal",
    draws: int = 100,
    discrepancy: Discrepancy | None = None,
    quadrature: rf.Quadrature | None = None,
    callback: Callable[[int, int], object] | None = None,
) -> Calibration:
    """Simulation-based calibration of a fit that is planned, as one ensemble.

    Parameters
    ----------
    scene, free, quadrature : as for `fitting.fit`
    data_plan : data sets, of which conditions and errors count; the values are drawn
    prior : of every free number a Gaussian; truths are drawn from it
    members : number of fits, each of its own truth and data; they start at the truth
    key : jax.random.key, or None for key(0)
    on : "normal" or "samples"
        what the truths are held against: the normal approximation that error bars are, or weighted draws from
        the posterior, which cost `draws` evaluations of the residuals for each fit
    draws : of each posterior
    discrepancy : as for `fitting.fit`, with amplitude and width; the data are drawn with it
    callback : as for `fitting.run_ensemble`; with "samples" called again from 0 while these are drawn

    Returns
    -------
    Calibration

    Raises
    ------
    ValueError : as `fitting.fit`, data without errors, or a free number without a Gaussian prior.

    Warns
    -----
    RuntimeWarning
        the draws of some fits say little of their posteriors; it names their rows, as does `doubtful`.
    """
    check_options(count=members, n=draws, key=key, prior=prior)
    if draws < _LEAST:
        raise ValueError(f"draws = {draws}: must be an integer >= {_LEAST}")
    if on not in POSTERIORS:
        raise ValueError(f"on = {shown(on)}: must be one of {', '.join(POSTERIORS)}")
    data = as_data_sets(data_plan)
    for one in data:
        if one.error is None:
            raise ValueError(f"data {one.label!r}: have no errors: must have, as data are drawn with them")
    problem = make_problem(scene, data, free, prior, quadrature=quadrature)
    if discrepancy is not None:
        check_discrepancy(discrepancy, data, "linear", "auto")
        for name in ("amplitude", "width"):
            if getattr(discrepancy, name) is None:
                raise ValueError(f"discrepancy: {name} = None: must be given, as data are drawn with it")
        problem = with_discrepancy(problem, [scene] * len(data), data, discrepancy)
    key = jax.random.key(0) if key is None else key
    x, targets = _twins(problem, members, key)
    fits = Members("calibration", problem, x, targets, NEAR, NEAR.max_steps, np.full(members, -1))
    found = run_ensemble(fits, callback=callback)
    good = succeeded(found.status)
    x, targets = x[good], targets._replace(measured=targets.measured[good])
    whole = padded(problem, targets)
    precision = _precisions(whole.structure, whole.numbers, whole.targets, jnp.asarray(found.x[good]))
    covariance = np.linalg.inv(np.asarray(precision))
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    normal = scipy.special.ndtr((x - found.x[good]) / deviation)
    result = Calibration(
        problem.names, problem.values(x), found.values[good], normal, deviation, int(np.sum(~good))
    )
    if on == "normal":
        return result
    random = np.random.default_rng(np.asarray(jax.random.key_data(jax.random.fold_in(key, 1))))
    proposal = guided(problem, targets, found.x[good], covariance, draws, random)
    rows = np.concatenate([proposal.draws(draws, random), x[:, None]], 1)
    weight = log_weights(problem, targets, proposal, rows, callback)
    result = dataclasses.replace(
        result,
        on=on,
        normal=normal,
        place=places(rows, weight, random),
        draws=draws,
        effective=effective(weight[:, :-1]),
        tail=tail_index(weight[:, :-1]),
    )
    if doubts := result.doubts():
        warnings.warn(f"calibration: {doubts}", RuntimeWarning, stacklevel=2)
    return result


def _twins(problem: Problem, members: int, key: jax.Array) -> tuple[np.ndarray, Targets]:
    """Truths from the priors, shape (members, size), and the data that they make, with errors."""
    pairs = zip(problem.structure.prior.terms, problem.numbers.prior, strict=True)
    drawn = [(term.elements, *numbers) for term, numbers in pairs if isinstance(term, GaussianRows)]
    known = [i for elements, *_ in drawn for i in elements]
    bare = [name for i, name in enumerate(problem.names) if i not in known]
    if bare:
        raise ValueError(f"prior: {bare[0]} has none: must be a Gaussian, as truths are drawn from it")
    draw_truth, draw_noise = jax.random.split(key)
    x = np.empty((members, len(known)))
    mean, sigma = (np.concatenate([np.asarray(one[k]) for one in drawn]) for k in (1, 2))
    x[:, known] = mean + sigma * np.asarray(jax.random.normal(draw_truth, (members, len(known))))
    of = padded(problem)
    model = np.asarray(_models(of.structure, of.numbers, jnp.asarray(x)))[:, of.data]
    targets = jax.tree.map(lambda a: np.asarray(a)[None], problem.targets)
    return x, targets._replace(measured=model + drawn_errors(problem, members, draw_noise))


@functools.partial(jax.jit, static_argnums=0)
def _models(structure, numbers, x):
    """What the model predicts at every x, one after the other: the values of one keep a core busy."""
    return jax.lax.map(lambda x: predictions(structure, numbers, x)[0], x)


@functools.partial(jax.jit, static_argnums=0)
def _precisions(structure, numbers, targets, x):
    """J^T J at every x, priors included; it does not depend on the data but through their errors."""
    one = jax.tree.map(lambda a: a[0], targets)

    def precision(x):
        jacobian = residuals_and_jacobian(structure, numbers, one, x)[1]
        return jacobian.T @ jacobian

    return jax.lax.map(precision, x)
