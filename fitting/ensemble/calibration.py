r"""Simulation-based calibration, which tests error bars by fitting data drawn from known scenes.

True parameters theta (truths) are drawn from the prior. Data are drawn from the scenes with these parameters,
and each data set is fitted with the same prior. The rank of the truth in the normal approximation of the
posterior,

.. math:: u = \Phi\left(\frac{x_\mathrm{true} - \hat x}{\sigma_x}\right)

is then uniform between 0 and 1 for every parameter [Talts et al., arXiv:1804.06788]. The empirical
distribution of u is compared with an envelope, which a uniform u leaves with a given small probability
[Säilynoja, Bürkner & Vehtari, Stat. Comput. 32 (2022) 32, arXiv:2103.10522].

The normal approximation can have errors of 0.1 to 0.2 standard deviations, for wide priors and for parameters
that compensate each other along a curve. A thousand fits show this. Weighted draws from the posterior
(`fitting.uncertainty.importance`) have no such error: the rank of the truth among them is uniform if the
posterior is right, also along curved valleys.
"""

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence

import jax
import numpy as np
import scipy

import rubberfric as rf
from fitting.data.kinds import as_data_sets
from fitting.data.measured import Measured
from fitting.ensemble.members import Members
from fitting.ensemble.run import run_ensemble
from fitting.parameters.constraints import Constraint
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.priors import GaussianRows, Prior
from fitting.solvers.evaluation import errors_of_slopes, evaluate_rows
from fitting.solvers.levenberg_marquardt import NEAR_MINIMUM
from fitting.solvers.objective import succeeded, was_interrupted
from fitting.solvers.options import check_options
from fitting.solvers.problem import Problem, Targets, make_problem
from fitting.solvers.residuals import padded
from fitting.uncertainty.covariance import KNOWN
from fitting.uncertainty.discrepancy import check_discrepancy, with_discrepancy
from fitting.uncertainty.importance import doubtful, effective, guided, log_weights, places, tail_index
from fitting.uncertainty.intervals import drawn_errors
from rubberfric.base import shown
from rubberfric.plot import style

