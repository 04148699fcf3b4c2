r"""Where the frictional power goes: into the lower solid, the upper solid and the sheared contact.

.. math:: \sigma_0 \mu v = \sigma_0 v\,(\mu_2 + \mu_1 + \mu_\mathrm{con}),\qquad
          \mu_j = \frac{1}{\sigma_0}\int d^2q\, S P\, C_j\, q\cos\varphi\,\mathrm{Im}K_j

[the terms of Scaraggi & Persson, arXiv:1506.06955, eq. (A17)]
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from rubberfric.base.blocks import over_points
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.scene import Scene
from rubberfric.scene.shear import shear_friction
from rubberfric.theory.arguments import settled, warn_of_last_iterates
from rubberfric.theory.integrals import prepare, solved

BLOCK = 128  # points evaluated at once


class DissipatedPower(NamedTuple):
    """Results of `dissipated_power`, each of the broadcast shape [W/m^2]."""

    lower: jax.Array  # in the lower solid, by the roughness of the upper one
    upper: jax.Array  # in the upper solid, by the roughness of the lower one
    shear: jax.Array  # in the area of real contact; 0 in a scene without contact shear
    total: jax.Array  # their sum, mu sigma_0 v


def dissipated_power(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
) -> DissipatedPower:
    r"""Power dissipated per nominal area, by where it goes.

    .. math:: p_\mathrm{lower} = v \int d^2q\, S P\, C_2\, q\cos\varphi\,\mathrm{Im}K_2,\qquad
              p_\mathrm{upper} = v \int d^2q\, S P\, C_1\, q\cos\varphi\,\mathrm{Im}K_1,\qquad
              p_\mathrm{shear} = \sigma_0 \mu_\mathrm{con} v

    [the terms of Scaraggi & Persson, eq. (A17)]

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    quadrature : Quadrature, static, or None: that which fits the scene

    Returns
    -------
    DissipatedPower, >= 0 and even in the velocity

    Raises
    ------
    ValueError : as `contact_area`.

    Warns
    -----
    RuntimeWarning : as `solve`, where the temperatures of a heated scene are not a solution.

    Notes
    -----
    Roughness of one solid strains the other periodically, and its own only statically: a solid that
    is rough against a smooth one dissipates nothing. Zero, not computed, for a solid that does not
    relax or faces a smooth one.
    """
    scene, conditions, quadrature = settled(scene, velocity, pressure, temperature, quadrature)
    power, converged = _dissipated_power(scene, *conditions, quadrature=quadrature)
    warn_of_last_iterates(scene, converged, conditions)
    return power


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _dissipated_power(scene, velocity, pressure, temperature, *, quadrature):
    prepared = prepare(scene, ("friction",), quadrature)

    def powers(points):
        velocity, pressure = points[:2]
        temperature = points[2] if len(points) > 2 else None
        results = {solid: jnp.zeros_like(pressure) for solid in ("lower", "upper", "shear")}
        area = jnp.ones_like(pressure)
        if prepared.integrated is not None:
            contact, temperatures = solved(prepared, *points)
            area = contact.area()
            if temperatures is not None:
                temperature = temperatures.surface
                results["converged"] = temperatures.converged
            for j, terms in contact.friction_terms().items():
                results[prepared.roughness.strained[j]] = jnp.sum(terms, (0, 2)) * pressure * velocity
        if scene.shear is not None:
            mu = shear_friction(scene.shear, area, velocity, pressure, temperature)
            results["shear"] = mu * pressure * velocity
        return results

    parts = over_points(powers, (velocity, pressure, temperature), BLOCK)
    converged = parts.pop("converged", None)
    total = parts["lower"] + parts["upper"] + parts["shear"]
    return DissipatedPower(**parts, total=total), converged
