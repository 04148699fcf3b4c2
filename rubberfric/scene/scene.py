"""A scene: two bodies, their interface, and the version of the theory."""

from collections.abc import Sequence
from typing import Any, Literal, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import (
    as_array,
    between,
    check_kind,
    is_concrete,
)
from rubberfric.base.objects.fields import Number, child, leaf, setting, static
from rubberfric.base.objects.physical import (
    PhysicalObject,
    fields_of,
    is_known,
    physical,
)
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.shifts import Shift
from rubberfric.roughness.anisotropy import slope_anisotropy
from rubberfric.roughness.spectra import Spectrum
from rubberfric.scene.body import Body, relaxes
from rubberfric.scene.heating import Heating
from rubberfric.scene.interface import Adhesion, Correlation, ShearLaw
from rubberfric.scene.patch import Patch
from rubberfric.scene.plausible import warn_of_scene
from rubberfric.scene.softening import Softening

_Tree = TypeVar("_Tree")

# Ratio of the stiffness of a slab and of a half-space up to which notebooks/law_table.md confirms the law.
_STIFFEST = 4.0
# Ratio of the rms slopes across and along the grooves up to which that page confirms the law.
_MOST_ANISOTROPIC = 1.9


@physical
class Scene(PhysicalObject):
    """Upper solid (2) sliding over lower solid (1).

    Parameters
    ----------
    lower, upper : Body
    gamma : elastic-energy factor in S = gamma + (1 - gamma) P^2 [-], 0 ... 1, about 1/2
        At gamma = 0 with area_correction and light load, the default quadrature has an error of 4e-8.
        Quadrature(graded=16) removes this error.
    area_correction : bool (static)
        If False, G(q) is computed as in the paper. If True, S also occurs inside G, dG = S dG_plain, as in
        the commercial program. Compared with boundary elements, the area at rest is within 4 to 7 % if True,
        and up to 30 % too small if False. The area in sliding is 8 % too large if True, and 20 % too small if
        False. The friction is closer if True, with an error that depends on velocity
        (notebooks/boundary_elements.md). The separation always uses the plain G, because with S in G the
        ratio of separations at two loads would be 9 % too small instead of 1 %.
    shear : ContactShear, another `ShearLaw`, or None
        shear stress in the contact area; changes only the friction.
    heating : Heating or None
        frictional heating of the deformable solids, with a temperature for each length scale.
    softening : Softening or None
        decrease of E' and E'' of viscoelastic solids with the strain of each length scale; see also Body.
    adhesion : Adhesion or None
        work of adhesion in the contact area, of short or long range.
    correlation : Correlation or None
        correlation of the roughness of both solids, which must be at rest.
    patch : Patch or None
        contact patch of a tyre or a test wheel, for fits to `fitting.SlipData`; changes no friction.
    contact_model : "paper" or "boundary_elements" (static)
        With "boundary_elements", area and friction follow a law that was fitted to boundary elements
        (`rubberfric.theory.area.boundary_elements_law`), for one rough surface. Both solids are half-spaces,
        or one is a `Slab` and the other one is rigid. In test cases with A/A0 > 1 %, 92 to 97 % of the
        friction values and 98 to 99 % of the areas are within 10 % of boundary elements (paper: 19 to 30 %
        and 15 to 22 %). With A/A0 < 1 %, 80 to 100 % of the friction values are. The law is least accurate
        for A/A0 < 0.5 %, q1/qr < 3.5 and hurst > 0.85. Slabs that are over 4 times as stiff as a half-space
        at qr raise an error, and so does anisotropic roughness with rms slopes across the grooves over 1.9
        times the slopes along them. The cases have q1/q0 = 4 ... 512. At q1/q0 = 1e4 on a road, other fits of
        the law give friction that differs by at most 7 % (notebooks/law_table.md). The numerical error is
        below 1e-7 (tabulated moduli: 1e-6). The separation is the paper's.
    quadrature : Quadrature or None (static)
        accuracy setting of calls without a `quadrature`. If None, every call chooses the setting.
        `rubberfric.tuned` chooses the setting for `jit` and `vmap` with the scene as an argument. Files do
        not contain this setting.

    Two rigid bodies raise ValueError, because nothing would deform.

    Examples
    --------
    A smooth rubber on a rigid road. `replace` returns a scene with another value:

    >>> road = rf.Body(rf.Rigid(), rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3))
    >>> rubber = rf.Body(rf.Prony(E_inf=3e6, E=[1e7, 1e8], tau=[1e-3, 1e-5]))
    >>> scene = rf.Scene(lower=road, upper=rubber, area_correction=True)
    >>> rougher = scene.replace("lower.spectrum.h_rms", 1e-3)
    >>> round(float(rf.rms_slope(rougher.lower.spectrum) / rf.rms_slope(scene.lower.spectrum)), 6)
    2.0
    """

    lower: Body = child()
    upper: Body = child()
    gamma: Number = leaf(between(0.0, 1.0), unit="-", default=0.5)
    area_correction: bool = static(default=False)
    shear: ShearLaw | None = child(unnamed="contact_shear", default=None)
    heating: Heating | None = child(default=None)
    softening: Softening | None = child(default=None)
    adhesion: Adhesion | None = child(default=None)
    correlation: Correlation | None = child(default=None)
    patch: Patch | None = child(default=None)
    contact_model: Literal["paper", "boundary_elements"] = static(default="paper")
    quadrature: Quadrature | None = setting(default=None)

    def _check(self):
        if not isinstance(self.quadrature, Quadrature | None):
            raise ValueError(
                f"Scene.quadrature is a {type(self.quadrature).__name__}: must be a Quadrature or None"
            )
        if not (self.lower.material.deforms or self.upper.material.deforms):
            raise ValueError(
                "Scene: lower.material and upper.material are both Rigid; one of the solids must deform"
            )
        if is_known(self):
            warn_of_scene(self)
        parts = optional_parts(self)
        _check_apart("adhesion", ("heating",), parts)
        self._check_correlation(parts)
        if self.contact_model == "boundary_elements":
            self._check_boundary_elements(parts)
        bodies = self.lower, self.upper
        if "softening" not in parts:
            return
        if any(body.spectrum is not None and body.spectrum.harmonic_count() for body in bodies):
            raise ValueError(
                "Scene.softening: not together with anisotropic roughness; one of them must be left out"
            )
        for body in bodies:
            if not body.separable:
                raise ValueError(
                    f"Scene.softening: not together with a {body.geometry}; one of them must be left out"
                )

    def _check_correlation(self, parts):
        if self.correlation is None:
            return
        for name, body in (("lower", self.lower), ("upper", self.upper)):
            if body.spectrum is None:
                raise ValueError(f"Scene.correlation: {name}.spectrum is None; both solids must be rough")
            if body.spectrum.harmonic_count():
                raise ValueError(f"Scene.correlation: {name}.spectrum is anisotropic; must be isotropic")
        _check_apart("correlation", ("heating", "softening"), parts)

    def _check_boundary_elements(self, parts):
        for name in sorted(parts - {"shear", "boundary_elements"}):
            raise ValueError(
                f'Scene.contact_model: "boundary_elements" is not possible together with {name}; '
                'leave one of them out or use "paper"'
            )
        bodies = self.lower, self.upper
        if all(body.spectrum is not None for body in bodies):
            raise ValueError(
                'Scene.contact_model: "boundary_elements" requires one rough surface, got two; use "paper"'
            )
        for name, body, other in (("lower", *bodies), ("upper", *bodies[::-1])):
            if not body.half_space and (other.material.deforms or not body.separable):
                raise ValueError(
                    'Scene.contact_model: "boundary_elements" requires half-spaces, or Slab and Rigid, '
                    f'but {name}.layer is a {body.geometry}; use "paper"'
                )
            if body.spectrum is not None and body.spectrum.harmonics_vary:
                kind = type(body.spectrum).__name__
                raise ValueError(
                    'Scene.contact_model: "boundary_elements" requires the same anisotropy at all '
                    f'wavevectors, but {name}.spectrum is a {kind}; use Anisotropic or "paper"'
                )
        with jax.ensure_compile_time_eval():  # within jit, operations on known numbers would be traced too
            self._check_thickness()
            self._check_anisotropy()

    def _check_anisotropy(self):
        """Refuse anisotropy for which the law disagrees with boundary elements, if the numbers are known."""
        for spectrum, _ in rough_surfaces(self):
            if not all(map(is_concrete, jax.tree.leaves(spectrum))):
                continue
            e = min(float(slope_anisotropy(spectrum)) ** 0.5, 1 - 1e-9)  # few harmonics may give more than 1
            slopes = np.sqrt((1 + e) / (1 - e))
            if slopes > _MOST_ANISOTROPIC * (1 + 1e-6):
                raise ValueError(
                    'Scene.contact_model: "boundary_elements" was tested for roughness with rms slopes '
                    f"across the grooves up to {_MOST_ANISOTROPIC:g} times the slopes along them; here they "
                    f'are {slopes:.3g} times as large. Use a smaller ratio, or "paper"'
                )

    def _check_thickness(self):
        """Refuse slabs for which the law disagrees with boundary elements, if the numbers are known."""
        rough = self.lower if self.lower.spectrum is not None else self.upper
        bodies = self.lower, self.upper
        thin = [body for body in bodies if not body.half_space]
        if not thin or rough.spectrum is None or not all(map(is_concrete, jax.tree.leaves(self))):
            return
        law = rough.spectrum.power_law()
        highest = law.q[jnp.argmax(law.log_value)]  # of q^2 C
        for body in thin:
            stiffer = float(body.S_bar(highest))
            if stiffer > _STIFFEST:
                raise ValueError(
                    f'Scene.contact_model: "boundary_elements" was tested for slabs that are up to '
                    f"{_STIFFEST:g} times as stiff as a half-space at the wavevector of the largest "
                    f"heights, {float(highest):.3g} 1/m; this slab is {stiffer:.3g} times as stiff. "
                    'Use a thicker slab, or "paper"'
                )


