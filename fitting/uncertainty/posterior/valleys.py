r"""Numbers that trade with each other along a valley, and whether their error bars hold along it.

At the ends of the linear interval of a number, :math:`\hat x_i \pm q \sigma_i`, all others are fitted again
by a few Gauss-Newton steps. Were the rows linear in x, twice the cost would have risen by q^2, as its profile
does at the ends of the interval [Bates & Watts, Nonlinear Regression Analysis and Its Applications, Wiley
1988, ch. 6]. Where it has not, the root of the rise, which is nearly linear in x, says where about it does.
"""

from typing import NamedTuple

import numpy as np

from fitting.solvers.evaluation import errors_of_rows, errors_of_slopes, evaluate_rows
from fitting.solvers.residuals import padded
from fitting.uncertainty.intervals import SolvedProblem

# Correlation of two numbers above which their bars are looked at, level of these, and how many pairs are.
CLOSE, LEVEL, PAIRS = 0.98, 0.95, 2
# Rises as part of the expected one at which bars hold: to a tenth of their length.
HOLD = (0.8, 1.25)
# Steps of the others at the ends of an interval, which are near already, and a cost that is worth none.
_STEPS, _LITTLE = 4, 0.05


class Valley(NamedTuple):
    """A number that the data know far better together with another than alone."""

    name: str
    other: str
    correlation: float
    expected: float  # rise of twice the cost at the ends of its linear interval, if bars hold
    rises: tuple[float, float]  # that found, at the lower end and at the upper one
    linear: tuple[float, float]  # its linear interval
    interval: tuple[float, float]  # about that by profile; an end is inf where the cost does not rise

    @property
    def holds(self) -> bool:
        """Whether the linear interval is that of the profile."""
        low, high = HOLD
        return all(low <= rise / self.expected <= high for rise in self.rises)

    @property
    def text(self) -> str:
        """The intervals in words, and what gives the exact one."""
        (a, b), (low, high) = self.linear, self.interval
        return (
            f"{self.name} trades with {self.other} (correlation {self.correlation:+.3f}): {100 * LEVEL:.0f} %"
            f" by its bar {a:.3g} ... {b:.3g}, by profile about {low:.3g} ... {high:.3g}: see"
            f" profile({self.name!r})"
        )


def valleys(solved: SolvedProblem) -> tuple[Valley, ...]:
    """Numbers of the pairs that are correlated above `CLOSE`, of at most `PAIRS` of them, the closest first.

    By the program of the fit: of every number six to ten evaluations of the rows with their derivatives. Not
    of robust losses, whose cost is no likelihood, and not where the model is not finite at the ends.
    """
    known, names = solved.uncertainty, solved.names
    size = np.triu(np.abs(known.correlation), 1)
    # NaN, of numbers without a bar, is not above it.
    pairs = sorted(np.argwhere(size > CLOSE).tolist(), key=lambda pair: -size[*pair])[:PAIRS]
    if not pairs or solved.problem.structure.loss != "linear":
        return ()
    partners = {}
    for i, j in pairs:
        partners.setdefault(i, j)
        partners.setdefault(j, i)
    which, q = np.array(list(partners)), solved.quantile(LEVEL)
    deviation = np.sqrt(known.spread[which, which])
    steps = q * known.spread[which] / deviation[:, None]
    ends = np.concatenate([solved.x - steps, solved.x + steps])
    rises = np.maximum(2 * (_refitted(solved, ends, np.tile(which, 2)) - solved.cost), 0.0).reshape(2, -1)
    with np.errstate(divide="ignore"):
        reach = q * deviation * (q / np.sqrt(rises)) * np.array([[-1], [1]])
    linear, interval = (
        np.stack([_values(solved, which, side) for side in offsets], 1)
        for offsets in ((-q * deviation, q * deviation), reach)
    )
    return tuple(
        Valley(names[i], names[j], float(known.correlation[i, j]), q**2, *map(tuple, rows))
        for (i, j), *rows in zip(
            partners.items(), rises.T.tolist(), linear.tolist(), interval.tolist(), strict=True
        )
        if np.isfinite(rows[0]).all()
    )


def _values(solved, which, offsets):
    """Values of numbers so far from the solution in x."""
    x = np.tile(solved.x, (len(which), 1))
    x[np.arange(len(which)), which] += offsets
    return solved.problem.values(x)[np.arange(len(which)), which]


def _refitted(solved, x, held):
    """Costs at rows of x, all but one number of each fitted again; inf where the model is not finite."""
    of = padded(solved.problem)
    best, cost = x, np.full(len(x), np.inf)
    step = np.zeros_like(x)
    for _ in range(_STEPS + 1):
        found = evaluate_rows(of.structure, of.numbers, x.astype(solved.problem.start.dtype), slopes=True)
        # One by one, as error bars have them: nothing is compiled.
        rows = np.array([errors_of_rows(of.structure, of.numbers, of.targets, r) for r in found[0]])
        slopes = [errors_of_slopes(of.structure, of.numbers, of.targets, s) for s in found[1]]
        here = 0.5 * np.sum(rows**2, 1)
        better = here < cost  # False where not finite
        done = np.all(here > cost - _LITTLE)
        cost, best = np.where(better, here, cost), np.where(better[:, None], x, best)
        if done:
            break
        for k in range(len(x)):
            # Half the way back to the best, or a whole step on.
            step[k] = _step(rows[k], np.asarray(slopes[k]), held[k]) if better[k] else 0.5 * step[k]
        x = best + step
    return cost


def _step(rows, slopes, held):
    """The Gauss-Newton step of all but one number."""
    others = np.delete(np.arange(slopes.shape[1]), held)
    step = np.zeros(slopes.shape[1])
    step[others] = -np.linalg.lstsq(slopes[:, others], rows, rcond=None)[0]
    return step
