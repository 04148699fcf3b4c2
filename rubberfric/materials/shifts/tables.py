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
    r"""Shift factors from a table: ln a_T linear in T between the entries.

    The table is divided by its own value at T_ref, so that a_T(T_ref) = 1 also when
    T_ref lies between two entries.

    Parameters
    ----------
    T : temperatures, strictly increasing [K], shape (n,), n >= 2
    aT : shift factors [-], shape (n,)
    T_ref : [K], inside the table

    Limits: concrete temperatures outside the table raise ValueError (an extrapolated
    shift is a guess); under jit the end values are held.
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
        """With entries above the last temperature, where its value is held."""
        return _padded(self, "aT")


@physical
class TabulatedVertical(VerticalShift):
    r"""Vertical shift factors from a table: ln b_T linear in T between the entries.

    The table is divided by its own value at the T_ref of the shift it belongs to.

    Parameters
    ----------
    T : temperatures, strictly increasing [K], shape (n,), n >= 2
    bT : vertical shift factors [-], shape (n,)

    Limits: concrete temperatures outside the table raise ValueError; under jit the end values are held.
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
        """With entries above the last temperature, where its value is held."""
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
    log = jnp.log(factor)
    return saturated(_between_entries(temperature, T, log) - _between_entries(T_ref, T, log))


def _between_entries(x, nodes, values):
    """Linear interpolation, the end values held: `jnp.interp`, of which a tenth of the operations suffice."""
    x, nodes, values = map(jnp.asarray, (x, nodes, values))
    first, inner, last = nodes[0], nodes[1:-1], nodes[-1]
    # Selected, not clipped: at an end the derivative is that of the table.
    x = jnp.where(x < first, first, jnp.where(x > last, last, x))
    if inner.shape[0] < _FEW:
        i = jnp.sum(x[..., None] >= inner, -1, dtype=jnp.int32)
    else:
        i = jnp.searchsorted(inner, x, side="right")
    slopes = (values[1:] - values[:-1]) / (nodes[1:] - nodes[:-1])
    left, value, slope = (
        a.at[i].get(mode="promise_in_bounds", wrap_negative_indices=False) for a in (nodes, values, slopes)
    )
    return value + (x - left) * slope


def _padded(law, name):
    """A tabulated law with entries above the last temperature, where its value is held."""
    T, factor = np.asarray(law.T), np.asarray(getattr(law, name))
    added = recurring_length(T.size) - T.size
    above = T[-1] + np.arange(1, added + 1, dtype=T.dtype)
    longer = np.append(factor, np.repeat(factor[-1:], added))
    return law.replace({"T": np.append(T, above), name: longer})
