"""Time-temperature superposition: E(omega, T) = b_T E(a_T omega) with a_T(T_ref) = b_T(T_ref) = 1.

A `Shift` is a law for ln a_T, and may have a `VerticalShift`, a law for ln b_T: `log_factor` gives them,
finite for every finite T.
[Ferry, Viscoelastic Properties of Polymers, 3rd edition, Wiley 1980, chapter 11]
"""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from numpy.typing import DTypeLike

from rubberfric.base.checks import (
    NONNEGATIVE,
    PLAUSIBLE_TEMPERATURE,
    POSITIVE,
    check_values,
    is_concrete,
)
from rubberfric.base.objects.fields import Number, child, leaf
from rubberfric.base.objects.physical import Kind, physical

BOLTZMANN_EV = 8.617333262e-5  # Boltzmann constant [eV/K], CODATA 2018 (exact to the digits given)


class VerticalShift(Kind):
    """ln b_T(T), by which moduli themselves change, the role of Entropic and TabulatedVertical."""

    def check_temperature(self, temperature: ArrayLike) -> None:
        """Raise ValueError for concrete temperatures [K], any shape, that the law does not hold for."""
        check_values("temperature", temperature, POSITIVE)

    def log_factor(self, temperature: ArrayLike, T_ref: ArrayLike) -> jax.Array:
        """ln b_T at temperature [K], any shape, 0 at T_ref [K]; finite, and its derivative."""
        raise NotImplementedError(f"{type(self).__name__}.log_factor")


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Shift(Kind):
    """ln a_T(T), the role of WLF, Arrhenius and TabulatedShift.

    Parameters
    ----------
    vertical : Entropic, TabulatedVertical or None, of every law, by keyword
        how much stiffer the solid is at a temperature, E(omega, T) = b_T E(a_T omega); b_T = 1 if None.
    """

    vertical: VerticalShift | None = child(default=None)  # noqa: RUF009 (`child` gives a field)

    @property
    def reference_temperature(self) -> jax.Array:
        """T_ref [K], where a_T = b_T = 1; a law without a field of this name answers it."""
        return self.T_ref  # pyright: ignore[reportAttributeAccessIssue] (every law has one)

    def check_temperature(self, temperature: ArrayLike) -> None:
        """Raise ValueError for concrete temperatures [K], any shape, that the law does not hold for."""
        check_values("temperature", temperature, POSITIVE)
        if self.vertical is not None:
            self.vertical.check_temperature(temperature)

    def log_factor(self, temperature: ArrayLike) -> jax.Array:
        """ln a_T at temperature [K], any shape; within `largest_log_factor`, and finite its derivative."""
        raise NotImplementedError(f"{type(self).__name__}.log_factor")


def log_vertical(shift: Shift | None, temperature: ArrayLike | None) -> jax.Array | None:
    """ln b_T at temperature [K], any shape; None where nothing but b_T = 1 is known."""
    if shift is None or shift.vertical is None or temperature is None:
        return None
    return shift.vertical.log_factor(temperature, shift.reference_temperature)


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
        super().check_temperature(temperature)

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
class Entropic(VerticalShift):
    r"""Stiffness of a rubber network, whose elasticity is that of entropy.

    .. math:: b_T = \frac{\rho T}{\rho_\mathrm{ref} T_\mathrm{ref}},\qquad
              \rho = \rho_\mathrm{ref} e^{-\alpha (T - T_\mathrm{ref})}

    [Rouse, J. Chem. Phys. 21 (1953) 1272, doi:10.1063/1.1699180; Ferry, chapter 11]

    Parameters
    ----------
    expansion : alpha, of the volume [1/K]; 6e-4 for a rubber, 0: the density stays

    Limits: held below 1 K.
    """

    expansion: Number = leaf(NONNEGATIVE, unit="1/K", default=0.0)

    def log_factor(self, temperature: ArrayLike, T_ref: ArrayLike) -> jax.Array:
        """ln b_T at temperature [K]."""
        temperature = jnp.maximum(temperature, 1.0)  # ln 0 has no derivative
        return saturated(jnp.log(temperature / T_ref) - self.expansion * (temperature - T_ref))


def largest_log_factor(dtype: DTypeLike) -> float:
    """Where |ln a_T| saturates, so that a_T and its products with q v tau stay finite: 177 (float32: 22)."""
    return 0.25 * float(np.log(float(jnp.finfo(dtype).max)))


def saturated(log_factor: jax.Array) -> jax.Array:
    """ln a_T within the limits that keep a_T and its products finite."""
    limit = largest_log_factor(jnp.result_type(log_factor))
    return jnp.clip(log_factor, -limit, limit)
