r"""Maps that collapse: without heat, velocity and temperature enter as v a_T alone.

Time-temperature superposition E(omega, T) = E(a_T omega) [Ferry, Viscoelastic Properties of Polymers, 3rd
edition, Wiley 1980, chapter 11] makes of a map over both one curve over v a_T, where all that relaxes in the
scene has one a_T and no b_T. Contact shear, which has a shift of its own, is added to it.
"""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.analysis.maps.chebyshev import summed
from rubberfric.analysis.maps.interpolation import (
    AGREEMENT,
    Interpolant,
    Quantities,
    a_few,
    difference,
    interpolant,
)
from rubberfric.base.process.compiler import quick_jit
from rubberfric.io.results import Conditions, Interpolation, result_shape
from rubberfric.scene.pairs import pairs_of
from rubberfric.scene.scene import Scene
from rubberfric.scene.shear import shear_friction
from rubberfric.theory.quantities import parts_of

# Fewer points of a map are computed at once.
_LEAST = 4096

# Pairs of temperature and velocity whose places in the series are held in memory.
_PAIRS = 2**20

# Quantities that change sign with the velocity.
_ODD = ("viscoelastic_friction", "transverse_friction")

# Function of quantities and conditions to what the model says, [temperature, pressure, velocity].
Model = Callable[[tuple[str, ...], Conditions], Quantities]


class Curve(NamedTuple):
    """What all points of a map without heat lie on."""

    scene: Scene
    quantities: tuple[str, ...]  # of the map
    series: Interpolant  # of what depends on v a_T and pressure alone
    interpolation: Interpolation


def curve(scene: Scene, conditions: Conditions, quantities: tuple[str, ...], model: Model) -> Curve | None:
    """The curve of a map; None if it does not collapse, or is no more work than its curve.

    Parameters
    ----------
    scene : Scene
    conditions : of the map
    quantities : fields of `Solution`
    model : `Model` of the scene
    """
    log_speed = log_speeds(scene, conditions)
    names = _on_curve(scene, quantities)
    if log_speed is None or not names or log_speed.size * conditions.pressure.size < _LEAST:
        return None
    one = None if conditions.temperature is None else conditions.temperature[:1]
    moving = np.flatnonzero(conditions.velocity)
    if not moving.size:
        return None
    first = moving[0]
    # v of the nodes is v a_T over the a_T of one temperature, as the map itself has it.
    unshifted = abs(conditions.velocity[first]) / np.exp(log_speed[0, first])

    def evaluate(speed: np.ndarray, pressure: np.ndarray) -> Quantities:
        found = model(names, Conditions(speed * unshifted, pressure, one))
        return {name: values[0] for name, values in found.items()}

    series = interpolant(log_speed, np.log(conditions.pressure), evaluate)
    if series is None:
        return None
    some = Conditions(*(None if x is None else a_few(x) for x in conditions))  # pyright: ignore[reportArgumentType]
    found = Curve(scene, names, series, Interpolation(series.evaluations, 0.0))
    error = difference(whole(found, some), model(names, some))
    if not error <= AGREEMENT:
        return None
    evaluations = series.evaluations + math.prod(result_shape(some))
    return Curve(scene, quantities, series, Interpolation(evaluations, error))


def log_speeds(scene: Scene, conditions: Conditions) -> np.ndarray | None:
    """ln|v a_T|, (temperatures, velocities), -inf at rest; None if temperature or heat change more."""
    if scene.heating is not None:
        return None
    shift = _log_shift(scene, conditions.temperature)
    with np.errstate(divide="ignore"):
        return None if shift is None else np.log(np.abs(conditions.velocity)) + shift[:, None]


def _log_shift(scene, temperature):
    """ln a_T at every temperature, (temperatures,); None if something else changes with it."""
    if temperature is None or temperature.size == 1:
        return np.zeros(1)
    found = _log_factors(scene, temperature)
    if found is None:
        return None
    one, *others = map(np.asarray, found or [np.zeros(temperature.size)])
    return one if all(np.array_equal(other, one) for other in others) else None


@quick_jit()
def _log_factors(scene, temperature):
    """The same of every pair that sliding excites; one program."""
    found = []
    for pair in pairs_of(scene):
        if pair.static:
            continue
        shift = pair.strained.material.shift
        if pair.varies or (shift is not None and shift.vertical is not None):
            return None
        found.append(jnp.zeros(temperature.shape) if shift is None else shift.log_factor(temperature))
    return found


def whole(found: Curve, conditions: Conditions) -> Quantities:
    """The quantities of a map at conditions of it, [temperature, pressure, velocity]."""
    values = {name: np.empty(result_shape(conditions)) for name in found.quantities}
    for T, j, piece in pieces(found, conditions):
        for name, array in piece.items():
            values[name][T, j] = array
    return values


def pieces(found: Curve, conditions: Conditions) -> Iterator[tuple[slice, int, Quantities]]:
    """(temperatures, number of a pressure, quantities (temperatures, velocities) there) of a map."""
    log_speed = log_speeds(found.scene, conditions)
    assert log_speed is not None
    v, T = conditions.velocity, conditions.temperature
    sign, rest = np.sign(v), v == 0
    rows = max(1, _PAIRS // v.size)
    parts = parts_of(found.quantities)
    for begin in range(0, len(log_speed), rows):
        block = slice(begin, min(begin + rows, len(log_speed)))
        cell, place = found.series.places(log_speed[block])
        shear = None
        if "shear_friction" in parts and found.scene.shear is not None:
            shear = np.asarray(_shear(found.scene.shear, v, None if T is None else T[block, None]))
        for j, pressure in enumerate(conditions.pressure):
            values = {}
            for name in found.series.values:
                polynomials, at_rest = found.series.at_pressure(name, float(np.log(pressure)))
                one = summed(polynomials, cell, place)
                one[:, rest] = at_rest
                values[name] = one * sign if name in _ODD else one
            if "shear_friction" in parts:
                values["shear_friction"] = 0.0 if shear is None else shear * values["area"] / pressure
            if "friction" in found.quantities:
                values["friction"] = values["viscoelastic_friction"] + values["shear_friction"]
            yield block, j, {name: values[name] for name in found.quantities}


def _on_curve(scene, quantities):
    """What is interpolated: the parts without the contact shear, and the area if that needs it."""
    parts = parts_of(quantities)
    needed = parts - {"shear_friction"}
    if scene.shear is not None and "shear_friction" in parts:
        needed.add("area")
    return tuple(sorted(needed))


@jax.jit
def _shear(shear, velocity, temperature):
    """Friction of the contact shear at the whole area and 1 Pa, (temperatures, velocities)."""
    one = jnp.ones((), velocity.dtype)
    shape = velocity.shape if temperature is None else (temperature.size, velocity.size)
    found = shear_friction(shear, one, velocity, one, temperature)
    return jnp.broadcast_to(found, (1, *shape) if temperature is None else shape)
