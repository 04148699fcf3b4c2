"""Where truths lie in the posteriors of their fits: coverage, ranks, and the envelope of a uniform place."""

import dataclasses

import numpy as np
import scipy

from fitting.solvers.options import check_options
from fitting.uncertainty.covariance import KNOWN
from fitting.uncertainty.importance import doubtful
from rubberfric.plot import style

# Where the distributions are compared, and uniform samples that the envelope is made of.
_POINTS, _SAMPLES = 100, 2000
# Lines of a figure that can be told apart, and doubtful fits that a text names.
_NAMED = 8


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """Where truths lie among the error bars of their fits.

    Attributes
    ----------
    names : of the free elements
    truth, values : true and fitted, shape (members, size), of the fits that converged
    place : share of the posterior below the truth, shape (members, size)
    deviation : standard deviation of x by the fit, shape (members, size)
    failed : fits that did not converge
    on : "normal" or "samples", what the posterior is taken for, see `fitting.calibration`
    normal : place of the same fits in the normal approximation, where on is "samples"
    draws : of every posterior; 0 in the normal approximation
    effective, tail : of every fit, the number of equal draws that its own are worth, and the tail index k of
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
        """Which elements the data, with the prior, determine to a factor e in most fits, shape (size,)."""
        return np.median(self.deviation, 0) < KNOWN

    @property
    def doubtful(self) -> np.ndarray:
        """Rows of fits whose draws say little of their posterior: few count, or k is well above 0.7."""
        if self.effective is None or self.tail is None:
            return np.zeros(0, int)
        return np.flatnonzero(doubtful(self.effective, self.tail, self.draws))

    def on_normal(self) -> "Calibration":
        """The same fits, held against their normal approximations."""
        if self.normal is None:
            return self
        bare = {"normal": None, "draws": 0, "effective": None, "tail": None}
        return dataclasses.replace(self, place=self.normal, on="normal", **bare)

    def ranks(self, draws: int = 99) -> np.ndarray:
        """Rank of the truth among so many draws of the posterior, 0 ... draws, shape (members, size)."""
        return np.minimum((self.place * (draws + 1)).astype(int), draws)

    def coverage(self, level: float = 0.95) -> np.ndarray:
        """Share of the truths within the intervals of a level, shape (size,)."""
        check_options(level=level)
        return np.mean(np.abs(self.place - 0.5) < 0.5 * level, 0)

    def distribution(self) -> tuple[np.ndarray, np.ndarray]:
        """Points between 0 and 1, and the share of u below each of them, shape (points, size)."""
        at = np.arange(1, _POINTS) / _POINTS
        return at, np.mean(self.place[:, None] < at[:, None], 0)

    def envelope(self, level: float = 0.99) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper shares at these points that a uniform u stays between, everywhere at once."""
        check_options(level=level)
        count, at = len(self.place), np.arange(1, _POINTS) / _POINTS
        # Of uniform samples, how many are below every point: a multinomial, summed up.
        parts = np.random.default_rng(0).multinomial(count, np.full(_POINTS, 1 / _POINTS), _SAMPLES)
        below = np.cumsum(parts, 1)[:, :-1]
        binomial = scipy.stats.binom(count, at)
        tails = np.min(np.minimum(binomial.cdf(below), binomial.sf(below - 1)), 1)
        tail = np.quantile(tails, 1 - level)
        return scipy.stats.binom.ppf(tail, count, at) / count, scipy.stats.binom.isf(tail, count, at) / count

    def inside(self, level: float = 0.99) -> np.ndarray:
        """Which elements stay within the envelope, shape (size,)."""
        low, high = self.envelope(level)
        share = self.distribution()[1]
        return np.all((share >= low[:, None]) & (share <= high[:, None]), 0)

    def report(self) -> str:
        """Text: a line a parameter."""
        lines = [
            f"{len(self.place)} fits, {self.failed} did not converge; {self._posterior()}",
            "parameter: share within 68 %, 95 %",
        ]
        columns = zip(
            self.names, self.coverage(0.68), self.coverage(0.95), self.inside(), self.identified, strict=True
        )
        for name, middle, most, inside, known in columns:
            remark = ("calibrated" if inside else "NOT CALIBRATED") + ", hardly identified" * (not known)
            lines.append(f"{name}: {100 * middle:.1f} %, {100 * most:.1f} %: {remark}")
        return "\n".join(lines) + "\n"

    def doubts(self) -> str:
        """What speaks against the draws, on one line; "" if nothing does."""
        rows = self.doubtful
        if not rows.size:
            return ""
        named = ", ".join(map(str, rows[:_NAMED])) + ", ..." * (rows.size > _NAMED)
        return (
            f"draws of {rows.size} of {len(self.place)} fits say little of their posteriors (few count, or"
            f" weights have heavy tails), those of rows {named}: draw more, or take narrower priors"
        )

    def _posterior(self):
        """What the truths are held against, in words."""
        if self.effective is None or self.tail is None:
            return "normal approximation"
        middle, least = np.median(self.effective), self.effective.min()
        said = f"{self.draws} draws, {middle:.0f} effective in most and {least:.0f} in the worst"
        said += f", tail index {np.median(self.tail):.2f}"
        return said + f", {self.doubtful.size} doubtful" * bool(self.doubtful.size)

    def plot(self, ax: style.Axes | None = None) -> style.Axes:
        """Share of u below each point minus the expected one, a line a parameter, and the 99 % envelope.

        Of more than eight only those that leave the envelope have a name and a colour.
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
