r"""Two deformable solids of which the moving one softens: angular means by quadrature.

.. math:: F = \frac{1}{1/(f E' + i g E'') + 1/k},\qquad k = f E(0)\ \text{of the other solid if it softens}

E' and E'' fall by different factors, so that the solid is no Prony solid any more and the series with
the other one has no closed form. f and g have kinks over q: F is taken at the contact nodes themselves.
"""

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.materials.material import Material
from rubberfric.theory.stiffness.angular_means import Means
from rubberfric.theory.stiffness.series import Relaxing, Sampled
from rubberfric.theory.stiffness.tabulated_means import log_and_sign, moduli_at, moduli_on_grid, rule_of_node
from rubberfric.theory.stiffness.uniform_grid import circle_rule

# Step of the trapezoidal rule over the circle for a Prony series, whose poles are pi/2 from the real axis
# of ln omega.
_STEP = 0.22


def sampled_means(F: Sampled, qv: jax.Array, wanted: set | frozenset) -> Means:
    """`Means` at the contact nodes, (panels, points, order).

    Parameters
    ----------
    F : stiffness.Sampled
    qv : q v a_T [1/s], (panels, points, order)
    wanted : set of "power", "dissipation", "storage"
    """
    material = F.modulus if isinstance(F.modulus, Material) else None
    s, psi, weight = circle_rule(_STEP) if material is None else rule_of_node(material)
    cosine, weight = (jnp.asarray(x, qv.dtype) for x in (np.sin(psi), weight))
    moduli = None if material is None else moduli_on_grid(material)

    def panel(values):
        qv, storage_factor, loss_factor, spring = values
        if material is None:
            storage, loss = _series_modulus(F.modulus, qv[..., None] * cosine)
        else:
            log_qv, sign = log_and_sign(material, qv)
            storage, loss = moduli_at(material, moduli, log_qv[..., None] - s)
            loss = loss * sign[..., None]
        storage, loss = storage_factor[:, None] * storage, loss_factor[:, None] * loss
        square = storage**2 + loss**2
        spring = spring[:, None]
        share = spring / ((storage + spring) ** 2 + loss**2)
        return (
            (share * spring * square) @ weight,
            (share * spring * loss * cosine) @ weight,
            (share * (spring * storage + square)) @ weight,
        )

    # Panel by panel, and again for the gradient: all angles at once would take gigabytes.
    power, dissipation, storage = jax.lax.map(jax.checkpoint(panel), (qv, F.storage, F.loss, F.spring))
    return Means(
        (power,) if "power" in wanted else None,
        (dissipation,) if "dissipation" in wanted else None,
        (storage,) if "storage" in wanted else None,
    )


def _series_modulus(series: Relaxing, omega):
    """E' and E'' of a Prony series at omega of any sign, odd in E''."""
    # a^2 must not overflow; beyond the bound the terms are glassy to the last bit.
    bound = 1e150 if omega.dtype == jnp.float64 else 1e18
    storage, loss = jnp.ones_like(omega) * series.rest, jnp.zeros_like(omega)
    for i in range(series.tau.shape[0]):
        a = jnp.clip(omega * series.tau[i], -bound, bound)
        relaxing = series.weight[i] * a / (1 + a * a)
        storage, loss = storage + a * relaxing, loss + relaxing
    return storage, loss
