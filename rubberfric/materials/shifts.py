"""Time-temperature superposition: E(omega, T) = E(a_T omega) with a_T(T_ref) = 1.

Each class is one law for ln a_T. All are callable: `shift.log_factor(T)` gives ln a_T,
finite for every finite T.
"""

import math
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from numpy.typing import DTypeLike

from rubberfric.base.checks import (
    PLAUSIBLE_TEMPERATURE,
    POSITIVE,
    check_increasing,
    check_lengths,
    check_values,
    is_concrete,
)
from rubberfric.base.objects.fields import Number, Vector, leaf
from rubberfric.base.objects.physical import Kind, physical

BOLTZMANN_EV = 8.617333262e-5  # Boltzmann constant [eV/K], CODATA 2018 (exact to the digits given)


class Shift(Kind):
    """ln a_T(T), the role of WLF, Arrhenius and TabulatedShift."""

    def check_temperature(self, temperature: ArrayLike) -> None:
        """Raise ValueError for concrete temperatures [K], any shape, that the law does not hold for."""
        check_values("temperature", temperature, POSITIVE)

    def log_factor(self, temperature: ArrayLike) -> jax.Array:
        """ln a_T at temperature [K], any shape; within `largest_log_factor`, and finite its derivative."""
        raise NotImplementedError(f"{type(self).__name__}.log_factor")


@physical
class WLF(Shift):
    r"""Williams-Landel-Ferry shift, log10 a_T = -C1 (T - T_ref) / (C2 + T - T_ref).

    [Williams, Landel & Ferry, J. Am. Chem. Soc. 77 (1955) 3701, doi:10.1021/ja01619a008]

    Parameters
    ----------
    C1 : [-]
    C2 : [K]
    T_ref : [K]

    Limits: the law has a pole at T_ref - C2. Concrete temperatures at or below it
    raise ValueError; under jit the factor saturates at the largest finite value.
    """

    C1: Number = leaf(POSITIVE, unit="-")
    C2: Number = leaf(POSITIVE, unit="K")
    T_ref: Number = leaf(POSITIVE, unit="K", plausible=PLAUSIBLE_TEMPERATURE)

    def check_temperature(self, temperature: ArrayLike) -> None:
        """Raise ValueError for concrete temperatures at or below the pole."""
        if is_concrete(temperature) and is_concrete(self.T_ref) and is_concrete(self.C2):
            pole = float(self.T_ref) - float(self.C2)
            rule = (f"must be > {pole:g} K, the pole of the WLF law", lambda T: pole < T)
            check_values("temperature", temperature, rule)

    def log_factor(self, temperature: ArrayLike) -> jax.Array:
        """ln a_T at temperature [K]."""
        above = temperature - self.T_ref
        distance = self.C2 + above
        # Below the pole the formula changes sign; the glass is taken as saturated there.
        safe = jnp.where(distance > 0, distance, 1.0)
        log10 = jnp.where(distance > 0, -self.C1 * above / safe, jnp.inf)
        return saturated(log10 * math.log(10.0))  # a NumPy scalar would widen float32


@physical
class Arrhenius(Shift):
    r"""Arrhenius shift, ln a_T = (energy / k_B) (1/T - 1/T_ref).

    Parameters
    ----------
    energy : activation energy [eV]
    T_ref : [K]
    """

    energy: Number = leaf(POSITIVE, unit="eV")
    T_ref: Number = leaf(POSITIVE, unit="K", plausible=PLAUSIBLE_TEMPERATURE)

    def log_factor(self, temperature: ArrayLike) -> jax.Array:
        """ln a_T at temperature [K]."""
        # Below 1 K the factor is beyond all numbers; held there, it has a finite derivative at 0.
        temperature = jnp.maximum(temperature, 1.0)
        ratio = (self.T_ref - temperature) / (temperature * self.T_ref)
        return saturated(self.energy / BOLTZMANN_EV * ratio)


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

    T: Vector = leaf(POSITIVE, unit="K", column="T")
    aT: Vector = leaf(POSITIVE, unit="-", column="aT")
    T_ref: Number = leaf(POSITIVE, unit="K", plausible=PLAUSIBLE_TEMPERATURE)

    def _check(self):
        check_lengths("TabulatedShift", T=self.T, aT=self.aT)
        if self.T.shape[0] < 2:
            raise ValueError(f"TabulatedShift.T has {self.T.shape[0]} entries: must have at least 2")
        check_increasing("TabulatedShift.T", self.T)
        if is_concrete(self.T) and is_concrete(self.T_ref):
            self._inside("TabulatedShift.T_ref", self.T_ref)

    def _inside(self, name, temperature):
        # In a trace an entry of a concrete jax array is not concrete; one of a NumPy array is.
        low, high = np.asarray(self.T)[[0, -1]].tolist()
        rule = (f"must be inside the table, {low:g} to {high:g} K", lambda T: (low <= T) & (high >= T))
        check_values(name, temperature, rule)

    def check_temperature(self, temperature: ArrayLike) -> None:
        """Raise ValueError for concrete temperatures outside the table."""
        if is_concrete(temperature) and is_concrete(self.T):
            self._inside("temperature", temperature)

    def log_factor(self, temperature: ArrayLike) -> jax.Array:
        """ln a_T at temperature [K]."""
        log_aT = jnp.log(self.aT)
        here = jnp.interp(temperature, self.T, log_aT)
        return saturated(here - jnp.interp(self.T_ref, self.T, log_aT))


def largest_log_factor(dtype: DTypeLike) -> float:
    """Where |ln a_T| saturates, so that a_T and its products with q v tau stay finite: 177 (float32: 22)."""
    return 0.25 * float(np.log(float(jnp.finfo(dtype).max)))


def saturated(log_factor: jax.Array) -> jax.Array:
    """ln a_T within the limits that keep a_T and its products finite."""
    limit = largest_log_factor(jnp.result_type(log_factor))
    return jnp.clip(log_factor, -limit, limit)


__all__ = ["WLF", "Arrhenius", "Shift", "TabulatedShift"]
