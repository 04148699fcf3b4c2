"""Logarithms of numbers that may be 0, with finite derivatives of every order."""

import math

import jax
import jax.numpy as jnp


def floored_log(values: jax.Array, power: float = 1.0) -> jax.Array:
    """Return ln of values >= 0; up to the floor, the logarithm of the floor with derivatives 0.

    The floor is the smallest normal number of the dtype to the given power. The derivatives of
    `jnp.log(jnp.maximum(values, floor))` contain 0 / floor^2, which is NaN.
    """
    floor = float(jnp.finfo(jnp.result_type(values, 1.0)).tiny) ** power
    above = values > floor
    return jnp.where(above, jnp.log(jnp.where(above, values, 1.0)), math.log(floor))
