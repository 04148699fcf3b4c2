"""Layers: stiffening of a solid by its finite thickness, M = 2 / (q E_r Sbar(q d))."""

from typing import ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import POSITIVE
from rubberfric.base.objects.fields import Number, leaf, static
from rubberfric.base.objects.physical import Kind, physical
from rubberfric.materials.in_series import times
from rubberfric.materials.material import Material, poisson_of
from rubberfric.materials.shifts import Shift

# sinh(2x) - 2x = sum_{k>=1} (2x)^(2k+1) / (2k+1)!: exact to rounding for x <= 1.
_SINH_SERIES = 1.0 / np.cumprod([6.0] + [(2 * k) * (2 * k + 1) for k in range(2, 13)])


class Layer(Kind):
    """Finite thickness of a body: base class of Slab and Coating.

    If `multiplies` is True, a subclass implements `stiffening`. Otherwise it implements `E_r_S_bar`.
    """

    # True if the stiffness of the layered solid is E_r(omega) times a real function of q.
    multiplies: ClassVar[bool] = True

    @property
    def below(self) -> Material | None:
        """Return the material of a deformable base, or None if the base is rigid."""
        return None

    @property
    def relaxes(self) -> bool:
        """Return True if the base relaxes."""
        return self.below is not None and self.below.relaxes

    @property
    def shift(self) -> Shift | None:
        """Return the shift of the base, or None if the base has no shift."""
        return None if self.below is None else self.below.shift

    def varies(self, material: Material) -> bool:
        """Return True if temperature changes the body differently from its material."""
        del material
        return False

    def check_material(self, material: Material) -> None:
        """Raise ValueError if the layer cannot consist of `material`."""

    def stiffening(self, poisson: jax.Array, q: jax.Array) -> jax.Array:
        """Return Sbar [-], the stiffness of the layer divided by the stiffness of a half-space.

        `q` is the wavevector [1/m] and may have any shape. `poisson` is Poisson's ratio of the layer.
        """
        raise NotImplementedError(f"{type(self).__name__}.stiffening")

    def E_r_S_bar(
        self, poisson: jax.Array, q: jax.Array, layer: jax.Array, base: jax.Array | None
    ) -> jax.Array:
        """Return E_r Sbar, in the unit of the moduli.

        Parameters
        ----------
        poisson : Poisson's ratio of the layer [-]
        q : wavevector [1/m], any shape
        layer : E_r of the layer, real or complex, broadcastable to q
        base : E_r of the material `below`; None: the base is rigid
        """
        del base
        return times(self.stiffening(poisson, q), layer)

    def base_shift(self, material: Material) -> Shift | None:
        """Return the shift of the base if the layer consists of `material`."""
        del material
        return self.shift

    def glassy_stiffening(self, material: Material, q: jax.Array) -> jax.Array:
        """Return Sbar [-] at wavevectors q [1/m] if all solids of the body have their glassy moduli."""
        layer = material.glassy_reduced()
        base = None if self.below is None else self.below.glassy_reduced()
        return self.E_r_S_bar(poisson_of(material), q, layer, base) / layer


@physical
class Slab(Layer):
    """A solid of finite thickness on a rigid base.

    Parameters
    ----------
    thickness : d [m], > 0
    base : "bonded" or "frictionless" (static)
        With "bonded", the far side of the solid sticks to the base. With "frictionless", the far side slides.

    Examples
    --------
    >>> q, d = 10.0, 1e-3  # q d = 0.01
    >>> round(float(rf.Slab(d).stiffening(0.5, q)) * (q * d) ** 3, 3)
    1.5
    >>> round(float(rf.Slab(d, base="frictionless").stiffening(0.5, q)) * q * d, 3)
    2.0
    """

    thickness: Number = leaf(POSITIVE, unit="m")
    base: Literal["bonded", "frictionless"] = static(default="bonded")

    def stiffening(self, poisson: jax.Array, q: jax.Array) -> jax.Array:
        r"""Return Sbar(q d) [-], the stiffness of the slab divided by the stiffness of a half-space.

        Bonded [Scaraggi & Persson, arXiv:1506.06955, below (A10), scaled by exp(-2x)], x = q d, a = 3 - 4 nu:

        .. math:: \bar S = \frac{2a\sinh^2 x + 2x^2 + 8(1-\nu)^2}{a(\sinh 2x - 2x) + 4(1-2\nu)x}

        Frictionless: coth x + x / sinh^2 x.

        Parameters
        ----------
        poisson : Poisson's ratio of the layer's material [-]
        q : wavevector [1/m], any shape

        Limits: Sbar tends to 1 for x -> infinity. For x -> 0, Sbar tends to 3/(2 x^3) if the slab is bonded
        and incompressible, so that Sbar^2 overflows float32 for x below 1e-6.
        """
        x = q * self.thickness
        # Above x = 60 every correction is below e^-120; the limit avoids inf * 0 in x^2 e^-2x.
        x = jnp.minimum(x, 60.0)
        decay, rise = jnp.exp(-2 * x), -jnp.expm1(-2 * x)
        if self.base == "frictionless":
            return (1 + decay) / rise + 4 * x * decay / rise**2
        a = 3 - 4 * poisson
        top = 0.5 * a * rise**2 + (2 * x**2 + 8 * (1 - poisson) ** 2) * decay
        bottom = a * sinh_minus_linear(x, decay) + 4 * (1 - 2 * poisson) * x * decay
        return top / bottom


def sinh_minus_linear(x: jax.Array, decay: jax.Array) -> jax.Array:
    """Return (sinh 2x - 2x) e^(-2x) without cancellation at small x, where `decay` is e^(-2x)."""
    small = jnp.minimum(x, 1.0)
    y = (2 * small) ** 2
    series = jnp.zeros_like(x)
    for coefficient in _SINH_SERIES[::-1]:
        series = series * y + float(coefficient)
    near = 2 * small * y * series * jnp.exp(-2 * small)
    return jnp.where(x < 1, near, 0.5 * (1 - decay**2) - 2 * x * decay)
