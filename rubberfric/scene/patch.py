r"""Contact patches of a tyre or a test wheel: size, tangential stiffness, and pressure along the patch.

The pressure at the share s = x / L of the length behind the leading edge is the mean pressure times a shape,

.. math:: p(s) = \frac{F_z}{L w}\, f(s),\qquad \int_0^1 f(s)\, ds = 1
"""

import abc
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import NONNEGATIVE, POSITIVE, between, is_concrete
from rubberfric.base.objects.fields import Number, Vector, child, leaf
from rubberfric.base.objects.physical import Kind, PhysicalObject, physical


class PressureShape(Kind, abc.ABC):
    """Base class of the pressure along a patch."""

    @abc.abstractmethod
    def relative(self, s: jax.Array) -> jax.Array:
        """Return the pressure divided by its mean at s of any shape, 0 <= s <= 1."""

    @abc.abstractmethod
    def highest(self) -> jax.Array | float:
        """Return the largest pressure divided by the mean."""

    def kinks(self) -> jax.Array | np.ndarray:
        """Return the s between which the pressure is smooth, in increasing order, from 0 to 1.

        Between two neighbouring ones, the pressure is > 0 everywhere or 0 everywhere.
        """
        return np.array([0.0, 1.0])

    def contacts(self) -> tuple[jax.Array, jax.Array]:
        """Return where the contact of each part between two `kinks` begins, and whether the part is loaded.

        Returns
        -------
        Tuple of the index of the kink at which the contact of each part begins, and an array that is True for
        loaded parts. Both have shape (kinks - 1,). A contact begins at the first kink, and at kinks without
        pressure.
        """
        kinks = jnp.asarray(self.kinks())
        begins = self.relative(kinks[:-1]) == 0
        index = jnp.arange(begins.shape[0])
        loaded = self.relative(0.5 * (kinks[:-1] + kinks[1:])) > 0
        return jax.lax.cummax(jnp.where(begins, index, 0)), loaded

    @property
    def is_constant(self) -> bool:
        """True if the pressure is the same along the whole patch."""
        return False


@physical
class Parabolic(PressureShape):
    """Pressure f = 6 s (1 - s) of a loaded tyre.

    Examples
    --------
    >>> shape = rf.Parabolic()
    >>> shape.relative(np.array([0.0, 0.25, 0.5])), shape.highest()
    (array([0.   , 1.125, 1.5  ]), 1.5)
    >>> patch = rf.Patch(length=0.12, width=0.15, stiffness=5e7, pressure=shape)
    """

    def relative(self, s: jax.Array) -> jax.Array:
        """Return the pressure divided by its mean at s."""
        return 6 * s * (1 - s)

    def highest(self) -> float:
        """Return 1.5."""
        return 1.5


@physical
class Uniform(PressureShape):
    """Constant pressure, f = 1.

    Examples
    --------
    >>> patch = rf.Patch(length=0.12, width=0.15, stiffness=5e7, pressure=rf.Uniform())
    >>> patch.shape.highest(), patch.shape.is_constant
    (1.0, True)
    """

    def relative(self, s: jax.Array) -> jax.Array:
        """Return 1 for every s."""
        return jnp.ones_like(s)

    def highest(self) -> float:
        """Return 1."""
        return 1.0

    @property
    def is_constant(self) -> bool:
        """True."""
        return True


