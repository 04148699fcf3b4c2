"""Functions of points over conditions of any shape."""

from collections.abc import Callable, Iterable
from typing import Any

import jax
import jax.numpy as jnp


def over_points(
    function: Callable[[list[jax.Array]], Any], conditions: Iterable[jax.Array | None], block: int
) -> Any:
    """A function of points over conditions of any shape, a block of points at a time.

    Parameters
    ----------
    function : takes [velocity, pressure(, temperature)] of shape (n,), returns a pytree of arrays (n, ...)
    conditions : velocity, pressure, temperature; None is left out
    block : points evaluated at once. More are taken in blocks, each recomputed in the backward pass,
        so that 1e5 points differentiate in a few hundred MB.

    Returns
    -------
    the pytree, with the broadcast shape of the conditions in place of (n,)
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
