"""Result of a profile likelihood: values, costs and the confidence interval. Plots need matplotlib."""

from typing import NamedTuple

import numpy as np

from rubberfric.plot import style

# Values over a larger factor are drawn on a logarithmic axis.
_WIDE = 5.0
_OPEN = {np.inf: "inf", -np.inf: "-inf"}


class LikelihoodProfile(NamedTuple):
    """Profile likelihood: cost against one parameter, with all other parameters fitted again."""

    name: str
    values: np.ndarray  # of the parameter, increasing
    rise: np.ndarray  # twice the cost above the lowest found; NaN where a fit did not converge
    low: float  # ends of the interval; an open end is the limit of the parameter's rule: -inf or inf, 0 if
    high: float  # Positive, a bound if Bounded; NaN if the profile ends below the threshold
    threshold: float  # `rise` at the ends of the interval
    names: tuple[str, ...] = ()  # of all free elements
    parameters: np.ndarray | None = None  # their values, fitted again, shape (values, elements)
    ends: tuple[str, str] = ("reached", "reached")  # for each end "reached", or the reason if not
    better: dict[str, float] | None = None  # values of a minimum below the fit, by name
    warning: str = ""  # on such a minimum, or on an interval of several parts

    def __repr__(self) -> str:
        return f"LikelihoodProfile({self.name}: {self._interval()}, {self.values.size} values)"

    def _interval(self):
        ends = [f"{end:.6g}" if np.isfinite(end) else _OPEN.get(end, "?") for end in (self.low, self.high)]
        return f"{ends[0]} ... {ends[1]}"

    def report(self) -> str:
        """Return the interval, and a line for every value, as text."""
        lines = [
            f"[[Profile of {self.name}]]",
            f"    {self._interval()}, where chi-square rises by {self.threshold:.4g}",
        ]
        named = zip(("lower", "upper"), self.ends, strict=True)
        lines += [f"    {side} end {text}" for side, text in named if text != "reached"]
        lines += [f"    {self.warning}"] * bool(self.warning)
        lines.append(f"    {'value':>12s} {'rise':>10s}  others, fitted again")
        parameters = np.zeros((self.values.size, 0)) if self.parameters is None else self.parameters
        for value, rise, row in zip(self.values, self.rise, parameters, strict=True):
            pairs = zip(self.names, row, strict=False)
            others = ", ".join(f"{name} = {number:.4g}" for name, number in pairs if name != self.name)
            lines.append(f"    {value:12.6g} {rise:10.4g}  {others}")
        return "\n".join(lines) + "\n"

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """Draw the rise of chi-square and the other parameters, see `fitting.plot.plot_profile`."""
        return plot_profile(self, ax)


def plot_profile(profile: LikelihoodProfile, ax: style.Panels | None = None) -> style.Panels:
    """Draw a likelihood profile: the rise of chi-square, and the other parameters in a panel below.

    The other parameters are drawn relative to their values at the lowest cost. Vertical lines show the ends
    of the confidence interval.

    Parameters
    ----------
    profile : LikelihoodProfile, from `FitResult.profile` or `FitResult.profile_cutoff`
    ax : two matplotlib axes, or None
        If None, the axes belong to a new figure, `ax[0].figure`.

    Returns
    -------
    the two axes

    Examples
    --------
    The 95 % interval of the height in mm, with the Hurst exponent fitted again at each height:

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    >>> h, hurst = "lower.spectrum.h_rms", "lower.spectrum.hurst"
    >>> result = fitting.fit(scene, data, {h: fitting.Positive(), hurst: fitting.Bounded(0.3, 1.0)})
    >>> profile = result.profile(h)
    >>> axes = fitting.plot.plot_profile(profile)
    >>> round(1e3 * float(profile.low), 2), round(1e3 * float(profile.high), 2)
    (0.45, 0.56)
    """
    panels: style.Panels = style.new_figure((7.0, 6.0), "").subplots(2, 1, sharex=True) if ax is None else ax
    upper, lower = panels
    upper.plot(profile.values, profile.rise, "o-", markersize=3.5)
    upper.axhline(profile.threshold, color="0.5", linestyle="--", linewidth=0.8)
    for end in (profile.low, profile.high):
        if np.isfinite(end) and end > 0:
            upper.axvline(end, color="0.5", linewidth=0.8)
    upper.set_ylabel("rise of chi-square [-]")
    if profile.parameters is not None and np.isfinite(profile.rise).any():
        best = profile.parameters[np.nanargmin(profile.rise)]
        drawn = style.looks(len(profile.names), profile.values.size)
        for name, values, at_best, look in zip(profile.names, profile.parameters.T, best, drawn, strict=True):
            if name != profile.name:
                lower.plot(profile.values, values / at_best, label=name, linewidth=1.2, **look)
        style.legend(lower)
    lower.set_ylabel("others, by their best [-]")
    lower.set_xlabel(profile.name)
    if profile.values.min() > 0 and profile.values.max() > _WIDE * profile.values.min():
        lower.set_xscale("log")
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    return panels
