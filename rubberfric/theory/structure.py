"""Quantities of a scene, its parts, and the means that its quantities need, determined once per trace.

Roughness of one solid strains the other solid periodically, and its own solid only statically
[Scaraggi & Persson, eq. (A6) at omega = q v_j].
"""

import dataclasses
import enum
from collections.abc import Iterable
from typing import Any, NamedTuple

import jax
import numpy as np

from rubberfric.base.checks import ArrayLike
from rubberfric.base.objects.labelled import Labelled, LabelledArrays
from rubberfric.roughness.spectra import BrokenPowerLaw, Spectrum
from rubberfric.scene.body import Body, differs_by_wavevector, relaxes
from rubberfric.scene.scene import Scene, iterates, rough_surfaces, softening_of, temperature_by_scale
from rubberfric.scene.softening import Softened

QUANTITIES = ("area", "friction", "separation")
# Units of the fields of `Solution`.
SOLUTION_UNITS = dict.fromkeys(
    ("area", "friction", "viscoelastic_friction", "shear_friction", "transverse_friction", "converged"), "-"
) | {"separation": "m", "flash_temperature": "K"}
CONDITION_UNITS = {"velocity": "m/s", "pressure": "Pa", "temperature": "K"}
# From `solve`, or read from a file.
Values = jax.Array | np.ndarray


class Solution(NamedTuple):
    """Results of `solve`. Quantities that were not requested are None.

    Examples
    --------
    >>> scene = rf.load_scene("data/sheared_tread_on_asphalt.toml")
    >>> v, p = np.array([1e-4, 1e-2]), 0.15e6
    >>> solution = rf.solve(scene, v, p, quantities=("friction", "shear_friction"))
    >>> (solution.shear_friction / solution.friction).round(3)
    Array([0.918, 0.895], dtype=float64)
    >>> solution.area is None
    True
    >>> list(solution.to_dataframe(v, p))
    ['velocity [m/s]', 'pressure [Pa]', 'friction [-]', 'shear_friction [-]']
    >>> dict(solution.to_xarray(v, p).sizes)
    {'velocity': 2}
    """

    # Any, because a type checker does not know which quantities were requested.
    area: Values | Any = None  # A/A0 [-]
    friction: Values | Any = None  # mu, the sum of its two parts below [-]
    separation: Values | Any = None  # u_bar [m]
    viscoelastic_friction: Values | Any = None  # [-]
    shear_friction: Values | Any = None  # mu_con; 0 in a scene without contact shear [-]
    transverse_friction: Values | Any = None  # across the sliding; 0 if isotropic [-]
    flash_temperature: Values | Any = None  # of the contact, mean of the deformable solids [K]
    converged: Values | Any = None  # bool; True if heated or adhesive contact converged

    def to_dataframe(
        self,
        velocity: ArrayLike | None = None,
        pressure: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
    ) -> Any:
        """Return the quantities as a pandas.DataFrame, a row for each point.

        Parameters
        ----------
        velocity, pressure, temperature : arguments of `solve` [m/s], [Pa], [K]
            They become columns. None leaves them out.

        Raises
        ------
        ImportError : pandas is not installed
        ValueError : the conditions do not broadcast to the quantities
        """
        return self.labelled(velocity, pressure, temperature).to_dataframe()

    def to_xarray(
        self,
        velocity: ArrayLike | None = None,
        pressure: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
    ) -> Any:
        """Return the quantities as an xarray.Dataset whose coordinates are the conditions.

        The arguments are those of `to_dataframe`. An axis along which one condition changes has its name.
        Raise ImportError if xarray is not installed.
        """
        return self.labelled(velocity, pressure, temperature).to_xarray()

    def labelled(
        self,
        velocity: ArrayLike | None = None,
        pressure: ArrayLike | None = None,
        temperature: ArrayLike | None = None,
        axes: tuple[str, ...] | None = None,
    ) -> LabelledArrays:
        """Return the quantities and the conditions with their units. `axes` are names of the axes."""
        conditions = {"velocity": velocity, "pressure": pressure, "temperature": temperature}
        return LabelledArrays(
            {n: Labelled(x, CONDITION_UNITS[n]) for n, x in conditions.items() if x is not None},
            {n: Labelled(x, SOLUTION_UNITS[n]) for n, x in self._asdict().items() if x is not None},
            axes,
        )


def quantity_parts(quantities: Iterable[str]) -> set[str]:
    """Return the set of quantities, with "friction" replaced by its two parts."""
    parts = set(quantities)
    if "friction" in parts:
        parts = parts - {"friction"} | {"viscoelastic_friction", "shear_friction"}
    return parts


def quantities_of(scene: Scene) -> tuple[str, ...]:
    """Return the names of all quantities that a scene has.

    The names are the three basic quantities and the quantities of optional parts of the scene.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> rf.quantities_of(scene)
    ('area', 'friction', 'separation')
    """
    names: list[str] = list(QUANTITIES)
    if scene.shear is not None:
        names += ["viscoelastic_friction", "shear_friction"]
    if has_transverse_force(scene):
        names.append("transverse_friction")
    if temperature_by_scale(scene):
        names.append("flash_temperature")
    if iterates(scene):
        names.append("converged")
    return tuple(names)


