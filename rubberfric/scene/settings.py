r"""Default quadrature of a scene, from a rule that takes microseconds.

Three properties of a scene determine how many nodes give an error of 1e-9. L is the range of the roughness in
e-folds, in which rising parts of q^2 C count more (on a plateau :math:`\sqrt G \sim q^2`),

.. math:: L = \ln\frac{q_1}{q_0} + \sum_j \frac12 \int d\ln q\;
          \mathrm{clip}\Big(\frac{d\ln q^2 C_j}{d\ln q}, 0, 2\Big)

Lambda describes how steeply contact is lost where roughness begins, with the glassy modulus E_r of the softer
solid,

.. math:: \Lambda = \max_j \ln\frac{E_r\,q_{0j}^2 \sqrt{C_j(q_{0j})}}{\sigma_0}

(of a table the largest value within the first e-fold; E_r of a slab includes its factor at q0). P falls from
1 within :math:`\ln(q/q_0) \sim e^{-2\Lambda}`. The third property is the finest detail of the moduli over the
frequency. Materials and spectra give these properties by their public methods, so the rule holds for a user's
own ones. `notebooks/benchmarks/settings.py` prints the errors over L and Lambda.
`tests/rubberfric/scene/test_settings_of_random_scenes.py` tests random scenes of all kinds.
"""

import dataclasses
import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import (
    NONNEGATIVE,
    POSITIVE,
    ArrayLike,
    as_leaf,
    as_numbers,
    check_kind,
    check_values,
    is_concrete,
)
from rubberfric.base.compilation import quick_jit
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.body import differs_by_wavevector
from rubberfric.scene.scene import Scene, iterates, rough_surfaces, temperature_by_scale

# Number of panels of the shortest roughness.
_FIRST = 0.75

# Panels per unit of L: an e-fold takes two thirds of a panel of 12 nodes.
_PER_FOLD = 0.65

# Panels per unit of L where F_j depends on q itself. It may fall by 1e9 within an e-fold of a coating.
_PER_FOLD_OF_EACH_Q = 0.85

# Smallest number of panels for the boundary-element law, whose nodes of the circle depend on the panels.
_LEAST_OF_LAW = 12

# Panels per unit of L for a modulus with a finer detail than relaxation spectra have. `Quadrature.resolving`
# adds more.
_PER_FOLD_OF_DETAIL = 1.0

# Factor of these panels in heated scenes, whose temperatures depend on the details at all wavevectors.
_DETAIL_BY_SCALE = 1.5

# Additional panels for two spectra, for layers, and for parts of a scene whose contact is iterated.
_MORE = 1.8

# Additional panels for the separation at heavy loads, where it is a small part of the roughness.
_MORE_FOR_SEPARATION = 3.5

# Lambda above which the separation needs no more panels than the area.
_LIGHT = 6.0

# Width in Lambda of the transition from heavy to light loads.
_TRANSITION = 8.0

# Numbers of panels. The rule rounds up to one of a few, so that similar scenes share a compiled function.
PANELS = (5, 6, 7, 8, 9, 10, 12, 14, 17, 20, 24, 30)

# Numbers of graded panels.
GRADED = (4, 6, 8, 11, 14)

# For scenes whose numbers are traced, and for calls that state no scene: the rule for L = 28 and Lambda = 14.
ROBUST = Quadrature()


class Extent(NamedTuple):
    """Range and loads of a scene, see above."""

    length: float  # L
    heaviest: float  # smallest and largest Lambda over all pressures
    lightest: float


def default_quadrature(
    scene: Scene, pressure: ArrayLike, *, margin: float = 0.0, separation: bool = True
) -> Quadrature:
    """Return a setting with errors below 1e-9 for a scene.

    Parameters
    ----------
    scene : Scene
        If the scene has a `quadrature`, this quadrature is returned.
    pressure : [Pa], any shape
    margin : e-folds by which the range of wavevectors and the moduli may grow
    separation : if False, only area and friction must meet 1e-9

    Returns
    -------
    Quadrature. If `jit` or `vmap` traces a number of the scene or the pressure, it is `Quadrature()`, which
    is made for ten decades of roughness and for loads down to 10 Pa on a road. (It has an error of 1e-7 for
    two rough solids with plateaus of nine decades each; pass `quadrature` there.) Outside `jit`, a derivative
    is computed with the same setting as the value. Tabulated moduli with steps may have errors of 1e-8, and
    of 1e-7 in heated scenes. The temperatures of other heated scenes in strong feedback may have errors of
    1e-8. With contact_model="boundary_elements" errors are below 1e-7 (tabulated moduli: 1e-6).

    Raises
    ------
    ValueError : if `scene` is not a Scene, or if a concrete pressure is <= 0.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> rf.analysis.default_quadrature(scene, 0.15e6).order
    13
    """
    check_kind("scene", scene, Scene)
    pressure = as_numbers("pressure", pressure, POSITIVE)
    return _chosen(scene, pressure, margin, separation) if scene.quadrature is None else scene.quadrature


def _chosen(scene, pressure, margin, separation):
    if not rough_surfaces(scene):
        return ROBUST
    # Numbers that are differentiated outside `jit` are concrete. All at once, because each takes 0.25 ms.
    if not all(is_concrete(x) for x in jax.tree.leaves((scene, pressure))):
        scene, pressure = _stopped((scene, pressure))
        if not all(is_concrete(x) for x in jax.tree.leaves((scene, pressure))):
            return ROBUST
    length, heaviest, lightest = extent_of(scene, pressure)
    return _setting(scene, Extent(length + margin, heaviest - margin, lightest + margin), separation)


