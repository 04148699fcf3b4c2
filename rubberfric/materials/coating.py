"""A layer bonded to a deformable half-space, where layer and base are elastic or Prony solids."""

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
        material of the half-space. If a Prony base has no shift, the shift of the body's material applies to
        the base.
    """

    multiplies: ClassVar[bool] = False

    thickness: Number = leaf(POSITIVE, unit="m")
    base: Coatable = child(hint=" (on a rigid base use Slab)")

    @property
    def below(self) -> Material:
        """Return `base`, the material of the half-space."""
        return self.base

    def varies(self, material: Material) -> bool:
        """Return True if temperature changes base and layer differently."""
        vertical = material.shift is not None and material.shift.vertical is not None
        return self.shift is not None or (vertical and not self.base.relaxes)

    def _base_shift(self, material):
        return material.shift if self.shift is None and self.base.relaxes else self.shift

    def _bonded(self, material):
        return Bonded(self.thickness, poisson_of(material), poisson_of(self.base))

    def check_material(self, material: Material) -> None:
        """Raise ValueError unless `material` is a `Coatable`, such as Elastic or Prony."""
        if not isinstance(material, Coatable):
            raise ValueError(
                f"Body.material is a {type(material).__name__} with a Coating: must be "
                f"{either(kinds(Coatable))}"
            )

    def static_reduced(
        self, material: Material, scale: ArrayLike, q: jax.Array, temperature: jax.Array | None = None
    ) -> jax.Array:
        """Return E_r Sbar of the coated body at zero frequency, divided by `scale` [-].

        `scale` is in Pa, `q` is the wavevector [1/m], and `temperature` is in K. E_r is the reduced modulus
        of the layer's material, and Sbar is the stiffness of the body relative to a half-space of this
        material.
        """
        layer, base = (
            apply_vertical_shift(solid.static_reduced() / scale, shift, temperature)
            for solid, shift in ((material, material.shift), (self.base, self._base_shift(material)))
        )
        return coated_spring(self._bonded(material), layer, base, q)

    def glassy_stiffening(self, material: Material, q: jax.Array) -> jax.Array:
        """Return Sbar [-] at wavevectors q [1/m] of any shape if layer and base are glassy."""
        layer, base = material.glassy_reduced(), self.base.glassy_reduced()
        return coated_spring(self._bonded(material), layer, base, q) / layer

    def reduced_series(
        self, material: Material, scale: ArrayLike, q: jax.Array, temperature: jax.Array | None = None
    ) -> Series:
        """Return E_r Sbar divided by `scale` [Pa] as a Prony series at every q [1/m] of shape (nodes,).

        All values belong to one temperature [K]. `coated_series` describes the shapes of the result. The
        relaxation times do not include a_T of the material. If the base has another shift, the relaxation
        times of the base therefore change with temperature.
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