# Number of points at which the distributions are compared.
_POINTS = 100
# Number of uniform samples for the envelope.
_SAMPLES = 2000
# Number of lines in a figure with a colour each, and of unreliable fits that a message names.
_NAMED = 8


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """Result of `calibration`: ranks of true parameters in the posteriors of their fits.

    Attributes
    ----------
    names : key paths of the free elements
    truth, values : true and fitted values of the fits that converged, shape (members, size)
    place : share u of the posterior below the truth, shape (members, size)
    deviation : standard deviation of x according to the fit, shape (members, size)
    failed : number of fits that did not converge
    on : representation of the posterior, "normal" or "samples"; see `fitting.calibration`
    normal : `place` in the normal approximation of the same fits, if `on` is "samples"
    draws : number of draws from every posterior; 0 in the normal approximation
    effective, tail : effective sample size of the draws of every fit, and the tail index k of
        their weights, shape (members,); None in the normal approximation
    """

    names: tuple[str, ...]
    truth: np.ndarray
    values: np.ndarray
    place: np.ndarray
    deviation: np.ndarray
    failed: int
    on: str = "normal"
    normal: np.ndarray | None = None
    draws: int = 0
    effective: np.ndarray | None = None
    tail: np.ndarray | None = None

    @property
    def identified(self) -> np.ndarray:
        """True for each element whose standard deviation of x has a median < `KNOWN`, shape (size,)."""
        return np.median(self.deviation, 0) < KNOWN

    @property
    def doubtful(self) -> np.ndarray:
        """Indices of the fits whose draws have a small effective size, or a tail index well above 0.7."""
        if self.effective is None or self.tail is None:
            return np.zeros(0, int)
        return np.flatnonzero(doubtful(self.effective, self.tail, self.draws))

    def on_normal(self) -> "Calibration":
        """Return this calibration with ranks from the normal approximations of the posteriors."""
        if self.normal is None:
            return self
        bare = {"normal": None, "draws": 0, "effective": None, "tail": None}
        return dataclasses.replace(self, place=self.normal, on="normal", **bare)

    def ranks(self, draws: int = 99) -> np.ndarray:
        """Return the ranks of the true values among `draws` draws, as integers of shape (members, size)."""
        return np.minimum((self.place * (draws + 1)).astype(int), draws)

    def coverage(self, level: float = 0.95) -> np.ndarray:
        """Return the share of true values within central intervals of probability `level`, shape (size,)."""
        check_options(level=level)
        return np.mean(np.abs(self.place - 0.5) < 0.5 * level, 0)

    def distribution(self) -> tuple[np.ndarray, np.ndarray]:
        """Return points between 0 and 1, and the share of fits with u below each point, (points, size)."""
        at = np.arange(1, _POINTS) / _POINTS
        return at, np.mean(self.place[:, None] < at[:, None], 0)

    def envelope(self, level: float = 0.99) -> tuple[np.ndarray, np.ndarray]:
        """Return limits, of shape (points,), that a uniform u keeps everywhere with probability `level`."""
        check_options(level=level)
        count, at = len(self.place), np.arange(1, _POINTS) / _POINTS
        # Number of uniform samples below every point: cumulative sums of a multinomial distribution.
        parts = np.random.default_rng(0).multinomial(count, np.full(_POINTS, 1 / _POINTS), _SAMPLES)
        below = np.cumsum(parts, 1)[:, :-1]
        binomial = scipy.stats.binom(count, at)
        tails = np.min(np.minimum(binomial.cdf(below), binomial.sf(below - 1)), 1)
        tail = np.quantile(tails, 1 - level)
        return scipy.stats.binom.ppf(tail, count, at) / count, scipy.stats.binom.isf(tail, count, at) / count

    def inside(self, level: float = 0.99) -> np.ndarray:
        """Return booleans of shape (size,), True for elements whose distribution is within the envelope."""
        low, high = self.envelope(level)
        share = self.distribution()[1]
        return np.all((share >= low[:, None]) & (share <= high[:, None]), 0)

    def report(self) -> str:
        """Return the report as text of several lines, with one line for each parameter."""
        lines = [
            f"{len(self.place)} fits, {self.failed} did not converge; {self._posterior()}",
            "parameter: share within 68 %, 95 %",
        ]
        columns = zip(
            self.names, self.coverage(0.68), self.coverage(0.95), self.inside(), self.identified, strict=True
        )
        for name, middle, most, inside, known in columns:
            remark = ("calibrated" if inside else "NOT CALIBRATED") + ", poorly identified" * (not known)
            lines.append(f"{name}: {100 * middle:.1f} %, {100 * most:.1f} %: {remark}")
        return "\n".join(lines) + "\n"

    def doubts(self) -> str:
        """Return a one-line warning about unreliable draws, or "" if all draws are reliable."""
        rows = self.doubtful
        if not rows.size:
            return ""
        named = ", ".join(map(str, rows[:_NAMED])) + ", ..." * (rows.size > _NAMED)
        return (
            f"draws of {rows.size} of {len(self.place)} fits are unreliable (small effective sample size, or"
            f" heavy tails of the weights), in rows {named}: draw more, or use narrower priors"
        )

    def _posterior(self):
        if self.effective is None or self.tail is None:
            return "normal approximation"
        middle, least = np.median(self.effective), self.effective.min()
        said = f"{self.draws} draws, {middle:.0f} effective in most and {least:.0f} in the worst"
        said += f", tail index {np.median(self.tail):.2f}"
        return said + f", {self.doubtful.size} doubtful" * bool(self.doubtful.size)

    def plot(self, ax: style.Axes | None = None) -> style.Axes:
        """Draw the share of u below each point minus the expected share, and the 99 % envelope.

        If there are more than eight lines, only lines that leave the envelope have a name and a colour.
        """
        ax = style.one_axes(ax, (6.0, 4.0))
        at, share = self.distribution()
        low, high = self.envelope()
        ax.fill_between(at, low - at, high - at, color="0.85", label="99 % envelope")
        shown = np.ones(len(self.names), bool) if len(self.names) <= _NAMED else ~self.inside()
        if not shown.all():
            ax.plot(at, share[:, ~shown] - at[:, None], color="0.55", linewidth=0.8)
        named = np.flatnonzero(shown).tolist()
        for k, look in zip(named, style.colours(len(named)), strict=True):
            ax.plot(at, share[:, k] - at, color=look, label=self.names[k])
        ax.set_xlabel("place of the truth in the posterior [-]")
        ax.set_ylabel("share below, minus expected [-]")
        ax.legend(fontsize="small")
        return ax


POSTERIORS = ("normal", "samples")
# Smallest number of draws from which a tail index can be estimated.
_LEAST = 10


