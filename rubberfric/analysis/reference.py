r"""Errors of values and gradients against a reference that validates itself, and the cheapest setting.

The reference is the model, refined far beyond normal use in two different ways. If two refinements without
common nodes agree, each is accurate to about their difference. Refinement cannot reveal errors that all
settings share: the tabulated functions of partial contact have errors of 1e-11.

Gradients are compared as relative sensitivities, theta dQ / d theta, of a quantity at a point with respect to
every number of the scene, the velocity, the pressure and the temperature:

.. math:: \max_\theta |\theta\,\partial_\theta Q - (\theta\,\partial_\theta Q)_\mathrm{ref}| \Big/
          \max_\theta |(\theta\,\partial_\theta Q)_\mathrm{ref}|
"""

import bisect
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.stages import Compiled

from rubberfric.analysis.jacobian import uses_forward_mode
from rubberfric.base.checks import ArrayLike
from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.mesh.nodes import build_mesh
from rubberfric.roughness.moments import moment
from rubberfric.scene.scene import Scene, cast, rough_surfaces
from rubberfric.theory.model import solve
from rubberfric.theory.structure import QUANTITIES, rough_surfaces_of

# Two refinements of different order, so that their difference shows the error of the less accurate one.
REFINED = (
    Quadrature(order=16, panels=40, graded=20, ratio=3.0, angular_order=18, heat=320),
    Quadrature(order=20, panels=24, graded=12, ratio=4.0, angular_order=24, heat=240),
)

# The refinements must agree to this fraction of a wanted error.
TRUSTED = 0.1

# Most points at which gradients are compared, which take longer than values.
_GRADIENT_POINTS = 30

# Most points at which gradients of a tabulated modulus are compared. Each needs an angular table.
_GRADIENT_POINTS_TABULATED = 6

# Separations and derivatives below this fraction of the roughness and of the quantity count as zero: in full
# contact they are 1e-100 of it.
_NEGLIGIBLE = 1e-6


CaseConditions = tuple[jax.Array, ...]  # velocity, pressure(, temperature), each of shape (points,)


class Case(NamedTuple):
    """A scene and its conditions, in double precision."""

    scene: Scene
    conditions: CaseConditions
    differentiated: np.ndarray  # indices of the points whose gradients are compared
    height: float  # rms height of all roughness [m]


class Outcome(NamedTuple):
    """Results of one setting."""

    values: np.ndarray  # (quantities, points)
    sensitivities: np.ndarray | None = None  # theta dQ / d theta, (quantities, chosen points, numbers)


class Errors(NamedTuple):
    """Largest relative errors over the points. A gradient is None if it was not computed."""

    area: float
    friction: float
    separation: float
    area_gradient: float | None = None
    friction_gradient: float | None = None
    separation_gradient: float | None = None

    @property
    def value(self) -> float:
        """Largest error of area, friction and separation."""
        return max(self[:3])

    @property
    def gradient(self) -> float | None:
        """Largest error of the gradients of area, friction and separation; None unless all are known."""
        slopes = [error for error in self[3:] if error is not None]
        return max(slopes) if len(slopes) == 3 else None

    @property
    def worst(self) -> float:
        """Largest of all known errors."""
        return max(error for error in self if error is not None)


class Reference(NamedTuple):
    """Reference results."""

    compiled: Compiled  # function of the first refinement, for other inputs
    exact: Outcome
    agreement: Errors  # of the two refinements


def case_of(
    scene: Scene, velocity: ArrayLike, pressure: ArrayLike, temperature: ArrayLike | None = None
) -> Case:
    """Return the `Case` of a scene and conditions in double precision, or raise ValueError."""
    if jnp.result_type(float) != jnp.float64:
        raise ValueError(
            "errors are measured in float64, which is switched off; "
            'write jax.config.update("jax_enable_x64", True) first'
        )
    solve(scene, velocity, pressure, temperature, quantities=())  # only checks its arguments
    arrays = [np.asarray(x, float) for x in (velocity, pressure, temperature) if x is not None]
    conditions = tuple(jnp.asarray(x.ravel()) for x in np.broadcast_arrays(*arrays))
    tabulated = uses_forward_mode(scene)
    count = min(conditions[0].size, _GRADIENT_POINTS_TABULATED if tabulated else _GRADIENT_POINTS)
    if conditions[0].size == 0:
        raise ValueError("velocity, pressure and temperature have no points; give at least one")
    differentiated = np.unique(np.linspace(0, conditions[0].size - 1, count).round().astype(int))
    height2 = sum(float(moment(spectrum, 0)) for spectrum, _ in rough_surfaces(scene))
    return Case(cast(scene, jnp.float64), conditions, differentiated, height2**0.5)


