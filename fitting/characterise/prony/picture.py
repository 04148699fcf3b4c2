"""Picture of a Prony series and what it was fitted to. It needs matplotlib, as `rubberfric.plot`."""

import numpy as np

import rubberfric as rf
from fitting.characterise.prony.times import reduced
from fitting.data.kinds import ModulusData
from rubberfric.plot import style

_NAMES = "storage $E'$", "loss $E''$"
_LOOKS = ("-", "o"), ("--", "s")
_POINTS = 300


def plot_series(
    material: rf.Prony, data: ModulusData, residuals: np.ndarray, ax: style.Panels | None = None
) -> style.Panels:
    """Draw E' and E'' over omega with the terms E_i at 1/tau_i, and ln(fit / measured) below.

    Parameters
    ----------
    material : the series
    data : points at other temperatures are shifted to the reference temperature.
    residuals : of E' and of E'', shape (2, n)
    ax : two axes, or None for those of a new figure

    Returns
    -------
    the two axes
    """
    if ax is None:
        ax = style.new_figure((7.4, 5.0)).subplots(2, 1, sharex=True, height_ratios=[3, 1])
    upper, lower = ax = style.several_axes(ax, ("moduli", "residuals"), (7.4, 5.0))
    data = reduced(data, material.shift)
    omega = data.omega
    tau, E = np.asarray(material.tau), np.asarray(material.E)
    ends = np.concatenate([omega, 1 / tau])
    line = np.geomspace(ends.min() / 3, ends.max() * 3, _POINTS)
    modulus = np.asarray(rf.complex_modulus(material, line))
    parts = (np.real(modulus), np.imag(modulus)), (data.storage, data.loss), residuals
    for (dashes, marker), tone, name, fitted, measured, rest in zip(
        _LOOKS, style.colours(2), _NAMES, *parts, strict=True
    ):
        look = {"color": tone, "marker": marker, "markersize": 3.5, "linestyle": "none"}
        shown = np.where(measured > 0, measured, np.nan)
        upper.plot(omega, shown, markerfacecolor="white", label=f"{name}, measured", **look)
        upper.plot(line, fitted, dashes, color=tone, linewidth=1.6, label=f"{name}, series")
        lower.plot(omega, rest, **look)
    upper.plot(1 / tau, E, "|", color="0.3", markersize=9, label="terms $E_i$ at $1/\\tau_i$")
    upper.set_xscale("log")
    upper.set_yscale("log")
    upper.set_ylabel("modulus $E'$, $E''$ [Pa]")
    style.legend(upper)
    lower.axhline(0, color="0.5", linewidth=0.8)
    lower.set_ylabel("ln(fit /\nmeasured) [-]")
    lower.set_xlabel("angular frequency $\\omega$ [rad/s]")
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    return ax
