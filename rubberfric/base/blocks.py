"""Evaluation of functions at conditions of any shape, and standard lengths of padded arrays."""

import math
from collections.abc import Callable, Iterable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

# Largest number of points of one call. Conditions and results of so many points take several GB, and XLA
# aborts the process if it gets no memory.
MOST_POINTS = 50_000_000


def broadcast_shape(**arrays: Any) -> tuple[int, ...]:
    """Return the broadcast shape of arrays, which may be traced. Arrays that are None are left out.

    Raises
    ------
    ValueError : the shapes do not broadcast, or the result has more than `MOST_POINTS` points.
    """
    shapes = {name: np.shape(x) for name, x in arrays.items() if x is not None}
    listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
    try:
        shape = np.broadcast_shapes(*shapes.values())
    except ValueError:
        raise ValueError(f"shapes differ ({listed}): the shapes must broadcast against each other") from None
    check_count(shape, listed)
    return shape


def check_count(shape: tuple[int, ...], listed: str) -> None:
    """Raise ValueError if an array of a shape has more than `MOST_POINTS` points.

    The text `listed` names the arrays that broadcast to this shape.
    """
    if math.prod(shape) > MOST_POINTS:
        raise ValueError(
            f"{listed} broadcast to the shape {shape} with {math.prod(shape):.3g} points: must be at most "
            f"{MOST_POINTS:.3g} points in one call; pass fewer points at a time, or compute a grid with "
            "rubberfric.friction_map, which writes a file"
        )


def over_points(
    function: Callable[[list[jax.Array]], Any], conditions: Iterable[jax.Array | None], block: int
) -> Any:
    """Evaluate a function at conditions of any shape, in blocks of points.

    Parameters
    ----------
    function : function of a list of the given conditions, each of shape (n,), to a pytree of arrays (n, ...)
    conditions : velocity, pressure and temperature. A condition that is None is left out of the list.
    block : number of points evaluated together. Each block is recomputed in the backward pass, so that
        the gradient of 1e5 points takes a few hundred MB.

    Returns
    -------
    The pytree of `function`, with the broadcast shape of the conditions in place of the first axis
    """
    conditions = [x for x in conditions if x is not None]
    shape = jnp.broadcast_shapes(*(x.shape for x in conditions))
    points = [jnp.broadcast_to(x, shape).reshape(-1) for x in conditions]
    count = points[0].shape[0]
    if count <= block:
        results = function(points)
    else:
        blocks = -(-count // block)
        padding = (0, blocks * block - count)
        stacked = [jnp.pad(x, padding, mode="edge").reshape(blocks, block) for x in points]
        results = jax.lax.map(jax.checkpoint(function), stacked)
        results = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:])[:count], results)
    return jax.tree.map(lambda x: x.reshape(*shape, *x.shape[1:]), results)


def recurring_length(size: int) -> int:
    """Return the length to which arrays of `size` entries are padded.

    The lengths are 8, 12, 16 ... 32, 40 ... 64, 80 and so on. Above 16 the length exceeds `size` by at most a
    quarter. A function that was compiled for one length serves all data that are padded to this length.
    """
    step = 2 ** max((size - 1).bit_length() - 3, 2)
    return max(8, -(-size // step) * step)
