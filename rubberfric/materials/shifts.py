"""Time-temperature superposition: E(omega, T) = b_T E(a_T omega) with a_T(T_ref) = b_T(T_ref) = 1.

A `Shift` is a law for ln a_T and may have a `VerticalShift`, a law for ln b_T. The method `log_factor` of a
law is finite for every finite T. [Ferry, Viscoelastic Properties of Polymers, 3rd edition, Wiley 1980,
chapter 11]
"""

import dataclasses
import math
from typing import ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import DTypeLike

from rubberfric.base.blocks import recurring_length
from rubberfric.base.checks import (
    NONNEGATIVE,
    PLAUSIBLE_TEMPERATURE,
    POSITIVE,
    ArrayLike,
    NumberLike,
    check_table,
    check_values,
    is_concrete,
)
from rubberfric.base.compilation import quick_jit
from rubberfric.base.objects.fields import Number, Vector, child, leaf
from rubberfric.base.objects.physical import Kind, physical

# Largest table in which all entries are compared. Longer tables are searched by a loop.
_FEW = 64
BOLTZMANN_EV = 8.617333262e-5  # Boltzmann constant [eV/K], CODATA 2018 (exact to the digits given)


class VerticalShift(Kind):
    """Law for ln b_T(T), where b_T multiplies the moduli: base class of Entropic and TabulatedVertical."""

    def check_temperature(self, temperature: NumberLike) -> None:
        """Raise ValueError if a concrete temperature [K] is outside the range of the law."""
        check_values("temperature", temperature, POSITIVE)

    def log_factor(self, temperature: NumberLike, T_ref: NumberLike) -> jax.Array:
        """Return ln b_T at `temperature` [K] of any shape.

        ln b_T is 0 at `T_ref` [K] and has a finite derivative.
        """
        raise NotImplementedError(f"{type(self).__name__}.log_factor")


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Shift(Kind):
    """Law for ln a_T(T): base class of WLF, Arrhenius and TabulatedShift.

    Parameters
    ----------
    vertical : Entropic, TabulatedVertical or None; a keyword argument of every law
        law for the factor b_T of the moduli in E(omega, T) = b_T E(a_T omega). If None, b_T = 1.
    """

    vertical: VerticalShift | None = child(default=None)  # noqa: RUF009 (`child` gives a field)

    @property
    def reference_temperature(self) -> jax.Array:
        """Return T_ref [K], the temperature at which a_T = b_T = 1.

        A law without the field `T_ref` must override this property.
        """
        return self.T_ref  # pyright: ignore[reportAttributeAccessIssue] (every law has one)

    def check_temperature(self, temperature: NumberLike) -> None:
        """Raise ValueError if a concrete temperature [K] is outside the range of the law."""
        check_values("temperature", temperature, POSITIVE)
        if self.vertical is not None:
            self.vertical.check_temperature(temperature)

    def log_factor(self, temperature: NumberLike) -> jax.Array:
        """Return ln a_T at `temperature` [K] of any shape.

        The absolute value of ln a_T is at most `largest_log_factor`, and the derivative of ln a_T is finite.
        """
        raise NotImplementedError(f"{type(self).__name__}.log_factor")


def log_vertical(shift: Shift | None, temperature: NumberLike | None) -> jax.Array | None:
    """Return ln b_T at `temperature` [K] of any shape, or None if an argument or the vertical law is None."""
    if shift is None or shift.vertical is None or temperature is None:
        return None
    return shift.vertical.log_factor(temperature, shift.reference_temperature)


# Some programs write log10 a_T = C1 (T - T_ref) / (C2 + T - T_ref).
_C1 = (f"{POSITIVE[0]}, as in log10 a_T = -C1 (T - T_ref) / (C2 + T - T_ref); check its sign", POSITIVE[1])


