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
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

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
    ready = _linearised(lambda x: prepare(scene_of(x), (quantity,), quadrature), x)
    tangents = [tangent.reshape(x.size, -1) for tangent in ready.tangents]
    tangents = jnp.concatenate([jnp.zeros((x.size, 0), x.dtype), *tangents], 1)

    def at(moving, point):
        found = evaluate(ready.tree(moving), (quantity, *heated), [c[None] for c in point])
        return _or_nan(found[quantity], found.get("converged"))[0]

    def block(points):
        values, slopes = jax.vmap(jax.value_and_grad(at), in_axes=(None, 0))(ready.moving, points)
        # One product of all: added up one by one, jax 0.12.0 on CPU reads uninitialised memory.
        slopes = [slope.reshape(values.size, -1) for slope in slopes]
        return values, jnp.concatenate([jnp.zeros((values.size, 0), x.dtype), *slopes], 1) @ tangents.T

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
    ready = _linearised(lambda x: prepare(scene_of(x), (quantity,), quadrature), x)
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

    slopes = jax.lax.map(slope, ready.tangents)
    return _or_nan(values, found.converged), _or_nan(slopes, found.converged).T


class _Linearised(NamedTuple):
    """A tree of arrays, and of what is none, that depends on x, and its derivatives."""

    moving: list[jax.Array]  # leaves that depend on x
    tangents: list[jax.Array]  # their derivatives, x first
    tree: Callable[[list[jax.Array]], Any]  # the tree with others in their place


def _linearised(function, x):
    """`_Linearised` of a function of x."""
    shape = {}  # of the tree, and its leaves that are no arrays

    def leaves(x):
        """Arrays, reals and integers; what is no array stays behind in `shape`."""
        leaves, shape["tree"] = jax.tree_util.tree_flatten(function(x))
        shape["kind"] = [_kind(leaf) for leaf in leaves]
        shape["objects"] = [leaf for leaf in leaves if _kind(leaf) == "object"]
        return (
            [leaf for leaf in leaves if _kind(leaf) == "real"],
            [leaf for leaf in leaves if _kind(leaf) == "integer"],
        )

    arrays, push, integers = jax.linearize(leaves, x, has_aux=True)
    depends = _dependent(lambda x: leaves(x)[0], x)
    tangents = jax.vmap(push)(jnp.eye(x.size, dtype=x.dtype))

    def tree(moving):
        moving = iter(moving)
        parts = {
            "real": iter([next(moving) if moves else a for a, moves in zip(arrays, depends, strict=True)]),
            "integer": iter(integers),
            "object": iter(shape["objects"]),
        }
        return jax.tree_util.tree_unflatten(shape["tree"], [next(parts[kind]) for kind in shape["kind"]])

    def chosen(values):
        return [a for a, moves in zip(values, depends, strict=True) if moves]

    return _Linearised(chosen(arrays), chosen(tangents), tree)


def _or_nan(values, converged):
    """Values, NaN instead of those of a last iterate."""
    return values if converged is None else jnp.where(converged, values, jnp.nan)


def _kind(leaf):
    if not isinstance(leaf, jax.Array):
        return "object"
    return "real" if jnp.issubdtype(leaf.dtype, jnp.floating) else "integer"


def _dependent(function, x):
    """Which of the arrays that a function returns depend on x at all."""
    jaxpr = jax.make_jaxpr(function)(x).jaxpr
    live = set(jaxpr.invars)

    def alive(variables):
        return any(not hasattr(v, "val") and v in live for v in variables)

    for equation in jaxpr.eqns:
        if alive(equation.invars):
            live.update(equation.outvars)
    return np.array([alive([variable]) for variable in jaxpr.outvars])
