"""One solid of a scene: its material, roughness and layer, and the factor of its stiffness."""

import jax
import jax.numpy as jnp

from rubberfric.base.checks import is_concrete
from rubberfric.base.objects.fields import child
from rubberfric.base.objects.physical import PhysicalObject, physical
from rubberfric.materials.material import Material, poisson_of
from rubberfric.materials.shifts import Shift
from rubberfric.materials.slab import Layer
from rubberfric.roughness.spectra import Spectrum
from rubberfric.scene.heating import ThermalProperties
from rubberfric.scene.softening import Softening

# Largest Sbar in float32, in which Sbar^2 must not overflow.
_STIFFEST_SINGLE = 1e18


@physical
class Body(PhysicalObject):
    """One solid.

    Parameters
    ----------
    material : Rigid, Elastic, Prony, PronyShear or TabulatedModulus
    spectrum : SelfAffine, TabulatedSpectrum, Anisotropic, TabulatedAnisotropic or None (smooth)
    layer : Slab, Coating or None (half-space)
        a finite thickness of the material, on a rigid base or on a half-space of another solid
    thermal : ThermalProperties or None
        thermal properties of this solid, which replace the thermal properties in the scene's Heating. A rigid
        body takes up its share of the heat of contact shear.
    softening : Softening or None
        softening of this solid, which replaces the softening of the scene.

    Examples
    --------
    Rubber of 2 mm that covers a softer foam:

    >>> foam = rf.Elastic(young=1e6, poisson=0.3)
    >>> tread = rf.Body(rf.Prony(E_inf=3e6, E=[1e7], tau=[1e-3]), layer=rf.Coating(thickness=2e-3, base=foam))
    >>> float(tread.below.young)
    1000000.0

    A slab of 2 mm on a rigid base is stiffer than a half-space at q = 1000 1/m:

    >>> round(float(rf.Body(foam, layer=rf.Slab(thickness=2e-3)).S_bar(1e3)), 2)
    1.31
    """

    material: Material = child()
    spectrum: Spectrum | None = child(default=None)
    layer: Layer | None = child(unnamed="slab", default=None)
    thermal: ThermalProperties | None = child(default=None)
    softening: Softening | None = child(default=None)

    def _check(self):
        if self.softening is not None and not relaxes(self):
            raise ValueError("Body.softening: only viscoelastic solids soften; must be None")
        if self.layer is None:
            return
        if not self.material.deforms:
            raise ValueError("Body.layer: a rigid body has no layer; must be None")
        if self.material.poisson is None:
            raise ValueError(
                f"Body.layer: a body of {type(self.material).__name__} is a half-space, because the factor "
                f"of a layer depends on Poisson's ratio; must be None"
            )
        self.layer.check_material(self.material)

    @property
    def below(self) -> Material | None:
        """Return the material of the deformable base of the layer, or None."""
        return None if self.layer is None else self.layer.below

    @property
    def half_space(self) -> bool:
        """Return True if the body has no layer."""
        return self.layer is None

    @property
    def separable(self) -> bool:
        """Return True if the stiffness is E_r(omega) times `S_bar(q)`."""
        return self.layer is None or self.layer.multiplies

    @property
    def geometry(self) -> str:
        """Return the name of the kind of the layer, or "half-space"."""
        return "half-space" if self.layer is None else type(self.layer).__name__

    @property
    def shifts(self) -> list[Shift]:
        """Return the shifts of the material and of the base of the layer, as far as they exist."""
        both = self.material.shift, None if self.layer is None else self.layer.shift
        return [shift for shift in both if shift is not None]

    @property
    def shifts_apart(self) -> bool:
        """Return True if temperature changes the body differently from its material."""
        return self.layer is not None and self.layer.varies(self.material)

    def S_bar(self, q: jax.Array) -> jax.Array:
        """Return the stiffness of a separable body divided by the stiffness of a half-space [-].

        `q` is the wavevector [1/m] and may have any shape.
        """
        if self.layer is None:
            return jnp.ones_like(q)
        return self.layer.stiffening(poisson_of(self.material), q)

    def check_single(self, name: str, wavevectors: list[jax.Array]) -> None:
        """Raise ValueError naming a number of the body `name` that requires float64.

        `wavevectors` are the first wavevectors of the roughness [1/m].
        """
        layer, below = self.layer, self.below
        if layer is None:
            return
        for q in wavevectors:
            if not all(map(is_concrete, jax.tree.leaves((q, layer, self.material)))):
                continue
            stiffer = float(jnp.max(layer.glassy_stiffening(self.material, q)))
            if not stiffer < _STIFFEST_SINGLE:
                thickness = getattr(layer, "thickness", None)
                value = "" if thickness is None else f".thickness = {float(thickness):g}"
                raise ValueError(
                    f"{name}.layer{value}: the thin layer is {stiffer:.2g} times as stiff as a half-space "
                    f"at q = {float(q):g} 1/m, and float32 allows less than {_STIFFEST_SINGLE:g} times; "
                    "use float64"
                )
        if below is not None and relaxes(self) and self.material.is_liquid() and below.is_liquid():
            raise ValueError(
                f"{name}.material.E_inf and {name}.layer.base.E_inf are 0: one must be > 0 in float32; "
                "use float64"
            )


def relaxes(body: Body) -> bool:
    """Return True if the material of a body or the base of its layer is viscoelastic."""
    return body.material.relaxes or (body.layer is not None and body.layer.relaxes)


def differs_by_wavevector(rough: Body, strained: Body) -> bool:
    """Return True if layers change K_j / q at two wavevectors by more than a factor.

    K_j belongs to the roughness of the body `rough`.
    """
    layered = not (rough.half_space and strained.half_space)
    return not strained.separable or (rough.material.deforms and layered)
