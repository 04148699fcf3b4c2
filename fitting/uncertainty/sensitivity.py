r"""Relative sensitivities of a quantity to the numbers of a scene, over the sliding velocity.

.. math:: s_{ki} = \frac{\partial \ln Q(v_i)}{\partial \ln \theta_k}

s = 0.1 means that an increase of theta_k by 1 % increases Q by 0.1 %. If |s| is small at all velocities, a
fit to Q cannot determine theta_k. If two rows are proportional, it determines only a combination of their
parameters.
"""

import functools
from collections.abc import Iterable

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from fitting.parameters.scenes import find, leaf_names
from rubberfric.analysis import value_and_jacobian
from rubberfric.base import ArrayLike, as_leaf, shape_of, shown
from rubberfric.scene import cast, result_dtype


def sensitivity(
    scene: rf.Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    parameters: str | Iterable[str],
    temperature: ArrayLike | None = None,
    *,
    quantity: str = "friction",
    quadrature: rf.Quadrature | None = None,
) -> jax.Array:
    r"""Return d ln Q / d ln theta of a quantity with respect to numbers of the scene.

    .. math:: \frac{\partial \ln |Q|}{\partial \ln \theta_k}
              = \frac1Q \left.\frac{\partial Q(\theta_k e^x)}{\partial x}\right|_{x=0}

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
        as for `rubberfric.solve`.
    parameters : key path, or a sequence of them (a dict gives its keys)
        such as "gamma", "upper.material.E" (all elements), "upper.material.E[3]" or
        "upper.material.E[2:5]".
    quantity : "friction", or any other field of `rubberfric.Solution` that is a number
    quadrature : Quadrature, static, or None: as for `rubberfric.solve`

    Returns
    -------
    array, shape (n_parameters, ...) with the broadcast shape [-]
        a row for each element, in the order of `sensitivity_names`.

    Raises
    ------
    ValueError : an unknown path (the message suggests similar ones), or as in `rubberfric.solve`.

    Notes
    -----
    The result is 0 for theta_k = 0, and by definition for Q = 0, such as friction at rest. The function
    supports jit, vmap and grad. Points are evaluated in blocks, so only the result grows with points times
    parameters. The derivatives by all parameters together take as long as a few evaluations; with a
    TabulatedModulus each derivative takes one evaluation.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> slopes = fitting.sensitivity(scene, np.logspace(-6, 1, 8), 0.15e6, "upper.material.E")
    >>> slopes.shape  # relaxation times, velocities
    (17, 8)
    """
    known = [name for name in rf.Solution._fields if name != "converged"]  # a flag
    if quantity not in known:
        raise ValueError(f"quantity = {quantity!r}: must be one of {', '.join(known)}")
    velocity, pressure = (
        as_leaf(name, value, len(shape_of(value)))
        for name, value in (("velocity", velocity), ("pressure", pressure))
    )
    if temperature is not None:
        temperature = as_leaf("temperature", temperature, len(shape_of(temperature)))
    conditions = velocity, pressure, temperature
    # `solve` checks its arguments; nothing is computed here.
    jax.eval_shape(lambda: rf.solve(scene, *conditions, quadrature=quadrature, quantities=(quantity,)))
    quadrature = quadrature or rf.analysis.default_quadrature(scene, pressure)
    places = (find(scene, path) for path in _paths(parameters))
    rows = tuple((leaf, element) for leaf, elements in places for element in elements or (None,))
    dtype = result_dtype(scene, *conditions)
    return _sensitivity(
        cast(scene, dtype), *cast(conditions, dtype), rows=rows, quantity=quantity, quadrature=quadrature
    )


def sensitivity_names(scene: rf.Scene, parameters: str | Iterable[str]) -> tuple[str, ...]:
    """Return the key path of every row that `sensitivity` returns for the same `parameters`.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> names = fitting.sensitivity_names(scene, ["gamma", "upper.material.E"])
    >>> names[:2], len(names)
    (('gamma', 'upper.material.E[0]'), 18)
    """
    return tuple(name for path in _paths(parameters) for name in leaf_names(path, find(scene, path)[1]))


def _paths(parameters):
    if isinstance(parameters, str):
        return (parameters,)
    if not isinstance(parameters, Iterable) or not (paths := tuple(parameters)):
        raise ValueError(f"parameters = {shown(parameters)}: must be one or several key paths")
    return paths


# Jitted with the structure static: a second call of the same kind compiles nothing.
@functools.partial(jax.jit, static_argnames=("rows", "quantity", "quadrature"))
def _sensitivity(scene, velocity, pressure, temperature, *, rows, quantity, quadrature):
    leaves, tree = jax.tree_util.tree_flatten(scene)

    def moved(x):
        """Return the scene in which the number of row k is multiplied by e^x[k], twice if it has two rows."""
        exponents = {}
        for leaf in dict.fromkeys(leaf for leaf, _ in rows):
            own = [k for k, row in enumerate(rows) if row[0] == leaf]
            where = [rows[k][1] for k in own]
            zero = jnp.zeros_like(leaves[leaf])
            here = x[np.array(own)]
            exponents[leaf] = jnp.sum(here) if where[0] is None else zero.at[np.array(where)].add(here)
        new = [old * jnp.exp(exponents[i]) if i in exponents else old for i, old in enumerate(leaves)]
        return jax.tree_util.tree_unflatten(tree, new)

    conditions = [c for c in (velocity, pressure, temperature) if c is not None]
    shape = jnp.broadcast_shapes(*(c.shape for c in conditions))
    v, p = (jnp.broadcast_to(c, shape).reshape(-1) for c in (velocity, pressure))
    T = None if temperature is None else jnp.broadcast_to(temperature, shape).reshape(-1)
    x = jnp.zeros(len(rows), conditions[0].dtype)
    value, slope = value_and_jacobian(moved, x, (v, p, T), quantity, quadrature)
    nothing = value == 0
    # Divided by 1 if Q = 0, because the unused quotient and its derivatives must not be NaN.
    ratio = jnp.where(nothing[:, None], 0.0, slope / jnp.where(nothing, 1.0, value)[:, None])
    return ratio.T.reshape(len(rows), *shape)
