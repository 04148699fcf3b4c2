r"""Temperatures of a heated scene: friction heats the solids, which changes their moduli and the friction.

The branch of solutions is followed on a coarse mesh of the scene (`branch`). A fixed-point iteration on the
fine mesh (`rubberfric.base.fixed_points`) then uses a coarse derivative as preconditioner. P maps temperature
rises on the coarse mesh to rises on the fine mesh. J is P' along a few functions of ln q, and R projects on
these functions,

.. math:: (1 - F')^{-1} \approx 1 + J (1 - R J)^{-1} R

Near folds, where this iteration does not lead to a nearby solution, the branch is followed on the fine mesh.
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.fixed_points import Inverse, fixed_point, implicit
from rubberfric.base.quadrature import typed
from rubberfric.scene.heating import diffusivity
from rubberfric.theory.contact import Contact, Roughness
from rubberfric.theory.heat.balance import (
    HeatedPoints,
    Temperatures,
    Thermal,
    heat_balance,
    heat_of,
    inner_temperatures,
    shear_temperature,
    without_derivatives,
)
from rubberfric.theory.heat.branch import arrive, begin_at, path

# Temperature rise below which a solution is unique [K]. A smaller one makes the way along a branch longer.
_COLD_RISE = 0.03
# Velocity where branches from high velocities begin [m/s], far above every sliding velocity.
_FASTEST = 1e8
# Smallest absolute velocity whose logarithm is taken [m/s]. Below it sliding counts as rest.
_SLOWEST = 1e-30
# Largest last step on the coarse mesh [K]. The fine mesh corrects what remains.
_COARSE_STEP = 1e-4
# Largest last step [K] where the branch is followed on the fine mesh, which nothing corrects afterwards.
_FINE_STEP = 1e-10
# Largest distance of a solution from the branch on the coarse mesh [K], times det(1 - R J), which is small
# near folds.
_CLOSE = 1.0
# Number of functions of ln q for the derivative J, for every solid.
_HATS = 12
# Step of the differences that give J [K].
_STEP = 0.01


class Rises(NamedTuple):
    """Temperature rises at points, without derivatives."""

    rises: jax.Array  # (points, unknowns) [K]
    left: jax.Array  # of the `Inverse`
    converged: jax.Array  # True for the fixed point of the branch


def solve_temperatures(
    thermal: Thermal, roughness: Roughness, velocity: jax.Array, pressure: jax.Array, background: jax.Array
) -> Temperatures:
    """Return the `Temperatures` of a heated scene at points. The conditions have the shape (points,)."""
    points = velocity, pressure, background
    heat = heat_balance(thermal, roughness, thermal.diffusion, points)
    if thermal.coarse is None:
        nothing = jnp.zeros((velocity.shape[0], _size(thermal, roughness)), velocity.dtype)
        rises, converged = heat(nothing), jnp.ones_like(velocity, bool)
    else:
        solution = solve_rises(thermal, roughness, points)
        inverse = preconditioner(thermal, solution)
        rises, converged = implicit(heat, solution.rises, inverse), solution.converged
    return temperatures_of(thermal, roughness, rises, background, converged)


def preconditioner(thermal: Thermal, rises: Rises) -> Inverse:
    """Return the `Inverse` that preconditions the heat balance near given `Rises`."""
    assert thermal.coarse is not None
    return Inverse(rises.left, _hats(thermal, thermal.coarse)[0])


def temperatures_of(
    thermal: Thermal, roughness: Roughness, rises: jax.Array, background: jax.Array, converged: jax.Array
) -> Temperatures:
    """Return the `Temperatures` that belong to given temperature rises at the unknowns.

    `rises` has the shape (points, unknowns) [K].
    """
    inside, flash = inner_temperatures(thermal, roughness.mesh, rises, background)
    surface = shear_temperature(thermal.heating, flash, background)
    return Temperatures(thermal, inside, flash, surface, converged)


def imbalance(
    thermal: Thermal, roughness: Roughness, rises: jax.Array, points: HeatedPoints, converged: jax.Array
) -> tuple[jax.Array, tuple[Contact, Temperatures]]:
    """Return the rises that the friction causes minus the assumed rises, and the contact with these rises.

    Parameters
    ----------
    rises : assumed temperature rises at the unknowns [K], shape (points, unknowns)
    converged : field of the `Temperatures`
    """
    velocity, pressure, background = points
    hot = temperatures_of(thermal, roughness, rises, background, converged)
    contact = roughness.contact(velocity, pressure, hot.inside)
    return heat_of(thermal, roughness, contact, points, hot.surface) - rises, (contact, hot)


def _size(thermal, roughness):
    return len(thermal.exciting) * (roughness.mesh.angular_q.size + 1)


def solve_rises(thermal: Thermal, roughness: Roughness, points: HeatedPoints) -> Rises:
    """Solve for the temperature rises of a scene.

    The branch is followed on the coarse mesh, and the end of the branch is refined on the fine mesh. Where
    the refinement fails, the branch is followed on the fine mesh.
    """
    thermal, roughness, points = without_derivatives((thermal, roughness, points))
    targets = jnp.log(jnp.maximum(jnp.abs(points[0]), _SLOWEST))
    coarse = thermal.coarse
    assert coarse is not None
    places = _places(thermal, points, targets)
    residual = _residual(thermal, coarse.roughness, coarse.diffusion, points)
    solution = _refined(thermal, roughness, points, *arrive(residual, places, targets, _COARSE_STEP))

    def mended(progress):
        solution, left = progress
        # One row at a time, because there are few.
        i = jnp.argmax(left)
        pick = functools.partial(jax.lax.dynamic_slice_in_dim, start_index=i, slice_size=1)
        point, target = tuple(map(pick, points)), pick(targets)
        begin = begin_at(_before(thermal, _begin(thermal, point), target), jnp.zeros_like(solution.rises[:1]))
        rises, arrived = arrive(
            _residual(thermal, roughness, thermal.diffusion, point), begin, target, _FINE_STEP
        )
        return solution._replace(
            rises=solution.rises.at[i].set(rises[0]), converged=solution.converged.at[i].set(arrived[0])
        ), left.at[i].set(False)

    doubtful = ~solution.converged
    return jax.lax.while_loop(lambda progress: jnp.any(progress[1]), mended, (solution, doubtful))[0]


def _residual(thermal, roughness, ready, points):
    def residual(log_v, rises):
        at = (jnp.exp(log_v), *points[1:])
        return heat_balance(thermal, roughness, ready, at)(rises) - rises

    return residual


def _direction(thermal):
    return 1 if thermal.heating.branch == "rising" else -1


def _begin(thermal, points):
    r"""Return ln v at which the branches through the points begin.

    Branches from high velocities begin at `_FASTEST`. Branches from low velocities begin where the solids are
    nearly cold: with mu < 1, no temperature rises by more than `_COLD_RISE`. The bound on the rise is

    .. math:: \frac{2\sigma_0}{\pi P_m \rho c_p} \int_0^\infty dk\,\frac{v (1 - e^{-D k^2 R/v})}{D k^2}
              = \frac{2\sigma_0}{P_m \rho c_p} \sqrt{\frac{v R}{\pi D}}
    """
    area, pressure = thermal.heating.area_fraction, points[1]
    if _direction(thermal) < 0:
        return jnp.full_like(pressure, np.log(_FASTEST))
    area = 0.01 if area is None else area

    def begin(own):
        # Logarithms, because the squares overflow float32.
        heat = jnp.log(own.density) + jnp.log(own.heat_capacity) + jnp.log(area) - jnp.log(pressure)
        length = jnp.log(diffusivity(own)) - jnp.log(own.radius)
        # NumPy's logarithm would widen float32.
        return 2 * (heat + math.log(0.5 * _COLD_RISE)) + length + math.log(math.pi)

    return functools.reduce(jnp.minimum, map(begin, thermal.bodies))


def _before(thermal, log_v, targets):
    return jnp.minimum(log_v, targets) if _direction(thermal) > 0 else jnp.maximum(log_v, targets)


def _places(thermal, points, targets):
    """Follow the branches on the coarse mesh, and return the last position before each target.

    Points with equal pressure and background temperature share a branch.
    """
    coarse, direction = thermal.coarse, _direction(thermal)
    _, pressure, background = points
    size = _size(thermal, coarse.roughness)

    def followed(progress):
        places, left = progress
        i = jnp.argmax(left)
        point = tuple(jax.lax.dynamic_slice_in_dim(x, i, 1) for x in points)
        residual = _residual(thermal, coarse.roughness, coarse.diffusion, point)
        same = left & (pressure == point[1]) & (background == point[2])
        begin = begin_at(_begin(thermal, point), jnp.zeros((1, size), targets.dtype))
        own = path(residual, begin, jnp.where(same, targets, -direction * jnp.inf), direction)
        places = jax.tree.map(
            lambda new, old: jnp.where(same.reshape(-1, *(1,) * (old.ndim - 1)), new, old), own, places
        )
        return places, left & ~same

    nothing = begin_at(targets, jnp.zeros((targets.shape[0], size), targets.dtype))
    everything = jnp.ones(targets.shape, bool)
    return jax.lax.while_loop(lambda progress: jnp.any(progress[1]), followed, (nothing, everything))[0]


def _refined(thermal, roughness, points, guess, arrived):
    """Refine temperature rises from the coarse mesh, and return the `Rises` on the fine mesh."""
    coarse = thermal.coarse
    restrict, along, at = _hats(thermal, coarse)
    prolong = heat_balance(thermal, coarse.roughness, coarse.prolonged, points)
    # J by differences, because it need not be exact.
    steps = typed(np.vstack([0 * along[:1], along]), guess)
    moved = jax.vmap(lambda step: prolong(guess + _STEP * step))(steps)
    rises, J = moved[0], jnp.moveaxis(moved[1:] - moved[0], 0, -1) / _STEP  # points, fine, hats
    matrix = jnp.eye(len(along), dtype=guess.dtype) - jnp.einsum("cf,pfd->pcd", restrict, J)
    left = jnp.einsum("pfc,pcd->pfd", J, jnp.linalg.inv(matrix))
    start = rises + jnp.einsum("pfc,pc->pf", left, rises @ restrict.T - guess[:, at])
    heat = heat_balance(thermal, roughness, thermal.diffusion, points)
    refined, reached = fixed_point(heat, start, Inverse(left, restrict))
    close = _CLOSE * jnp.clip(jnp.linalg.det(matrix), 0.0, 1.0)
    near = jnp.max(jnp.abs(refined - start), -1) <= close
    return Rises(refined, left, arrived & reached & near)


def _hats(thermal, coarse):
    """Return data of a few selected unknowns of the coarse mesh, as (restriction, hats, indices).

    The restriction is a matrix from fine unknowns to the selected unknowns. The hats are hat functions on the
    coarse mesh, one row for each selected unknown.
    """
    solids = len(thermal.exciting)
    size = _size(thermal, coarse.roughness) // solids
    some = np.unique(np.linspace(0, size - 1, min(size, _HATS)).round().astype(int))
    hats = np.stack([np.interp(np.arange(size), some, row) for row in np.eye(some.size)])
    at = (size * np.arange(solids)[:, None] + some).reshape(-1)
    return coarse.restriction[at], np.kron(np.eye(solids), hats), at