def _check_apart(part, others, parts):
    for name in others:
        if part in parts and name in parts:
            raise ValueError(f"Scene.{part}: not together with {name}; one of them must be left out")


def same(scene: Scene, other: Scene) -> bool:
    """Return True if two scenes have the same parts, options and numbers.

    `quadrature` and the dtypes of equal numbers may differ. The operator == returns False for them. Raise
    ValueError if an argument is not a Scene.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> rf.same(scene, scene.replace("gamma", 0.4))
    False
    """
    check_kind("scene", scene, Scene)
    check_kind("other", other, Scene)
    (left, tree), (right, other_tree) = (
        jax.tree.flatten([getattr(compared, name) for name in fields_of(Scene)])
        for compared in (scene, other)
    )
    return tree == other_tree and all(map(np.array_equal, left, right))


def optional_parts(scene: Scene) -> set[str]:
    """Return the names of the optional parts and non-default options that a scene and its bodies have."""
    names = ("shear", "heating", "softening", "adhesion", "correlation")
    present = {name for name in names if getattr(scene, name) is not None}
    if scene.area_correction:
        present.add("area_correction")
    if scene.contact_model != "paper":
        present.add(scene.contact_model)
    if any(body.softening is not None for body in (scene.lower, scene.upper)):
        present.add("softening")
    return present


