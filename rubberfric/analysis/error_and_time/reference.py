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
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.moments import moment
from rubberfric.scene.scene import cast, rough_surfaces
from rubberfric.theory.model import solve
from rubberfric.theory.quantities import QUANTITIES

REFINED = (
    Quadrature(order=16, panels=40, graded=20, ratio=3.0, angular_order=18, angle=900, heat=320),
    Quadrature(order=20, panels=24, graded=12, ratio=4.0, angular_order=24, angle=600, heat=240),
)

# An error is only searched for where the refinements agree to this part of it.
TRUSTED = 0.1

# Points at which gradients are compared. With a tabulated modulus each costs an angular table.
_GRADIENTS, _GRADIENTS_TABULATED = 30, 6

# In full contact the separation is 1e-100 of the roughness and a derivative 1e-100 of its quantity:
# what is below this part of them counts as zero.
_NEGLIGIBLE = 1e-6


class Points(NamedTuple):
    """A scene and where it is computed, in double precision."""

    scene: object
    conditions: tuple  # velocity, pressure(, temperature), each of shape (points,)
    chosen: np.ndarray  # indices of the points whose gradients are compared
    height: float  # rms height of all roughness [m]


class Sample(NamedTuple):
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
    def value(self):
        """The largest error of area, friction and separation."""
        return max(self[:3])

    @property
    def gradient(self):
        """The largest error of their gradients, None where there is none."""
        return None if None in self[3:] else max(self[3:])

    @property
    def worst(self):
        """The largest error of all that there is."""
        return max(error for error in self if error is not None)


class Reference(NamedTuple):
    """What to compare with."""

    compiled: object  # the first refinement's function, for other inputs
    exact: Sample
    agreement: Errors  # of the two refinements


def points_of(scene, velocity, pressure, temperature=None):
    """Points in double precision; ValueError as `solve` raises it, or if JAX has no double precision."""
    if jnp.result_type(float) != jnp.float64:
        raise ValueError(
            "errors are measured against float64, which is switched off; "
            'write jax.config.update("jax_enable_x64", True) first'
        )
    solve(scene, velocity, pressure, temperature, quantities=())  # checks its arguments, computes nothing
    given = [np.asarray(x, float) for x in (velocity, pressure, temperature) if x is not None]
    conditions = [x.ravel() for x in np.broadcast_arrays(*given)]
    tabulated = any(body.material.needs_quadrature for body in (scene.lower, scene.upper))
    count = min(conditions[0].size, _GRADIENTS_TABULATED if tabulated else _GRADIENTS)
    if conditions[0].size == 0:
        raise ValueError("velocity, pressure and temperature have no point in common: must have at least one")
    chosen = np.unique(np.linspace(0, conditions[0].size - 1, count).round().astype(int))
    height2 = sum(float(moment(spectrum, 0)) for spectrum, _ in rough_surfaces(scene))
    return Points(*cast((scene, tuple(conditions)), jnp.float64), chosen, height2**0.5)


def rounded(points):
    """The same points after rounding every number to single precision."""
    single = cast((points.scene, points.conditions), jnp.float32)
    return points._replace(**dict(zip(("scene", "conditions"), cast(single, jnp.float64), strict=True)))


def refused(points):
    """Why single precision cannot hold the scene: the error that `solve` raises, "" if it can."""
    (scene, conditions), _ = arguments(points, jnp.float32)
    try:
        solve(scene, *conditions, quantities=())
    except ValueError as error:
        return str(error)
    return ""


def forward_of(quadrature):
    """Function (scene, conditions) -> values, (quantities, points)."""

    def forward(scene, conditions):
        solution = solve(scene, *conditions, quadrature=quadrature)
        return jnp.stack([getattr(solution, name) for name in QUANTITIES])

    return forward


def gradient_of(quadrature):
    """Function (scene, conditions, weight) -> values, and the gradient of their weighted sum."""

    def gradient(scene, conditions, weight):
        values, pull = jax.vjp(forward_of(quadrature), scene, conditions)
        return values, pull(weight)

    return gradient


def compiled(function, *arguments):
    """A function compiled for arguments, and how long that took [s]."""
    begin = time.perf_counter()
    ready = jax.jit(function).lower(*arguments).compile()
    return ready, time.perf_counter() - begin


def arguments(points, dtype):
    """(scene, conditions) and a weight of one for every value, in one dtype."""
    scene, conditions = cast((points.scene, points.conditions), dtype)
    return (scene, conditions), jnp.ones((len(QUANTITIES), conditions[0].size), dtype)


def sample(gradient, points, dtype=jnp.float64):
    """What a compiled `gradient_of` gives at points: values and sensitivities."""
    at, ones = arguments(points, dtype)
    numbers = [np.asarray(leaf, float) for leaf in jax.tree_util.tree_leaves(at)]
    sensitivities = []
    for quantity, point in np.ndindex(len(QUANTITIES), points.chosen.size):
        weight = np.zeros_like(ones)
        weight[quantity, points.chosen[point]] = 1.0
        values, slopes = gradient(*at, jnp.asarray(weight))
        slopes = [np.asarray(slope, float) for slope in jax.tree_util.tree_leaves(slopes)]
        products = [(x * slope).ravel() for x, slope in zip(numbers, slopes, strict=True)]
        sensitivities.append(np.concatenate(products))
    shape = (len(QUANTITIES), points.chosen.size, -1)
    return Sample(np.asarray(values, float), np.reshape(sensitivities, shape))


def measured(points, quadrature, gradients=True):
    """What a setting gives at points in double precision, and the compiled function that gave it.

    A Sample; without gradients a Sample of values alone, its sensitivities None.
    """
    at, ones = arguments(points, jnp.float64)
    if gradients:
        function, _ = compiled(gradient_of(quadrature), *at, ones)
        return sample(function, points), function
    function, _ = compiled(forward_of(quadrature), *at)
    return Sample(np.asarray(function(*at)), None), function


def reference(points, gradients=True):
    """Reference at points, from the two refinements."""
    (exact, function), (other, _) = (measured(points, quadrature, gradients) for quadrature in REFINED)
    return Reference(function, exact, compare(other, exact, points))


def compare(found, exact, points):
    """Errors of one sample against another: of the values alone if `found` has no sensitivities."""
    scale = np.abs(exact.values)
    scale[QUANTITIES.index("separation")] += _NEGLIGIBLE * points.height
    worst = _relative(np.abs(found.values - exact.values), scale)
    if found.sensitivities is None:
        return Errors(*worst)
    difference = np.max(np.abs(found.sensitivities - exact.sensitivities), -1)
    largest = np.max(np.abs(exact.sensitivities), -1) + _NEGLIGIBLE * scale[:, points.chosen]
    return Errors(*worst, *_relative(difference, largest))


def _relative(difference, scale):
    """Largest ratios over the last axis; 0/0 = 0, and what is not finite is infinitely wrong."""
    ratio = difference / np.where(scale > 0, scale, 1.0)
    ratio = np.where((scale > 0) | (difference == 0), ratio, np.inf)
    return [float(x) for x in np.max(np.where(np.isfinite(ratio), ratio, np.inf), -1)]
