"""How far a friction rests on the extrapolation of tabulated moduli."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.scene.scene import Scene
from rubberfric.theory.model import solve


def tabulated_solids(scene: Scene) -> list[str]:
    """Which of "lower" and "upper" have a tabulated modulus."""
    bodies = {"lower": scene.lower, "upper": scene.upper}
    return [name for name, body in bodies.items() if isinstance(body.material, TabulatedModulus)]


def friction_outside_table(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
    compiler_options: Mapping[str, bool | int | float | str] | None = None,
) -> jax.Array:
    r"""Share of the viscoelastic friction that comes from frequencies outside the tabulated moduli.

    .. math:: 1 - \mu_\mathrm{none} / \mu

    with :math:`\mu` the viscoelastic friction, without contact shear, and
    :math:`\mu_\mathrm{none}` the same when E'' is zero outside the tables
    (`TabulatedModulus.outside` = "none"). Near 1, the result says more about the
    extrapolation than about the material.

    Parameters
    ----------
    scene : Scene with at least one TabulatedModulus
    velocity, pressure, temperature, quadrature : as for `friction`
    compiler_options : as for `solve`

    Returns
    -------
    array, broadcast shape [-]; 0 where there is no viscoelastic friction

    Raises
    ------
    ValueError : as `contact_area`, or a scene without a tabulated modulus.
    """
    tabulated = tabulated_solids(scene)
    if not tabulated:
        raise ValueError("scene: no material is a TabulatedModulus; one must be")
    cut = scene.replace({f"{solid}.material.outside": "none" for solid in tabulated})
    conditions = (velocity, pressure, temperature)
    part = "viscoelastic_friction"
    options = {"quadrature": quadrature, "quantities": (part,), "compiler_options": compiler_options}
    return _share_beyond(*(getattr(solve(s, *conditions, **options), part) for s in (scene, cut)))


@jax.jit
def _share_beyond(whole, inside):
    return jnp.where(whole != 0, 1 - inside / jnp.where(whole != 0, whole, 1.0), 0.0)
