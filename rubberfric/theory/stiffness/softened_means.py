r"""Two deformable solids of which the moving one softens: angular means by quadrature.

.. math:: F = \frac{1}{1/(f E' + i g E'') + 1/k},\qquad k = f E(0)\ \text{of the other solid if it softens}

E' and E'' fall by different factors, so that the solid is no Prony solid any more and the series with
the other one has no closed form. f and g have kinks over q: F is taken at the contact nodes themselves.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.materials.master_curve import interpolated_modulus
from rubberfric.materials.materials import TabulatedModulus
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.angular_means import Means, Relaxing
from rubberfric.theory.stiffness.tabulated_means import angular_rule


class SoftenedInSeries(NamedTuple):
    """F of a softened solid in series with a spring, at given wavevectors, (panels, order) each."""

    modulus: TabulatedModulus | Relaxing  # the latter in units of the scale
    storage: jax.Array  # f times what makes it a stiffness in units of the scale
    loss: jax.Array  # the same with g
    spring: jax.Array  # the other solid at rest [-]
    angle: int  # nodes of the angular integral over a TabulatedModulus; a Prony solid has half as many

    by_node = False  # its panels are those of q

    def means(self, qv: jax.Array, needs: Needs, split: bool = False, harmonics: None = None) -> Means:
        """`Means` of qv = q v a_T [1/s], shape (panels, points, order); neither split nor harmonics."""
        del split, harmonics
        # Without a table's kinks half the nodes are good to 1e-9.
        smooth = isinstance(self.modulus, Relaxing)
        sine, weight = angular_rule(self.angle // 2 if smooth else self.angle, qv.dtype)

        def panel(values):
            qv, storage_factor, loss_factor, spring = values
            omega = qv[..., None] * sine
            storage, loss = _modulus(self.modulus, omega)
            storage, loss = storage_factor[:, None] * storage, loss_factor[:, None] * loss
            square = storage**2 + loss**2
            spring = spring[:, None]
            share = spring / ((storage + spring) ** 2 + loss**2)
            return (
                (share * spring * square) @ weight,
                (share * spring * loss * sine) @ weight,
                (share * (spring * storage + square)) @ weight,
            )

        # Panel by panel, and again for the gradient: all angles at once would take gigabytes.
        power, dissipation, storage = jax.lax.map(
            jax.checkpoint(panel), (qv, self.storage, self.loss, self.spring)
        )
        return Means(
            (power,) if needs.power else None,
            (dissipation,) if needs.dissipation else None,
            (storage,) if needs.storage else None,
        )


def _modulus(modulus: TabulatedModulus | Relaxing, omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """E' and E'' at omega of any sign, odd in E''."""
    if isinstance(modulus, TabulatedModulus):
        # Far below the table E'' is linear in omega: so v = 0 keeps its derivative.
        floor = jnp.log(modulus.omega[0]) - math.log(1e9)
        log_omega = jnp.log(jnp.maximum(jnp.abs(omega), float(jnp.finfo(omega.dtype).tiny)))
        log_omega = jnp.maximum(log_omega, floor)
        storage, loss = interpolated_modulus(modulus, log_omega)
        sign = jnp.sign(omega) if modulus.outside == "hold" else omega * jnp.exp(-log_omega)
        return storage, loss * sign

    # a^2 must not overflow; beyond the bound the terms are glassy to the last bit.
    bound = 1e150 if omega.dtype == jnp.float64 else 1e18
    storage, loss = jnp.ones_like(omega) * modulus.rest, jnp.zeros_like(omega)
    for i in range(modulus.tau.shape[0]):
        a = jnp.clip(omega * modulus.tau[i], -bound, bound)
        relaxing = modulus.weight[i] * a / (1 + a * a)
        storage, loss = storage + a * relaxing, loss + relaxing
    return storage, loss
