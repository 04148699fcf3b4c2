"""The quantities of a sliding scene."""

from collections.abc import Iterable
from typing import NamedTuple

import jax
import numpy as np

from rubberfric.scene.scene import Scene, relaxes, rough_surfaces

QUANTITIES = ("area", "friction", "separation")
# From `solve`, or read from a file.
Values = jax.Array | np.ndarray


class Solution(NamedTuple):
    """Results of `solve`. Quantities that were not requested are None."""

    area: Values | None = None  # A/A0 [-]
    friction: Values | None = None  # mu, the sum of its two parts below [-]
    separation: Values | None = None  # u_bar [m]
    viscoelastic_friction: Values | None = None  # [-]
    shear_friction: Values | None = None  # mu_con; 0 in a scene without contact shear [-]
    transverse_friction: Values | None = None  # across the sliding; 0 if isotropic [-]
    flash_temperature: Values | None = None  # of the contact, mean of the deformable solids [K]
    converged: Values | None = None  # bool; True if heated or adhesive contact converged


def quantity_parts(quantities: Iterable[str]) -> set[str]:
    """Return the set of quantities, with "friction" replaced by its two parts."""
    parts = set(quantities)
    if "friction" in parts:
        parts = parts - {"friction"} | {"viscoelastic_friction", "shear_friction"}
    return parts


def quantities_of(scene: Scene) -> tuple[str, ...]:
    """Return the names of all quantities that a scene has.

    The names are the three basic quantities and the quantities of optional parts of the scene.
    """
    names: list[str] = list(QUANTITIES)
    if scene.shear is not None:
        names += ["viscoelastic_friction", "shear_friction"]
    if has_transverse_force(scene):
        names.append("transverse_friction")
    if scene.heating is not None:
        names.append("flash_temperature")
    if iterates(scene):
        names.append("converged")
    return tuple(names)


def iterates(scene: Scene) -> bool:
    """Return True if the contact is found by an iteration, which may fail to converge."""
    return scene.heating is not None or scene.adhesion is not None or scene.contact_model != "paper"


def iterated(scene: Scene) -> str:
    """Return the name of the iterated quantity: "temperatures" in a heated scene, otherwise "areas"."""
    return "areas" if scene.heating is None else "temperatures"


def has_transverse_force(scene: Scene) -> bool:
    """Return True if anisotropic roughness strains a viscoelastic solid."""
    return any(spectrum.harmonic_count() and relaxes(other) for spectrum, other in rough_surfaces(scene))