def shifts(scene: Scene) -> list[Shift]:
    """Return the shifts of both materials, of the bases of coatings and of contact shear.

    Parts without a shift are left out.
    """
    of_shear = getattr(scene.shear, "shift", None)
    return [*scene.lower.shifts, *scene.upper.shifts, *([] if of_shear is None else [of_shear])]


def takes_temperature(scene: Scene) -> bool:
    """Return True if anything in the scene depends on temperature."""
    return temperature_by_scale(scene) or bool(shifts(scene))


def temperature_by_scale(scene: Scene) -> bool:
    """Return True if the solids have a temperature for each length scale, which follows from the friction.

    Otherwise the solids have the temperature of the conditions.
    """
    return scene.heating is not None


def iterates(scene: Scene) -> bool:
    """Return True if the contact is found by an iteration, which may fail to converge."""
    return temperature_by_scale(scene) or scene.adhesion is not None or scene.contact_model != "paper"


def isothermal(scene: Scene) -> Scene:
    """Return a scene whose solids have the temperature of the conditions."""
    return scene.replace(heating=None)


def check_background(scene: Scene, where: str = "", missing: str = "temperature is missing") -> None:
    """Raise ValueError if the scene has heating, which requires a background temperature.

    The message begins with `where` and `missing`.
    """
    if temperature_by_scale(scene):
        raise ValueError(f"{where}{missing}: a scene with heating requires it, far from the contact [K]")


def check_without(scene: Scene, parts: Sequence[str], what: str) -> None:
    """Raise ValueError if `what` is not defined for the contact model or one of the `parts` of a scene."""
    there = optional_parts(scene)
    if scene.contact_model != "paper":
        raise ValueError(
            f'scene.contact_model: {what} is not defined for {scene.contact_model!r}; use "paper"'
        )
    for name in parts:
        if name in there:
            raise ValueError(f"scene.{name}: {what} is not defined with {name}; must be None")


def rough_surfaces(scene: Scene) -> list[tuple[Spectrum, Body]]:
    """Return (spectrum, facing body) for every rough surface, where the lower surface comes first."""
    facing = [(scene.lower.spectrum, scene.upper), (scene.upper.spectrum, scene.lower)]
    return [(spectrum, other) for spectrum, other in facing if spectrum is not None]


def softening_of(scene: Scene, body: Body) -> Softening | None:
    """Return the softening of a body, by default that of the scene; None if the body does not relax."""
    if not relaxes(body):
        return None
    return scene.softening if body.softening is None else body.softening


def dissipates(scene: Scene) -> bool:
    """Return True if roughness excites a viscoelastic solid. Otherwise the viscoelastic friction is 0."""
    return any(relaxes(other) for _, other in rough_surfaces(scene))


def result_dtype(*values: Any) -> jnp.dtype:
    """Return the common floating-point dtype of all leaves.

    Python scalars adapt to the dtype of the other leaves.
    """
    leaves = jax.tree_util.tree_leaves(values)
    with jax.numpy_dtype_promotion("standard"):
        dtype = jnp.result_type(*leaves) if leaves else jnp.result_type(float)
    return dtype if jnp.issubdtype(dtype, jnp.floating) else jnp.result_type(float)


def cast(tree: _Tree, dtype: str | type | np.dtype) -> _Tree:
    """Convert all leaves to strongly typed arrays of one dtype."""
    return jax.tree_util.tree_map(lambda x: as_array(x, dtype), tree)