@physical
class WLF(Shift):
    r"""Williams-Landel-Ferry shift, log10 a_T = -C1 (T - T_ref) / (C2 + T - T_ref).

    [Williams, Landel & Ferry, J. Am. Chem. Soc. 77 (1955) 3701, doi:10.1021/ja01619a008]

    Parameters
    ----------
    C1 : [-]
    C2 : [K]
    T_ref : [K]

    Limits: the law has a pole at T_ref - C2. Concrete temperatures at or below the pole raise ValueError.
    Under jit, ln a_T is `largest_log_factor` at and below the pole.

    Examples
    --------
    >>> wlf = rf.WLF(C1=8.86, C2=101.6, T_ref=293.15)
    >>> round(float(np.exp(-wlf.log_factor(303.15))), 2)
    6.22
    """

    C1: Number = leaf(_C1, unit="-")
    C2: Number = leaf(POSITIVE, unit="K")
    T_ref: Number = leaf(POSITIVE, unit="K", plausible=PLAUSIBLE_TEMPERATURE)

    def check_temperature(self, temperature: NumberLike) -> None:
        """Raise ValueError for concrete temperatures [K] at or below the pole T_ref - C2."""
        if is_concrete(temperature) and is_concrete(self.T_ref) and is_concrete(self.C2):
            pole = float(self.T_ref) - float(self.C2)
            rule = (f"must be > {pole:g} K, the pole of the WLF law", lambda T: pole < T)
            check_values("temperature", temperature, rule)
        super().check_temperature(temperature)

    def log_factor(self, temperature: NumberLike) -> jax.Array:
        """Return ln a_T at temperature [K]."""
        above = temperature - self.T_ref
        distance = self.C2 + above
        # Below the pole the formula changes sign; the factor stays saturated there.
        safe = jnp.where(distance > 0, distance, 1.0)
        log10 = jnp.where(distance > 0, -self.C1 * above / safe, jnp.inf)
        return saturated(log10 * math.log(10.0))  # NumPy would widen float32


@physical
class Arrhenius(Shift):
    r"""Arrhenius shift, ln a_T = (energy / k_B) (1/T - 1/T_ref).

    Parameters
    ----------
    energy : activation energy [eV]
    T_ref : [K]

    Examples
    --------
    >>> shift = rf.Arrhenius(energy=0.97, T_ref=293.15)  # eV, K
    >>> round(float(np.exp(shift.log_factor(313.15))), 4)
    0.0861
    """

    energy: Number = leaf(POSITIVE, unit="eV")
    T_ref: Number = leaf(POSITIVE, unit="K", plausible=PLAUSIBLE_TEMPERATURE)

    def log_factor(self, temperature: NumberLike) -> jax.Array:
        """Return ln a_T at temperature [K]."""
        # Below 1 K the factor would overflow; it is constant there, with a finite derivative at 0.
        temperature = jnp.maximum(temperature, 1.0)
        ratio = (self.T_ref - temperature) / (temperature * self.T_ref)
        return saturated(self.energy / BOLTZMANN_EV * ratio)


@physical
class Entropic(VerticalShift):
    r"""Vertical shift of a rubber network with entropy elasticity.

    .. math:: b_T = \frac{\rho T}{\rho_\mathrm{ref} T_\mathrm{ref}},\qquad
              \rho = \rho_\mathrm{ref} e^{-\alpha (T - T_\mathrm{ref})}

    [Rouse, J. Chem. Phys. 21 (1953) 1272, doi:10.1063/1.1699180; Ferry, chapter 11]

    Parameters
    ----------
    expansion : alpha, thermal expansion of the volume [1/K]
        alpha is about 6e-4 for a rubber, and 0 for a constant density.

    Limits: b_T is constant below 1 K.

    Examples
    --------
    >>> law = rf.Entropic(expansion=6e-4)
    >>> round(float(np.exp(law.log_factor(353.15, 293.15))), 3)
    1.162
    >>> shift = rf.WLF(C1=8.86, C2=101.6, T_ref=293.15, vertical=law)
    """

    expansion: Number = leaf(NONNEGATIVE, unit="1/K", default=0.0)

    def log_factor(self, temperature: NumberLike, T_ref: NumberLike) -> jax.Array:
        """Return ln b_T at temperature [K]."""
        temperature = jnp.maximum(temperature, 1.0)  # ln 0 has no derivative
        return saturated(jnp.log(temperature / T_ref) - self.expansion * (temperature - T_ref))


