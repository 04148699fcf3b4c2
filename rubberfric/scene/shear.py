r"""Contact shear: resistance of the contact area to shearing, in addition to viscoelastic losses.

.. math:: \mu_\mathrm{con} = \frac{\tau_f(v^*)}{\sigma_0}\frac{A}{A_0},\qquad
          \tau_f = \tau_{f0}\, e^{-c\,[\log_{10}(v^*/v_0)]^2},\qquad v^* = a_T' v

This law is empirical: friction on smooth glass is such a bell curve, which shifts with temperature
[Grosch, Proc. R. Soc. A 274 (1963) 21].
"""

import math

import jax
import jax.numpy as jnp

from rubberfric.base.checks import NONNEGATIVE, PLAUSIBLE_STRESS, POSITIVE
from rubberfric.base.objects.fields import Number, child, leaf
from rubberfric.base.objects.physical import PhysicalObject, physical
from rubberfric.materials.shifts import Shift, log_vertical

_LN_10 = math.log(10.0)  # a NumPy float would widen float32


@physical
class ContactShear(PhysicalObject):
    r"""Shear stress in the contact area, a bell curve over the logarithm of the velocity.

    .. math:: \tau_f = \tau_{f0} \exp\left(-c\,[\log_{10}(a_T' v / v_0)]^2\right)

    Parameters
    ----------
    tau_f0 : largest shear stress, >= 0 [Pa]; 6.5e6 for a tread compound
    c : decay on either side of v0, >= 0 [-]; about 0.1
    v0 : velocity of the largest stress at the reference temperature, > 0 [m/s]; about 6e-3, up to 10
        in the literature
    shift : WLF, Arrhenius, TabulatedShift or None
        shift of v0 with temperature, independent of the material's shift; a_T' = 1 if None or without a
        temperature. Arrhenius(energy, T_ref), energy about 0.97 eV, gives
        ln a_T' = (energy / k_B) (1/T - 1/T_ref). A vertical shift multiplies the stress by b_T'.

    Limits: the stress is odd in the velocity. For c > 0 the stress decreases faster than any power of v for v
    -> 0, so value and slope are 0 at v = 0. The stress falls to 1/e of its maximum at v = v0 10^(1/sqrt(c)),
    so a very small c is like c = 0. For c = 0 the stress is dry friction, tau_f0 sign(v), which is
    discontinuous at v = 0, where value and derivatives are set to 0. ln a_T' saturates at a quarter of the
    exponent range (see `rubberfric.materials.shifts`).
    """

    tau_f0: Number = leaf(NONNEGATIVE, unit="Pa", plausible=PLAUSIBLE_STRESS)
    c: Number = leaf(NONNEGATIVE, unit="-")
    v0: Number = leaf(POSITIVE, unit="m/s")
    shift: Shift | None = child(default=None)


def shear_friction(
    shear: ContactShear,
    area: jax.Array,
    velocity: jax.Array,
    pressure: jax.Array,
    temperature: jax.Array | None = None,
) -> jax.Array:
    r"""Return the friction coefficient of contact shear, (tau_f / sigma_0) (A / A_0) sign(v).

    Parameters
    ----------
    shear : ContactShear
    area : A/A0, array [-]
    velocity, pressure, temperature : arrays, broadcastable [m/s], [Pa], [K]

    Returns
    -------
    array, broadcast shape [-]
    """
    log_ratio = _log(jnp.abs(velocity)) - _log(shear.v0)
    if temperature is not None and shear.shift is not None:
        log_ratio = log_ratio + shear.shift.log_factor(temperature)
    largest = shear.tau_f0 * area / pressure
    log_vertical_factor = log_vertical(shear.shift, temperature)
    if log_vertical_factor is not None:
        largest = largest * jnp.exp(log_vertical_factor)
    return jnp.sign(velocity) * largest * _bell(shear.c, log_ratio / _LN_10)


def _log(speed):
    """Return ln(speed) for speed >= 0, which is finite and has the derivative 0 at speed 0.

    The result is constant below the smallest normal number. At rest the friction has the exact factor
    sign(v) = 0, which would otherwise multiply ln 0 in the value and 1/0 in derivatives.
    """
    smallest = float(jnp.finfo(jnp.result_type(speed, 1.0)).tiny)
    return jnp.log(jnp.maximum(speed, smallest))


@jax.custom_jvp
def _bell(c, x):
    return jnp.exp(-c * x * x)


@_bell.defjvp
def _bell_jvp(primals, tangents):
    # The value comes first in every product. Otherwise c x dx in forward mode may overflow (c = 1e30 or
    # dx = dv/v = 1e30) before it is multiplied by e^(-c x^2) = 0.
    c, x = primals
    value = _bell(c, x)
    return value, -(value * x * x) * tangents[0] - (2 * (value * c) * x) * tangents[1]
