r"""Derivatives of a quantity at many points with respect to a few parameters x of the scene.

With leaves s of the scene and leaves w of the prepared scene (meshes, weights, series;
`rubberfric.theory.integrals`) the chain rule reads

.. math:: \frac{\partial Q_i}{\partial x} = \sum_{parts} \frac{\partial Q_i}{\partial w}\,
          \frac{\partial w}{\partial s_{part}}\,\frac{\partial s_{part}}{\partial x}

The first factor is found by reverse mode, point by point, at the cost of a few evaluations whatever the
number of parameters. The other two factors are found by forward mode, once for all points. The parts are
the spectra, the layers and all other leaves, because few parameters move the meshes, which hold most of the
numbers. If the series stiffness differs between wavevectors, there is one part: a moving mesh also changes
every series, and each part would compute all series again. A leaf is left out only where JAX itself has a
symbolic zero for its tangent.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jax.flatten_util import ravel_pytree

from rubberfric.base.checks import ArrayLike
from rubberfric.base.compilation import exact_products
from rubberfric.base.fixed_points import linear_fixed_point
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.scene import Scene, iterates
from rubberfric.theory.integrals import evaluate, fixed_point_of, imbalance_of, prepare
from rubberfric.theory.model import solve
from rubberfric.theory.structure import MeansMethod, Structure, means_methods

# Points evaluated together on a GPU, and the most points of a heated scene that are differentiated in forward
# mode. Each keeps its derivatives with respect to all prepared leaves, about 0.2 MB.
BLOCK = 256
# Points evaluated together on a CPU, where the derivatives must fit the cache. Blocks of 32 take a third of
# the time of blocks of 256.
_CPU_BLOCK = 32


# Velocity, pressure, and temperature or None.
Conditions = tuple[ArrayLike | None, ...]


class LinearisedTree(NamedTuple):
    """A pytree that depends on x, with its derivatives with respect to x."""

    leaves: list[Any]  # of the pytree
    structure: Any
    moving: list[int]  # indices of the leaves that depend on x
    push: Callable[[Any], list[jax.Array]]  # tangent of x -> tangents of the moving leaves

    def tree(self, others: Mapping[int, jax.Array]) -> Any:
        """Return the pytree with the leaves in `others`, a mapping from index to leaf, replaced."""
        leaves = [others.get(i, leaf) for i, leaf in enumerate(self.leaves)]
        return jax.tree_util.tree_unflatten(self.structure, leaves)


def linearise_tree(function: Callable[[Any], Any], x: Any) -> LinearisedTree:
    """Linearise a function that returns a pytree, in which only real arrays get derivatives."""
    structure, others, moves = None, {}, []

    def reals_and_integers(x):
        nonlocal structure
        leaves, structure = jax.tree_util.tree_flatten(function(x))
        arrays = {i: leaf for i, leaf in enumerate(leaves) if isinstance(leaf, jax.Array)}
        others.update((i, leaf) for i, leaf in enumerate(leaves) if i not in arrays)
        reals = {i: a for i, a in arrays.items() if jnp.issubdtype(a.dtype, jnp.inexact)}
        integers = {i: a for i, a in arrays.items() if i not in reals}
        return dict(zip(reals, _watched(moves, *reals.values()), strict=True)), integers

    reals, push, integers = jax.linearize(reals_and_integers, x, has_aux=True)
    leaves = {**others, **integers, **reals}
    moving = [i for i, moved in zip(reals, moves, strict=True) if moved]

    def push_moving(tangent):
        pushed = push(tangent)  # once, because every call is traced again
        return [pushed[i] for i in moving]

    return LinearisedTree([leaves[i] for i in range(len(leaves))], structure, moving, push_moving)


def _watched(moves, *arrays):
    """Return the arrays, and fill the list `moves` with True for each array with a nonzero tangent."""

    @jax.custom_jvp
    def identity(*arrays):
        return arrays

    def rule(primals, tangents):
        moves[:] = [not isinstance(tangent, SymbolicZero) for tangent in tangents]
        zeros = map(jnp.zeros_like, primals)
        return primals, tuple(
            t if moved else zero for t, zero, moved in zip(tangents, zeros, moves, strict=True)
        )

    identity.defjvp(rule, symbolic_zeros=True)
    moves[:] = [False] * len(arrays)
    return identity(*arrays)


def uses_forward_mode(scene: Scene) -> bool:
    """Return True if `value_and_jacobian` uses forward mode, because F is not a Prony series.

    In reverse mode each point would keep derivatives with respect to a whole table of means.

    Examples
    --------
    >>> series = rf.load_scene("data/tread_on_asphalt.toml")
    >>> table = rf.load_scene("data/tabulated_tread.toml")
    >>> rf.analysis.uses_forward_mode(series), rf.analysis.uses_forward_mode(table)
    (False, True)
    """
    return bool({*means_methods(scene)} - {MeansMethod.CONSTANT, MeansMethod.CLOSED_FORM})


@exact_products
def value_and_jacobian(
    scene_of: Callable[[jax.Array], Scene],
    x: jax.Array,
    conditions: Conditions | Callable[[jax.Array], Conditions],
    quantity: str,
    quadrature: Quadrature,
) -> tuple[jax.Array, jax.Array]:
    """Compute a quantity at points and its derivatives with respect to x.

    Parameters
    ----------
    scene_of : function from x to a Scene
    x : shape (size,)
    conditions : (velocity, pressure, temperature or None), arrays of shape (points,), or a function from x
    quantity : a field of `rubberfric.Solution`
    quadrature : Quadrature

    Returns
    -------
    (values, jacobian), shapes (points,) and (points, size). Values are NaN where the temperatures of a
    heated scene did not converge.

    Examples
    --------
    At light load mu hardly depends on a common factor of all moduli, here e^x:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> def scaled(x):
    ...     rubber = scene.upper.material
    ...     moduli = {"E_inf": rubber.E_inf * np.e**x[0], "E": rubber.E * np.e**x[0]}
    ...     return scene.replace("upper.material", rubber.replace(**moduli))
    >>> at = np.array([0.01]), np.array([0.15e6]), None
    >>> mu, slope = rf.analysis.value_and_jacobian(scaled, np.zeros(1), at, "friction", rf.Quadrature())
    >>> round(float(mu[0]), 3), round(float(slope[0, 0] / mu[0]), 3)
    (0.083, -0.006)
    """
    scene, fixed = scene_of(x), not callable(conditions)
    conditions_of = conditions if callable(conditions) else lambda _: conditions

    def points_of(x):
        return [jnp.asarray(c, x.dtype) for c in conditions_of(x) if c is not None]

    points = points_of(x)
    if uses_forward_mode(scene):
        feeds_back, few = Structure.of(scene, (quantity,)).feeds_back, max(c.size for c in points) <= BLOCK
        if feeds_back and fixed and len(points) == 3 and few:
            return _forward_fixed_point(scene_of, x, points, quantity, quadrature)
        return _forward(scene_of, x, conditions_of, quantity, quadrature)
    also = ("converged",) if iterates(scene) else ()
    parts = _parts(scene_of, x, lambda scene: prepare(scene, (quantity,), quadrature))
    moving = sorted({i for part, _, _ in parts for i in part.moving})
    first = parts[0][0]
    by_x = jnp.concatenate([along for *_, along in parts])

    def at(leaves, point):
        ready = first.tree(dict(zip(moving, leaves, strict=True)))
        results = evaluate(ready, (quantity, *also), [c[None] for c in point])
        return _or_nan(results[quantity], results.get("converged"))[0]

    def block(points):
        leaves = [first.leaves[i] for i in moving]
        gradient = jax.value_and_grad(at, argnums=(0,) if fixed else (0, 1))
        values, (slopes, *by_point) = jax.vmap(gradient, in_axes=(None, 0))(leaves, points)
        slopes = dict(zip(moving, slopes, strict=True))
        # One product at the end: a sum of products reads uninitialised memory in jax 0.12.0 on CPU.
        by_part = [
            _flat([slopes[i] for i in part.moving], values) @ tangents.T for part, tangents, _ in parts
        ]
        return values, jnp.concatenate(by_part, 1) @ by_x, by_point

    def with_moving_points(values, jacobian, by_point):
        """Add the derivatives by the points, which may depend on x."""
        if fixed:
            return values, jacobian
        pairs = zip(*by_point, jax.jacfwd(points_of)(x), strict=True)
        return values, jacobian + sum(slope[:, None] * by_x for slope, by_x in pairs)

    count = points[0].size
    blocks = -(-count // (_CPU_BLOCK if jax.default_backend() == "cpu" else BLOCK))
    if blocks <= 1:
        return with_moving_points(*block(points))
    size = -(-count // blocks)  # all about equally large
    padding = (0, blocks * size - count)
    stacked = [jnp.pad(c, padding, mode="edge").reshape(blocks, size) for c in points]
    values, jacobian, by_point = jax.lax.map(block, stacked)
    return with_moving_points(
        values.reshape(-1)[:count],
        jacobian.reshape(-1, x.size)[:count],
        jax.tree.map(lambda slope: slope.reshape(-1)[:count], by_point),
    )


def _parts(scene_of, x, prepared):
    """Return the prepared scene's derivatives by each part, as (LinearisedTree, tangents, components).

    The m directions are the elements of the leaves of the part, or of x if it has no more elements. Tangents
    of the leaves that depend on x have the shape (m, numbers), components of x the shape (m, size).
    """
    scene = linearise_tree(scene_of, x)
    every = jnp.eye(x.size, dtype=x.dtype)
    by_x = dict(zip(scene.moving, jax.vmap(scene.push)(every), strict=True))
    paths = [path for path, _ in jax.tree_util.tree_flatten_with_path(scene.tree({}))[0]]
    groups: dict[str, list[int]] = {}
    for i in scene.moving:
        names = [getattr(key, "name", "") for key in paths[i]]
        part_name = next((name for name in ("spectrum", "layer") if name in names), "others")
        groups.setdefault(part_name, []).append(i)
    parts = []
    for group in list(groups.values()) or [[]]:
        leaves = [scene.leaves[i] for i in group]
        part = linearise_tree(
            lambda own, group=group: prepared(scene.tree(dict(zip(group, own, strict=True)))), leaves
        )
        flat, unflatten = ravel_pytree(leaves)
        components, directions = _flat([by_x[i] for i in group], every).T, jnp.eye(flat.size, dtype=x.dtype)
        if flat.size >= x.size:
            components, directions = every, components.T
        tangents = jax.vmap(lambda along, part=part, to=unflatten: part.push(to(along)))(directions)
        parts.append((part, _flat(tangents, directions), components))
    return parts


def _flat(arrays, like):
    # Shape (rows, numbers). `like` gives the number of rows and the dtype.
    rows = len(like)
    # In reverse mode a complex leaf would need its conjugate.
    assert not any(jnp.iscomplexobj(a) for a in arrays)
    return jnp.concatenate([jnp.zeros((rows, 0), like.dtype), *(a.reshape(rows, -1) for a in arrays)], 1)


def _forward(scene_of, x, conditions_of, quantity, quadrature):
    """Compute values and derivatives by forward mode, one parameter after the other."""

    def values(x):
        scene = scene_of(x)
        also = ("converged",) if iterates(scene) else ()
        solution = solve(scene, *conditions_of(x), quadrature=quadrature, quantities=(quantity, *also))
        return _or_nan(getattr(solution, quantity), solution.converged)

    value, push = jax.linearize(values, x)
    return value, jax.lax.map(push, jnp.eye(x.size, dtype=x.dtype)).T


def _forward_fixed_point(scene_of, x, conditions, quantity, quadrature):
    """Compute values and derivatives by forward mode for a scene whose temperatures are a fixed point.

    The unknowns y = f(y, x) change by dy = f_y dy + f_x dx; the quantity is linearised with f.
    """
    ready = linearise_tree(lambda x: prepare(scene_of(x), (quantity,), quadrature), x)
    shape = np.broadcast_shapes(*map(np.shape, conditions))
    velocity, pressure, background = (jnp.broadcast_to(jnp.asarray(c, x.dtype), shape) for c in conditions)
    points = velocity, pressure, background
    solution = fixed_point_of(ready.tree({}), points)

    def at(moving, unknowns):
        here = ready.tree(dict(zip(ready.moving, moving, strict=True)))
        left, known = imbalance_of(here, solution, unknowns, points)
        return left, evaluate(here, (quantity,), points, known)[quantity]

    (_, values), push = jax.linearize(at, [ready.leaves[i] for i in ready.moving], solution.unknowns)

    def slope(tangents):
        start, also = jnp.zeros_like(solution.unknowns), jnp.zeros_like(values)
        return linear_fixed_point(lambda along: push(tangents, along), start, also, solution.inverse)

    slopes = jax.lax.map(slope, jax.vmap(ready.push)(jnp.eye(x.size, dtype=x.dtype)))
    return _or_nan(values, solution.converged), _or_nan(slopes, solution.converged).T


def _or_nan(values, converged):
    return values if converged is None else jnp.where(converged, values, jnp.nan)