@physical
class Trapezoid(PressureShape):
    """Pressure that rises from 0 along a share of the length, is constant, and falls to 0 likewise.

    Parameters
    ----------
    ramp : share of the length of each ramp, 0 ... 0.5 [-]

    Examples
    --------
    >>> shape = rf.Trapezoid(ramp=0.2)
    >>> round(float(shape.highest()), 6)  # 1 / (1 - 0.2)
    1.25
    >>> round(float(shape.relative(0.1)), 6)  # in the middle of the first ramp
    0.625
    >>> patch = rf.Patch(length=0.12, width=0.15, stiffness=5e7, pressure=shape)
    """

    ramp: Number = leaf(between(1e-6, 0.5), unit="-")

    def relative(self, s: jax.Array) -> jax.Array:
        """Return the pressure divided by its mean at s."""
        return jnp.minimum(jnp.minimum(s, 1 - s) / self.ramp, 1.0) * self.highest()

    def highest(self) -> jax.Array:
        """Return 1 / (1 - ramp)."""
        return 1 / (1 - self.ramp)

    def kinks(self) -> jax.Array:
        """Return both ends, and the ends of the ramps."""
        return jnp.stack([0.0 * self.ramp, self.ramp, 1 - self.ramp, 1 + 0.0 * self.ramp])


@physical
class MeasuredPressure(PressureShape):
    """Pressure with values at even distances from the leading edge to the trailing edge, linear between them.

    Parameters
    ----------
    values : pressures in any unit, at least two, >= 0; only their ratios matter
        A value 0 separates contacts, as a groove does: an element leaves it without deflection. Zeros at the
        ends of a record are outside the contact. Replace readings below the threshold of a sensor by 0,
        because elements with a small pressure slide, and continue to slide until their contact ends.

    Examples
    --------
    >>> shape = rf.MeasuredPressure([0.0, 200.0, 300.0, 200.0, 0.0])
    >>> round(float(shape.highest()), 4)  # the mean is 175 kPa
    1.7143
    >>> patch = rf.Patch(length=0.12, width=0.15, stiffness=5e7, pressure=shape)
    """

    values: Vector = leaf(NONNEGATIVE, unit="-")

    def _check(self) -> None:
        if np.shape(self.values)[0] < 2:
            raise ValueError("MeasuredPressure.values has one pressure: must have at least two")
        if is_concrete(self.values) and not np.any(self.values):
            raise ValueError("MeasuredPressure.values: all pressures are 0: one must be > 0")

    def _shape(self):
        values = self.values
        mean = jnp.sum(values[1:] + values[:-1]) / (2 * (values.shape[0] - 1))
        return values / mean

    def relative(self, s: jax.Array) -> jax.Array:
        """Return the pressure divided by its mean at s."""
        return jnp.interp(s, self.kinks().astype(s.dtype), self._shape())

    def highest(self) -> jax.Array:
        """Return the largest value divided by the mean."""
        return jnp.max(self._shape())

    def kinks(self) -> np.ndarray:
        """Return the places of the values."""
        return np.linspace(0.0, 1.0, self.values.shape[0])


@physical
class Patch(PhysicalObject):
    """Contact patch whose surface is a row of independent elastic elements (brush model).

    Parameters
    ----------
    length, width : size of the patch [m]
    stiffness : shear stress of an element per displacement of its tip [Pa/m]
        A tread block of height h and shear modulus G has about G / h; 5e7 Pa/m for tyres.
    pressure : "parabolic", "uniform", Trapezoid(ramp), MeasuredPressure(values), or another `PressureShape`

    Examples
    --------
    >>> patch = rf.Patch(length=0.12, width=0.15, stiffness=5e7, pressure="uniform")
    >>> round(3000.0 / float(patch.area))
    166667
    """

    length: Number = leaf(POSITIVE, unit="m", plausible=(1e-4, 10.0))
    width: Number = leaf(POSITIVE, unit="m", plausible=(1e-4, 10.0))
    stiffness: Number = leaf(POSITIVE, unit="Pa/m", plausible=(1e4, 1e12))
    pressure: PressureShape | Literal["parabolic", "uniform"] = child(default=Parabolic())

    @property
    def shape(self) -> PressureShape:
        """Pressure along the patch."""
        assert isinstance(self.pressure, PressureShape)
        return self.pressure

    @property
    def area(self) -> jax.Array:
        """Nominal area [m^2]."""
        return self.length * self.width