def rounded(case: Case) -> Case:
    """Round every number of a case to single precision."""
    scene, conditions = cast(cast((case.scene, case.conditions), jnp.float32), jnp.float64)
    return case._replace(scene=scene, conditions=conditions)


def refused(case: Case) -> str:
    """Return the error message of `solve` if single precision cannot represent the scene, otherwise ""."""
    (scene, conditions), _ = arguments(case, jnp.float32)
    try:
        solve(scene, *conditions, quantities=())
    except ValueError as error:
        return str(error)
    return ""


def forward_of(quadrature: Quadrature) -> Callable[[Scene, CaseConditions], jax.Array]:
    """Return a function of (scene, conditions) to the quantities, an array of shape (quantities, points)."""

    def forward(scene: Scene, conditions: CaseConditions) -> jax.Array:
        solution = solve(scene, *conditions, quadrature=quadrature)
        return jnp.stack([getattr(solution, name) for name in QUANTITIES])

    return forward


def gradient_of(
    quadrature: Quadrature,
) -> Callable[[Scene, CaseConditions, jax.Array], tuple[jax.Array, Any]]:
    """Return a function of (scene, conditions, weight) to (values, gradient of their weighted sum).

    `weight` and the values have the shape (quantities, points).
    """

    def gradient(scene: Scene, conditions: CaseConditions, weight: jax.Array) -> tuple[jax.Array, Any]:
        values, pull = jax.vjp(forward_of(quadrature), scene, conditions)
        return values, pull(weight)

    return gradient


def compiled(function: Callable[..., Any], *arguments: Any) -> tuple[Compiled, float]:
    """Compile a function for given arguments, and return the result and the compile time [s]."""
    begin = time.perf_counter()
    ready = jax.jit(function).lower(*arguments).compile()
    return ready, time.perf_counter() - begin


def arguments(case: Case, dtype: type) -> tuple[tuple[Scene, CaseConditions], jax.Array]:
    """Return (scene, conditions) of a case and unit weights for all values, in one dtype."""
    scene, conditions = cast((case.scene, case.conditions), dtype)
    return (scene, conditions), jnp.ones((len(QUANTITIES), conditions[0].size), dtype)


def outcome(gradient: Compiled, case: Case, dtype: type = jnp.float64) -> Outcome:
    """Evaluate a compiled function from `gradient_of`, and return values and sensitivities."""
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
    """Evaluate a setting in double precision; return the `Outcome` and the compiled function."""
    at, ones = arguments(case, jnp.float64)
    if gradients:
        function, _ = compiled(gradient_of(quadrature), *at, ones)
        return outcome(function, case), function
    function, _ = compiled(forward_of(quadrature), *at)
    return Outcome(np.asarray(function(*at))), function


def reference(case: Case, gradients: bool = True) -> Reference:
    """Compute the reference of a case from the two refinements."""
    (exact, function), (other, _) = (measured(case, quadrature, gradients) for quadrature in REFINED)
    return Reference(function, exact, compare_outcomes(other, exact, case))


def compare_outcomes(outcome: Outcome, exact: Outcome, case: Case) -> Errors:
    """Return the errors of an outcome, without gradients if an outcome has no sensitivities."""
    scale = np.abs(exact.values)
    scale[QUANTITIES.index("separation")] += _NEGLIGIBLE * case.height
    worst = _relative(np.abs(outcome.values - exact.values), scale)
    if outcome.sensitivities is None or exact.sensitivities is None:
        return Errors(*worst)
    difference = np.max(np.abs(outcome.sensitivities - exact.sensitivities), -1)
    largest = np.max(np.abs(exact.sensitivities), -1) + _NEGLIGIBLE * scale[:, case.differentiated]
    return Errors(*worst, *_relative(difference, largest))


def _relative(difference: np.ndarray, scale: np.ndarray) -> list[float]:
    """Return the largest ratio of each row, where 0/0 counts as 0 and other nonfinite ratios as infinite."""
    ratio = difference / np.where(scale > 0, scale, 1.0)
    ratio = np.where((scale > 0) | (difference == 0), ratio, np.inf)
    return [float(x) for x in np.max(np.where(np.isfinite(ratio), ratio, np.inf), -1)]


