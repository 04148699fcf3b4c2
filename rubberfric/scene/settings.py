r"""Default quadrature of a scene, from a rule that takes microseconds.

Two numbers determine how many nodes give an error of 1e-9. L is the range of the roughness in e-folds, in
which plateaus count twice (there :math:`\sqrt G \sim q^2`). Lambda describes how steeply contact is lost:

.. math:: L = \ln\frac{q_1}{q_0} + \sum_j \ln\frac{q_{rj}}{q_{0j}},\qquad
          \Lambda = \max_j \ln\frac{E_r\,q_{0j}^2 \sqrt{C_{0j}}}{\sigma_0}

with the glassy modulus of the softer solid. P falls from 1 within :math:`\ln(q/q_0) \sim e^{-2\Lambda}`.
Within the limits below, the errors of thousands of random scenes are below 4e-10.
`tests/benchmarks/test_settings_table.py` prints the table of these errors, and
`tests/rubberfric/scene/test_settings.py` tests the limits on other scenes.
"""

import dataclasses
import math

import jax
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import (
    NONNEGATIVE,
    POSITIVE,
    as_leaf,
    as_numbers,
    check_kind,
    check_values,
    is_concrete,
)
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.material import Elastic, Rigid
from rubberfric.materials.prony import Prony
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.roughness.spectra import SelfAffine
from rubberfric.roughness.tabulated import TabulatedSpectrum
from rubberfric.scene.scene import Scene, optional_parts

_ALL = math.inf, -math.inf, math.inf

# (setting, largest L, smallest and largest Lambda) in order of work, for one and for two rough solids.
WITH_SEPARATION = {
    1: (
        (Quadrature(order=13, panels=4, graded=6, ratio=5.0, angular_order=12), 3.0, -1.0, 8.0),
        (Quadrature(order=13, panels=6, graded=6, ratio=5.0, angular_order=12), 8.2, 1.0, 8.0),
        (Quadrature(order=13, panels=8, graded=6, ratio=5.0, angular_order=12), 5.0, -math.inf, 8.0),
        (Quadrature(order=13, panels=12, graded=8, ratio=4.5, angular_order=13), 14.0, -1.0, 14.0),
        (Quadrature(order=13, panels=12, graded=8, ratio=4.5, angular_order=13), 9.0, -math.inf, 14.0),
        (Quadrature(order=13, panels=18, graded=8, ratio=4.5, angular_order=12), 26.0, -math.inf, 14.0),
        (Quadrature(order=14, panels=22, graded=12, ratio=4.5, angular_order=13), *_ALL),
    ),
    2: (
        (Quadrature(order=14, panels=8, graded=8, ratio=4.5, angular_order=12), 6.0, -math.inf, 14.0),
        (Quadrature(order=14, panels=12, graded=8, ratio=4.5, angular_order=13), 11.5, -math.inf, 14.0),
        (Quadrature(order=14, panels=18, graded=8, ratio=4.5, angular_order=14), 26.0, -math.inf, 14.0),
        (Quadrature(order=14, panels=28, graded=12, ratio=4.5, angular_order=14), *_ALL),
    ),
}
# For area and friction only. Near full contact the separation, a millionth of the roughness, needs more
# panels.
WITHOUT_SEPARATION = {
    1: (
        (Quadrature(order=13, panels=4, graded=6, ratio=5.0, angular_order=12), 5.0, -math.inf, 8.0),
        (Quadrature(order=13, panels=6, graded=6, ratio=5.0, angular_order=12), 8.2, 1.0, 8.0),
        (Quadrature(order=13, panels=7, graded=6, ratio=5.0, angular_order=12), 9.0, -math.inf, 8.0),
        (Quadrature(order=13, panels=8, graded=6, ratio=5.0, angular_order=12), 10.5, -math.inf, 8.0),
        (Quadrature(order=13, panels=12, graded=8, ratio=4.5, angular_order=13), 14.0, -math.inf, 14.0),
    ),
    2: (
        (Quadrature(order=13, panels=6, graded=6, ratio=5.0, angular_order=12), 8.0, -math.inf, 8.0),
        (Quadrature(order=13, panels=8, graded=6, ratio=5.0, angular_order=12), 10.5, -math.inf, 8.0),
        (Quadrature(order=14, panels=8, graded=8, ratio=4.5, angular_order=12), 10.0, -math.inf, 14.0),
        (Quadrature(order=13, panels=10, graded=6, ratio=5.0, angular_order=12), 12.5, -math.inf, 8.0),
        (Quadrature(order=14, panels=10, graded=8, ratio=4.5, angular_order=13), 12.5, -math.inf, 14.0),
    ),
}
# For one rough solid with heating. Temperatures need more panels and have errors of 1e-8 in strong feedback.
HEATED = ((Quadrature(order=13, panels=8, graded=6, ratio=5.0, angular_order=12), 8.2, -1.0, 8.0),)
# For parts without measurements, and for traced numbers.
ROBUST = Quadrature()
TRACED = {1: Quadrature(angular_order=12), 2: ROBUST}
# For parts that the rules were not measured for, at any Lambda.
OTHER = Quadrature(order=12, panels=12, angular_order=15), 12.0


