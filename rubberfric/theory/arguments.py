"""Validate and cast arguments; refuse scenes beyond single precision; warn about unconverged points.

Scenes within the limits of single precision, tested on extreme scenes, have errors below 1e-5 in float32.
Values that are known only at run time (under jit) are not checked.
"""

import math
import operator
from collections.abc import Iterable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.blocks import broadcast_shape
from rubberfric.base.checks import (
    FINITE,
    POSITIVE,
    ArrayLike,
    Rule,
    as_arguments,
    as_numbers,
    check_kind,
    check_values,
    is_concrete,
    shape_of,
    warn_caller,
)
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.shifts import largest_log_factor
from rubberfric.scene.plausible import warn_of_conditions
from rubberfric.scene.scene import (
    Scene,
    check_background,
    iterates,
    result_dtype,
    shifts,
    takes_temperature,
    temperature_by_scale,
)
from rubberfric.scene.settings import ROBUST, default_quadrature
from rubberfric.theory.structure import MeansMethod, Values, iterated, means_methods

# Rule for the velocity of solids that are both rough with correlated heights.
AT_REST: Rule = (
    "must be 0, because correlated roughness is possible between solids at rest only",
    lambda v: v == 0,
)

# Smallest pressure and largest velocity for each dtype. Below this pressure, the square of modulus / pressure
# in G overflows. Above this velocity, the squares of omega tau overflow.
_LIMITS: dict[np.dtype, tuple[Rule, Rule]] = {
    np.dtype("float64"): (
        ("must be >= 1e-100 Pa", lambda p: p >= np.float64(1e-100)),
        ("must be between -1e100 and 1e100 m/s", lambda v: np.abs(v) <= np.float64(1e100)),
    ),
    np.dtype("float32"): (
        ("must be >= 1e-7 Pa in float32; use float64", lambda p: p >= 1e-7),
        ("must be between -1e15 and 1e15 m/s in float32; use float64", lambda v: np.abs(v) <= 1e15),
    ),
}


def validate(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None,
    quadrature: Quadrature | None,
    separation: bool = True,
) -> tuple[Scene, tuple[jax.Array, jax.Array, jax.Array | None], Quadrature]:
    """Return the scene and the conditions from `checked_arguments`, and the quadrature.

    If `quadrature` is None, `default_quadrature` chooses the quadrature.
    """
    setting = ROBUST if quadrature is None else quadrature
    ready, conditions = checked_arguments(scene, velocity, pressure, temperature, setting)
    if quadrature is None:
        setting = default_quadrature(scene, pressure, separation=separation)
    return ready, conditions, setting


def checked_arguments(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None,
    quadrature: Quadrature,
) -> tuple[Scene, tuple[jax.Array, jax.Array, jax.Array | None]]:
    """Return the scene and (velocity, pressure, temperature) as arrays of one dtype.

    A ValueError is raised if an argument is invalid.
    """
    check_kinds(scene, quadrature)
    velocity = as_numbers("velocity", velocity, FINITE)
    pressure = as_numbers("pressure", pressure, POSITIVE)
    if scene.correlation is not None:
        check_values("velocity", velocity, AT_REST)
    if temperature is not None:
        temperature = as_numbers("temperature", temperature, POSITIVE)
        _check_temperature(scene, temperature)
    else:
        check_background(scene)

    warn_of_conditions(velocity=velocity, pressure=pressure, temperature=temperature)
    broadcast_shape(velocity=velocity, pressure=pressure, temperature=temperature)

    dtype = result_dtype(scene, velocity, pressure, temperature)
    lightest, fastest = _LIMITS[dtype]
    check_values("pressure", pressure, lightest)
    check_values("velocity", velocity, fastest)
    # None has no leaves and is unchanged.
    scene, conditions = as_arguments((scene, (velocity, pressure, temperature)), dtype)
    if dtype == jnp.float32:
        check_single(scene, conditions[2])
    return scene, conditions


def check_kinds(scene: object, quadrature: object) -> None:
    """Raise ValueError unless `scene` is a Scene and `quadrature` is a Quadrature."""
    check_kind("scene", scene, Scene)
    check_kind("quadrature", quadrature, Quadrature)


def check_quantities(scene: Scene, quantities: Iterable[str]) -> None:
    """Raise ValueError if a scene has no "flash_temperature" or "converged", and it is one of the quantities.

    "flash_temperature" requires heating. "converged" requires heating or another iteration (`iterates`).
    """
    absent = {"flash_temperature"} if iterates(scene) else {"flash_temperature", "converged"}
    if not temperature_by_scale(scene) and absent & set(quantities):
        raise ValueError("quantities has 'flash_temperature' or 'converged': the scene must have heating")


