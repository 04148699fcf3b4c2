r"""Derivatives of a quantity at many points with respect to a few parameters of the scene.

A row of this Jacobian belongs to one velocity, pressure and temperature, and a point needs
only what the scene was prepared into (meshes, weights, series: `rubberfric.theory.integrals`). So

.. math:: \frac{\partial Q_i}{\partial x} = \sum_k \frac{\partial Q_i}{\partial w_k}
          \frac{\partial w_k}{\partial x}

with the first factor by reverse mode, point by point, at the price of a few evaluations
whatever the number of parameters, and the second by forward mode, once for all points.
Forward mode alone costs an evaluation for every parameter.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.analysis.derivatives.linearised import linearised
from rubberfric.base.fixed_points.anderson import linear_fixed_point
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.scene import Scene
from rubberfric.theory.integrals import evaluate, prepare
from rubberfric.theory.model import solve
from rubberfric.theory.quantities import iterates
from rubberfric.theory.temperatures.heat_balance import feeds_back, heat_of
from rubberfric.theory.temperatures.solution import preconditioner, solve_rises, temperatures_of

# Points at once: each keeps the derivatives with respect to all that was prepared, about 0.2 MB.
# On a processor they must stay in its cache: 32 at once take a third of the time that 256 take.
BLOCK, CACHED = 256, 32


def value_and_jacobian(
    scene_of: Callable[[jax.Array], Scene],
    x: jax.Array,
    conditions: tuple[ArrayLike, ArrayLike, ArrayLike | None],
    quantity: str,
    quadrature: Quadrature,
) -> tuple[jax.Array, jax.Array]:
    """A quantity at points, and its derivatives with respect to x.

    Parameters
    ----------
    scene_of : function from x to a Scene
    x : shape (size,)
    conditions : (velocity, pressure, temperature or None), arrays of shape (points,)
    quantity : a field of `rubberfric.Solution`
    quadrature : Quadrature

    Returns
    -------
    (values, jacobian), shapes (points,) and (points, size); values are NaN where the temperatures of a
    heated scene did not converge
    """
    scene = scene_of(x)
    if any(body.material.needs_quadrature for body in (scene.lower, scene.upper)):
        # By reverse mode each point would keep derivatives with respect to the whole table of means.
        heats_itself = scene.heating is not None and feeds_back(scene) and scene.adhesion is None
        known = all(c is not None for c in conditions)
        few = max(np.size(c) for c in conditions if c is not None) <= BLOCK
        forward = _forward_heated if heats_itself and known and few else _forward
        return forward(scene_of, x, conditions, quantity, quadrature)
    heated = ("converged",) if iterates(scene) else ()
    points = [jnp.asarray(c, x.dtype) for c in conditions if c is not None]
    ready = linearised(lambda x: prepare(scene_of(x), (quantity,), quadrature), x)
    groups = [(*group, _side_by_side(ready.tangents(group[1]), group[0])) for group in ready.groups()]

    def at(moving, point):
        found = evaluate(ready.tree(moving), (quantity, *heated), [c[None] for c in point])
        return _or_nan(found[quantity], found.get("converged"))[0]

    def block(points):
        values, slopes = jax.vmap(jax.value_and_grad(at), in_axes=(None, 0))(ready.moving, points)
        # One product of many: added up one by one, jax 0.12.0 on CPU reads uninitialised memory.
        by_group = [_side_by_side(slopes, which) @ tangents.T for which, _, tangents in groups]
        found = jnp.zeros((values.size, x.size), x.dtype)
        if by_group:
            columns = np.concatenate([columns for _, columns, _ in groups])
            found = found.at[:, columns].add(jnp.concatenate(by_group, 1))
        return values, found

    count = points[0].size
    blocks = -(-count // (CACHED if jax.default_backend() == "cpu" else BLOCK))
    if blocks <= 1:
        return block(points)
    size = -(-count // blocks)  # all about equally large
    padding = (0, blocks * size - count)
    stacked = [jnp.pad(c, padding, mode="edge").reshape(blocks, size) for c in points]
    values, jacobian = jax.lax.map(block, stacked)
    return values.reshape(-1)[:count], jacobian.reshape(-1, x.size)[:count]


def _forward(scene_of, x, conditions, quantity, quadrature):
    """The same by forward mode, one parameter after the other."""

    def values(x):
        scene = scene_of(x)
        heated = ("converged",) if iterates(scene) else ()
        solution = solve(scene, *conditions, quadrature=quadrature, quantities=(quantity, *heated))
        return _or_nan(getattr(solution, quantity), solution.converged)

    value, push = jax.linearize(values, x)
    return value, jax.lax.map(push, jnp.eye(x.size, dtype=x.dtype)).T


def _forward_heated(scene_of, x, conditions, quantity, quadrature):
    """The same of a scene whose friction heats it: heat and the quantity are one function, derived once.

    Its temperatures y = f(y, x) move by dy = f_y dy + f_x dx, and the quantity with them.
    """
    ready = linearised(lambda x: prepare(scene_of(x), (quantity,), quadrature), x)
    shape = np.broadcast_shapes(*map(np.shape, conditions))
    velocity, pressure, background = (jnp.broadcast_to(jnp.asarray(c, x.dtype), shape) for c in conditions)
    points = velocity, pressure, background
    prepared = ready.tree(ready.moving)
    found = solve_rises(prepared.thermal, prepared.roughness, points)

    def at(moving, rises):
        here = ready.tree(moving)
        thermal, roughness = here.thermal, here.roughness
        hot = temperatures_of(thermal, roughness, rises, background, found.converged)
        contact = roughness.contact(velocity, pressure, hot.inside)
        left = heat_of(thermal, roughness, contact, points, hot.surface) - rises
        return left, evaluate(here, (quantity,), points, (contact, hot))[quantity]

    (_, values), push = jax.linearize(at, ready.moving, found.rises)
    inverse = preconditioner(prepared.thermal, found)

    def slope(tangents):
        start, also = jnp.zeros_like(found.rises), jnp.zeros_like(values)
        return linear_fixed_point(lambda rises: push(tangents, rises), start, also, inverse)

    slopes = jax.lax.map(slope, ready.tangents())
    return _or_nan(values, found.converged), _or_nan(slopes, found.converged).T


def _side_by_side(arrays, which):
    """Some of several arrays with the same first axis, one number after the other along the second."""
    return jnp.concatenate([arrays[i].reshape(arrays[i].shape[0], -1) for i in which], 1)


def _or_nan(values, converged):
    """Values, NaN instead of those of a last iterate."""
    return values if converged is None else jnp.where(converged, values, jnp.nan)