# For a tabulated modulus without steps on a rough rigid solid, in rows as in `WITH_SEPARATION`. The detail
# of the table determines the number of panels (`Quadrature.resolving`). They are so narrow that order 8
# suffices.
TABULATED = tuple(
    (Quadrature(order=8, panels=panels, graded=8, ratio=ratio, angular_order=16), longest, -math.inf, largest)
    for panels, ratio, longest, largest in (
        (5, 3.2, 4.0, 8.0),
        (7, 3.2, 5.6, 8.0),
        (9, 3.2, 7.2, 8.0),
        (11, 3.2, 8.8, 10.5),
        (13, 3.2, 12.5, 10.5),
        (17, 4.0, 15.0, 12.5),
    )
)
# With heating only the last. One of a hundred scenes has temperature errors of 1e-8, also with more nodes.
HEATED_TABLES = TABULATED[-1:]
# A step: moduli that rise by more than e^1.5 within three smoothing widths.
STEP = 1.5


class _TracedError(Exception):
    """Internal error: a number is traced, so its value is unknown."""


def default_quadrature(
    scene: Scene, pressure: ArrayLike, *, margin: float = 0.0, separation: bool = True
) -> Quadrature:
    """Return the cheapest setting with errors below 1e-9 for a scene.

    Parameters
    ----------
    scene : Scene
        If the scene has a `quadrature`, this quadrature is returned.
    pressure : [Pa], any shape
    margin : e-folds by which the range of wavevectors and the moduli may grow
    separation : if False, only area and friction must meet 1e-9

    Returns
    -------
    Quadrature. If `jit` or `vmap` traces a number of the scene or the pressure, the setting is made for ten
    decades at any load. (It has an error of 1e-7 for two rough solids with plateaus of nine decades each;
    pass `quadrature` there.) Outside `jit`, a derivative is computed with the same setting as the value. The
    rules were measured for half-spaces of `Rigid`, `Elastic` and `Prony` with `SelfAffine` roughness, and for
    `TabulatedModulus` on a rough rigid solid. Both groups were also measured with heating and roughness of up
    to three decades, and tabulated moduli also with the area correction. Other scenes use some more nodes.
    With contact_model="boundary_elements" errors are below 1e-7 (tabulated moduli: 1e-6).

    Raises
    ------
    ValueError : if `scene` is not a Scene, or if a concrete pressure is <= 0.
    """
    check_kind("scene", scene, Scene)
    pressure = as_numbers("pressure", pressure, POSITIVE)
    return _chosen(scene, pressure, margin, separation) if scene.quadrature is None else scene.quadrature


