"""Picture of a complex modulus over frequency. It needs matplotlib, as `rubberfric.plot`."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.units import to_celsius
from rubberfric.materials.material import Material, complex_modulus
from rubberfric.materials.shifts.laws import log_vertical
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.plot.style import Axes, colours, legend, one_axes, signed, vector

_POINTS = 400
# Points up to which each has room.
_LARGE = 60
# Decades beyond the relaxation times, where the solid is relaxed or glassy, and beyond a table.
_BEYOND, _BEYOND_TABLE = 2.0, 1.0
# Line, marker of measured points and of entries of a table, and name, of E', E'' and tan delta.
_LOOKS = (
    ("-", "o", "storage $E'$"),
    ("--", "s", "loss $E''$"),
    (":", "^", "$\\tan\\delta$ (right)"),
)

Points = tuple[np.ndarray, np.ndarray, np.ndarray]  # omega, E', E''

_modulus = jax.jit(complex_modulus)


def plot_modulus(
    material: Material,
    ax: Axes | None = None,
    omega: ArrayLike | None = None,
    temperature: float | None = None,
    data: Any = None,
) -> Axes:
    r"""Draw E' and E'' over omega in log-log, and tan delta = E''/E' on a linear scale of its own.

    Parameters
    ----------
    material : Elastic, Prony, PronyShear or TabulatedModulus
        entries of a table are points.
    ax : matplotlib axes, or None for those of a new figure
        The scale of tan delta is the last of `ax.figure.axes`.
    omega : angular frequencies [rad/s], > 0, shape (n,)
        None: two decades more than the relaxation times span, one more than a table, and the data.
    temperature : [K], or None for the reference temperature
    data : measured points to draw as well, with arrays omega, storage and loss, as
        `fitting.ModulusData` has them, or None
        those at other temperatures are shifted to this one by the material's shift.

    Returns
    -------
    the axes of E' and E''

    Raises
    ------
    ValueError : the material is rigid or none; a temperature without a shift; a wrong omega, data or ax.
    """
    if not isinstance(material, Material) or not material.deforms:
        raise ValueError(f"material is a {type(material).__name__}: must be one that deforms")
    _check_temperature(material, temperature)
    points = None if data is None else _shifted(material, temperature, data)
    table = _table(material, temperature)
    if omega is None:
        omega = _range(material, temperature, [one[0] for one in (points, table) if one is not None])
    else:
        omega = np.sort(vector("omega", omega, positive=True))
    modulus = np.asarray(_modulus(material, omega, temperature))
    axes = one_axes(ax, (7.4, 4.0))
    right = axes.twinx()
    storage, loss = np.real(modulus), np.imag(modulus)
    lines = (storage, loss, loss / storage)
    handles = []
    for tone, place, (style, _, name), line in zip(
        colours(3), (axes, axes, right), _LOOKS, lines, strict=True
    ):
        if (line > 0).any():  # an elastic solid has no loss
            look: dict[str, Any] = {"color": tone, "linestyle": style, "linewidth": 1.8, "label": name}
            handles += place.plot(omega, np.where(line > 0, line, np.nan), **look)
    handles += _points(axes, right, table, "entries of the table", "white")
    handles += _points(axes, right, points, "measured", None)
    if temperature is None and material.shift is not None:
        temperature = float(material.shift.reference_temperature)
    _dress(axes, right, temperature)
    right.set_visible(bool(right.lines))
    legend(axes, handles, scale_right=bool(right.lines), inside="upper left")
    return axes


def _check_temperature(material: Material, temperature: float | None) -> None:
    if temperature is None:
        return
    if material.shift is None:
        raise ValueError(f"temperature = {temperature!r}: must be None, for the material has no shift")
    if np.ndim(temperature) != 0:
        raise ValueError(f"temperature has shape {np.shape(temperature)}: must be one number")
    material.shift.check_temperature(temperature)


def _log_shift(material: Material, temperature: ArrayLike | None) -> np.ndarray | float:
    """ln a_T, 0 at the reference temperature."""
    if temperature is None or material.shift is None:
        return 0.0
    return np.asarray(material.shift.log_factor(jnp.asarray(temperature, float)), float)


def _vertical(material: Material, temperature: ArrayLike | None) -> np.ndarray | float:
    """b_T, 1 at the reference temperature."""
    at = None if temperature is None else jnp.asarray(temperature, float)
    log_factor = log_vertical(material.shift, at)
    return 1.0 if log_factor is None else np.exp(np.asarray(log_factor, float))


def _range(material: Material, temperature: float | None, known: list[np.ndarray]) -> np.ndarray:
    """Frequencies over all that the material and the points at `known` frequencies show."""
    ends = [np.array([one.min(), one.max()]) for one in known]
    beyond = _BEYOND_TABLE
    if not isinstance(material, TabulatedModulus) and (own := material.frequency_range()) is not None:
        beyond = _BEYOND
        ends.append(np.exp(-_log_shift(material, temperature)) * np.asarray(own, float))
    ends = np.concatenate(ends) if ends else np.array([1e-2, 1e2])  # elastic: any will do
    return np.geomspace(ends.min() / 10**beyond, ends.max() * 10**beyond, _POINTS)


def _table(material: Material, temperature: float | None) -> Points | None:
    """(omega, E', E'') of the entries of a table, or None."""
    if not isinstance(material, TabulatedModulus):
        return None
    omega, storage, loss = (np.asarray(x, float) for x in (material.omega, material.storage, material.loss))
    vertical = _vertical(material, temperature)
    return omega * np.exp(-_log_shift(material, temperature)), vertical * storage, vertical * loss


def _shifted(material: Material, temperature: float | None, data: Any) -> Points:
    """(omega, E', E'') of measured points, at the temperature of the picture."""
    for name in ("omega", "storage", "loss"):
        if not hasattr(data, name):
            raise ValueError(
                f"data is a {type(data).__name__} without {name}: must have omega, storage, loss"
            )
    omega = vector("data.omega", data.omega, positive=True)
    storage, loss = (vector(f"data.{x}", getattr(data, x), omega.size) for x in ("storage", "loss"))
    at = getattr(data, "temperature", None)
    if at is not None:
        at = np.broadcast_to(np.asarray(at, float), omega.shape)
        if material.shift is None and np.ptp(at) > 0:
            raise ValueError("data.temperature: has several values; the material must have a shift then")
        if material.shift is not None:
            material.shift.check_temperature(at)
        omega = omega * np.exp(_log_shift(material, at) - _log_shift(material, temperature))
        ratio = _vertical(material, temperature) / _vertical(material, at)
        storage, loss = ratio * storage, ratio * loss
    return omega, storage, loss


def _points(axes, right, points, name, face):
    """Draw points of E', E'' and tan delta; the handle of a legend."""
    from matplotlib.lines import Line2D

    if points is None:
        return []
    omega, storage, loss = points
    with np.errstate(divide="ignore", invalid="ignore"):
        values = (storage, loss, loss / storage)
    size = 3.5 if omega.size <= _LARGE else 2.0
    look: dict[str, Any] = {"linestyle": "none", "markersize": size, "markeredgewidth": 0.8}
    for tone, place, (_, marker, _), value in zip(
        colours(3), (axes, axes, right), _LOOKS, values, strict=True
    ):
        place.plot(omega, value, marker=marker, color=tone, markerfacecolor=face or tone, **look)
    return [Line2D([], [], color="0.3", marker="o", markerfacecolor=face or "0.3", label=name, **look)]


def _dress(axes: Axes, right: Axes, temperature: float | None) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("angular frequency $\\omega$ [rad/s]")
    axes.set_ylabel("modulus $E'$, $E''$ [Pa]")
    if temperature is not None:
        axes.set_title(f"{signed(to_celsius(float(temperature)))} °C", fontsize="medium")
    right.set_ylabel("$\\tan\\delta = E''/E'$ [-]")
    right.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
