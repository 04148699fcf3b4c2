r"""Angular means by quadrature for two deformable solids if the strained one softens.

.. math:: F = \frac{1}{1/(f E' + i g E'') + 1/k},\qquad k = f E(0)\ \text{of the other solid if it softens}

E' and E'' decrease by different factors, so the solid is not a Prony solid and the series stiffness has no
closed form. f and g have kinks over q, so F is evaluated at the contact nodes.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.compilation import exact_products
from rubberfric.materials.material import Material, clip_for_square
from rubberfric.theory.stiffness.angular_means import Means, PronyStiffness
from rubberfric.theory.stiffness.circle_means import circle_rule
from rubberfric.theory.stiffness.tabulated_means import log_frequency, moduli_at, moduli_on_grid, rule_of_node
from rubberfric.theory.structure import RequiredMeans

# Step of the integral over the circle for a Prony series, whose poles are pi/2 from the real axis of ln
# omega, and t at which the step is larger by sqrt(2). The error is 1e-11, and 2e-10 with a growth of 5.
_STEP, _GROWTH = 0.3, 7.0


class SoftenedInSeries(NamedTuple):
    """Series stiffness F of a softened solid and a spring, at wavevectors of shape (panels, order)."""

    modulus: Material | PronyStiffness  # a material without a series, or a series in units of the scale
    storage: jax.Array  # f times the factor that gives a stiffness in units of the scale
    loss: jax.Array  # the same with g
    spring: jax.Array  # the other solid at rest [-]

    by_node = False  # the panels are those of q

    def means(
        self,
        qv: jax.Array,
        needs: RequiredMeans,
        strained: jax.Array | None = None,
        resting: jax.Array | None = None,
    ) -> Means:
        """Return the `Means` at qv = q v a_T [1/s], shape (panels, points, order).

        `strained` is b_T of the strained solid, and `resting` is b_T of the rough solid. Arrays of b_T must
        broadcast to the shape of qv. None stands for b_T = 1.
        """
        modulus = self.modulus
        if isinstance(modulus, PronyStiffness):
            _, psi, weight = circle_rule(_STEP, _GROWTH)
            moduli_along = functools.partial(_series_modulus, modulus, np.sin(psi))
        else:
            s, psi, weight = rule_of_node(modulus)
            moduli_along = functools.partial(_modulus, modulus, moduli_on_grid(modulus), s)
        sine, weight = (jnp.asarray(x, qv.dtype) for x in (np.sin(psi), weight))

        def panel(values):
            qv, *factors = values
            return _means_in_series(moduli_along(qv), tuple(factors), sine, weight)

        # Panel by panel, recomputed for the gradient, because all angles at once would take gigabytes.
        factors = (
            self._stiffer(qv, (self.storage, self.loss), strained),
            self._stiffer(qv, (self.spring,), resting),
        )
        found = jax.lax.map(jax.checkpoint(panel), (qv, *factors[0], *factors[1]))
        found = dict(zip(("mean_abs2", "mean_cos_loss", "mean_storage"), found, strict=True))
        return {kind: (found[kind],) for kind in needs.kinds if kind in found}

    @staticmethod
    def _stiffer(qv, factors, vertical):
        """Multiply factors of shape (panels, order) by the vertical shift b_T.

        If `vertical` is None, the factors are unchanged. Otherwise the result has the shape (panels, points,
        order).
        """
        if vertical is None:
            return factors
        return tuple(jnp.broadcast_to(x[:, None] * vertical, qv.shape) for x in factors)


@jax.custom_jvp
def _means_in_series(moduli, factors, sine, weight):
    """Return <|F|^2>, <cos(phi) F''> and <F'>.

    `moduli` are E' and E'' in all directions, which lie along the last axis. `factors` are f, g and the
    spring k.
    """
    storage_factor, loss_factor, spring = (x[..., None] for x in factors)
    storage, loss = storage_factor * moduli[0], loss_factor * moduli[1]
    square = storage**2 + loss**2
    share = spring / ((storage + spring) ** 2 + loss**2)
    return (
        (share * spring * square) @ weight,
        (share * spring * loss * sine) @ weight,
        (share * (spring * storage + square)) @ weight,
    )


@_means_in_series.defjvp
@exact_products
def _means_in_series_jvp(primals, tangents):
    """Use F = k z / (z + k), dF = (k / (z + k))^2 dz + (z / (z + k))^2 dk with z = f E' + i g E''."""
    moduli, factors, sine, weight = primals
    storage_factor, loss_factor, k = (x[..., None] for x in factors)
    storage, loss = storage_factor * moduli[0], loss_factor * moduli[1]
    inverse = 1 / ((storage + k) ** 2 + loss**2)
    # k / (z + k) and z / (z + k), without cancellation.
    own = k * (storage + k) * inverse, -k * loss * inverse
    other = (storage * (storage + k) + loss**2) * inverse, -own[1]
    slope, by_spring = ((re**2 - im**2, 2 * re * im) for re, im in (own, other))
    F = k * other[0], k * other[1]
    storage_factor_dot, loss_factor_dot, k_dot = (_along(x, storage) for x in tangents[1])
    storage_dot = moduli[0] * storage_factor_dot + storage_factor * tangents[0][0]
    loss_dot = moduli[1] * loss_factor_dot + loss_factor * tangents[0][1]
    re_dot = slope[0] * storage_dot - slope[1] * loss_dot + by_spring[0] * k_dot
    im_dot = slope[1] * storage_dot + slope[0] * loss_dot + by_spring[1] * k_dot
    dots = 2 * (F[0] * re_dot + F[1] * im_dot), sine * im_dot, re_dot
    return _means_in_series(*primals), tuple(x @ weight for x in dots)


