r"""Elastic energy of full contact, and whether adhesion matters beside it.

.. math:: \frac{U_\mathrm{el}}{A_0} = \frac12\int d^2q \sum_j C_j\,\mathrm{Re}K_j
          \qquad\Big[= \frac{\pi}{2} E_r\int dq\, q^2 C(q) \text{ of one elastic half-space}\Big]

[Persson and Tosatti, J. Chem. Phys. 115, 5597 (2001), doi:10.1063/1.1398300]. Solids that
come together over all of their roughness store U_el and gain the work of adhesion.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.blocks import over_points
from rubberfric.base.checks import POSITIVE, as_leaf, check_values, is_concrete
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.adhesion import Adhesion
from rubberfric.scene.scene import Scene, rough_surfaces
from rubberfric.theory.arguments import checked
from rubberfric.theory.contributions import total
from rubberfric.theory.integrals import prepare, solved

_DEFAULT = Quadrature()

BLOCK = 64  # points evaluated at once

WORK = 0.05  # of adhesion, of rubber on most clean solids [J/m^2]

# Energy over work beyond which adhesion is nothing or everything: a factor of 30 on either side of 1, as
# works of adhesion are known within a factor of a few.
NOTHING, EVERYTHING = 30.0, 1 / 30


class AdhesionVerdict(NamedTuple):
    """Results of `adhesion_matters`; arrays of the broadcast shape of the conditions."""

    ratio: jax.Array  # elastic energy of full contact over the work of adhesion [-]
    elastic_energy: jax.Array  # of full contact [J/m^2]
    words: str  # what the smallest ratio means

    def __str__(self) -> str:
        """The words."""
        return self.words


def full_contact_energy(
    scene: Scene,
    velocity: ArrayLike = 0.0,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature = _DEFAULT,
) -> jax.Array:
    r"""Elastic energy per nominal area of solids in contact over all of their roughness.

    .. math:: U_\mathrm{el}/A_0 = \frac12\int d^2q \sum_j C_j\,\mathrm{Re}K_j(q v\cos\varphi)

    [Persson and Tosatti, J. Chem. Phys. 115, 5597 (2001)]

    Parameters
    ----------
    scene : Scene; its heating and its adhesion, if any, are left out
    velocity, temperature : array_like, broadcastable [m/s], [K]; at rest 0: the relaxed moduli
    quadrature : Quadrature, static

    Returns
    -------
    array, broadcast shape [J/m^2]; 0 without roughness

    Raises
    ------
    ValueError : as `contact_area`.
    """
    scene = scene.replace(heating=None, adhesion=None)
    scene, (velocity, _, temperature) = checked(scene, velocity, 1.0, temperature, quadrature)
    return _full_contact_energy(scene, velocity, temperature, quadrature=quadrature)


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _full_contact_energy(scene, velocity, temperature, *, quadrature):
    if not rough_surfaces(scene):
        shape = (
            velocity.shape if temperature is None else jnp.broadcast_shapes(velocity.shape, temperature.shape)
        )
        return jnp.zeros(shape, velocity.dtype)
    prepared = prepare(scene, ("separation",), quadrature)

    def energy(points):
        velocity, *temperature = points
        contact, _ = solved(prepared, velocity, jnp.ones_like(velocity), *temperature)
        storage = total(jnp.sum(terms.densities["storage"], (0, 2)) for terms in contact.terms)
        return jnp.broadcast_to(jnp.pi / 2 * prepared.roughness.scale * storage, velocity.shape)

    return over_points(energy, (velocity, temperature), BLOCK)


def adhesion_matters(
    scene: Scene,
    velocity: ArrayLike = 0.0,
    temperature: ArrayLike | None = None,
    *,
    work: ArrayLike | None = None,
    quadrature: Quadrature = _DEFAULT,
) -> AdhesionVerdict:
    r"""Whether adhesion matters in a scene, as a number and in words.

    .. math:: ratio = \frac{U_\mathrm{el}/A_0}{\Delta\gamma}

    Parameters
    ----------
    scene : Scene
    velocity, temperature : as of `full_contact_energy`
    work : of adhesion [J/m^2], > 0, a number; None: that of the scene, 0.05 if it has none
    quadrature : Quadrature, static

    Returns
    -------
    AdhesionVerdict. Above about 30 adhesion cannot pull the solids together and may be left out; below
    about 1/30 it brings full contact without any load; between them it decides how much of the fine
    roughness is in contact. The words are about the smallest ratio of all points.

    Raises
    ------
    ValueError : as `contact_area`; work <= 0; within jit, where no words can be chosen
        (`full_contact_energy` can be traced).

    Notes
    -----
    Tread rubber on asphalt at rest: 1e4. A seal on ground steel: about 1. Silicone on glass: 1e-3 and less.
    """
    if work is None:
        work = WORK if scene.adhesion is None else scene.adhesion.work
    work = as_leaf("work", work, 0)
    check_values("work", work, POSITIVE)
    energy = full_contact_energy(scene, velocity, temperature, quadrature=quadrature)
    if not is_concrete(energy) or not is_concrete(work):
        raise ValueError(
            "adhesion_matters is called within jit: must be outside, full_contact_energy may be in"
        )
    ratio = energy / work
    return AdhesionVerdict(ratio, energy, _words(float(np.min(ratio)), float(np.min(energy)), float(work)))


def _words(ratio, energy, work):
    compared = (
        f"full contact would store {energy:.3g} J/m^2 of elastic energy, {ratio:.3g} times the work of "
        f"adhesion of {work:.3g} J/m^2"
    )
    if ratio >= NOTHING:
        return f"adhesion does not matter: {compared}; leave it out"
    if ratio <= EVERYTHING:
        return f"adhesion is everything: {compared}; the solids pull each other into full contact"
    return f"adhesion matters: {compared}; it decides how much of the fine roughness is in contact"


def adhesion_of(scene: Scene) -> Adhesion:
    """The adhesion of a scene, or ValueError."""
    if scene.adhesion is None:
        raise ValueError("scene.adhesion is None: must be an Adhesion")
    return scene.adhesion
