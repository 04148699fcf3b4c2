r"""A Prony solid in series with a spring is a Prony solid with the same number of terms.

For f(s) = f_rest + sum_i f_i s/(s + l_i), rates l_i = 1/tau_i, and a spring k,

.. math:: \frac{k f}{k + f} = \frac{k f_\infty}{k + f_\infty} + \sum_i f_i' \frac{s}{s + l_i'}

with one new rate l' in every interval between neighbouring old ones (the first below
l_1): the roots of k + f(-l') = 0. The weights are f_i' = k^2 / (l_i' F_i) with
F_i = sum_j f_j l_j / (l_j - l_i')^2. Each root is found in the logarithm of its relative
distance to the nearer old rate, as LAPACK's laed4 does: the rate itself loses all digits
of that distance once k >> f.
"""

import functools

import jax
import jax.numpy as jnp

BISECTIONS = 64


def in_series(rest, weight, tau, spring):
    """Prony series of the solid in series with a spring.

    Parameters
    ----------
    rest : f_inf >= 0, shape ()
    weight : f_i >= 0, shape (n,)
    tau : [s], shape (n,), any order
    spring : k >= 0, same unit as the moduli, shape () or (nodes,)

    Returns
    -------
    rest, weight, tau of the series solid: the spring's shape, and (n,) after it.
    """
    order = jnp.argsort(-tau)
    rate = 1 / tau[order]
    # A term or spring of no stiffness would put a root on a pole, 0/0, and with it a
    # spurious mode. A part of 1e-30 (float32: 1e-10) of the stiffest is as good as none,
    # and the derivative with respect to it stays that of the original.
    stiffest = jax.lax.stop_gradient(jnp.maximum(rest + jnp.sum(weight), jnp.max(spring)))
    tiny = stiffest * (1e-30 if tau.dtype == jnp.float64 else 1e-10)
    weight, spring = weight[order] + tiny, spring + tiny

    solve = functools.partial(_one_spring, rest, weight, rate)
    return jax.vmap(solve)(spring) if spring.ndim else solve(spring)


def _one_spring(rest, weight, rate, spring):
    pole, distance = _roots(rest / spring, weight / spring, rate)
    own = rate[pole]
    # l_j - l' = (l_j - l_pole) - l_pole * distance, both exact: no cancellation at the pole.
    gap = (rate[None, :] - own[:, None]) / own[:, None] - distance[:, None]
    new_rate = own * (1 + distance)
    # F_i * own, so that rates of 1e30 do not overflow when squared.
    curvature = jnp.sum(weight * (rate[None, :] / own[:, None]) / gap**2, -1)
    new_weight = spring * (spring / curvature) / (1 + distance)
    return rest / (1 + rest / spring), new_weight, 1 / new_rate


@jax.custom_jvp
def _roots(rest, weight, rate):
    """Roots of 1 + f(-l') = 0 as (index of the nearer pole, relative distance to it)."""
    n = rate.shape[0]
    index = jnp.arange(n)
    left = jnp.maximum(index - 1, 0)
    # The sign of 1 + f at the middle of the interval says which end is nearer. Below the
    # first rate the left end is 0, and the root is taken from the first rate always.
    middle = jnp.where(index == 0, 0.5 * rate, 0.5 * (rate[left] + rate))
    from_right = (index == 0) | (_function(rest, weight, rate, middle, jnp.zeros(n)) > 0)
    pole = jnp.where(from_right, index, left)
    own = rate[pole]
    sign = jnp.where(from_right, -1.0, 1.0).astype(rate.dtype)
    width = jnp.where(index == 0, rate, rate - rate[left])
    share = jnp.where(index == 0, 1.0, 0.5)
    # Far below the distances of the smallest weights, and its inverse cube still finite.
    tiny = jnp.asarray(1e-60 if rate.dtype == jnp.float64 else 1e-12, rate.dtype)
    # Two equal rates enclose an empty interval; its mode has no weight, and any point serves.
    high = jnp.log(jnp.maximum(share * width / own, 2 * tiny))
    low = jnp.full_like(high, jnp.log(tiny))

    def halve(_, bounds):
        low, high = bounds
        trial = 0.5 * (low + high)
        value = _function(rest, weight, rate, own, sign * jnp.exp(trial))
        # 1 + f(-l') decreases in l': right of a pole +inf falls, left of one it falls to -inf.
        further = jnp.where(from_right, value < 0, value > 0)
        return jnp.where(further, trial, low), jnp.where(further, high, trial)

    low, high = jax.lax.fori_loop(0, BISECTIONS, halve, (low, high))
    return pole, sign * jnp.exp(0.5 * (low + high))


def _function(rest, weight, rate, own, distance):
    """1 + f(-l') at l' = own (1 + distance), shape (roots,)."""
    # Difference before quotient: XLA may multiply by 1/own, and own/own is not 1 then.
    gap = (rate[None, :] - own[:, None]) / own[:, None] - distance[:, None]
    return 1 + rest - jnp.sum(weight * (1 + distance)[:, None] / gap, -1)


@_roots.defjvp
def _roots_jvp(primals, tangents):
    pole, distance = _roots(*primals)

    # The equation times the distance, which is finite where the root meets its pole.
    def balance(rest, weight, rate, distance):
        own = rate[pole]
        gap = (rate[None, :] - own[:, None]) / own[:, None] - distance[:, None]
        return distance * (1 + rest - jnp.sum(weight * (1 + distance)[:, None] / gap, -1))

    _, by_parameters = jax.jvp(lambda *p: balance(*p, distance), primals, tangents)
    _, by_distance = jax.jvp(lambda d: balance(*primals, d), (distance,), (jnp.ones_like(distance),))
    # In the empty interval between two equal rates the distance is no root, and its
    # derivative, huge, would bring the mode of no weight back: it moves with the rates.
    rate = primals[2]
    empty = jnp.concatenate([jnp.zeros(1, bool), rate[1:] == rate[:-1]])
    by_parameters = jnp.where(empty, 0.0, by_parameters)
    return (pole, distance), (jnp.zeros(pole.shape, jax.dtypes.float0), -by_parameters / by_distance)
