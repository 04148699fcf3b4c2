"""Shift factors from tables, as a laboratory has them."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.blocks import recurring_length
from rubberfric.base.checks import (
    PLAUSIBLE_TEMPERATURE,
    POSITIVE,
    check_increasing,
    check_lengths,
    check_values,
    is_concrete,
)
from rubberfric.base.objects.fields import Number, Vector, leaf
from rubberfric.base.objects.physical import physical
from rubberfric.materials.shifts.laws import Shift, VerticalShift, saturated

# Entries within a table of which all are compared; in a longer one they are searched, by a loop.
_FEW = 64


@physical
class TabulatedShift(Shift):
    r"""Shift factors from a table: ln a_T a monotone cubic in T between the entries.

    Its slope is continuous and depends continuously on the entries, and ln a_T has an extremum at entries
    only. [Fritsch & Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, doi:10.1137/0905021] Outside the table
    ln a_T goes on along the lines through its first and its last two entries, whose slopes it has at the
    ends. The table is divided by its own value at T_ref, so that a_T(T_ref) = 1 also when T_ref lies between
    two entries.

    Parameters
    ----------
    T : temperatures, strictly increasing [K], shape (n,), n >= 2
    aT : shift factors [-], shape (n,)
    T_ref : [K], inside the table

    Limits: concrete temperatures outside the table raise ValueError (an extrapolated
    shift is a guess); flash temperatures may leave it.
    """

    file_kind: ClassVar[str] = "table"
    rising: ClassVar = ("T",), ("T[0]", "T_ref", "T[-1]")

    T: Vector = leaf(POSITIVE, unit="K", column="T")
    aT: Vector = leaf(POSITIVE, unit="-", column="aT", over="T")
    T_ref: Number = leaf(POSITIVE, unit="K", plausible=PLAUSIBLE_TEMPERATURE)

    def _check(self):
        _check_table(self, "aT", self.T_ref)

    def check_temperature(self, temperature: ArrayLike) -> None:
        """Raise ValueError for concrete temperatures outside the table."""
        _check_inside("temperature", temperature, self.T)
        super().check_temperature(temperature)

    def log_factor(self, temperature: ArrayLike) -> jax.Array:
        """ln a_T at temperature [K]."""
        return _log_interpolated(temperature, self.T, self.aT, self.T_ref)

    def padded(self) -> "TabulatedShift":
        """With entries above the last temperature, on the line on which it goes on."""
        return _padded(self, "aT")


@physical
class TabulatedVertical(VerticalShift):
    r"""Vertical shift factors from a table: ln b_T over T as ln a_T of `TabulatedShift`.

    The table is divided by its own value at the T_ref of the shift it belongs to.

    Parameters
    ----------
    T : temperatures, strictly increasing [K], shape (n,), n >= 2
    bT : vertical shift factors [-], shape (n,)

    Limits: concrete temperatures outside the table raise ValueError; flash temperatures may leave it.
    """

    file_kind: ClassVar[str] = "table"
    rising: ClassVar = (("T",),)

    T: Vector = leaf(POSITIVE, unit="K", column="T")
    bT: Vector = leaf(POSITIVE, unit="-", column="bT", over="T")

    def _check(self):
        _check_table(self, "bT")

    def check_temperature(self, temperature: ArrayLike) -> None:
        """Raise ValueError for concrete temperatures outside the table."""
        _check_inside("temperature", temperature, self.T)
        super().check_temperature(temperature)

    def log_factor(self, temperature: ArrayLike, T_ref: ArrayLike) -> jax.Array:
        """ln b_T at temperature [K]."""
        return _log_interpolated(temperature, self.T, self.bT, T_ref)

    def padded(self) -> "TabulatedVertical":
        """With entries above the last temperature, on the line on which it goes on."""
        return _padded(self, "bT")


def _check_table(law, name, T_ref=None):
    """The rules of a table of factors over T."""
    kind = type(law).__name__
    check_lengths(kind, T=law.T, **{name: getattr(law, name)})
    if law.T.shape[0] < 2:
        raise ValueError(f"{kind}.T has {law.T.shape[0]} entries: must have at least 2")
    check_increasing(f"{kind}.T", law.T)
    if T_ref is not None and is_concrete(T_ref):
        _check_inside(f"{kind}.T_ref", T_ref, law.T)


def _check_inside(name, temperature, T):
    """ValueError for concrete temperatures outside a table."""
    if is_concrete(temperature) and is_concrete(T):
        # In a trace an entry of a concrete jax array is not concrete; one of a NumPy array is.
        low, high = np.asarray(T)[[0, -1]].tolist()
        rule = (f"must be inside the table, {low:g} to {high:g} K", lambda T: (low <= T) & (high >= T))
        check_values(name, temperature, rule)


def _log_interpolated(temperature, T, factor, T_ref):
    """ln of a tabulated factor over that at T_ref."""
    T, log = jnp.asarray(T), jnp.log(factor)
    pieces = _pieces(T, log)
    return saturated(_at(jnp.asarray(temperature), T, pieces) - _at(jnp.asarray(T_ref), T, pieces))


def _pieces(nodes, values):
    """Cubic polynomials in the distance from the left node, ascending, (4, n + 1): lines outside the table.

    The slope at an inner node is the weighted harmonic mean of those of the lines on its sides, 0 if they
    have different signs, and that of the line at an end: the monotone interpolation by Fritsch & Butland of
    a table that goes on along its first and last lines.
    """
    width = jnp.diff(nodes)
    line = jnp.diff(values) / width
    before, after = line[:-1], line[1:]
    monotone = before * after > 0
    # With 1 for a slope of the other sign nothing is divided by 0.
    one, two = jnp.where(monotone, before, 1.0), jnp.where(monotone, after, 1.0)
    share = (width[:-1] + 2 * width[1:]) / (3 * (width[:-1] + width[1:]))
    inner = jnp.where(monotone, one * two / (share * two + (1 - share) * one), 0.0)
    slope = jnp.concatenate([line[:1], inner, line[-1:]])
    left, right = (slope[:-1] - line) / width, (slope[1:] - line) / width
    return jnp.stack(
        [
            jnp.concatenate([values[:1], values]),
            jnp.concatenate([line[:1], slope]),
            jnp.pad(-(2 * left + right), 1),
            jnp.pad((left + right) / width, 1),
        ]
    )


def _at(x, nodes, pieces):
    """The polynomials of `_pieces` at x, any shape."""
    if nodes.shape[0] < _FEW:
        i = jnp.sum(x[..., None] >= nodes, -1, dtype=jnp.int32)
    else:
        i = jnp.searchsorted(nodes, x, side="right")

    def taken(row):
        return row.at[i].get(mode="promise_in_bounds", wrap_negative_indices=False)

    value, slope, second, third = map(taken, pieces)
    away = x - taken(jnp.concatenate([nodes[:1], nodes]))
    return value + away * (slope + away * (second + away * third))


def _padded(law, name):
    """A tabulated law with entries above the last temperature, on the line on which it goes on."""
    T, factor = np.asarray(law.T), np.asarray(getattr(law, name))
    added = recurring_length(T.size) - T.size
    slope = np.diff(np.log(factor[-2:]))[0] / np.diff(T[-2:])[0]
    # No factor that leaves single precision.
    step = min(1.0, 10.0 / (1e-9 + added * abs(slope)))
    above = step * np.arange(1, added + 1)
    longer = np.append(factor, (factor[-1] * np.exp(slope * above)).astype(factor.dtype))
    return law.replace({"T": np.append(T, (T[-1] + above).astype(T.dtype)), name: longer})
