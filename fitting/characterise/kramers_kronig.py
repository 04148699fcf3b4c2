r"""Check measured E' and E'' against the Kramers-Kronig relations.

In a causal linear solid E' determines E''. If the solid relaxes without oscillating, both follow from one
relaxation spectrum H >= 0,

.. math:: E' = E_\infty + \int H \frac{\omega^2\tau^2}{1 + \omega^2\tau^2} d\ln\tau,\qquad
          E'' = \int H \frac{\omega\tau}{1 + \omega^2\tau^2} d\ln\tau

[J. D. Ferry, Viscoelastic Properties of Polymers, 1980, ch. 3]. Measured data may violate this: master curves
of several sweeps, raw data with a wrong compliance of the instrument, or a strain that softens the rubber.
"""

import dataclasses

import numpy as np
import scipy

from fitting.characterise.prony_series import columns, nonnegative_logarithmic, reduced
from fitting.data.kinds import ModulusData
from fitting.parameters.constraints import is_number
from rubberfric.base import shown
from rubberfric.materials import Shift
from rubberfric.plot import style

# Nodes of the contradiction are counted if its standard error is below this.
_COUNTED = 0.25
# Data are inconsistent if the probability of their contradiction is below this.
_CHANCE = 0.01
# Most contradictions that are reported, the most significant ones first.
_WORST = 3
# Relaxation times per decade. They fit a power law to 1e-4.
_TIMES_PER_DECADE = 3
# Decades that the relaxation times reach beyond the data, where the loss of a term is 2 % of its peak.
_BEYOND = 2.0
# Number of fits, each weighted with the scatter of E' and E'' about the previous fit.
_ROUNDS = 4
# Smallest scatter of ln E' and ln E'', the error with which the relaxation times fit a power law.
_EXACT = 1e-4
# Prior standard deviation of a term, in units of the estimate from the loss at its peak.
_ALIKE = 2.0
# Smallest part of a measured value that a spectrum gives. Its logarithm is finite.
_LEAST = 1e-6
# Prior standard deviation of the contradiction, which remains at nodes in a gap of the data.
_UNKNOWN = 10.0
_FEWEST = 6  # frequencies


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class KramersKronig:
    """Result of `kramers_kronig`: the contradiction between measured E' and E''.

    The contradiction is the logarithm of measured E'' divided by the E'' that follows from E'.

    Attributes
    ----------
    omega : angular frequencies of nodes, evenly spaced in ln omega over the data [rad/s], shape (n,)
    contradiction : ln(E'' measured / E'' implied by E') at the nodes, linear between them [-], shape (n,)
    stderr, covariance : standard errors and covariance of the contradiction [-]
        They follow from the errors of the data, or from the scatter if the data have no errors.
    counted : True for nodes whose standard error is below 0.25
        Nodes at the ends of noisy data are not counted, because relaxation beyond the ends is not measured.
    scatter : relative errors of E' and of E'': estimates from the scatter, or medians of the given errors
    data : the data that were checked

    Examples
    --------
    >>> omega = np.logspace(-2, 4, 25)
    >>> E = np.asarray(rf.complex_modulus(rf.Prony(1e6, [1e6, 2e6, 4e6], [1.0, 1e-1, 1e-2]), omega))
    >>> check = fitting.kramers_kronig(fitting.ModulusData(omega, E.real, E.imag, relative=0.01))
    >>> check.consistent, bool(check.rms < 0.01), bool(check.chance > 0.05)
    (True, True, True)
    >>> print(check.report().splitlines()[0])
    E' and E'' of modulus, 25 points, 0.01 ... 1e+04 rad/s
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
        """Standard errors of the contradiction at the nodes [-], shape (n,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def rms(self) -> float:
        """Root mean square of the contradiction at the counted nodes [-].

        Nodes have the weights 1/stderr^2. The part that scatter alone would cause is subtracted from the mean
        square. The result is NaN if no node is counted.
        """
        if not self.counted.any():
            return np.nan
        weight = self.stderr[self.counted] ** -2.0
        square = weight @ self.contradiction[self.counted] ** 2 - weight.size
        return float(np.sqrt(max(square, 0.0) / weight.sum()))

    @property
    def chance(self) -> float:
        """Chi-square probability that consistent data scatter at least as much as the measured data.

        The probability is NaN if no node is `counted`.
        """
        c = self.counted
        if not c.any():
            return np.nan
        square = self.contradiction[c] @ np.linalg.solve(self.covariance[np.ix_(c, c)], self.contradiction[c])
        return float(scipy.special.chdtrc(c.sum(), square))

    @property
    def consistent(self) -> bool:
        """True if `chance` is at least 1 %, `rms` is below 1 %, or no node is counted."""
        return not self.chance < _CHANCE or self.rms < 0.01

    @property
    def worst(self) -> tuple[tuple[float, float, float], ...]:
        """Tuples (omega, contradiction, stderr) of the most significant nodes, at most three, worst first.

        At every listed node the contradiction exceeds three standard errors. Listed nodes lie at least 0.9
        decades apart.
        """
        pull = np.where(self.counted, np.abs(self.contradiction) / self.stderr, 0.0)
        places = []
        for i in np.argsort(-pull):
            apart = all(abs(np.log10(self.omega[i] / omega)) > 0.9 for omega, *_ in places)
            if pull[i] > 3.0 and apart and len(places) < _WORST:
                places.append((float(self.omega[i]), float(self.contradiction[i]), float(self.stderr[i])))
        return tuple(places)

    def __repr__(self) -> str:
        return (
            f"<KramersKronig: contradiction {self.rms:.2%} rms, {'' if self.consistent else 'in'}consistent>"
        )

    def report(self) -> str:
        """Return the result as text of several lines."""
        ends = f"{self.reduced.min():.3g} ... {self.reduced.max():.3g} rad/s"
        lines = [f"E' and E'' of {self.data.label}, {ends}"]
        if not self.counted.any():
            lines.append(
                f"    no conclusion: the standard error of the contradiction is nowhere below {_COUNTED:.0%};"
                " less scatter or more frequencies are needed"
            )
        elif self.consistent:
            lines.append(f"    no contradiction beyond the scatter: {self.rms:.1%} rms of E''")
        else:
            lines.append(
                f"    CONTRADICT EACH OTHER: E'' differs by {self.rms:.1%} rms from the E'' that E' implies"
                f" (probability for scatter alone {max(self.chance, 1e-99):.1g})"
            )
        for omega, value, error in () if self.consistent else self.worst:
            side = "above" if value > 0 else "below"
            lines.append(
                f"    at {omega:.3g} rad/s E'' is {abs(np.expm1(value)):.0%} {side} (+/- {error:.0%}),"
                f" or E' too {'flat' if value > 0 else 'steep'}"
            )
        if self.counted.any():
            low, high = self.omega[self.counted][[0, -1]]
            lines.append(
                f"    judged: {low:.3g} ... {high:.3g} rad/s, where E' implies E'' to {_COUNTED:.0%}"
            )
        lines.append(f"    scatter: E' {self.scatter[0]:.2%}, E'' {self.scatter[1]:.2%}")
        return "\n".join(lines)

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """Draw E', E'' and the E'' implied by E', and below them the contradiction with 95 % error bars.

        Needs matplotlib: pip install 'rubberfric[plot]'. Nodes that are not counted are grey.

        Parameters
        ----------
        ax : two matplotlib axes; None: a new figure, `ax[0].figure`

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


def kramers_kronig(
    data: ModulusData, per_decade: float = 2.0, *, shift: Shift | None = None
) -> KramersKronig:
    r"""Test whether measured E' and E'' satisfy the Kramers-Kronig relations.

    .. math:: \min_{H \ge 0, k} \sum_j \left(\frac{\ln E'_j / E'(\omega_j)}{s'}\right)^2
              + \left(\frac{\ln E''_j / E''(\omega_j) - k(\omega_j)}{s''}\right)^2

    The free function k is the logarithm of the factor by which E'' is too large. k is linear in ln omega
    between nodes. There are three relaxation times per decade. The times extend two decades beyond the data,
    because relaxation outside the measured range contributes to E' and E''.

    Parameters
    ----------
    data : ModulusData
        Data with temperatures are raw curves, which `shift` superposes. Data without temperatures are a
        master curve.
    per_decade : nodes of k per decade [-]; the total is limited to half the number of frequencies
        More nodes resolve narrower contradictions, with larger standard errors.
    shift : time-temperature shift, for data with temperatures

    Returns
    -------
    KramersKronig

    Raises
    ------
    ValueError
        `data` is not a ModulusData, has values <= 0, has temperatures although no shift is given, or has
        fewer than six frequencies. The message is one line.

    Notes
    -----
    If the data have no errors, the errors of E' and E'' are estimated separately from the scatter. A fault of
    the data is not detected if a relaxation spectrum can produce it, for example a common constant factor
    of E' and E''. A constant factor of E' alone, or of E'' alone, is detected.

    To see how a contradiction changes friction, compare the tabulated modulus, which uses E' and E'' as
    measured, with a Prony series, which is a compromise between them:

        table = rubberfric.TabulatedModulus(data.omega, data.storage, data.loss)
        series = fitting.fit_prony(data, 2.0).material
        mu = [rubberfric.friction(scene.replace("lower.material", m), v, p) for m in (table, series)]

    Examples
    --------
    E'' is 20 % too large, and ln 1.2 = 0.18:

    >>> omega = np.logspace(-2, 4, 25)
    >>> E = np.asarray(rf.complex_modulus(rf.Prony(1e6, [1e6, 2e6, 4e6], [1.0, 1e-1, 1e-2]), omega))
    >>> check = fitting.kramers_kronig(fitting.ModulusData(omega, E.real, 1.2 * E.imag, relative=0.01))
    >>> check.consistent, round(check.rms, 2)
    (False, 0.18)
    """
    if not (is_number(per_decade) and 0 < per_decade <= 10):
        raise ValueError(f"per_decade = {shown(per_decade)}: must be a number > 0, at most 10")
    data = reduced(data, shift)
    omega = data.omega
    if not (data.measured > 0).all():
        raise ValueError(f"data {data.label!r} have values <= 0; E' and E'' must be > 0")
    t, n = np.log10(omega), omega.size
    if n < _FEWEST:
        raise ValueError(f"data {data.label!r}: {n} frequencies: must have at least {_FEWEST}")
    count = min(max(round(per_decade * np.ptp(t)), 1) + 1, n // 2)
    nodes = np.linspace(t.min(), t.max(), count)
    hats = np.stack([np.interp(t, nodes, unit) for unit in np.eye(count)], axis=1)
    error, known = _relative(data)
    for _ in range(1 if known else _ROUNDS):
        model, contradiction, covariance, used = _spectrum_and_contradiction(data, hats, error)
        if not known:
            apart = np.log(data.measured / model) - np.append(np.zeros(n), hats @ contradiction)
            parts = slice(n), slice(n, None)
            scatter = [np.sum(apart[part] ** 2) / max(n - used[part].sum(), 1.0) for part in parts]
            error = np.repeat(np.maximum(np.sqrt(scatter), _EXACT), n)
    return KramersKronig(
        10.0**nodes,
        contradiction,
        covariance,
        np.sqrt(np.diag(covariance)) < _COUNTED,
        (float(np.median(error[:n])), float(np.median(error[n:]))),
        data,
        omega,
        model[n:],
    )


def _spectrum_and_contradiction(data, hats, error):
    """Fit the relaxation spectrum and the contradiction k = hats @ x to data with relative errors.

    Returns E' and E'' of the spectrum, x and its covariance, and the part of every value that the fit uses.
    """
    omega, n, count = data.omega, data.omega.size, hats.shape[1]
    low, high = np.log10(omega.min()) - _BEYOND, np.log10(omega.max()) + _BEYOND
    times = 10.0 ** -np.linspace(low, high, int(np.ceil(_TIMES_PER_DECADE * (high - low))) + 1)
    A, free = columns(omega, np.append(times, np.inf)), np.concatenate([np.zeros_like(hats), hats])
    E = nonnegative_logarithmic(A, data.measured, np.zeros(2 * n), error, free)
    # E'' is 0 where the loss of the spectrum lies decades away, as in data that do not relax.
    model = np.maximum(A @ E, _LEAST * data.measured)
    apart = np.log(data.measured / model)[n:]
    contradiction = np.linalg.lstsq(hats / error[n:, None], apart / error[n:], rcond=None)[0]
    # Terms at 0 may change too, by the estimate from the loss at their peak, so that the error bars cover all
    # spectra that fit.
    order = np.argsort(omega)
    peaks = np.exp(np.interp(-np.log(times), np.log(omega[order]), np.log(data.loss[order])))
    typical = np.append(2 / np.pi * np.log(10) / _TIMES_PER_DECADE * peaks, 0.1 * data.storage.min())
    width = _ALIKE * np.maximum(E, typical)
    J = np.concatenate([A * width / model[:, None], free], axis=1) / error[:, None]
    # The QR decomposition keeps digits that J^T J would lose where terms are far larger than the moduli.
    prior = np.diag(np.append(np.ones(E.size), np.full(count, 1 / _UNKNOWN)))
    R = np.linalg.qr(np.concatenate([J, prior]), mode="r")
    inverse = scipy.linalg.solve_triangular(R, np.eye(len(R)))
    covariance = inverse @ inverse.T
    used = np.sum((J @ covariance) * J, axis=1)
    return model, contradiction, covariance[-count:, -count:], used


def _relative(data):
    if data.error is None:
        return np.ones(len(data)), False
    return data.error if data.logarithmic else data.error / data.measured, True
