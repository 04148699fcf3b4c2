"""Validate and cast arguments; warn about unconverged points."""

from collections.abc import Iterable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import (
    FINITE,
    POSITIVE,
    Rule,
    as_arguments,
    as_leaf,
    check_values,
    is_concrete,
    warn_caller,
)
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.scene import (
    Scene,
    check_background,
    result_dtype,
    shifts,
    takes_temperature,
    warn_of_conditions,
)
from rubberfric.scene.settings import ROBUST, default_quadrature
from rubberfric.scene.single_precision import check_single
from rubberfric.theory.quantities import Values, iterated, iterates

AT_REST: Rule = (
    "must be 0, because correlated roughness is possible between solids at rest only",
    lambda v: v == 0,
)


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
    velocity = _condition("velocity", velocity, FINITE)
    pressure = _condition("pressure", pressure, POSITIVE)
    if scene.correlation is not None:
        check_values("velocity", velocity, AT_REST)
    if temperature is not None:
        temperature = _condition("temperature", temperature, POSITIVE)
        _check_temperature(scene, temperature)
    else:
        check_background(scene)

    warn_of_conditions(velocity=velocity, pressure=pressure, temperature=temperature)
    shapes = {"velocity": jnp.shape(velocity), "pressure": jnp.shape(pressure)}
    if temperature is not None:
        shapes["temperature"] = jnp.shape(temperature)
    try:
        jnp.broadcast_shapes(*shapes.values())
    except ValueError:
        shown = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ValueError(f"shapes differ ({shown}): the shapes must broadcast against each other") from None

    dtype = result_dtype(scene, velocity, pressure, temperature)
    # None has no leaves and is unchanged.
    scene, conditions = as_arguments((scene, (velocity, pressure, temperature)), dtype)
    if dtype == jnp.float32:
        check_single(scene, conditions[2])
    return scene, conditions


def check_kinds(scene: object, quadrature: object) -> None:
    """Raise ValueError unless `scene` is a Scene and `quadrature` is a Quadrature."""
    for name, value, cls in (("scene", scene, Scene), ("quadrature", quadrature, Quadrature)):
        if not isinstance(value, cls):
            raise ValueError(f"{name} is a {type(value).__name__}: must be a {cls.__name__}")


def check_heated(scene: Scene, quantities: Iterable[str]) -> None:
    """Raise ValueError if a scene without heating lacks one of the quantities.

    "flash_temperature" requires heating. "converged" requires heating or another iteration (`iterates`).
    """
    absent = {"flash_temperature"} if iterates(scene) else {"flash_temperature", "converged"}
    if scene.heating is None and absent & set(quantities):
        raise ValueError("quantities has 'flash_temperature' or 'converged': the scene must have heating")


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
    given = [(x, *unit) for x, unit in zip(conditions, _UNITS, strict=True) if x is not None]
    columns = [
        [f"{symbol} = {x:g} {unit}" for x in np.broadcast_to(np.asarray(values), left.shape)[left][:3]]
        for values, symbol, unit in given
    ]
    named = [", ".join(point) for point in zip(*columns, strict=True)]
    warn_caller(
        f"the {iterated(scene)} did not converge at {left.sum()} of {left.size} points, at {'; '.join(named)}"
        f"{' and others' if left.sum() > len(named) else ''}: their values are the last iterate",
        RuntimeWarning,
    )


def _condition(name, value, rule):
    if isinstance(value, bool) or not isinstance(value, int | float):
        try:
            ndim = np.ndim(value)
        except ValueError:  # rows of different lengths, which `as_leaf` refuses
            ndim = 1
        value = as_leaf(name, value, ndim)
    check_values(name, value, rule)
    return value


def _check_temperature(scene, temperature):
    if not takes_temperature(scene):
        raise ValueError("temperature is given, but nothing in the scene has a shift: it must be None")
    for shift in shifts(scene):
        shift.check_temperature(temperature)