def log_factors(law: Shift | VerticalShift, *temperatures: ArrayLike) -> np.ndarray:
    """Return `law.log_factor(*temperatures)` as a NumPy array of double precision.

    The law is compiled as a whole; each of its operations would be compiled separately outside `jax.jit`.
    `temperatures` are T [K] of any shape, and T_ref [K] for a vertical shift. The result is ln a_T or ln b_T.

    Examples
    --------
    >>> rf.materials.log_factors(rf.WLF(8.86, 101.6, 293.15), [293.15, 303.15]).round(3) + 0
    array([ 0.   , -1.828])
    """
    return np.asarray(_log_factor(law, *(jnp.asarray(T, float) for T in temperatures)), float)


@quick_jit()
def _log_factor(law, *temperatures):
    return law.log_factor(*temperatures)


def largest_log_factor(dtype: DTypeLike) -> float:
    """Return the bound of |ln a_T|, 177 in float64 and 22 in float32, which keeps products of a_T finite."""
    return 0.25 * float(np.log(float(jnp.finfo(dtype).max)))


def saturated(log_factor: jax.Array) -> jax.Array:
    """Limit the logarithm of a shift factor to the range from -L to L with L = `largest_log_factor`."""
    limit = largest_log_factor(jnp.result_type(log_factor))
    return jnp.clip(log_factor, -limit, limit)


class _Table(Kind):
    """Base class of laws from a table of factors, in the field named `factor`, over the temperatures T."""

    factor: ClassVar[str]

    T: Vector

    def check_temperature(self, temperature: NumberLike) -> None:
        """Raise ValueError for concrete temperatures outside the table."""
        self._check_inside("temperature", temperature)
        super().check_temperature(temperature)  # pyright: ignore[reportAttributeAccessIssue] (of the law)

    def padded(self) -> Self:
        """Return the law with a table that is extended to a standard length.

        The added entries lie on the line of the logarithm through the last two entries.
        """
        T, factor = np.asarray(self.T), np.asarray(getattr(self, self.factor))
        added = recurring_length(T.size) - T.size
        slope = np.diff(np.log(factor[-2:]))[0] / np.diff(T[-2:])[0]
        # Factors must not overflow single precision.
        step = min(1.0, 10.0 / (1e-9 + added * abs(slope)))
        above = step * np.arange(1, added + 1)
        longer = np.append(factor, (factor[-1] * np.exp(slope * above)).astype(factor.dtype))
        return self.replace({"T": np.append(T, (T[-1] + above).astype(T.dtype)), self.factor: longer})

    def _check(self):
        check_table(type(self).__name__, T=self.T, **{self.factor: getattr(self, self.factor)})

    def _check_inside(self, name, temperature):
        if is_concrete(temperature) and is_concrete(self.T):
            # Within a trace, an entry of a concrete JAX array is not concrete. An entry of a NumPy array is.
            low, high = np.asarray(self.T)[[0, -1]].tolist()
            rule = (f"must be inside the table, {low:g} to {high:g} K", lambda T: (low <= T) & (high >= T))
            check_values(name, temperature, rule)


@physical
class TabulatedShift(_Table, Shift):
    r"""Shift factors from a table, where ln a_T is a monotone cubic in T between the entries.

    The slope of ln a_T is continuous and depends continuously on the entries. Extrema of ln a_T occur only at
    entries. [Fritsch & Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, doi:10.1137/0905021] Outside the
    table ln a_T continues along the lines through the first two and the last two entries. At the first and
    the last entry the slope of ln a_T is the slope of these lines. The table is divided by its value at
    T_ref, so that a_T(T_ref) = 1 also between entries.

    Parameters
    ----------
    T : temperatures, strictly increasing [K], shape (n,), n >= 2
    aT : shift factors [-], shape (n,)
    T_ref : [K], inside the table

    Limits: concrete temperatures outside the table raise ValueError. Flash temperatures may leave the table.

    Examples
    --------
    >>> shift = rf.TabulatedShift(T=[273.15, 293.15, 313.15], aT=[100.0, 1.0, 0.03], T_ref=283.15)
    >>> log_aT = np.asarray(shift.log_factor(np.array([273.15, 283.15, 293.15])))
    >>> round(float(np.exp(log_aT[0] - log_aT[2])), 9), round(float(log_aT[1]), 9)
    (100.0, 0.0)
    """

    file_kind: ClassVar[str] = "table"
    factor: ClassVar[str] = "aT"
    rising: ClassVar = ("T",), ("T[0]", "T_ref", "T[-1]")

    T: Vector = leaf(POSITIVE, unit="K", column="T")
    aT: Vector = leaf(POSITIVE, unit="-", column="aT", over="T")
    T_ref: Number = leaf(POSITIVE, unit="K", plausible=PLAUSIBLE_TEMPERATURE)

    def _check(self):
        super()._check()
        self._check_inside("TabulatedShift.T_ref", self.T_ref)

    def log_factor(self, temperature: NumberLike) -> jax.Array:
        """Return ln a_T at temperature [K]."""
        return _log_interpolated(temperature, self.T, self.aT, self.T_ref)


