"""How far E' and E'' contradict each other, and where."""

import dataclasses

import numpy as np
import scipy.stats

from fitting.data.kinds import ModulusData
from rubberfric.plot import style

# Where the contradiction is known no better than this, it is not counted.
KNOWN = 0.25
# Chance of as large a contradiction in data without any, below which it is one.
_CHANCE = 0.01
_WORST = 3


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class KramersKronig:
    """How far E' and E'' contradict each other.

    Attributes
    ----------
    omega : angular frequencies, evenly in ln omega from end to end of the data [rad/s], shape (n,)
    contradiction : ln(E'' measured / E'' that E' implies) there, linear between [-], shape (n,)
    stderr, covariance : of it, by the scatter of the data (their errors, if they have some)
    counted : where it is known to 0.25 at least; the ends of the data never are if they scatter, as what
        relaxes beyond them is not seen
    scatter : relative errors of E' and of E'', estimated or given (median)
    data : what was checked
    """

    omega: np.ndarray
    contradiction: np.ndarray
    covariance: np.ndarray
    counted: np.ndarray
    scatter: tuple[float, float]
    data: ModulusData
    reduced: np.ndarray = dataclasses.field(repr=False)
    implied: np.ndarray = dataclasses.field(repr=False)

    @property
    def stderr(self) -> np.ndarray:
        """Standard errors of the contradiction."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def rms(self) -> float:
        """Root mean square of the contradiction where it counts, less what scatter explains; NaN if nowhere.

        Frequencies weigh with 1/stderr^2.
        """
        if not self.counted.any():
            return np.nan
        weight = self.stderr[self.counted] ** -2.0
        square = weight @ self.contradiction[self.counted] ** 2 - weight.size
        return float(np.sqrt(max(square, 0.0) / weight.sum()))

    @property
    def chance(self) -> float:
        """Probability of a contradiction as large in data of one material, by chi-square; NaN if unknown."""
        c = self.counted
        if not c.any():
            return np.nan
        square = self.contradiction[c] @ np.linalg.solve(self.covariance[np.ix_(c, c)], self.contradiction[c])
        return float(scipy.stats.chi2.sf(square, c.sum()))

    @property
    def consistent(self) -> bool:
        """Whether no contradiction is seen beyond the scatter: by its chance, or none of 1 %."""
        return not self.chance < _CHANCE or self.rms < 0.01

    @property
    def worst(self) -> tuple[tuple[float, float, float], ...]:
        """(omega, contradiction, stderr) of the most significant parts, at most three, worst first."""
        pull = np.where(self.counted, np.abs(self.contradiction) / self.stderr, 0.0)
        found = []
        for i in np.argsort(-pull):
            apart = all(abs(np.log10(self.omega[i] / one[0])) > 0.9 for one in found)
            if pull[i] > 3.0 and apart and len(found) < _WORST:
                found.append((float(self.omega[i]), float(self.contradiction[i]), float(self.stderr[i])))
        return tuple(found)

    def __repr__(self) -> str:
        return (
            f"<KramersKronig: contradiction {self.rms:.2%} rms, {'' if self.consistent else 'in'}consistent>"
        )

    def report(self) -> str:
        """What was found, as text of several lines."""
        ends = f"{self.reduced.min():.3g} ... {self.reduced.max():.3g} rad/s"
        lines = [f"E' and E'' of {self.data.label}, {ends}"]
        if not self.counted.any():
            lines.append(
                f"    nothing can be said: what E' implies for E'' is nowhere known to {KNOWN:.0%};"
                " less scatter or more frequencies are needed"
            )
        elif self.consistent:
            lines.append(f"    no contradiction beyond the scatter: {self.rms:.1%} rms of E''")
        else:
            lines.append(
                f"    CONTRADICT EACH OTHER: E'' is off by {self.rms:.1%} rms from what E' implies"
                f" (chance of that by scatter {max(self.chance, 1e-99):.1g})"
            )
        for omega, value, error in () if self.consistent else self.worst:
            side = "above" if value > 0 else "below"
            lines.append(
                f"    at {omega:.3g} rad/s E'' is {abs(np.expm1(value)):.0%} {side} (+/- {error:.0%}),"
                f" or E' too {'flat' if value > 0 else 'steep'}"
            )
        if self.counted.any():
            low, high = self.omega[self.counted][[0, -1]]
            lines.append(f"    judged: {low:.3g} ... {high:.3g} rad/s, where E' implies E'' to {KNOWN:.0%}")
        lines.append(f"    scatter: E' {self.scatter[0]:.2%}, E'' {self.scatter[1]:.2%}")
        return "\n".join(lines)

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """E' and E'' with the E'' that E' implies, and below how far they are apart, with 95 % bars.

        Needs matplotlib: pip install 'rubberfric[plot]'. Grey is what is not counted.

        Parameters
        ----------
        ax : two matplotlib axes, or None for those of a new figure, `ax[0].figure`

        Returns
        -------
        the axes: moduli, contradiction
        """
        if ax is None:
            ax = style.new_figure((7.4, 5.0)).subplots(2, 1, sharex=True, height_ratios=[3, 2])
        upper, lower = ax = style.several_axes(ax, ("moduli", "contradiction"), (7.4, 5.0))
        first, second = style.colours(2)
        order = np.argsort(self.reduced)
        look = {"markersize": 3.5, "markerfacecolor": "white", "linestyle": "none"}
        for tone, marker, name, values in (
            (first, "o", "storage $E'$, measured", self.data.storage),
            (second, "s", "loss $E''$, measured", self.data.loss),
        ):
            upper.plot(self.reduced, values, marker=marker, color=tone, label=name, **look)
        upper.plot(
            self.reduced[order], self.implied[order], "--", color=second, label="$E''$ that $E'$ implies"
        )
        upper.set_xscale("log")
        upper.set_yscale("log")
        upper.set_ylabel("modulus $E'$, $E''$ [Pa]")
        style.legend(upper)
        value, reach = 100 * self.contradiction, 196 * self.stderr
        for used, tone in ((self.counted, second), (~self.counted, "0.6")):
            lower.errorbar(
                self.omega[used], value[used], reach[used], fmt="s", color=tone, markersize=3.5, elinewidth=1
            )
        lower.axhline(0, color="0.5", linewidth=0.8)
        tall = np.max(np.abs(value[self.counted]) + reach[self.counted], initial=10.0)
        lower.set_ylim(-1.1 * tall, 1.1 * tall)
        lower.set_ylabel("100 ln($E''$ /\nimplied) [%]")
        lower.set_xlabel("angular frequency $\\omega$ [rad/s]")
        for axes in (upper, lower):
            axes.grid(alpha=0.3)
        return ax
