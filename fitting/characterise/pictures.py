"""Plots of master curves and Prony series with their data. Like `rubberfric.plot`, they need matplotlib."""

from typing import Any

import numpy as np

import rubberfric as rf
from fitting.characterise.prony_series import reduced
from rubberfric.materials import log_factors
from rubberfric.plot import style

_NAMES = "storage $E'$", "loss $E''$"
_LOOKS = ("-", "o"), ("--", "s")
_POINTS = 300  # of a line


def plot_master_curve(curve: Any, ax: style.Panels | None, series: Any = None) -> style.Panels:
    """Draw E' (filled markers) and E'' (open markers) of the shifted sweeps, and below a_T over T.

    Lines in the upper panel are E' and E'' of `series`, a PronyFit, at the reference temperature.
    """
    if ax is None:
        ax = style.new_figure((7.4, 7.0)).subplots(2, 1, height_ratios=[3, 2])
    upper, lower = ax = style.several_axes(ax, ("moduli", "shifts"), (7.4, 7.0))
    data, T = curve.data, curve.T
    celsius = np.asarray(rf.units.to_celsius(T))
    # + 0: no minus before a zero
    named = [f"{style.signed(round(degrees, 1) + 0)} °C" for degrees in celsius]
    for i, tone in enumerate(style.colours(T.size)):
        here = curve.of_sweep == i
        marker = style.MARKERS[i % len(style.MARKERS)]
        look = {"color": tone, "marker": marker, "linestyle": "none", "markersize": 3.5}
        upper.plot(data.omega[here], data.storage[here], label=named[i], **look)
        upper.plot(data.omega[here], data.loss[here], markerfacecolor="white", **look)
        reach = 1.96 * curve.stderr[i] / np.log(10)
        lower.errorbar(celsius[i], curve.log_aT[i] / np.log(10), reach, elinewidth=1, capsize=2, **look)
    line = np.linspace(T.min(), T.max(), 200)
    for name, law, dashes in (("WLF", curve.wlf, "-"), ("Arrhenius", curve.arrhenius, "--")):
        if law is None:
            continue
        values = log_factors(law.shift, line) / np.log(10)
        lower.plot(rf.units.to_celsius(line), values, dashes, color="0.3", linewidth=1.2, label=name)
    if series is not None:
        omega = np.geomspace(data.omega.min(), data.omega.max(), _POINTS)
        for values, (dashes, _), name in zip(series.model(omega), _LOOKS, _NAMES, strict=True):
            upper.plot(omega, values, dashes, color="0.2", linewidth=1.2, label=f"series, {name}")
    upper.set_xscale("log")
    upper.set_yscale("log")
    upper.set_xlabel(f"$a_T\\omega$ at {named[curve.reference]} [rad/s]")
    upper.set_ylabel("modulus $E'$ (filled), $E''$ [Pa]")
    lower.set_xlabel("temperature [°C]")
    style.decades(lower.yaxis, "shift factor $a_T$ [-]")
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
        style.legend(axes)
    return ax


# Axes of the kinds of data: label of x, label of y, and names of the measured quantities.
_AXES = {
    "modulus": ("angular frequency $\\omega$ [rad/s]", "modulus $E'$, $E''$ [Pa]", _NAMES),
    "relaxation": ("time $t$ [s]", "modulus $E(t)$ [Pa]", ("$E(t)$",)),
    "creep": ("time $t$ [s]", "compliance $D(t)$ [1/Pa]", ("$D(t)$",)),
}


def plot_series(series: Any, ax: style.Panels | None) -> style.Panels:
    """Draw the measured quantities with the fitted series, and ln(fit / measured) below.

    E' and E'' are drawn over omega with the terms E_i at 1/tau_i, E(t) over time with the terms at tau_i.
    Points at other temperatures are shifted to the reference temperature.
    """
    if ax is None:
        ax = style.new_figure((7.4, 5.0)).subplots(2, 1, sharex=True, height_ratios=[3, 1])
    upper, lower = ax = style.several_axes(ax, ("moduli", "residuals"), (7.4, 5.0))
    material = series.material
    data = reduced(series.data, material.shift)
    abscissa, ordinate, names = _AXES[data.quantity]
    x, tau, E = getattr(data, data.conditions[0]), np.asarray(material.tau), np.asarray(material.E)
    peaks = 1 / tau if data.quantity == "modulus" else tau
    with_terms = data.quantity != "creep"
    ends = np.concatenate([x, peaks]) if with_terms else x
    line = np.geomspace(ends.min() / 3, ends.max() * 3, _POINTS)
    parts = series.model(line), (getattr(data, name) for name in data.values), series.residuals
    for (dashes, marker), tone, name, fitted, measured, rest in zip(
        _LOOKS, style.colours(2), names, *parts, strict=False
    ):
        look = {"color": tone, "marker": marker, "markersize": 3.5, "linestyle": "none"}
        shown = np.where(measured > 0, measured, np.nan)
        upper.plot(x, shown, markerfacecolor="white", label=f"{name}, measured", **look)
        upper.plot(line, fitted, dashes, color=tone, linewidth=1.6, label=f"{name}, series")
        lower.plot(x, rest, **look)
    if with_terms:
        at = "1/\\tau_i" if data.quantity == "modulus" else "\\tau_i"
        upper.plot(peaks, E, "|", color="0.3", markersize=9, label=f"terms $E_i$ at ${at}$")
    upper.set_xscale("log")
    upper.set_yscale("log")
    upper.set_ylabel(ordinate)
    style.legend(upper)
    lower.axhline(0, color="0.5", linewidth=0.8)
    lower.set_ylabel("ln(fit /\nmeasured) [-]")
    lower.set_xlabel(abscissa)
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    return ax