# Spans of ln(v a_T) are rounded up to multiples of this, so that few functions are compiled.
_SPAN_STEP = 6.0


def span_of_speeds(scene: Scene, velocity: ArrayLike, temperature: ArrayLike | None) -> float | None:
    """Return a bound of the largest minus the smallest ln(v a_T) of the points.

    The result is None if the span is unknown, infinite or not needed. It is needed if F depends on the
    wavevector.
    """
    if MeansMethod.BY_NODE not in means_methods(scene) or not is_concrete(velocity):
        return None
    if temperature is not None and math.prod(shape_of(temperature)) > 1:
        return None
    speeds = np.abs(np.asarray(velocity, float))
    if speeds.size == 0 or not speeds.all():
        return None
    return _SPAN_STEP * math.ceil(float(np.ptp(np.log(speeds))) / _SPAN_STEP)


# Rules for velocity, pressure and temperature.
_UNITS = ("v", "m/s"), ("p", "Pa"), ("T", "K")


def warn_of_last_iterates(
    scene: Scene, converged: Values | None, conditions: Sequence[jax.Array | None]
) -> None:
    """Warn about points where the temperatures, or with adhesion the areas, did not converge.

    converged : True where the iteration converged, in the broadcast shape of the conditions. There is no
        warning if `converged` is None or traced.
    """
    if converged is None or not is_concrete(converged) or np.all(converged):
        return
    left = ~np.asarray(converged)
    conditions_with_units = [(x, *unit) for x, unit in zip(conditions, _UNITS, strict=True) if x is not None]
    columns = [
        [f"{symbol} = {x:g} {unit}" for x in np.broadcast_to(np.asarray(values), left.shape)[left][:3]]
        for values, symbol, unit in conditions_with_units
    ]
    named = [", ".join(point) for point in zip(*columns, strict=True)]
    warn_caller(
        f"the {iterated(scene)} did not converge at {left.sum()} of {left.size} points, at {'; '.join(named)}"
        f"{' and others' if left.sum() > len(named) else ''}: their values are the last iterate",
        RuntimeWarning,
    )


def _check_temperature(scene, temperature):
    if not takes_temperature(scene):
        raise ValueError("temperature is given, but nothing in the scene has a shift: it must be None")
    for shift in shifts(scene):
        shift.check_temperature(temperature)


def check_single(scene: Scene, temperature: ArrayLike | None) -> None:
    """Raise ValueError naming a number of a float32 scene that requires float64."""
    spectra = [solid.spectrum for solid in (scene.lower, scene.upper) if solid.spectrum is not None]
    for name in ("lower", "upper"):
        body = getattr(scene, name)
        if body.spectrum is not None:
            _check_table(f"{name}.spectrum.C", body.spectrum.entries())
        if body.material.deforms:
            body.check_single(name, [spectrum.power_law().q[0] for spectrum in spectra])
    if _two_deform(scene) and all(body.material.is_liquid() for body in (scene.lower, scene.upper)):
        raise ValueError(
            "lower.material and upper.material are liquids, with an E_inf or G_inf of 0: one must be > 0 "
            "in float32; use float64"
        )
    if temperature is not None:
        for name in ("lower.material", "upper.material", "lower.layer", "upper.layer", "shear"):
            shift = getattr(operator.attrgetter(name)(scene), "shift", None)
            if shift is not None:
                _check_shift(name, shift, temperature)


def _two_deform(scene):
    return scene.lower.material.deforms and scene.upper.material.deforms


def _check_table(name, C):
    smallest = float(jnp.finfo(jnp.float32).tiny)
    if C is not None and is_concrete(C) and np.min(np.asarray(C)) < smallest:
        raise ValueError(
            f"{name} has values below {smallest:.2g} m^4, the smallest number of float32; use float64"
        )


def _check_shift(name, shift, temperature):
    log_factor = shift.log_factor(temperature)
    limit = largest_log_factor(log_factor.dtype)
    if not is_concrete(log_factor):
        return
    saturated = np.abs(np.asarray(log_factor)) >= limit
    if saturated.any():
        T = np.broadcast_to(np.asarray(temperature), saturated.shape)[saturated].flat[0]
        raise ValueError(
            f"temperature = {float(T):g} K: ln a_T of {name}.shift must be within {limit:.3g} in float32; "
            "use float64"
        )