def iterated(scene: Scene) -> str:
    """Return the name of the iterated quantity: "temperatures" if they are results, otherwise "areas"."""
    return "temperatures" if temperature_by_scale(scene) else "areas"


def has_transverse_force(scene: Scene) -> bool:
    """Return True if anisotropic roughness strains a viscoelastic solid."""
    return any(spectrum.harmonic_count() and relaxes(other) for spectrum, other in rough_surfaces(scene))


@dataclasses.dataclass(frozen=True)
class RequiredMeans:
    """Means that are integrated over the roughness. A field is False if the mean is not needed or is zero."""

    mean_abs2: bool = False  # <|K|^2>, and so G(q)
    area: bool = False  # P with S in G, if the scene has it
    mean_cos_loss: bool = False  # <cos(phi) Im K>
    mean_storage: bool = False  # <Re K>
    mean_sin_loss: bool = False  # <sin(phi) Im K>

    def __or__(self, other: "RequiredMeans") -> "RequiredMeans":
        both = zip(dataclasses.astuple(self), dataclasses.astuple(other), strict=True)
        return RequiredMeans(*(own or others for own, others in both))

    @property
    def kinds(self) -> tuple[str, ...]:
        """Return the names of the needed means over the direction of sliding."""
        kinds = ("mean_abs2", "mean_cos_loss", "mean_storage", "mean_sin_loss")
        return tuple(kind for kind in kinds if getattr(self, kind))

    @property
    def everywhere(self) -> bool:
        """Return True if G is needed at every wavevector, not only at the largest one."""
        return self.mean_cos_loss or self.mean_storage or self.mean_sin_loss


_AREA = RequiredMeans(mean_abs2=True, area=True)
_LOSS = _AREA | RequiredMeans(mean_cos_loss=True)
_NEEDS = {
    "area": _AREA,
    "separation": RequiredMeans(mean_abs2=True, mean_storage=True),
    "viscoelastic_friction": _LOSS,
    "shear_friction": _AREA,
    "transverse_friction": _AREA | RequiredMeans(mean_sin_loss=True),
    "flash_temperature": _LOSS,
    "converged": _LOSS,
}


class SurfaceTemperatures(NamedTuple):
    """Temperatures of a rough solid and of the solid that it strains [K].

    None stands for the reference temperature. Arrays have the shape (points,), or (panels, points, order) if
    the temperature depends on the wavevector.
    """

    strained: jax.Array | None = None
    rough: jax.Array | None = None


AT_REFERENCE = SurfaceTemperatures()


class MeansInterpolation(enum.Enum):
    """Interpolation of angular means to the contact nodes."""

    NONE = "evaluated at the contact nodes, because they have kinks over q"
    LINEAR = "interpolated between the angular nodes, because they are smooth in ln q"
    LOGARITHMIC = "as LINEAR, but in ln <|F|^2>, because <|F|^2> may rise by 1e9 within an e-fold of q"


class MeansMethod(enum.Enum):
    """Method of the means of F over the direction of sliding."""

    CONSTANT = "F does not depend on the velocity or the temperature"
    CLOSED_FORM = "F is a Prony series facing a rigid solid, and the roughness is isotropic"
    TABLE = "F depends on q v a_T only"
    BY_NODE = "F depends on q and on q v a_T"
    AT_POINTS = "temperature changes F by more than a_T and a common factor"


class RoughSurface(NamedTuple):
    """A rough surface and the solid that it strains."""

    rough: Body
    strained: Body
    side: str  # the strained solid: "lower" or "upper"
    spectrum: Spectrum  # of the rough body
    law: BrokenPowerLaw  # the spectrum, averaged over directions
    softened: Softened | None  # softening of the strained solid
    softened_rough: Softened | None  # softening of the rough solid
    relaxes: bool  # the strained solid is viscoelastic; otherwise nothing depends on the velocity
    harmonics: int  # highest m of cos(2 m phi) in the roughness that strains a viscoelastic solid
    detail: float | None  # finest detail of the angular means over ln q [-]; None for relaxation spectra
    method: MeansMethod
    interpolation: MeansInterpolation | None  # None if the method is CONSTANT

    @property
    def static(self) -> bool:
        """Return True if the stiffness is a constant at every wavevector."""
        return self.method is MeansMethod.CONSTANT

    @property
    def separate_storage_loss(self) -> bool:
        """Return True if softening factors multiply <E'^2> and <E''^2> separately."""
        return self.method is MeansMethod.TABLE and self.softened is not None

    @property
    def soft_solids(self) -> list[Softened]:
        """Return the softening of each solid that softens."""
        return [softening for softening in (self.softened, self.softened_rough) if softening is not None]


