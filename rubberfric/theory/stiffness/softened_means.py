r"""Two deformable solids of which the moving one softens: angular means by quadrature.

.. math:: F = \frac{1}{1/(f E' + i g E'') + 1/k},\qquad k = f E(0)\ \text{of the other solid if it softens}

E' and E'' fall by different factors, so that the solid is no Prony solid any more and the series with
the other one has no closed form. f and g have kinks over q: F is taken at the contact nodes themselves.
"""

import math

import jax
import jax.numpy as jnp

from rubberfric.materials.material import Material
from rubberfric.theory.stiffness.angular_means import Means
from rubberfric.theory.stiffness.tabulated_means import angular_rule


def sampled_means(F, qv, wanted, angle):
    """`Means` at the contact nodes, (panels, points, order).

    Parameters
    ----------
    F : stiffness.Sampled
    qv : q v a_T [1/s], (panels, points, order)
    wanted : set of "power", "dissipation", "storage"
    angle : nodes of the angular integral over a TabulatedModulus; a Prony solid has half as many
    """
    # Without a table's kinks half the nodes are good to 1e-9.
    smooth = not isinstance(F.modulus, Material)
    sine, weight = angular_rule(angle // 2 if smooth else angle, qv.dtype)

    def panel(values):
        qv, storage_factor, loss_factor, spring = values
        omega = qv[..., None] * sine
        storage, loss = _modulus(F.modulus, omega)
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
    power, dissipation, storage = jax.lax.map(jax.checkpoint(panel), (qv, F.storage, F.loss, F.spring))
    return Means(
        (power,) if "power" in wanted else None,
        (dissipation,) if "dissipation" in wanted else None,
        (storage,) if "storage" in wanted else None,
    )


def _modulus(modulus, omega):
    """E' and E'' at omega of any sign, odd in E''."""
    if isinstance(modulus, Material):
        # Far below the table E'' is linear in omega: so v = 0 keeps its derivative.
        floor = jnp.log(modulus.frequency_range()[0]) - math.log(1e9)
        log_omega = jnp.log(jnp.maximum(jnp.abs(omega), float(jnp.finfo(omega.dtype).tiny)))
        log_omega = jnp.maximum(log_omega, floor)
        storage, loss = modulus.storage_and_loss(log_omega)
        sign = jnp.sign(omega) if modulus.loss_at_rest else omega * jnp.exp(-log_omega)
        return storage, loss * sign

    # a^2 must not overflow; beyond the bound the terms are glassy to the last bit.
    bound = 1e150 if omega.dtype == jnp.float64 else 1e18
    storage, loss = jnp.ones_like(omega) * modulus.rest, jnp.zeros_like(omega)
    for i in range(modulus.tau.shape[0]):
        a = jnp.clip(omega * modulus.tau[i], -bound, bound)
        relaxing = modulus.weight[i] * a / (1 + a * a)
        storage, loss = storage + a * relaxing, loss + relaxing
    return storage, loss
