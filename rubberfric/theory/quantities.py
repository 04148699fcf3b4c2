"""The quantities of a sliding scene, and the integrals over its roughness that each of them needs."""

import dataclasses
from collections.abc import Iterable
from typing import NamedTuple

import jax
import numpy as np

from rubberfric.scene.scene import Scene, dissipates, relaxes, rough_surfaces

QUANTITIES = ("area", "friction", "separation")
# Of `solve`, or read from a file.
Values = jax.Array | np.ndarray


class Solution(NamedTuple):
    """Results of `solve`; quantities not asked for are None."""

    area: Values | None = None  # A/A0 [-]
    friction: Values | None = None  # mu, the sum of its two parts below [-]
    separation: Values | None = None  # u_bar [m]
    viscoelastic_friction: Values | None = None  # [-]
    shear_friction: Values | None = None  # mu_con; 0 in a scene without contact shear [-]
    transverse_friction: Values | None = None  # across the sliding; 0 if isotropic [-]
    flash_temperature: Values | None = None  # of the contact, of two deformable solids the mean [K]
    converged: Values | None = None  # whether heated or adhesive contact did, bool


@dataclasses.dataclass(frozen=True)
class RequiredMeans:
    """What is integrated over the roughness; false where the structure of a scene makes it zero."""

    power: bool = False  # <|K|^2>, and so G(q)
    area: bool = False  # P with S in G, where the scene has that
    dissipation: bool = False  # <cos(phi) Im K>
    storage: bool = False  # <Re K>
    transverse: bool = False  # <sin(phi) Im K>

    def __or__(self, other: "RequiredMeans") -> "RequiredMeans":
        pairs = zip(dataclasses.astuple(self), dataclasses.astuple(other), strict=True)
        return RequiredMeans(*(one or two for one, two in pairs))

    @property
    def kinds(self) -> tuple[str, ...]:
        """Which means over the direction of sliding are needed."""
        kinds = ("power", "dissipation", "storage", "transverse")
        return tuple(kind for kind in kinds if getattr(self, kind))

    @property
    def everywhere(self) -> bool:
        """Whether G is needed at every wavevector, not at the largest alone."""
        return self.dissipation or self.storage or self.transverse


_AREA = RequiredMeans(power=True, area=True)
NEEDS = {
    "area": _AREA,
    "separation": RequiredMeans(power=True, storage=True),
    "viscoelastic_friction": _AREA | RequiredMeans(dissipation=True),
    "shear_friction": _AREA,
    "transverse_friction": _AREA | RequiredMeans(transverse=True),
    "flash_temperature": _AREA | RequiredMeans(dissipation=True),
    "converged": _AREA | RequiredMeans(dissipation=True),
}


def parts_of(quantities: Iterable[str]) -> set[str]:
    """The quantities, the friction as its two parts."""
    parts = set(quantities)
    if "friction" in parts:
        parts = parts - {"friction"} | {"viscoelastic_friction", "shear_friction"}
    return parts


def needs_of(scene: Scene, quantities: Iterable[str]) -> RequiredMeans:
    """Return the integrals that quantities of a scene need; none for those that are constant in it."""
    needs = RequiredMeans()
    if not rough_surfaces(scene):
        return needs
    absent = set()
    if scene.shear is None:
        absent.add("shear_friction")
    if not dissipates(scene):
        absent.add("viscoelastic_friction")
    if not has_transverse_force(scene):
        absent.add("transverse_friction")
    for part in parts_of(quantities) - absent:
        needs |= NEEDS[part]
    if needs.power and scene.heating is not None:
        needs |= NEEDS["flash_temperature"]
    if needs.power and scene.adhesion is not None:
        needs |= RequiredMeans(storage=True)
    return needs if dissipates(scene) else dataclasses.replace(needs, dissipation=False)


def quantities_of(scene: Scene) -> tuple[str, ...]:
    """All quantities that say something about a scene: the three, and what its parts add to them."""
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
    """Whether the contact is a fixed point, which may not be reached."""
    return scene.heating is not None or scene.adhesion is not None


def iterated(scene: Scene) -> str:
    """What the fixed point is of, in a word."""
    return "areas" if scene.heating is None else "temperatures"


def has_transverse_force(scene: Scene) -> bool:
    """Whether roughness that differs with the direction strains a viscoelastic solid."""
    return any(spectrum.harmonic_count() and relaxes(other) for spectrum, other in rough_surfaces(scene))