def _chosen(scene, pressure, margin, separation):
    bodies = scene.lower, scene.upper
    rough = [body.spectrum for body in bodies if body.spectrum is not None]
    if not rough or not all(type(spectrum) in (SelfAffine, TabulatedSpectrum) for spectrum in rough):
        return ROBUST
    plain = all(type(body.material) in (Rigid, Elastic, Prony) and body.layer is None for body in bodies)
    plain = plain and all(type(spectrum) is SelfAffine for spectrum in rough)
    # Numbers that are differentiated outside `jit` are concrete. All at once, because each takes 0.25 ms.
    if not all(is_concrete(x) for x in jax.tree.leaves((scene, pressure))):
        scene, pressure = _stopped((scene, pressure))
    try:
        span, rules = span_of(scene), _rules_of(scene, len(rough), plain, separation, margin)
        if rules:
            flattest, steepest = loads_of(scene, pressure)
            for setting, longest, least, largest in rules:
                if span + margin <= longest and least <= flattest - margin and steepest + margin <= largest:
                    return setting
        return OTHER[0] if span + margin <= OTHER[1] else ROBUST
    except _TracedError:
        return TRACED[len(rough)] if plain else ROBUST


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
    """
    check_kind("scene", scene, Scene)
    if not all(is_concrete(x) for x in jax.tree.leaves((scene, pressure))):
        raise ValueError("scene and pressure: must be concrete numbers; call tuned outside jit and vmap")
    pressure = as_numbers("pressure", pressure, POSITIVE)
    as_leaf("margin", margin, 0)  # only checks that it is a number
    check_values("margin", margin, NONNEGATIVE)
    return dataclasses.replace(scene, quadrature=_chosen(scene, pressure, margin, separation=True))


def _rules_of(scene, rough, plain, separation, margin):
    """Return the rows (setting, largest L, smallest and largest Lambda) for a scene, in order of work."""
    parts = optional_parts(scene)
    bare = parts <= {"shear"}
    if plain and bare:
        return WITH_SEPARATION[rough] if separation else (*WITHOUT_SEPARATION[rough], *WITH_SEPARATION[rough])
    if plain and rough == 1 and parts <= {"shear", "heating"}:
        return HEATED
    if parts <= {"shear", "area_correction", "heating"} and _tabulated_smoothly(scene, margin):
        return HEATED_TABLES if "heating" in parts else TABULATED
    return ()


def span_of(scene: Scene) -> float:
    """Return L, the range of the roughness in e-folds, in which plateaus count twice; 0 if all is smooth."""
    ends, plateaus = [], 0.0
    for body in (scene.lower, scene.upper):
        spectrum = body.spectrum
        if isinstance(spectrum, SelfAffine):
            q0, qr, q1 = (_number(x) for x in (spectrum.q0, spectrum.qr, spectrum.q1))
            ends += [q0, q1]
            plateaus += math.log(qr / q0)
        elif isinstance(spectrum, TabulatedSpectrum):
            q = np.log(_array(spectrum.q))
            rise = np.diff(np.log(_array(spectrum.C)) + 2 * q)
            ends += [math.exp(q[0]), math.exp(q[-1])]
            plateaus += 0.5 * float(np.sum(np.clip(rise, 0.0, 2 * np.diff(q))))
    return math.log(max(ends) / min(ends)) + plateaus if ends else 0.0


def _tabulated_smoothly(scene, margin):
    """Return True if the rules `TABULATED` apply to the solids of a scene."""
    bodies = [body for body in (scene.lower, scene.upper) if body.material.deforms]
    if len(bodies) > 1 or type(bodies[0].material) is not TabulatedModulus or bodies[0].layer is not None:
        return False
    if bodies[0].spectrum is not None:
        return False
    return _rise_of(bodies[0].material) + margin <= STEP


def _rise_of(material):
    """Return the largest change of ln E' or ln E'' of a table within three smoothing widths."""
    x, largest = np.log(_array(material.omega)), 0.0
    for y in (np.log(_array(material.storage)), np.log(_array(material.loss))):
        for widths in (1, 2, 3):
            after = np.interp(x + widths * material.smoothing, x, y)
            largest = max(largest, float(np.max(np.abs(after - y))))
    return largest


def loads_of(scene: Scene, pressure: ArrayLike) -> tuple[float, float]:
    """Return the smallest and the largest Lambda of a scene with isotropic roughness over all pressures."""
    steepest = 0.0
    for body in (scene.lower, scene.upper):
        spectrum = body.spectrum
        if isinstance(spectrum, SelfAffine):
            q0, qr, q1 = (_number(x) for x in (spectrum.q0, spectrum.qr, spectrum.q1))
            # The share of h_rms beyond q_r is smallest for H = 1, which bounds q0^2 sqrt(C0) from above.
            most = math.sqrt(math.pi * (2 - (q0 / qr) ** 2 - (qr / q1) ** 2))
            steepest = max(steepest, _number(spectrum.h_rms) * q0 * (q0 / qr) / most)
        elif isinstance(spectrum, TabulatedSpectrum):
            # The largest value at or after its beginning.
            steepest = max(steepest, float(np.max(_array(spectrum.q) ** 2 * np.sqrt(_array(spectrum.C)))))
    moduli = [_glassy(body.material) for body in (scene.lower, scene.upper) if body.material.deforms]
    stress = steepest * min(moduli)
    if stress == 0:
        return -math.inf, -math.inf
    log_pressure = np.log(_array(pressure))
    low, high = np.min(log_pressure, initial=math.inf), np.max(log_pressure, initial=-math.inf)
    return math.log(stress) - float(high), math.log(stress) - float(low)


def _glassy(material):
    """Return E_r at infinite frequency [Pa]."""
    if isinstance(material, Prony):
        modulus = _number(material.E_inf) + float(np.sum(_array(material.E)))
    elif isinstance(material, TabulatedModulus):
        modulus = float(np.max(_array(material.storage)))
    else:
        modulus = _number(material.young)
    return modulus / (1 - _number(material.poisson) ** 2)


def _number(value):
    return value if isinstance(value, float) else float(_array(value))


def _array(value):
    if not is_concrete(value):
        raise _TracedError
    return np.asarray(value)


_stopped = jax.jit(jax.lax.stop_gradient)