@physical
class TabulatedVertical(_Table, VerticalShift):
    r"""Vertical shift factors from a table, where ln b_T is a monotone cubic in T between the entries.

    ln b_T is interpolated like ln a_T in `TabulatedShift`. The table is divided by its value at the T_ref of
    the `Shift` that has this law as `vertical`.

    Parameters
    ----------
    T : temperatures, strictly increasing [K], shape (n,), n >= 2
    bT : vertical shift factors [-], shape (n,)

    Limits: concrete temperatures outside the table raise ValueError. Flash temperatures may leave the table.

    Examples
    --------
    >>> law = rf.TabulatedVertical(T=[273.15, 293.15, 313.15], bT=[0.93, 1.0, 1.07])
    >>> round(float(np.exp(law.log_factor(313.15, 293.15))), 9)
    1.07
    >>> shift = rf.WLF(C1=8.86, C2=101.6, T_ref=293.15, vertical=law)
    >>> rubber = rf.Prony(E_inf=1e6, E=[1e7], tau=[1e-3], shift=shift)
    >>> round(float(rf.complex_modulus(rubber, 0.0, 313.15).real))
    1070000
    """

    file_kind: ClassVar[str] = "table"
    factor: ClassVar[str] = "bT"
    rising: ClassVar = (("T",),)

    T: Vector = leaf(POSITIVE, unit="K", column="T")
    bT: Vector = leaf(POSITIVE, unit="-", column="bT", over="T")

    def log_factor(self, temperature: NumberLike, T_ref: NumberLike) -> jax.Array:
        """Return ln b_T at temperature [K]."""
        return _log_interpolated(temperature, self.T, self.bT, T_ref)


def _log_interpolated(temperature, T, factor, T_ref):
    T, log = jnp.asarray(T), jnp.log(factor)
    pieces = _pieces(T, log)
    return saturated(_at(jnp.asarray(temperature), T, pieces) - _at(jnp.asarray(T_ref), T, pieces))


def _pieces(nodes, values):
    """Return the coefficients of a piecewise cubic interpolant as an array of shape (4, n + 1).

    A column holds the coefficients of the powers 0 to 3 of the distance from the left node. In the first
    column, the distance is measured from the first node. The first and the last polynomial are the lines
    outside the table. The slope at an inner node is the weighted harmonic mean of the slopes of the two
    adjacent lines, or 0 if the signs of these slopes differ. The slope at an end is the slope of the line
    there. The result is the monotone interpolation by Fritsch & Butland of a table that continues along its
    first and last lines.
    """
    width = jnp.diff(nodes)
    line = jnp.diff(values) / width
    before, after = line[:-1], line[1:]
    monotone = before * after > 0
    # A slope of the other sign is replaced by 1 to avoid division by 0.
    first, second = jnp.where(monotone, before, 1.0), jnp.where(monotone, after, 1.0)
    share = (width[:-1] + 2 * width[1:]) / (3 * (width[:-1] + width[1:]))
    inner = jnp.where(monotone, first * second / (share * second + (1 - share) * first), 0.0)
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
    if nodes.shape[0] < _FEW:
        i = jnp.sum(x[..., None] >= nodes, -1, dtype=jnp.int32)
    else:
        i = jnp.searchsorted(nodes, x, side="right")

    def taken(row):
        return row.at[i].get(mode="promise_in_bounds", wrap_negative_indices=False)

    value, slope, second, third = map(taken, pieces)
    away = x - taken(jnp.concatenate([nodes[:1], nodes]))
    return value + away * (slope + away * (second + away * third))
