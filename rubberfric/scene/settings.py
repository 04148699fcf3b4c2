r"""The quadrature that fits a scene, by a rule of its numbers that takes microseconds.

Two numbers say how many nodes meet 1e-9: the range of the roughness in e-folds, plateaus twice (there
:math:`\sqrt G \sim q^2`), and how steeply the contact begins,

.. math:: L = \ln\frac{q_1}{q_0} + \sum_j \ln\frac{q_{rj}}{q_{0j}},\qquad
          \Lambda = \max_j \ln\frac{E_r\,q_{0j}^2 \sqrt{C_{0j}}}{\sigma_0}

with the glassy modulus of the softer solid: P falls from 1 within :math:`\ln(q/q_0) \sim e^{-2\Lambda}`. The
limits below are where errors of thousands of random scenes stay under 4e-10:
`tests/benchmarks/test_settings_table.py` prints the table that they are read from, and
`tests/rubberfric/scene/test_settings.py` tries them on other scenes.
"""

import math

import jax
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import POSITIVE, check_values, is_concrete
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.elastic import Elastic, Rigid
from rubberfric.materials.prony import Prony
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.roughness.spectra import SelfAffine
from rubberfric.roughness.tabulated import TabulatedSpectrum
from rubberfric.scene.scene import Scene, optional_parts

_ALL = math.inf, -math.inf, math.inf

# (setting, largest L, least and largest Lambda), of increasing work, for one rough solid and for two.
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
# Of area and friction alone: near full contact it is the separation, a millionth of the roughness there, that
# wants more panels.
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
# Of one rough solid with heating: temperatures want more panels, and are solved to 1e-8 in strong feedback.
HEATED = ((Quadrature(order=13, panels=8, graded=6, ratio=5.0, angular_order=12), 8.2, -1.0, 8.0),)
# Where nothing else was measured, and where a number is traced.
ROBUST = Quadrature()
TRACED = {1: Quadrature(angular_order=12), 2: ROBUST}
# For parts that the rules were not measured for, whatever Lambda.
OTHER = Quadrature(order=12, panels=12, angular_order=15), 12.0


# For a tabulated modulus without steps on a rough rigid solid, in rows as of `WITH_SEPARATION`. The detail of
# the table sets the number of panels (`Quadrature.resolving`); each is so narrow that order 8 is enough.
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
# With heating the last alone. Temperatures leave one of a hundred scenes 1e-8 off, with more nodes too.
HEATED_TABLES = TABULATED[-1:]
# A step: moduli that rise by more than e^1.5 within three widths of what rounds them.
STEP = 1.5


class _TracedError(Exception):
    """A number is traced."""


def default_quadrature(
    scene: Scene, pressure: ArrayLike, *, margin: float = 0.0, separation: bool = True
) -> Quadrature:
    """The setting of least work, out of a handful, that is good to 1e-9 for a scene.

    Parameters
    ----------
    scene : Scene
    pressure : [Pa], any shape
    margin : how much further the wavevectors may move apart and the moduli grow, in e-folds
    separation : False: only area and friction must be good to 1e-9, as where nothing else is asked for

    Returns
    -------
    Quadrature. One for ten decades at any load where `jit` or `vmap` traces a number of the scene or the
    pressure (two rough solids with plateaus of nine decades each are 1e-7 off with it: give `quadrature`
    there); a derivative outside `jit` has the setting of its value. The rules were measured for
    half-spaces of `Rigid`, `Elastic` and `Prony` with `SelfAffine` roughness, heated ones of three decades
    among them, and of `TabulatedModulus` on a rough rigid solid, also heated and with the area correction;
    other scenes have some nodes more.

    Raises
    ------
    ValueError : no scene; a pressure that is known and not > 0.
    """
    if not isinstance(scene, Scene):
        raise ValueError(f"scene is a {type(scene).__name__}: must be a Scene")
    check_values("pressure", pressure, POSITIVE)
    bodies = scene.lower, scene.upper
    rough = [body.spectrum for body in bodies if body.spectrum is not None]
    if not rough or not all(type(spectrum) in (SelfAffine, TabulatedSpectrum) for spectrum in rough):
        return ROBUST
    plain = all(type(body.material) in (Rigid, Elastic, Prony) and body.layer is None for body in bodies)
    plain = plain and all(type(spectrum) is SelfAffine for spectrum in rough)
    # So numbers that are differentiated outside `jit` are known. At once: each alone takes a quarter of a ms.
    scene, pressure = _without_tangents((scene, pressure))
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


def _rules_of(scene, rough, plain, separation, margin):
    """Settings and their limits that were measured for scenes of these parts, of increasing work."""
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
    """L of a scene whose roughness is `SelfAffine` or `TabulatedSpectrum`; 0 if it is smooth."""
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
    """Whether the solids are those that `TABULATED` is for."""
    bodies = [body for body in (scene.lower, scene.upper) if body.material.deforms]
    if len(bodies) > 1 or type(bodies[0].material) is not TabulatedModulus or bodies[0].layer is not None:
        return False
    if bodies[0].spectrum is not None:
        return False
    return _rise_of(bodies[0].material) + margin <= STEP


def _rise_of(material):
    """Largest change of ln E' and ln E'' of a table within three widths of the rounding."""
    x, largest = np.log(_array(material.omega)), 0.0
    for y in (np.log(_array(material.storage)), np.log(_array(material.loss))):
        for widths in (1, 2, 3):
            after = np.interp(x + widths * material.smoothing, x, y)
            largest = max(largest, float(np.max(np.abs(after - y))))
    return largest


def loads_of(scene: Scene, pressure: ArrayLike) -> tuple[float, float]:
    """Least and largest Lambda of a scene of isotropic roughness on `Elastic`, `Prony`, tabulated solids."""
    steepest = 0.0
    for body in (scene.lower, scene.upper):
        spectrum = body.spectrum
        if isinstance(spectrum, SelfAffine):
            q0, qr, q1 = (_number(x) for x in (spectrum.q0, spectrum.qr, spectrum.q1))
            # Of h_rms the least that lies beyond q_r is that of H = 1: q0^2 sqrt(C0) is this or less.
            most = math.sqrt(math.pi * (2 - (q0 / qr) ** 2 - (qr / q1) ** 2))
            steepest = max(steepest, _number(spectrum.h_rms) * q0 * (q0 / qr) / most)
        elif isinstance(spectrum, TabulatedSpectrum):
            # At its beginning or later: that is more.
            steepest = max(steepest, float(np.max(_array(spectrum.q) ** 2 * np.sqrt(_array(spectrum.C)))))
    moduli = [_glassy(body.material) for body in (scene.lower, scene.upper) if body.material.deforms]
    stress = steepest * min(moduli)
    if stress == 0:
        return -math.inf, -math.inf
    log_pressure = np.log(_array(pressure))
    low, high = np.min(log_pressure, initial=math.inf), np.max(log_pressure, initial=-math.inf)
    return math.log(stress) - float(high), math.log(stress) - float(low)


def _glassy(material):
    """E_r at infinite frequency [Pa]."""
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


def _without_tangents(tree):
    if all(is_concrete(x) for x in jax.tree.leaves(tree)):
        return tree
    return _stopped(tree)


_stopped = jax.jit(jax.lax.stop_gradient)
