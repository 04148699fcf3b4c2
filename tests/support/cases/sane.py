"""Random scenes as sane people make them, many at once: what settings are measured on.

Ranges of 0.1 ... 10 decades with plateaus of any part of them, loads of 1 ... 1e9 Pa, one and two rough
solids, whose spectra lie within ten decades; all numbers spread evenly in their logarithms.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from rubberfric.scene.settings import extent_of

KINDS = ("road", "elastic", "pair")
POINTS = 6  # velocities and loads of a scene
# Quadrature of the expected results.
TIGHT = rf.Quadrature(order=20, panels=48, graded=20, ratio=3.0, angular_order=20)

# Terms of a Prony series, over up to fourteen decades.
_TERMS = 8
# Scenes computed at once. More need more memory.
_CHUNK = 8


def draw(kind, count, seed):
    """(scenes, velocity, pressure): a list, and arrays (count, POINTS)."""
    rng = np.random.default_rng(seed)
    scenes = [_scene(kind, rng) for _ in range(count)]
    velocity = 10 ** rng.uniform(-8, 2, (count, POINTS))
    # Within a decade, as of one use: the lightest and the heaviest load choose the setting.
    pressure = 10 ** (rng.uniform(0.5, 8.5, (count, 1)) + rng.uniform(-0.5, 0.5, (count, POINTS)))
    return scenes, velocity, pressure


def draw_heated(kind, count, seed):
    """Draw a road or an elastic solid with contact shear, and temperatures (count, POINTS).

    Three decades, and loads that leave some contact.
    """
    rng = np.random.default_rng(seed)
    scenes, pressure = [], []
    while len(scenes) < count:
        one, load = _heated(kind, rng), 10 ** (rng.uniform(3, 8) + rng.uniform(-0.5, 0.5, POINTS))
        extent = extent_of(one, load)
        if extent.length <= 8.2 and extent.heaviest >= -1.0 and extent.lightest <= 8.0:
            scenes.append(one)
            pressure.append(load)
    reference = np.array([one.upper.material.shift.T_ref for one in scenes])
    temperature = reference[:, None] + rng.uniform(5, 80, (count, POINTS))
    return scenes, 10 ** rng.uniform(-4, 2, (count, POINTS)), np.array(pressure), temperature


def errors(scenes, velocity, pressure, quadrature, exact=None, temperature=None):
    """Relative errors (scenes, points) against the tight setting, or those values (scenes, 3, points).

    Separations below 1e-6 of the roughness count as zero; in full contact it is 1e-100.
    """
    found = values(scenes, velocity, pressure, quadrature, temperature)
    exact = values(scenes, velocity, pressure, TIGHT, temperature) if exact is None else exact
    scale = np.abs(exact)
    rough = [(scene.lower.spectrum, scene.upper.spectrum) for scene in scenes]
    heights = [np.hypot(*(0.0 if one is None else one.h_rms for one in both)) for both in rough]
    scale[:, 2] += 1e-6 * np.array(heights)[:, None]
    return np.max(np.abs(found - exact) / scale, 1)


def values(scenes, velocity, pressure, quadrature, temperature=None):
    """Area, friction and separation, (scenes, 3, points); NaN where temperatures are not a solution."""
    count = len(scenes)
    padded = -(-count // 64) * 64  # sizes that recur
    index = np.minimum(np.arange(padded), count - 1)
    stacked = jax.tree.map(lambda *x: np.stack(x)[index], *scenes)
    at = velocity, pressure, *(() if temperature is None else (temperature,))
    return np.asarray(_values((stacked, *(x[index] for x in at)), quadrature))[:count]


def _values(calls, quadrature):
    names = "area", "friction", "separation"

    def one(call):
        if call[0].heating is None:
            return jnp.stack(rf.solve(*call, quadrature=quadrature, quantities=names)[:3])
        found = rf.solve(*call, quadrature=quadrature, quantities=(*names, "converged"))
        return jnp.where(found.converged, jnp.stack(found[:3]), jnp.nan)

    return jax.jit(lambda calls: jax.lax.map(one, calls, batch_size=_CHUNK))(calls)


def _scene(kind, rng):
    one = _spectrum(rng)
    if kind == "road":
        return rf.Scene(rf.Body(rf.Rigid(), one), rf.Body(_rubber(rng)))
    if kind == "elastic":
        return rf.Scene(rf.Body(rf.Elastic(10 ** rng.uniform(6, 11), 0.3), one), rf.Body(_rubber(rng)))
    return rf.Scene(rf.Body(_rubber(rng), one), rf.Body(_rubber(rng), _spectrum(rng, one)))


def _heated(kind, rng):
    one = _scene(kind, rng)
    shift = rf.WLF(rng.uniform(6, 20), rng.uniform(40, 200), rng.uniform(240, 320))
    heating = rf.Heating(*10 ** rng.uniform([2.9, 2.7, -1, -4], [3.5, 3.3, 0.5, -1.5]))
    shear = rf.ContactShear(10 ** rng.uniform(5, 7.5), rng.uniform(0.1, 0.5), 10 ** rng.uniform(-6, 0), shift)
    return dataclasses.replace(
        one,
        upper=rf.Body(one.upper.material.replace(shift=shift)),
        heating=heating,
        shear=shear if kind == "elastic" else None,
    )


def _spectrum(rng, other=None):
    begin, decades = rng.uniform(0, 5), 10 ** rng.uniform(-1, 1)
    if other is not None:
        low, high = np.log10(other.q0), np.log10(other.q1)
        begin = low if rng.random() < 0.2 else rng.uniform(max(low - 3, high - 10), high)
        decades = max(0.05, min(decades, min(begin, low) + 10 - begin))
    q0, q1 = 10**begin, 10 ** (begin + decades)
    plateau = rng.choice([0.0, rng.uniform(0, 1), 1.0], p=[0.25, 0.7, 0.05])
    qr = {0.0: q0, 1.0: q1}.get(plateau, min(10 ** (begin + plateau * decades), q1))
    hurst = 0.8 if rng.random() < 0.2 else rng.uniform(0, 1)
    return rf.SelfAffine(q0, max(qr, q0), q1, hurst, 10 ** rng.uniform(-4, 0) / q0)


def _rubber(rng):
    tau = 10 ** np.sort(rng.uniform(-12, 2, _TERMS))[::-1]
    E_inf = 10 ** rng.uniform(5, 7.5)
    E = E_inf * 10 ** np.cumsum(rng.uniform(-0.6, 1.0, _TERMS))
    return rf.Prony(E_inf, E, tau, rng.uniform(0, 0.5))
