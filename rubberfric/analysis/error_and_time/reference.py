r"""How far off results are: values and gradients against a reference that validates itself.

The reference is the model itself, refined far beyond use, twice and differently: where two
refinements that share no node agree, either is right to about their difference. What all settings
share no refinement can see: the functions of partial contact are tables, good to 1e-11.

Gradients are compared as relative sensitivities, theta dQ / d theta, of a quantity at a point with
respect to every number of the scene, the velocity, the pressure and the temperature:

.. math:: \max_\theta |\theta\,\partial_\theta Q - (\theta\,\partial_\theta Q)_\mathrm{ref}| \Big/
          \max_\theta |(\theta\,\partial_\theta Q)_\mathrm{ref}|
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.stages import Compiled
from jax.typing import ArrayLike

from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.moments import moment
from rubberfric.scene.scene import Scene, cast, rough_surfaces
from rubberfric.theory.model import solve
from rubberfric.theory.quantities import QUANTITIES

REFINED = (
    Quadrature(order=16, panels=40, graded=20, ratio=3.0, angular_order=18, heat=320),
    Quadrature(order=20, panels=24, graded=12, ratio=4.0, angular_order=24, heat=240),
)

# An error is only searched for where the refinements agree to this part of it.
TRUSTED = 0.1

# Points at which gradients are compared. With a tabulated modulus each costs an angular table.
_GRADIENTS, _GRADIENTS_TABULATED = 30, 6

# In full contact the separation is 1e-100 of the roughness and a derivative 1e-100 of its quantity:
# what is below this part of them counts as zero.
_NEGLIGIBLE = 1e-6


Conditions = tuple[jax.Array, ...]  # velocity, pressure(, temperature), each of shape (points,)


class Case(NamedTuple):
    """A scene and where it is computed, in double precision."""

    scene: Scene
    conditions: Conditions
    differentiated: np.ndarray  # indices of the points whose gradients are compared
    height: float  # rms height of all roughness [m]


class Outcome(NamedTuple):
    """What one setting gave."""

    values: np.ndarray  # (quantities, points)
    sensitivities: np.ndarray | None = None  # theta dQ / d theta, (quantities, chosen points, numbers)


class Errors(NamedTuple):
    """Largest relative errors over the points; of a gradient None where there is none."""

    area: float
    friction: float
    separation: float
    area_gradient: float | None = None
    friction_gradient: float | None = None
    separation_gradient: float | None = None

    @property
    def value(self) -> float:
        """The largest error of area, friction and separation."""
        return max(self[:3])

    @property
    def gradient(self) -> float | None:
        """The largest error of their gradients, None where there is none."""
        slopes = [error for error in self[3:] if error is not None]
        return max(slopes) if len(slopes) == 3 else None

    @property
    def worst(self) -> float:
        """The largest error of all that there is."""
        return max(error for error in self if error is not None)


class Reference(NamedTuple):
    """What to compare with."""

    compiled: Compiled  # the first refinement's function, for other inputs
    exact: Outcome
    agreement: Errors  # of the two refinements


def case_of(
    scene: Scene, velocity: ArrayLike, pressure: ArrayLike, temperature: ArrayLike | None = None
) -> Case:
    """The case in double precision; ValueError as `solve` raises it, or if JAX has no double precision."""
    if jnp.result_type(float) != jnp.float64:
        raise ValueError(
            "errors are measured against float64, which is switched off; "
            'write jax.config.update("jax_enable_x64", True) first'
        )
    solve(scene, velocity, pressure, temperature, quantities=())  # checks its arguments, computes nothing
    given = [np.asarray(x, float) for x in (velocity, pressure, temperature) if x is not None]
    conditions = tuple(jnp.asarray(x.ravel()) for x in np.broadcast_arrays(*given))
    tabulated = any(body.material.needs_quadrature for body in (scene.lower, scene.upper))
    count = min(conditions[0].size, _GRADIENTS_TABULATED if tabulated else _GRADIENTS)
    if conditions[0].size == 0:
        raise ValueError("velocity, pressure and temperature have no point in common: must have at least one")
    differentiated = np.unique(np.linspace(0, conditions[0].size - 1, count).round().astype(int))
    height2 = sum(float(moment(spectrum, 0)) for spectrum, _ in rough_surfaces(scene))
    return Case(cast(scene, jnp.float64), conditions, differentiated, height2**0.5)


def rounded(case: Case) -> Case:
    """The same case after rounding every number to single precision."""
    scene, conditions = cast(cast((case.scene, case.conditions), jnp.float32), jnp.float64)
    return case._replace(scene=scene, conditions=conditions)


def refused(case: Case) -> str:
    """Why single precision cannot hold the scene: the error that `solve` raises, "" if it can."""
    (scene, conditions), _ = arguments(case, jnp.float32)
    try:
        solve(scene, *conditions, quantities=())
    except ValueError as error:
        return str(error)
    return ""


def forward_of(quadrature: Quadrature) -> Callable[[Scene, Conditions], jax.Array]:
    """Function (scene, conditions) -> values, (quantities, points)."""

    def forward(scene: Scene, conditions: Conditions) -> jax.Array:
        solution = solve(scene, *conditions, quadrature=quadrature)
        return jnp.stack([getattr(solution, name) for name in QUANTITIES])

    return forward


def gradient_of(quadrature: Quadrature) -> Callable[[Scene, Conditions, jax.Array], tuple[jax.Array, Any]]:
    """Function (scene, conditions, weight) -> values, and the gradient of their weighted sum."""

    def gradient(scene: Scene, conditions: Conditions, weight: jax.Array) -> tuple[jax.Array, Any]:
        values, pull = jax.vjp(forward_of(quadrature), scene, conditions)
        return values, pull(weight)

    return gradient


def compiled(function: Callable[..., Any], *arguments: Any) -> tuple[Compiled, float]:
    """A function compiled for arguments, and how long that took [s]."""
    begin = time.perf_counter()
    ready = jax.jit(function).lower(*arguments).compile()
    return ready, time.perf_counter() - begin


def arguments(case: Case, dtype: type) -> tuple[tuple[Scene, Conditions], jax.Array]:
    """(scene, conditions) and a weight of one for every value, in one dtype."""
    scene, conditions = cast((case.scene, case.conditions), dtype)
    return (scene, conditions), jnp.ones((len(QUANTITIES), conditions[0].size), dtype)


def outcome(gradient: Compiled, case: Case, dtype: type = jnp.float64) -> Outcome:
    """What a compiled `gradient_of` gives: values and sensitivities."""
    at, ones = arguments(case, dtype)
    numbers = [np.asarray(leaf, float) for leaf in jax.tree_util.tree_leaves(at)]
    values, sensitivities = np.empty(0), []
    for quantity, point in np.ndindex(len(QUANTITIES), case.differentiated.size):
        weight = np.zeros_like(ones)
        weight[quantity, case.differentiated[point]] = 1.0
        values, slopes = gradient(*at, jnp.asarray(weight))
        slopes = [np.asarray(slope, float) for slope in jax.tree_util.tree_leaves(slopes)]
        products = [(x * slope).ravel() for x, slope in zip(numbers, slopes, strict=True)]
        sensitivities.append(np.concatenate(products))
    shape = (len(QUANTITIES), case.differentiated.size, -1)
    return Outcome(np.asarray(values, float), np.reshape(sensitivities, shape))


def measured(case: Case, quadrature: Quadrature, gradients: bool = True) -> tuple[Outcome, Compiled]:
    """What a setting gives in double precision, and the compiled function that gave it.

    Without gradients values alone: sensitivities are None.
    """
    at, ones = arguments(case, jnp.float64)
    if gradients:
        function, _ = compiled(gradient_of(quadrature), *at, ones)
        return outcome(function, case), function
    function, _ = compiled(forward_of(quadrature), *at)
    return Outcome(np.asarray(function(*at))), function


def reference(case: Case, gradients: bool = True) -> Reference:
    """Reference of a case, from the two refinements."""
    (exact, function), (other, _) = (measured(case, quadrature, gradients) for quadrature in REFINED)
    return Reference(function, exact, compare(other, exact, case))


def compare(found: Outcome, exact: Outcome, case: Case) -> Errors:
    """Errors of one outcome against another: of the values alone if `found` has no sensitivities."""
    scale = np.abs(exact.values)
    scale[QUANTITIES.index("separation")] += _NEGLIGIBLE * case.height
    worst = _relative(np.abs(found.values - exact.values), scale)
    if found.sensitivities is None or exact.sensitivities is None:
        return Errors(*worst)
    difference = np.max(np.abs(found.sensitivities - exact.sensitivities), -1)
    largest = np.max(np.abs(exact.sensitivities), -1) + _NEGLIGIBLE * scale[:, case.differentiated]
    return Errors(*worst, *_relative(difference, largest))


def _relative(difference: np.ndarray, scale: np.ndarray) -> list[float]:
    """Largest ratios over the last axis; 0/0 = 0, and what is not finite is infinitely wrong."""
    ratio = difference / np.where(scale > 0, scale, 1.0)
    ratio = np.where((scale > 0) | (difference == 0), ratio, np.inf)
    return [float(x) for x in np.max(np.where(np.isfinite(ratio), ratio, np.inf), -1)]
