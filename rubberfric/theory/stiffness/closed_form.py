r"""Means over the direction of sliding of a Prony series that faces a rigid solid.

For F(omega), omega = q v cos(phi), three means over phi:

    mean_abs2      <|F|^2>            enters G
    mean_cos_loss  <cos(phi) Im F>    enters mu
    mean_storage   <Re F>             enters u_bar

The residues at s = i omega = 1/tau_i give closed forms, with a_i = q v tau_i and r_i = sqrt(1 + a_i^2),

.. math:: \langle|F|^2\rangle = F_\infty^2 + 2\sum_i F_i F(s = 1/\tau_i)\,(1 - 1/r_i)
.. math:: \langle\cos\varphi\,\mathrm{Im} F\rangle = \sum_i F_i \frac{a_i}{r_i (1 + r_i)},\qquad
          \langle\mathrm{Re} F\rangle = F_\infty + \sum_i F_i (1 - 1/r_i)

These formulas take one square root and one division for each node, term and velocity, without an angular
grid.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.compilation import exact_products
from rubberfric.materials.material import clip_for_square
from rubberfric.theory.structure import RequiredMeans

# By kind, "mean_abs2", "mean_cos_loss", "mean_storage" and "mean_sin_loss": one array each. <|F|^2> has two,
# <F'^2> and <F''^2>, if they are needed separately.
Means = dict[str, tuple[jax.Array, ...]]
# Shares (c_m, s_m) of the harmonics of anisotropic roughness, m = 1, 2, ... along the first axis.
Harmonics = tuple[jax.Array, jax.Array]


class PronyStiffness(NamedTuple):
    """F(s) = rest + sum_i weight_i s tau_i / (1 + s tau_i)."""

    rest: jax.Array  # [-], shape ()
    weight: jax.Array  # [-], shape (n,)
    tau: jax.Array  # [s], shape (n,)
    square_weight: jax.Array  # 2 F_i F(s = 1/tau_i) [-], shape (n,)

    @classmethod
    def of(cls, rest: jax.Array, weight: jax.Array, tau: jax.Array) -> "PronyStiffness":
        """Return F with the weights of <|F|^2>, which do not depend on the velocity."""
        # By logarithms, because 40 decades of tau overflow float32 in the value or the derivative.
        at_own_rates = rest + _sum_of_shares(weight, jnp.log(tau))
        return cls(rest, weight, tau, 2 * weight * at_own_rates)

    def means(self, qv: jax.Array, needs: RequiredMeans) -> Means:
        """Return the `Means` at qv = q v a_T [1/s] of any shape; negative for reversed sliding."""
        weights = {"mean_abs2": self.square_weight}
        weights |= {kind: self.weight for kind in ("mean_cos_loss", "mean_storage")}
        sums = _sums({kind: weights[kind] for kind in needs.kinds}, self.tau, qv)
        constants = {"mean_abs2": self.rest**2, "mean_storage": self.rest}
        return {kind: (constants[kind] + x if kind in constants else x,) for kind, x in sums.items()}


@jax.custom_jvp
def _sums(weights, tau, qv):
    """Sum over the terms at every q v in one pass. No array of size terms x points is stored."""
    front = (slice(None), *(None,) * qv.ndim)
    storage, sine = _relaxation(_stored(tau)[front] * qv)
    parts = {"mean_abs2": storage, "mean_cos_loss": sine, "mean_storage": storage}
    return {name: jnp.sum(_stored(weight)[front] * parts[name], 0) for name, weight in weights.items()}


def _stored(values):
    """Return the values unchanged, computed as sums.

    XLA stores the result of a sum. XLA would repeat any other operation for every point.
    """
    return jnp.sum(jnp.where(jnp.eye(values.shape[0], dtype=bool), values, 0.0), -1)


@_sums.defjvp
@exact_products
def _sums_jvp(primals, tangents):
    return jax.jvp(_sums_as_products, primals, tangents)


def _sums_as_products(weights, tau, qv):
    """Return the sums of `_sums` as matrix products.

    Matrix products are slower than one pass, but have a faster derivative.
    """
    storage, sine = _relaxation(tau[:, None] * qv.reshape(-1))
    parts = {"mean_abs2": storage, "mean_cos_loss": sine, "mean_storage": storage}
    return {name: (weight @ parts[name]).reshape(qv.shape) for name, weight in weights.items()}


@jax.custom_jvp
def _relaxation(a):
    """Return 1 - 1/r and a / (r (1 + r)) for r = sqrt(1 + a^2), without cancellation."""
    return _relaxation_parts(a)[:2]


@_relaxation.defjvp
def _relaxation_jvp(primals, tangents):
    # d(1 - 1/r) = a/r^3 da and d sine = (1/r^3 - 1/(r (1 + r))) da need only products. Differentiating the
    # expressions would repeat divisions and roots.
    storage, sine, r, inverse = _relaxation_parts(*primals)
    cube = (inverse * (1 + r)) ** 3
    return (storage, sine), (primals[0] * cube * tangents[0], (cube - inverse) * tangents[0])


def _relaxation_parts(a):
    a = clip_for_square(a)
    r = jnp.sqrt(1 + a * a)
    inverse = 1 / (r * (1 + r))
    sine = a * inverse
    return a * sine, sine, r, inverse


@jax.custom_jvp
def _sum_of_shares(weight, log_tau):
    """Return sum_j weight_j tau_j / (tau_i + tau_j)."""
    return jnp.sum(_pair_shares(log_tau) * weight, -1)


@_sum_of_shares.defjvp
@exact_products
def _sum_of_shares_jvp(primals, tangents):
    # Matrix products: elementwise derivatives of n^2 shares take several times as long.
    (weight, log_tau), (weight_dot, log_tau_dot) = primals, tangents
    share = _pair_shares(log_tau)
    slope = share * share.T * weight
    moved = slope @ log_tau_dot - jnp.sum(slope, -1) * log_tau_dot
    return share @ weight, share @ weight_dot + moved


def _pair_shares(log_tau):
    """Return tau_j / (tau_i + tau_j), a matrix with rows i; the transposed matrix is 1 minus the matrix."""
    return jax.nn.sigmoid(log_tau - log_tau[:, None])
