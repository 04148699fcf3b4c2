r"""A Prony solid in series with a spring is a Prony solid with the same number of terms.

For f(s) = f_rest + sum_i f_i s/(s + l_i), rates l_i = 1/tau_i, and a spring k,

.. math:: \frac{k f}{k + f} = \frac{k f_\infty}{k + f_\infty} + \sum_i f_i' \frac{s}{s + l_i'}

with one new rate l' in every interval between neighbouring old ones (the first between 0
and l_1): the roots of k + f(-l') = 0. The weights are f_i' = k^2 / (l_i' F_i) with
F_i = sum_j f_j l_j / (l_j - l_i')^2. Each root is found in the logarithm of its distance
to the nearer end of its interval, as LAPACK's laed4 does: the rate itself loses all
digits of that distance once k >> f, and of the first rate once k << f.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

BISECTIONS = 64


class _Roots(NamedTuple):
    """l' = own (anchor + distance), own = rate[pole]; shape (n,) each."""

    pole: jax.Array
    anchor: jax.Array  # 1: measured from a rate; 0: from 0 (the first root only)
    distance: jax.Array  # negative to the left of the anchor


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
    # A unit of time in the middle of the spectrum: rates of 1e25/s squared leave float32.
    unit = jax.lax.stop_gradient(tau[order[tau.shape[0] // 2]])
    rate = unit / tau[order]
    # A term or spring of no stiffness would put a root on a pole, 0/0, and with it a
    # spurious mode. A part of 1e-30 (float32: 1e-10) of the stiffest is as good as none,
    # and the derivative with respect to it stays that of the original.
    stiffest = jax.lax.stop_gradient(jnp.maximum(rest + jnp.sum(weight), jnp.max(spring)))
    tiny = stiffest * (1e-30 if tau.dtype == jnp.float64 else 1e-10)
    weight, spring = weight[order] + tiny, spring + tiny

    solve = functools.partial(_one_spring, rest, weight, rate)
    rest, weight, tau = jax.vmap(solve)(spring) if spring.ndim else solve(spring)
    return rest, weight, unit * tau


def _one_spring(rest, weight, rate, spring):
    roots = _roots(rest / spring, weight / spring, rate)
    own = rate[roots.pole]
    relative = roots.anchor + roots.distance
    # F_i * own, so that rates need not be squared; 1/gap first, for the derivative of
    # 1/gap^2 holds a fourth power that leaves float32.
    curvature = jnp.sum(weight * (rate / own[:, None]) * (1 / _gaps(rate, roots)) ** 2, -1)
    new_weight = jnp.where(_empty(rate), 0.0, spring * (spring / curvature) / relative)
    return rest / (1 + rest / spring), new_weight, 1 / (own * relative)


def _empty(rate):
    """Intervals between two equal rates: one mode fewer, so that of the interval has no weight."""
    return jnp.concatenate([jnp.zeros(1, bool), rate[1:] == rate[:-1]])


def _gaps(rate, roots):
    """(l_j - l') / own for all roots and rates, without cancellation at the anchor."""
    # Difference before quotient: XLA may multiply by 1/own, and own/own is not 1 then.
    own = rate[roots.pole][:, None]
    return (rate - roots.anchor[:, None] * own) / own - roots.distance[:, None]


def _function(rest, weight, rate, roots):
    """1 + f(-l'), shape (roots,); it falls from +inf to -inf between two rates."""
    relative = (roots.anchor + roots.distance)[:, None]
    return 1 + rest - jnp.sum(weight * relative / _gaps(rate, roots), -1)


@jax.custom_jvp
def _roots(rest, weight, rate):
    """Roots of 1 + f(-l') = 0 for ascending rates."""
    n = rate.shape[0]
    index = jnp.arange(n)
    left = jnp.maximum(index - 1, 0)
    below = jnp.where(index == 0, 0.0, rate[left])
    # The sign in the middle of the interval says which end is nearer.
    half = 0.5 * (rate - below)
    at_middle = _Roots(index, jnp.ones_like(rate), -half / rate)
    right = _function(rest, weight, rate, at_middle) > 0
    pole = jnp.where(right, index, left)
    anchor = jnp.where(right | (index > 0), 1.0, 0.0).astype(rate.dtype)
    sign = jnp.where(right, -1.0, 1.0).astype(rate.dtype)
    # Far below the distances of the smallest weights, and its inverse cube still finite.
    tiny = 1e-60 if rate.dtype == jnp.float64 else 1e-11
    high = jnp.log(jnp.maximum(half / rate[pole], 2 * tiny))
    low = jnp.full_like(high, jnp.log(tiny))

    def halve(_, bounds):
        low, high = bounds
        trial = 0.5 * (low + high)
        value = _function(rest, weight, rate, _Roots(pole, anchor, sign * jnp.exp(trial)))
        further = jnp.where(right, value < 0, value > 0)
        return jnp.where(further, trial, low), jnp.where(further, high, trial)

    low, high = jax.lax.fori_loop(0, BISECTIONS, halve, (low, high))
    # An empty interval has no root: any point will do that is far from every pole.
    distance = jnp.where(_empty(rate), -0.5, sign * jnp.exp(0.5 * (low + high)))
    return _Roots(pole, anchor, distance)


@_roots.defjvp
def _roots_jvp(primals, tangents):
    roots = _roots(*primals)

    # The equation times the distance, which is finite where the root meets its pole.
    def balance(rest, weight, rate, distance):
        return distance * _function(rest, weight, rate, roots._replace(distance=distance))

    distance = roots.distance
    _, by_parameters = jax.jvp(lambda *p: balance(*p, distance), primals, tangents)
    _, by_distance = jax.jvp(lambda d: balance(*primals, d), (distance,), (jnp.ones_like(distance),))
    fixed = jnp.zeros(roots.pole.shape, jax.dtypes.float0)
    return roots, _Roots(fixed, jnp.zeros_like(roots.anchor), -by_parameters / by_distance)
