r"""A layer bonded to a deformable half-space; both are elastic or Prony solids."""

from typing import ClassVar

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from rubberfric.base.checks import POSITIVE, either
from rubberfric.base.objects.fields import Number, child, leaf
from rubberfric.base.objects.physical import kinds, physical
from rubberfric.materials.layer_and_base import Bonded, coated_series, coated_spring
from rubberfric.materials.material import (
    Coatable,
    Material,
    Series,
    apply_vertical_shift,
    poisson_of,
    series_of,
)
from rubberfric.materials.slab import Layer


@physical
class Coating(Layer):
    """A layer of the body's material, bonded to a deformable half-space.

    Parameters
    ----------
    thickness : d [m], > 0
    base : Elastic or Prony
        material of the half-space. A Prony solid without a shift has the shift of the body's material.
    """

    multiplies: ClassVar[bool] = False

    thickness: Number = leaf(POSITIVE, unit="m")
    base: Coatable = child(hint=" (on a rigid base use Slab)")

    @property
    def below(self) -> Material:
        """Return `base`."""
        return self.base

    def varies(self, material: Material) -> bool:
        """Return True if temperature changes base and layer differently."""
        vertical = material.shift is not None and material.shift.vertical is not None
        return self.shift is not None or (vertical and not self.base.relaxes)

    def _base_shift(self, material):
        """Return the shift of the base."""
        return material.shift if self.shift is None and self.base.relaxes else self.shift

    def _bonded(self, material):
        """Return thickness and Poisson's ratios of the two solids."""
        return Bonded(self.thickness, poisson_of(material), poisson_of(self.base))

    def check_material(self, material: Material) -> None:
        """Raise ValueError unless a coating can consist of this material."""
        if not isinstance(material, Coatable):
            raise ValueError(
                f"Body.material is a {type(material).__name__} with a Coating: must be "
                f"{either(kinds(Coatable))}"
            )

    def static_reduced(
        self, material: Material, scale: ArrayLike, q: jax.Array, temperature: jax.Array | None = None
    ) -> jax.Array:
        """Return E_r(0) Sbar / scale [-] of a body of this material at q [1/m] and T [K]; scale [Pa]."""
        layer, base = (
            apply_vertical_shift(solid.static_reduced() / scale, shift, temperature)
            for solid, shift in ((material, material.shift), (self.base, self._base_shift(material)))
        )
        return coated_spring(self._bonded(material), layer, base, q)

    def glassy_stiffening(self, material: Material, q: jax.Array) -> jax.Array:
        """Return Sbar [-] at q [1/m], any shape, with both solids glassy."""
        layer, base = material.glassy_reduced(), self.base.glassy_reduced()
        return coated_spring(self._bonded(material), layer, base, q) / layer

    def reduced_series(
        self, material: Material, scale: ArrayLike, q: jax.Array, temperature: jax.Array | None = None
    ) -> Series:
        """Return E_r Sbar / scale as a Prony series at q [1/m], shape (nodes,), and one T [K]; scale [Pa].

        See `coated_series` for the shapes. The relaxation times do not include a_T of the material. Times of
        a base with another shift therefore change with T.
        """
        layer, base = (series_of(solid, scale) for solid in (material, self.base))
        if temperature is not None:
            layer, base = (
                Series(
                    apply_vertical_shift(x.rest, shift, temperature),
                    apply_vertical_shift(x.weight, shift, temperature),
                    x.tau,
                )
                for x, shift in ((layer, material.shift), (base, self._base_shift(material)))
            )
            if self.shift is not None:
                factor = self.shift.log_factor(temperature)
                if material.shift is not None:
                    factor = factor - material.shift.log_factor(temperature)
                base = base._replace(tau=jnp.exp(factor) * base.tau)
        return coated_series(self._bonded(material), layer, base, q)
