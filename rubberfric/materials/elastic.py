"""Solids without relaxation: rigid and elastic."""

from typing import ClassVar

import jax.numpy as jnp

from rubberfric.base.checks import POSITIVE
from rubberfric.base.objects import leaf, physical
from rubberfric.materials.material import POISSON, Coatable, Material, Series, plane_strain


@physical
class Rigid(Material):
    """A solid that does not deform: compliance M = 0, and nothing of it is traced."""

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

    young: float = leaf(POSITIVE)
    poisson: float = leaf(POISSON)

    def reduced_series(self, scale):
        """E_r over a scale [Pa], a Prony series of no terms."""
        nothing = jnp.zeros(0, jnp.result_type(self.young))
        return Series(self.young * (plane_strain(self) / scale), nothing, nothing)
