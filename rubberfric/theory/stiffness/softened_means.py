r"""Two deformable solids of which the moving one softens: angular means by quadrature.

.. math:: F = \frac{1}{1/(f E' + i g E'') + 1/k},\qquad k = f E(0)\ \text{of the other solid if it softens}

E' and E'' fall by different factors, so that the solid is no Prony solid any more and the series with
the other one has no closed form. f and g have kinks over q: F is taken at the contact nodes themselves.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.materials.material import Material, squarable
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.angular_means import Means, Relaxing
from rubberfric.theory.stiffness.circle_means import circle_rule
from rubberfric.theory.stiffness.tabulated_means import log_frequency, moduli_at, moduli_on_grid, rule_of_node

# Step of the integral over the circle of a Prony series, whose poles are pi/2 from the real axis of ln omega:
# good to 3e-11.
_STEP = 0.3


class SoftenedInSeries(NamedTuple):
    """F of a softened solid in series with a spring, at given wavevectors, (panels, order) each."""

    modulus: Material | Relaxing  # without a series, or its series in units of the scale
    storage: jax.Array  # f times what makes it a stiffness in units of the scale
    loss: jax.Array  # the same with g
    spring: jax.Array  # the other solid at rest [-]

    by_node = False  # its panels are those of q

    def means(
        self,
        qv: jax.Array,
        needs: Needs,
        strained: jax.Array | None = None,
        resting: jax.Array | None = None,
    ) -> Means:
        """`Means` of qv = q v a_T [1/s], shape (panels, points, order).

        strained, resting : b_T of either solid, broadcastable to qv; None: 1
        """
        modulus = self.modulus
        if isinstance(modulus, Relaxing):
            _, psi, weight = circle_rule(_STEP)
            moduli_along = functools.partial(_series_modulus, modulus, np.sin(psi))
        else:
            s, psi, weight = rule_of_node(modulus)
            moduli_along = functools.partial(_modulus, modulus, moduli_on_grid(modulus), s)
        sine, weight = (jnp.asarray(x, qv.dtype) for x in (np.sin(psi), weight))

        def panel(values):
            qv, storage_factor, loss_factor, spring = values
            storage, loss = moduli_along(qv)
            storage, loss = storage_factor[..., None] * storage, loss_factor[..., None] * loss
            square = storage**2 + loss**2
            spring = spring[..., None]
            share = spring / ((storage + spring) ** 2 + loss**2)
            return (
                (share * spring * square) @ weight,
                (share * spring * loss * sine) @ weight,
                (share * (spring * storage + square)) @ weight,
            )

        # Panel by panel, and again for the gradient: all angles at once would take gigabytes.
        factors = (
            self._stiffer(qv, (self.storage, self.loss), strained),
            self._stiffer(qv, (self.spring,), resting),
        )
        found = jax.lax.map(jax.checkpoint(panel), (qv, *factors[0], *factors[1]))
        found = dict(zip(("power", "dissipation", "storage"), found, strict=True))
        return {kind: (found[kind],) for kind in needs.kinds if kind in found}

    @staticmethod
    def _stiffer(qv, factors, vertical):
        """Factors (panels, order) times b_T, (panels, points, order)."""
        if vertical is None:
            return factors
        return tuple(jnp.broadcast_to(x[:, None] * vertical, qv.shape) for x in factors)


def _modulus(material, moduli, s, qv):
    """E' and E'' at q v e^-s, (..., directions), odd in q v."""
    log_qv, sign = log_frequency(material, qv)
    storage, loss = moduli_at(material, moduli, log_qv[..., None] - jnp.asarray(s, log_qv.dtype))
    return storage, loss * sign[..., None]


def _series_modulus(series, cosine, qv):
    """The same of a Prony series at q v cos(phi)."""
    omega = qv[..., None] * jnp.asarray(cosine, qv.dtype)
    storage, loss = _relaxing(omega, series.weight, series.tau)
    return storage + series.rest, loss


@jax.custom_jvp
def _relaxing(omega, weight, tau):
    """Sums over the terms of weight a^2 / (1 + a^2) and weight a / (1 + a^2), a = omega tau."""
    storage, loss = jnp.zeros_like(omega), jnp.zeros_like(omega)
    for i in range(tau.shape[0]):
        a = squarable(omega * tau[i])
        relaxing = weight[i] * a / (1 + a * a)
        storage, loss = storage + a * relaxing, loss + relaxing
    return storage, loss


@_relaxing.defjvp
def _relaxing_jvp(primals, tangents):
    omega, weight, tau = primals

    # Term by term, and again for the gradient: left alone, XLA computes all terms anew for the derivative
    # by each of them.
    @functools.partial(jax.checkpoint, prevent_cse=False)
    def add(sums, term):
        (weight, tau), (weight_dot, tau_dot) = term
        a = squarable(omega * tau)
        inverse = 1 / (1 + a * a)
        loss = a * inverse
        a_dot = tangents[0] * tau + omega * tau_dot
        storage_dot = 2 * weight * loss * inverse * a_dot + a * loss * weight_dot
        # (1 - a^2) / (1 + a^2)^2, whose square must not overflow.
        loss_dot = weight * (inverse - a * loss) * inverse * a_dot + loss * weight_dot
        return (sums[0] + storage_dot, sums[1] + loss_dot), None

    nothing = jnp.zeros_like(omega)
    terms = (weight, tau), tuple(tangents[1:])
    return _relaxing(*primals), jax.lax.scan(add, (nothing, nothing), terms)[0]
