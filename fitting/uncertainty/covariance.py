r"""Covariance of the free parameters, and the directions that the data do not identify.

With the Jacobian at the minimum, J = U diag(s) V^T (rows in units of their errors, priors
included), the covariance of x is V diag(1/s^2) V^T. A direction V_k whose standard deviation 1/s_k
exceeds one - a factor e in Positive parameters - is not identified, and linear error bars along it are
meaningless. A parameter whose standard deviation in x exceeds one gets no error bar.

The value of a parameter at a bound, or driven to zero, barely changes with its x. The parameter's
column of the Jacobian would be zero there, and correlated parameters would look well determined. The column
is therefore scaled to a change of the value by a quarter of its range, or by its start value.

For robust losses the covariance is the sandwich A^-1 B A^-1 of M-estimators [Huber & Ronchetti, Robust
Statistics (2009), ch. 7], with the rows J_i of the Jacobian, the slopes psi_i of the loss and its curvatures
w_i:

.. math:: A = \sum_i w_i J_i^T J_i,\qquad B = k^2 \langle\psi^2\rangle \sum_i J_i^T J_i

The mean of psi^2 is at least the one of normal residuals, and k is the mean of w over the one of normal
residuals, at least 1. Few residuals say little about both, and error bars would be too short.
"""

from typing import NamedTuple

import numpy as np

from fitting.parameters.scenes import scene_paths
from fitting.parameters.variables import VANISHED, Variables, element_names, slopes
from fitting.solvers.evaluation import errors_of_rows, evaluate_rows
from fitting.solvers.objective import normal_means
from fitting.solvers.ordered import edges, put_in_order
from fitting.solvers.problem import Problem
from fitting.solvers.residuals import data_rows, in_errors, loss_of, padded, slopes_in_errors
from fitting.uncertainty.directions import Direction, describe_direction
from rubberfric.base import quick_jit

# Standard deviation in x beyond which a parameter is not identified: a factor e, or the whole middle range of
# a bounded parameter.
KNOWN = 1.0
# Standard deviation assigned to unidentified directions: a parameter with a loading of 0.001 in one is still
# identified.
OPEN = 100.0
# A Bounded parameter counts as at a bound if it is closer to it than this part of its range.
AT_BOUND = 1e-3
# Smallest distance from a bound for the linearisation, where the slope still has digits.
EDGE = 1e-6


class Uncertainty(NamedTuple):
    """Uncertainty of a solution, as in the module's docstring, with one entry per free element."""

    deviation: np.ndarray  # of x; NaN where withheld
    covariance: np.ndarray  # of the values; NaN rows and columns where withheld
    correlation: np.ndarray  # of x; NaN rows and columns where withheld
    withheld: dict[str, str]  # name -> reason for a missing error bar
    unidentified: tuple[Direction, ...]
    rank: int  # number of directions that change the data at all
    condition: float  # largest over smallest singular value
    directions: np.ndarray  # V, columns, shape (size, size)
    deviations: np.ndarray  # along them, shape (size,); inf if the data do not change
    spread: np.ndarray  # covariance of y = x / stretch; deviations above OPEN are set to OPEN, (size, size)
    x: np.ndarray  # point of linearisation: the solution, moved a little inside its bounds
    stretch: np.ndarray  # 1, larger for parameters at a bound or at zero, see the module's docstring
    parameters: float  # effective number of parameters that the data determine
    chisqr: float  # sum of squares of the data's residuals