def _along(x, values):
    """Broadcast x along the last axis of `values` by a matrix product.

    The transpose of a matrix product sums faster than the transpose of a broadcast.
    """
    x = jnp.broadcast_to(x, values.shape[:-1])
    return x[..., None] @ jnp.ones((1, values.shape[-1]), x.dtype)


def _modulus(material, moduli, s, qv):
    """Return E' and E'' at the frequencies q v e^-s, of shape (..., directions). E'' is odd in q v."""
    log_qv, sign = log_frequency(material, qv)
    storage, loss = moduli_at(material, moduli, log_qv[..., None] - jnp.asarray(s, log_qv.dtype))
    return storage, loss * sign[..., None]


def _series_modulus(series, cosine, qv):
    omega = qv[..., None] * jnp.asarray(cosine, qv.dtype)
    storage, loss = _relaxing(omega, series.weight, series.tau)
    return storage + series.rest, loss


@jax.custom_jvp
def _relaxing(omega, weight, tau):
    """Sum weight a^2 / (1 + a^2) and weight a / (1 + a^2) over the terms, where a = omega tau."""
    storage, loss = jnp.zeros_like(omega), jnp.zeros_like(omega)
    for i in range(tau.shape[0]):
        a = clip_for_square(omega * tau[i])
        relaxing = weight[i] * a / (1 + a * a)
        storage, loss = storage + a * relaxing, loss + relaxing
    return storage, loss


@_relaxing.defjvp
def _relaxing_jvp(primals, tangents):
    omega, weight, tau = primals

    # Term by term, recomputed for the gradient. Otherwise XLA computes all terms again for the derivative
    # with respect to each of them.
    @functools.partial(jax.checkpoint, prevent_cse=False)
    def add(sums, term):
        (weight, tau), (weight_dot, tau_dot) = term
        a = clip_for_square(omega * tau)
        inverse = 1 / (1 + a * a)
        loss = a * inverse
        a_dot = tangents[0] * tau + omega * _along(tau_dot, omega)
        weight_dot = _along(weight_dot, omega)
        storage_dot = 2 * weight * loss * inverse * a_dot + a * loss * weight_dot
        # (1 - a^2) / (1 + a^2)^2 without a square that overflows.
        loss_dot = weight * (inverse - a * loss) * inverse * a_dot + loss * weight_dot
        return (sums[0] + storage_dot, sums[1] + loss_dot), None

    nothing = jnp.zeros_like(omega)
    terms = (weight, tau), tuple(tangents[1:])
    return _relaxing(*primals), jax.lax.scan(add, (nothing, nothing), terms)[0]