@dataclasses.dataclass(frozen=True)
class Structure:
    """Parts of a scene, and the means that the quantities need. A structure contains no numbers."""

    needs: RequiredMeans  # empty for quantities that are constant in the scene
    rough: bool  # True if a surface is rough
    feeds_back: bool  # the temperatures are a fixed point: they follow from a friction that depends on them

    @classmethod
    def of(cls, scene: Scene, quantities: Iterable[str]) -> "Structure":
        """Return the structure of a scene for given quantities, which are fields of `Solution`."""
        facing = ((scene.lower.spectrum, scene.upper), (scene.upper.spectrum, scene.lower))
        strained = [(spectrum, other) for spectrum, other in facing if spectrum is not None]
        relaxing = [spectrum for spectrum, other in strained if relaxes(other)]
        absent = {
            "shear_friction": scene.shear is None,
            "viscoelastic_friction": not relaxing,
            "transverse_friction": not any(spectrum.harmonic_count() for spectrum in relaxing),
        }
        needs = RequiredMeans()
        for part in quantity_parts(quantities) if strained else ():
            needs |= RequiredMeans() if absent.get(part) else _NEEDS[part]
        if needs.mean_abs2 and temperature_by_scale(scene):
            needs |= _LOSS
        if needs.mean_abs2 and scene.adhesion is not None:
            needs |= RequiredMeans(mean_storage=True)
        if not relaxing:
            needs = dataclasses.replace(needs, mean_cos_loss=False)
        shifts = [*scene.lower.shifts, *scene.upper.shifts]
        if scene.heating is None:
            return cls(needs, bool(strained), feeds_back=False)
        if scene.shear is not None and scene.heating.shear_at == "flash":
            shifts += [scene.shear.shift] if scene.shear.shift is not None else []
        return cls(needs, bool(strained), feeds_back=bool(shifts))


def rough_surfaces_of(scene: Scene) -> tuple[RoughSurface, ...]:
    """Return the rough surfaces of a scene. The roughness of the lower solid comes first."""
    sides: list[tuple[Body, Body, str, Spectrum, BrokenPowerLaw]] = []
    for side, rough, strained in (("upper", scene.lower, scene.upper), ("lower", scene.upper, scene.lower)):
        if rough.spectrum is not None:
            sides.append((rough, strained, side, rough.spectrum, rough.spectrum.power_law()))
    laws = tuple(law for *_, law in sides)

    def softened(body):
        softening = softening_of(scene, body)
        return None if softening is None else Softened(softening, laws)

    return tuple(_surface(*parts, softened(parts[1]), softened(parts[0])) for parts in sides)


def means_methods(scene: Scene) -> list[MeansMethod]:
    """Return the `MeansMethod` of every rough surface, in the order of `rough_surfaces_of`."""
    pairs = (scene.lower, scene.upper), (scene.upper, scene.lower)
    softens = {id(body): softening_of(scene, body) is not None for body in (scene.lower, scene.upper)}
    return [
        _method(rough, strained, softens[id(rough)], softens[id(strained)])
        for rough, strained in pairs
        if rough.spectrum is not None
    ]


def _method(rough: Body, strained: Body, rough_softens: bool, strained_softens: bool) -> MeansMethod:
    material, both = strained.material, rough.material.deforms
    # A vertical shift changes one of two deformable solids; the base of a coating may have another shift.
    vertical = any(shift.vertical is not None for body in (rough, strained) for shift in body.shifts)
    if strained.shifts_apart or (both and vertical):
        return MeansMethod.AT_POINTS
    if not relaxes(strained):
        return MeansMethod.CONSTANT
    if differs_by_wavevector(rough, strained) or (both and (rough_softens or strained_softens)):
        return MeansMethod.BY_NODE
    grooved = rough.spectrum is not None and rough.spectrum.harmonic_count()
    if both or grooved or strained_softens or not material.has_series:
        return MeansMethod.TABLE
    return MeansMethod.CLOSED_FORM


def _surface(rough: Body, strained: Body, side, spectrum: Spectrum, law, softened, softened_rough):
    relaxing = relaxes(strained)
    method = _method(rough, strained, softened_rough is not None, softened is not None)
    interpolation = None
    if method is not MeansMethod.CONSTANT:
        softens = softened is not None or softened_rough is not None
        kinked = (rough.material.deforms and softens) or (relaxing and spectrum.harmonics_vary)
        steep = differs_by_wavevector(rough, strained)
        smooth = MeansInterpolation.LOGARITHMIC if steep else MeansInterpolation.LINEAR
        interpolation = MeansInterpolation.NONE if kinked else smooth
    details = [
        material.detail
        for material in (strained.material, strained.below)
        if material is not None and material.relaxes
    ]
    details = [detail for detail in details if detail is not None]
    return RoughSurface(
        rough,
        strained,
        side,
        spectrum,
        law,
        softened,
        softened_rough,
        relaxes=relaxing,
        harmonics=spectrum.harmonic_count() if relaxing else 0,
        detail=min(details) if relaxing and details else None,
        method=method,
        interpolation=interpolation,
    )
