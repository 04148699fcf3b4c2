r"""Error budget of a fit: how far each uncertain input moves each fitted parameter.

If an input changes, the residuals r at the solution x change by dr. A Gauss-Newton step with the Jacobian J
of the fit then moves x to the new minimum,

.. math:: \Delta x = -(J^T J)^{-1} J^T\, dr,\qquad dr = r_\mathrm{changed}(x) - r

where rows have the weights of a robust loss, the whitening of a `Discrepancy` and the priors, as in the
covariance (`fitting.uncertainty.covariance`). The noise of the data gives the standard errors, which are the
square roots of the diagonal of (J^T J)^-1. dr is evaluated with the changed input itself, so no derivatives
with respect to inputs are needed. Up to `_STEPS` further steps with the same J and r_changed(x + Delta x)
account for the curvature of the model. They end when a step is not much shorter than the one before.

A shift is the change of the fitted value if the input were changed. J stays the one of the fit, so shifts of
many standard errors are estimates.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

import rubberfric as rf
from fitting.budget.changes import Sizes, changes, finer_quadrature
from fitting.budget.contact_model import NoLawError, covariance_of_law, rows_by_law
from fitting.data.kinds import FrictionData
from fitting.data.measured import Measured
from fitting.parameters.priors import Prior
from fitting.solvers.evaluation import errors_of_rows, residual_rows
from fitting.solvers.problem import Problem
from fitting.solvers.residuals import in_errors, loss_of, padded
from fitting.uncertainty.covariance import OPEN, Uncertainty, linearised, weighted_rows
from rubberfric.base import quick_jit

# Name of the contribution of the contact model.
CONTACT = "contact model"

# Name of the contribution of the quadrature.
NUMERICAL = "numerical"

# Shift over standard error above which a contribution is mentioned.
MENTIONED = 1.0

# Largest number of steps.
_STEPS = 4

# Largest ratio of the lengths of a step and the step before, in standard errors.
_SHORTER = 0.5

# Ratios beyond which a change is described by a factor.
_FACTORS = 0.1, 2.0

# Length of a step that is negligible, in standard errors.
_NEGLIGIBLE = 1e-3


class Contribution(NamedTuple):
    """Contribution of one source to the errors of all free elements."""

    source: str  # "contact model", "temperature", ...; the key path of a number with a stated error
    text: str  # description of the change
    shift: np.ndarray  # change of the values, in their units; NaN where the error bar is withheld
    signed: bool  # False: sum of the squares of several changes, or a standard deviation
    stated: bool = False  # True if the size was given, False for a default
    without: tuple[str, ...] = ()  # parts of the scene that the comparison with the law leaves out


class SolvedFit(NamedTuple):
    """Parts of a fit that its budget uses."""

    problem: Problem
    x: np.ndarray
    known: Uncertainty
    prior: Mapping[str, Prior]
    data: Sequence[Measured]
    scenes: Sequence[rf.Scene]  # of each data set, at the solution
    has_discrepancy: bool


def contributions(
    fit: SolvedFit, sizes: Sizes, stated_sources: Sequence[str] = (), only: Sequence[str] = ()
) -> tuple[list[Contribution], list[str]]:
    """Return the contributions of all sources except noise, and notes on missing ones.

    Parameters
    ----------
    sizes : sizes of the changes
    stated_sources : fields of `sizes` that are not defaults
    only : "contact model" or "stated" if only these sources are needed
    """
    step = _Step(fit)
    rows, notes = [], []
    try:
        rows.append(_of_contact_model(fit, step))
    except NoLawError as reason:
        notes.append(f"contact model: not estimated, because {reason}")
    if only:
        sizes = Sizes(*np.zeros(len(Sizes._fields)))
    grouped: dict[str, list[tuple[str, np.ndarray]]] = {}
    every = list(changes(fit.problem, sizes, fit.prior))
    for change in every if only else [*every, finer_quadrature(fit.problem)]:
        shift = step.shift(lambda x, changed=change.problem: residual_rows(changed, x))
        grouped.setdefault(change.source, []).append((change.text, shift))
    for source, members in grouped.items():
        shifts = np.array([shift for _, shift in members])
        single = len(members) == 1
        shift = shifts[0] if single else np.sqrt(np.sum(shifts**2, 0))
        stated = source in stated_sources or source not in (*Sizes._fields, NUMERICAL)
        rows.append(Contribution(source, "; ".join(t for t, _ in members), shift, single, stated))
    return rows, notes


class _Step:
    """The change of the values for a change of the residuals."""

    def __init__(self, fit):
        problem, known = fit.problem, fit.known
        model = linearised(problem, fit.x)
        jacobian = weighted_rows(problem, model).jacobian
        curvature = _curvature(problem, model.inside)
        V, length = known.directions, np.minimum(known.deviations, OPEN)
        inverse = (V * length**2) @ V.T
        self.matrix = -known.stretch[:, None] * (inverse @ (jacobian * known.stretch).T) * curvature
        self.information = V.T / length[:, None] / known.stretch
        self.problem, self.x, self.at = problem, known.x, np.asarray(fit.x)
        self.rows = residual_rows(problem, fit.x)
        self.hidden = np.isnan(known.deviation)

    def shift(self, rows_at):
        """Return the change of the values for other residuals, a function of x, with the rows of priors."""
        change, before = np.zeros_like(self.at), np.inf
        for _ in range(_STEPS):
            with np.errstate(invalid="ignore"):
                step = self.matrix @ (rows_at(self.at + change) - self.rows)
                length = np.linalg.norm(self.information @ step)
            if not length < _SHORTER * before and np.isfinite(before):
                break
            change, before = change + step, length
            if not np.isfinite(length) or length < _NEGLIGIBLE:
                break
        return self.values(change)

    def values(self, change):
        """Return the change of the values for a change of x."""
        with np.errstate(over="ignore", invalid="ignore"):
            shift = self.problem.values(self.x + change) - self.problem.values(self.x)
        return np.where(self.hidden | ~np.isfinite(shift), np.nan, shift)


def _curvature(problem, rows):
    """Return the factors of the Jacobian rows by the loss, see `fitting.solvers.objective.factors`."""
    of = padded(problem)
    return of.kept(_padded_curvature(of.structure, of.numbers, of.targets, rows))


# With padding, so that fits of other numbers of points compile nothing.
@quick_jit(static_argnums=(0,))
def _padded_curvature(structure, numbers, targets, rows):
    return loss_of(structure, numbers).factors(in_errors(structure, numbers, targets, rows))[1]


def _of_contact_model(fit, step):
    """Return the contribution of the contact model, or raise `NoLawError`."""
    problem = fit.problem
    if all(scene.contact_model == "boundary_elements" for scene in fit.scenes):
        if fit.has_discrepancy:
            raise NoLawError("the error of the law is part of the discrepancy, and so of the noise")
        covariance_and_amplitude = covariance_of_law(problem, fit.scenes, fit.data)
        if covariance_and_amplitude is None:
            raise NoLawError("no friction is fitted")
        covariance, amplitude = covariance_and_amplitude
        matrix = step.matrix[:, : len(covariance)]
        deviation = np.sqrt(np.einsum("ij,jk,ik->i", matrix, covariance, matrix))
        text = f"law fitted to boundary elements, smooth error of {100 * amplitude:.2g} %"
        return Contribution(CONTACT, text, step.values(deviation), signed=False)
    rows = rows_by_law(problem, fit.x)

    def by_law(x):
        try:
            return errors_of_rows(padded(problem), rows_by_law(problem, x).rows)
        except NoLawError:  # the scene after a step
            return np.full_like(step.rows, np.nan)

    text = "law fitted to boundary elements instead of the theory"
    if rows.without:
        text += f", compared without {', '.join(rows.without)}"
    return Contribution(CONTACT, text, step.shift(by_law), signed=True, without=rows.without)


def largest_error(
    names: Sequence[str],
    values: np.ndarray,
    stderr: np.ndarray,
    rows: Sequence[Contribution],
    data: Sequence[Measured],
    is_linear: bool,
    has_discrepancy: bool,
) -> str:
    """Return a sentence on the largest contribution that exceeds the noise, or "".

    Only the difference between theory and law and stated errors count. Sizes by default are not known to
    occur.
    """
    known = [row for row in rows if row.stated or (row.source == CONTACT and row.signed)]
    shares = np.array([np.nan_to_num(np.abs(row.shift) / stderr) for row in known])
    times = float(np.max(shares, initial=0.0))
    if not times > MENTIONED:
        return ""
    which, i = divmod(int(np.argmax(shares)), len(names))
    largest = known[which]
    by = _relative(largest.shift[i], values[i])
    if not largest.signed and values[i]:
        by = f"+-{100 * abs(largest.shift[i] / values[i]):.2g} %"
    count = f"{times:.0f}" if times >= 10 else f"{times:.2g}"
    count += f" standard error{'s' * (count != '1')}"
    if largest.source != CONTACT:
        return f"an error of {largest.source} ({largest.text}) moves {names[i]} by {by} ({count})"
    advice = [] if largest.without else ['fit with contact_model="boundary_elements"']
    friction = [d for d in data if isinstance(d, FrictionData)]
    if friction and is_linear and not has_discrepancy and all(d.error is not None for d in friction):
        advice.append("add fitting.Discrepancy()")
    said = f"the theory's error moves {names[i]} by {by} ({count}), as boundary elements say"
    return f"{said}: {', or '.join(advice)}" if advice else said


def _relative(shift, value):
    """Return the change of a value as text, in per cent or as a factor."""
    if not value:
        return f"{shift:+.2g}"
    if not _FACTORS[0] < 1 + shift / value < _FACTORS[1]:
        return f"a factor of about {1 + shift / value:.2g}"
    return f"{100 * shift / value:+.2g} %"
