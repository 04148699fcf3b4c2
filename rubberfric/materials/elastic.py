"""Solids without relaxation: rigid and elastic."""

from typing import ClassVar

import jax.numpy as jnp
from jax.typing import ArrayLike

from rubberfric.base.checks import PLAUSIBLE_STRESS, POSITIVE
from rubberfric.base.objects.fields import Number, leaf
from rubberfric.base.objects.physical import physical
from rubberfric.materials.material import POISSON, Coatable, Material, Series, plane_strain_factor


@physical
class Rigid(Material):
    """Rigid solid: the compliance M is 0."""

    deforms: ClassVar[bool] = False
    relaxes: ClassVar[bool] = False


@physical
class Elastic(Coatable):
    """Elastic solid, E(omega) = young.

    Parameters
    ----------
    young : Young's modulus [Pa], > 0
    poisson : Poisson's ratio [-], 0 ... 0.5
    """

    relaxes: ClassVar[bool] = False

    young: Number = leaf(POSITIVE, unit="Pa", plausible=PLAUSIBLE_STRESS)
    poisson: Number = leaf(POISSON, unit="-")

    def reduced_series(self, scale: ArrayLike) -> Series:
        """Return E_r divided by `scale` [Pa] as a Prony series without terms."""
        nothing = jnp.zeros(0, jnp.result_type(self.young))
        return Series(self.young * (plane_strain_factor(self) / scale), nothing, nothing)