def _setting(scene, extent, separation):
    """Return the setting of a scene with the given `Extent`."""
    rough = rough_surfaces(scene)
    bodies = scene.lower, scene.upper
    pairs = [pair for pair in (bodies, bodies[::-1]) if pair[0].spectrum is not None]
    differs = any(differs_by_wavevector(*pair) for pair in pairs)
    materials = [
        material for body in bodies for material in (body.material, body.below) if material is not None
    ]
    detailed = any(material.relaxes and material.detail is not None for material in materials)
    law = scene.contact_model != "paper"
    rate = _PER_FOLD_OF_EACH_Q if differs else _PER_FOLD
    if detailed:
        rate = _PER_FOLD_OF_DETAIL * (_DETAIL_BY_SCALE if temperature_by_scale(scene) else 1.0)
    more = _MORE if len(rough) > 1 or differs or iterates(scene) else 0.0
    if separation:
        share = (_LIGHT - extent.heaviest) / _TRANSITION
        more = max(more, _MORE_FOR_SEPARATION * min(max(share, 0.0), 1.0))
    panels = _FIRST + rate * extent.length + more
    panels = max(panels, _LEAST_OF_LAW) if law else panels
    # The innermost graded panel has a width of about 4.5^(-2 graded), against e^(-2 Lambda); the nodes in it
    # are close to its beginning, so half of it suffices.
    graded = 0.5 * extent.lightest + 0.5
    return Quadrature(
        order=13,
        panels=_round_up(panels, PANELS),
        graded=_round_up(graded, GRADED),
        angular_order=16 if detailed else 15 if law else 12,
    )


def _round_up(value, numbers):
    return next((number for number in numbers if number >= value), numbers[-1])


def tuned(scene: Scene, pressure: ArrayLike, *, margin: float = 0.0) -> Scene:
    """Return a scene with its default quadrature, for functions that take the scene as an argument.

    `jit` and `vmap` trace the numbers of such a scene, and calls would otherwise use a setting for ten
    decades of roughness at any load::

        scene = rf.tuned(scene, 3e5)
        slope = jax.jit(jax.grad(lambda scene: rf.friction(scene, 0.1, 3e5)))(scene)

    Parameters
    ----------
    scene : Scene with concrete numbers
    pressure : all pressures that the scene will be computed at [Pa], any shape
    margin : e-folds >= 0 by which q1/q0, the moduli and the roughness may grow with errors below 1e-9

    Returns
    -------
    Scene with the same numbers and another `quadrature`. Errors grow slowly beyond the margin; tune the scene
    again after large changes.

    Raises
    ------
    ValueError : if `scene` is not a Scene, if a number of the scene or the pressure is traced, if a pressure
        is <= 0, or if the margin is < 0.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> tuned = rf.tuned(scene, 3e5)
    >>> scene.quadrature is None, tuned.quadrature == rf.analysis.default_quadrature(scene, 3e5)
    (True, True)
    """
    check_kind("scene", scene, Scene)
    if not all(is_concrete(x) for x in jax.tree.leaves((scene, pressure))):
        raise ValueError("scene and pressure: must be concrete numbers; call tuned outside jit and vmap")
    pressure = as_numbers("pressure", pressure, POSITIVE)
    as_leaf("margin", margin, 0)  # only checks that it is a number
    check_values("margin", margin, NONNEGATIVE)
    return dataclasses.replace(scene, quadrature=_chosen(scene, pressure, margin, separation=True))


def extent_of(scene: Scene, pressure: ArrayLike) -> Extent:
    """Return the `Extent` of a scene with concrete numbers; the length is 0 if all is smooth."""
    # Also within `jit`, where the operations on concrete numbers would be traced.
    with jax.ensure_compile_time_eval():
        bodies = [body for body in (scene.lower, scene.upper) if body.material.deforms]
        laws, moduli = _evaluated([spectrum for spectrum, _ in rough_surfaces(scene)], bodies)
    if not laws:
        return Extent(0.0, -math.inf, -math.inf)
    ends, rises, stress = [], 0.0, 0.0
    for law, modulus in zip(laws, moduli, strict=True):
        log_q, log_value, exponent = (
            np.asarray(x, float) for x in (np.log(law.q), law.log_value, law.exponent)
        )
        ends += [log_q[0], log_q[-1]]
        rises += 0.5 * float(np.sum(np.clip(exponent, 0.0, 2.0) * np.diff(log_q)))
        first = float(np.max((0.5 * log_value + log_q)[log_q <= log_q[0] + 1.0]))
        stress = max(stress, float(modulus) * math.sqrt(float(law.height2)) * math.exp(min(first, 300.0)))
    log_pressure = np.log(np.asarray(pressure, float))
    loads = -math.inf, -math.inf
    if stress > 0:
        low, high = np.min(log_pressure, initial=math.inf), np.max(log_pressure, initial=-math.inf)
        loads = math.log(stress) - float(high), math.log(stress) - float(low)
    return Extent(max(ends) - min(ends) + rises, *loads)


# Compiled as a whole, so that a call compiles once instead of once per operation.
@quick_jit()
def _evaluated(spectra, bodies):
    """Return the power law of each spectrum, and the glassy modulus of the softer body at its beginning."""
    laws, moduli = [spectrum.power_law() for spectrum in spectra], []
    for law in laws:
        of_bodies = []
        for body in bodies:
            modulus = body.material.glassy_reduced()
            if body.separable and not body.half_space:  # computing S_bar = 1 compiles one more program
                modulus = modulus * body.S_bar(law.q[0])
            of_bodies.append(modulus)
        moduli.append(functools.reduce(jnp.minimum, of_bodies))
    return laws, moduli


_stopped = jax.jit(jax.lax.stop_gradient)