# Settings of increasing work. Few others with as few nodes have errors as small, on a road and on a pair of
# rubbers from 1e-8 to 1e2 m/s and from 1e3 to 1e7 Pa. The last two are for far wider ranges.
SETTINGS = (
    Quadrature(order=4, panels=3, graded=1, ratio=6.0, angular_order=4),
    Quadrature(order=7, panels=3, graded=1, ratio=4.0, angular_order=7),
    Quadrature(order=8, panels=5, graded=1, ratio=3.5, angular_order=7),
    Quadrature(order=8, panels=6, graded=1, ratio=6.0, angular_order=7),
    Quadrature(order=10, panels=7, graded=2, ratio=4.5, angular_order=10),
    Quadrature(order=14, panels=7, graded=4, ratio=3.0, angular_order=12),
    Quadrature(),
    Quadrature(order=16, panels=20, graded=12, ratio=4.0, angular_order=16),
)


def node_count(scene: Scene, quadrature: Quadrature) -> int:
    """Return the number of nodes in q per point: contact nodes plus angular nodes."""
    laws = [pair.law for pair in rough_surfaces_of(scene)]
    if not laws:
        return 0
    mesh = jax.eval_shape(lambda: build_mesh(laws, quadrature))
    return mesh.q.size + mesh.angular_q.size


def with_automatic(scene: Scene, automatic: Quadrature) -> tuple[Quadrature, ...]:
    """Insert the automatic setting into `SETTINGS`, in the order of increasing work."""
    if automatic in SETTINGS:
        return SETTINGS
    work = node_count(scene, automatic)
    place = sum(node_count(scene, setting) < work for setting in SETTINGS)
    return (*SETTINGS[:place], automatic, *SETTINGS[place:])


def check_error(error: float) -> None:
    """Raise ValueError unless a requested error is a number >= 1e-15 (for double precision) and < 1."""
    if isinstance(error, bool) or not isinstance(error, int | float) or not 1e-15 <= error < 1:
        raise ValueError(f"error = {error!r}: must be a number, >= 1e-15 and < 1")


def quadrature_for(
    scene: Scene,
    error: float,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    *,
    gradients: bool = True,
) -> Quadrature:
    """Find the cheapest of `SETTINGS` that meets a relative error on a scene, in 10 to 30 s.

    The settings are compared with the reference of this module in double precision.

    Parameters
    ----------
    scene : Scene
    error : largest relative error of area, friction, separation [-], 0 ... 1
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
        conditions at which the error must be met, or their extremes. None: velocities 1e-8 ... 1e2 m/s and
        pressures 1e3 ... 1e7 Pa, one per decade, every shift at its reference temperature.
    gradients : if True, the gradients of these quantities must meet the error as well

    Returns
    -------
    Quadrature

    Raises
    ------
    ValueError : as `solve`; no setting meets the error, or the reference is not accurate enough;
        double precision is switched off.

    Examples
    --------
    >>> road = rf.Body(rf.Rigid(), rf.SelfAffine(q0=1e3, qr=1e3, q1=1e4, hurst=0.8, h_rms=20e-6))
    >>> scene = rf.Scene(road, rf.Body(rf.Prony(E_inf=3e6, E=[3e6], tau=[1e-3])))
    >>> setting = rf.analysis.quadrature_for(scene, 1e-4, 0.1, 1e5, gradients=False)
    >>> setting.order, setting.panels
    (4, 3)
    """
    check_error(error)
    velocity = np.logspace(-8, 2, 11)[:, None] if velocity is None else velocity
    pressure = np.logspace(3, 7, 5) if pressure is None else pressure
    case = case_of(scene, velocity, pressure, temperature)
    exact = reference(case, gradients)
    agreement = exact.agreement.worst
    if agreement > TRUSTED * error:
        raise ValueError(
            f"error = {error:g}: the reference cannot resolve it on this scene, because two refinements "
            f"agree to {agreement:.1e} only; error must be >= {agreement / TRUSTED:.1e}"
        )
    reached = {}

    def meets(setting: Quadrature) -> bool:
        outcome, _ = measured(case, setting, gradients)
        reached[setting] = compare_outcomes(outcome, exact.exact, case).worst
        return reached[setting] <= error

    # Bisect, because each setting is compiled.
    first = bisect.bisect_left(SETTINGS, True, key=meets)
    if first == len(SETTINGS):
        raise ValueError(
            f"error = {error:g}: none of {first} settings meets it on this scene; "
            f"the smallest error is {min(reached.values()):.1e}"
        )
    return SETTINGS[first]