def calibration(
    scene: rf.Scene,
    data_plan: Measured | Sequence[Measured],
    free: Mapping[str, Constraint],
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
    """Run a simulation-based calibration of a planned fit in one ensemble.

    If the draws of some fits are unreliable, a RuntimeWarning names their rows, which are in `doubtful`.
    Raise ValueError as `fitting.fit`, and for data without errors or a number without a Gaussian prior.

    Parameters
    ----------
    scene, free, quadrature : as for `fitting.fit`
    data_plan : data sets that give conditions and errors; their measured values are replaced by drawn ones
    prior : a Gaussian for every free number; truths are drawn from it
    members : number of fits; each fit has its own true parameters and data, and starts at the true parameters
    key : jax.random.key, or None for key(0)
    on : "normal" or "samples"
        representation of the posterior: the normal approximation of the error bars, or weighted draws, which
        take `draws` evaluations of the residuals for each fit
    draws : number of draws from each posterior
    discrepancy : as for `fitting.fit`, with a given amplitude and width; the data include this model error
    callback : as for `fitting.run_ensemble`; with "samples", the number of fits done
        is counted a second time, from 0, during the draws

    Examples
    --------
    95 % intervals contain 95 % of the true heights:

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> plan = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    >>> h = "lower.spectrum.h_rms"
    >>> prior = {h: fitting.Gaussian(mean=0.5e-3, sigma=0.1e-3)}
    >>> ranks = fitting.calibration(scene, plan, {h: fitting.Positive()}, prior, members=1000)
    >>> ranks.failed, bool(ranks.inside()[0]), round(float(ranks.coverage(0.95)[0]), 2)
    (0, True, 0.95)
    """
    check_options(count=members, n=draws, key=key, prior=prior)
    if draws < _LEAST:
        raise ValueError(f"draws = {draws}: must be an integer >= {_LEAST}")
    if on not in POSTERIORS:
        raise ValueError(f"on = {shown(on)}: must be one of {', '.join(POSTERIORS)}")
    problem = _planned(scene, as_data_sets(data_plan), free, prior, discrepancy, quadrature)
    key = jax.random.key(0) if key is None else key
    x, targets = _twins(problem, members, key)
    fits = Members("calibration", problem, x, targets, NEAR_MINIMUM, NEAR_MINIMUM.max_steps)
    fitted = run_ensemble(fits, callback=callback)
    good = succeeded(fitted.status)
    if was_interrupted(fitted.status).any() and not good.any():
        raise KeyboardInterrupt
    x, targets = x[good], targets._replace(measured=targets.measured[good])
    covariance = _covariances(problem, fitted.x[good])
    deviation = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    normal = scipy.special.ndtr((x - fitted.x[good]) / deviation)
    result = Calibration(
        problem.names, problem.values(x), fitted.values[good], normal, deviation, int(np.sum(~good))
    )
    if on == "normal":
        return result
    random = np.random.default_rng(np.asarray(jax.random.key_data(jax.random.fold_in(key, 1))))
    proposal = guided(problem, targets, fitted.x[good], covariance, draws, random)
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


def _planned(scene, data, free, prior, discrepancy, quadrature):
    """Return the problem of a planned fit, or raise ValueError if data cannot be drawn for it."""
    for dataset in data:
        if dataset.error is None:
            raise ValueError(
                f"data {dataset.label!r} have no errors; give errors, because simulated"
                " data are drawn with them"
            )
    problem = make_problem(scene, data, free, prior, quadrature=quadrature)
    if discrepancy is not None:
        check_discrepancy(discrepancy, data, "linear", "auto")
        for name in ("amplitude", "width"):
            if getattr(discrepancy, name) is None:
                raise ValueError(f"discrepancy: {name} = None: must be given, because data are drawn with it")
        problem = with_discrepancy(problem, [scene] * len(data), data, discrepancy)
    return problem


def _covariances(problem, x):
    """Return the covariance at every row of x, the minima of several fits, shape (fits, size, size)."""
    of = padded(problem)
    _, slopes = evaluate_rows(of.structure, of.numbers, x, slopes=True)
    jacobian = np.stack([errors_of_slopes(of, at_fit) for at_fit in slopes])
    return np.linalg.inv(np.swapaxes(jacobian, 1, 2) @ jacobian)


def _twins(problem: Problem, members: int, key: jax.Array) -> tuple[np.ndarray, Targets]:
    """Return true x from the priors, (members, size), and `Targets` with data drawn from their scenes."""
    drawn = [prior for prior in problem.numbers.prior if isinstance(prior, GaussianRows)]
    known = [i for prior in drawn for i in prior.elements]
    bare = [name for i, name in enumerate(problem.names) if i not in known]
    if bare:
        raise ValueError(
            f"{bare[0]} has no Gaussian prior; every free parameter needs one, to draw true values from"
        )
    draw_truth, draw_noise = jax.random.split(key)
    x = np.empty((members, len(known)))
    mean, sigma = (np.concatenate([getattr(prior, k) for prior in drawn]) for k in ("mean", "sigma"))
    x[:, known] = mean + sigma * np.asarray(jax.random.normal(draw_truth, (members, len(known))))
    of = padded(problem)
    model = evaluate_rows(of.structure, of.numbers, x.astype(problem.start.dtype))[0][:, of.data]
    return x, problem.targets.of_several(measured=model + drawn_errors(problem, members, draw_noise))