class WithUncertainty:
    """Base class of results with an `uncertainty`, whose arrays are attributes of the result."""

    uncertainty: Uncertainty

    @property
    def stderr(self) -> np.ndarray:
        """Standard errors of the values, NaN for elements listed in `withheld`."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the values, NaN for elements listed in `withheld`."""
        return self.uncertainty.covariance

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of x, NaN for elements listed in `withheld`."""
        return self.uncertainty.correlation

    @property
    def withheld(self) -> dict[str, str]:
        """Elements without a standard error: a dict from the name to the reason."""
        return self.uncertainty.withheld

    @property
    def unidentified(self) -> tuple[Direction, ...]:
        """Combinations of parameters that the data do not determine."""
        return self.uncertainty.unidentified


class Linearised(NamedTuple):
    """Result of `rows_of`, with padding, and its derivatives at a solution."""

    at: np.ndarray  # at the solution, (rows,)
    inside: np.ndarray  # at the point of linearisation, a little inside the bounds
    slopes: np.ndarray  # derivatives with respect to x at that point, (rows, size)


def linearised(problem: Problem, x: np.ndarray) -> Linearised:
    """Linearise the model of a problem at the solution x of shape (size,)."""
    of, x = padded(problem), np.asarray(x)
    _, inside, _ = _at_bounds(problem, x)
    rows, slopes = (part[0] for part in evaluate_rows(of.structure, of.numbers, inside[None], slopes=True))
    same = np.array_equal(inside, x)
    at = rows if same else evaluate_rows(of.structure, of.numbers, x[None])[0][0]
    return Linearised(at, rows, slopes)


def data_residuals(problem: Problem, model: Linearised) -> np.ndarray:
    """Return the residuals of the data at a solution, in units of the errors."""
    return errors_of_rows(padded(problem), model.at)[: data_rows(problem.structure)]


class WeightedRows(NamedTuple):
    """Residuals and Jacobian of a problem in units of the errors, see `fitting.solvers.objective.factors`."""

    residuals: np.ndarray  # shape (rows,)
    slopes: np.ndarray  # psi, the residuals times the factors of both; for least squares the residuals
    factors: np.ndarray  # of the rows of the Jacobian, 1 for least squares
    jacobian: np.ndarray  # times the factors, shape (rows, size)


def weighted_rows(problem: Problem, model: Linearised) -> WeightedRows:
    """Return the rows of a problem at a solution, with the factors of its loss."""
    of = padded(problem)
    weighted = _weighted(of.structure, of.numbers, of.targets, model.inside, model.slopes)
    return WeightedRows(*map(of.kept, map(np.asarray, weighted)))


@quick_jit(static_argnums=(0,))
def _weighted(structure, numbers, targets, rows, slopes):
    # The arrays of `WeightedRows`, with padding, from one XLA computation.
    rows = in_errors(structure, numbers, targets, rows)
    of_rows, factors = loss_of(structure, numbers).factors(rows)
    jacobian = slopes_in_errors(structure, numbers, targets, slopes) * factors[:, None]
    return rows, rows * of_rows * factors, factors, jacobian


class Robust(NamedTuple):
    """Slopes of a robust loss at the data, and their means over normal residuals."""

    slopes: np.ndarray  # psi of each row
    factors: np.ndarray  # of the rows of the Jacobian, the roots of the curvatures w
    normal_square: float  # mean of psi^2
    normal_curvature: float  # mean of w

    def size(self, parameters: float) -> float:
        """Return k times the root of the mean of psi^2, for a fit that determines `parameters`."""
        # The residuals of a fit are smaller than the errors, because it has parameters.
        square = np.sum(self.slopes**2) / max(self.slopes.size - parameters, 1.0)
        k = np.mean(self.factors**2) / self.normal_curvature
        return float(max(k, 1.0) * np.sqrt(max(square, self.normal_square)))


def uncertainty(problem: Problem, x: np.ndarray, model: Linearised | None = None) -> Uncertainty:
    """Return the uncertainty of a solution x of shape (size,), with `model` = `linearised` at x."""
    structure, numbers = problem.structure, problem.numbers
    withheld, inside, stretch = _at_bounds(problem, x)
    model = linearised(problem, x) if model is None else model
    rows = weighted_rows(problem, model)
    count = data_rows(problem.structure)
    slope = slopes(problem.variables, numbers.constants, inside)
    robust = None
    if structure.loss != "linear":
        normal = normal_means(structure.loss, float(numbers.width))
        robust = Robust(rows.slopes[:count], rows.factors[:count], *normal)
    return from_jacobian(
        problem.variables,
        rows.jacobian * stretch,
        count,
        slope=stretch * slope,
        chisqr=float(np.sum(data_residuals(problem, model) ** 2)),
        x=inside,
        stretch=stretch,
        withheld=withheld,
        robust=robust,
    )


def from_jacobian(
    variables: Variables,
    jacobian: np.ndarray,
    count: int,
    *,
    slope: np.ndarray,
    chisqr: float,
    x: np.ndarray,
    stretch: np.ndarray | None = None,
    withheld: dict[str, str] | None = None,
    robust: Robust | None = None,
) -> Uncertainty:
    """Return the uncertainty from the Jacobian of a solution, without any compilation.

    Parameters
    ----------
    jacobian : derivatives of the rows, in units of their errors and with the priors last, with respect to
        x / stretch, shape (rows, size)
    count : number of rows that are data
    slope : d value / d (x / stretch), shape (size,)
    chisqr, x, stretch, withheld : as in `Uncertainty`; withheld only for parameters at a bound
    robust : slopes of a robust loss at the data, or None for least squares
    """
    names, withheld = element_names(variables), dict(withheld or {})
    # V is needed in full even with fewer rows than columns; U is not.
    U, s, Vt = np.linalg.svd(jacobian, full_matrices=jacobian.shape[0] < jacobian.shape[1])
    V = Vt.T
    s = np.concatenate([s, np.zeros(V.shape[0] - s.size)])
    # Singular values below this are rounding of the Jacobian.
    noise = s[0] * np.finfo(jacobian.dtype).eps * max(jacobian.shape)
    seen = s > noise
    deviations = np.where(seen, 1 / np.where(seen, s, 1.0), np.inf)

    determined = float(np.sum(U[:count, : s.size][:, seen[: U.shape[1]]] ** 2))
    spread, along = _spread(jacobian, count, robust, V, deviations, determined)
    deviation = np.sqrt(np.diag(spread))
    far = along > KNOWN
    # V is not the eigenbasis of a sandwich: all directions may be short while a parameter is not identified.
    if np.any(deviation > KNOWN) and not far.any():
        far[np.argmax(along)] = True
    unidentified = tuple(
        Direction(V[:, k], float(deviations[k]), describe_direction(variables, V[:, k], deviations[k]))
        for k in np.flatnonzero(far)
    )
    for i in np.flatnonzero(deviation > KNOWN):
        which = int(np.argmax([abs(d.loadings[i]) * min(d.deviation, OPEN) for d in unidentified]))
        withheld.setdefault(names[i], f"not identified, see direction {which + 1}")
    hidden = np.array([name in withheld for name in names])
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = spread / np.outer(deviation, deviation)
    covariance = spread * np.outer(slope, slope)
    for array in (covariance, correlation):
        array[hidden, :] = array[:, hidden] = np.nan
    return Uncertainty(
        deviation=np.where(hidden, np.nan, deviation),
        covariance=covariance,
        correlation=correlation,
        withheld=withheld,
        unidentified=unidentified,
        rank=int(seen.sum()),
        condition=float(s[0] / s[-1]) if s[-1] > 0 else np.inf,
        directions=V,
        deviations=deviations,
        spread=spread,
        x=x,
        stretch=np.ones(len(names)) if stretch is None else stretch,
        parameters=determined,
        chisqr=chisqr,
    )


def _spread(jacobian, count, robust, V, deviations, parameters):
    """Return the covariance of x / stretch, and the standard deviation along each column of V.

    In the covariance, deviations along V are at most `OPEN`.
    """
    length = np.minimum(deviations, OPEN)
    if robust is None:
        return (V * length**2) @ V.T, deviations
    influence = jacobian.copy()
    influence[:count] *= robust.size(parameters) / robust.factors[:, None]
    middle = V.T @ (influence.T @ influence) @ V
    inner = middle * np.outer(length**2, length**2)
    beyond = deviations > OPEN
    inner[beyond, :] = inner[:, beyond] = 0.0
    inner[beyond, beyond] = OPEN**2
    return V @ inner @ V.T, np.sqrt(np.where(beyond, OPEN**2, np.diag(inner)))


def at_bounds(problem: Problem, x: np.ndarray) -> dict[str, str]:
    """Return a text such as "at its lower bound 0.3" for each parameter at a bound or near zero, by name."""
    return _at_bounds(problem, x)[0]


def inside_bounds(problem: Problem, x: np.ndarray, known: Uncertainty) -> np.ndarray:
    """Return x with parameters at a bound or at zero moved away by one standard deviation of their value.

    There the value changes with x, so that a fit from there can leave the bound. The part of the range of a
    Bounded parameter is limited to 1e-3 ... 0.5, and the part of the start of a Positive one to 1.
    """
    x = np.array(x, float)
    for i in np.flatnonzero(known.stretch != 1):
        # A change of x / stretch by 1 changes the value by a quarter of the range, or by the start.
        deviation = np.sqrt(known.spread[i, i])
        if problem.variables.kinds[i] == "Bounded":
            x[i] = np.sign(x[i]) * np.log(1 / np.clip(deviation / 4, AT_BOUND, 0.5) - 1)
        else:
            x[i] = problem.start[i] + np.log(np.clip(deviation, 1 / VANISHED, 1.0))
    if not problem.variables.order or not np.any(known.stretch != 1):
        return x
    moving = np.ones((1, x.size))
    return put_in_order(problem.variables, problem.numbers.constants, x[None], moving)[0]


def _at_bounds(problem, x):
    """Return reasons by name for parameters at a bound or driven to zero, and `x` and `stretch` there."""
    constants, names, reasons = problem.numbers.constants, problem.names, {}
    inside, stretch = np.array(x), np.ones(len(names), np.asarray(x).dtype)
    edge, far = np.log(1 / EDGE - 1), np.log(VANISHED)
    paths = scene_paths(problem.scene(np.asarray(x))) if problem.variables.order else []
    for i, side, neighbour in edges(problem.variables, constants, x):
        reasons[names[i]] = f"at its {side} bound {neighbour.name(paths)}"
    for i, kind in enumerate(problem.variables.kinds):
        if kind == "Bounded":
            place = 1 / (1 + np.exp(-np.clip(x[i], -edge, edge)))
            if AT_BOUND <= place <= 1 - AT_BOUND:
                continue
            low, width = float(constants.low[i]), float(constants.width[i])
            side, bound = ("lower", low) if place < 0.5 else ("upper", low + width)
            reasons[names[i]] = f"at its {side} bound {bound:g}"
            inside[i], stretch[i] = np.clip(x[i], -edge, edge), 0.25 / (place * (1 - place))
        elif kind == "Positive" and x[i] < problem.start[i] - far:
            reasons[names[i]] = "driven towards zero: the data want it absent"
            inside[i], stretch[i] = problem.start[i] - far, VANISHED
    return reasons, inside, stretch
