r"""Loss of contact at each length scale, and the distribution of the separations.

At the wavevector q the solids touch over the share P(q) of the nominal area. Finer roughness opens gaps in
this area, with the volume u_bar P per nominal area. The area that leaves contact at q has the mean separation
u1 [Yang & Persson, J. Phys.: Condens. Matter 20, 215214 (2008), doi:10.1088/0953-8984/20/21/215214], with
G(q) = 1/(4 X^2), P = erf X:

.. math:: u_1 = \frac{d[\bar u P]}{dP} = \frac{scale}{2\sigma_0} P\int_q^{q_1} k(x)\, dU,\qquad
          x = \frac{1}{2 P\sqrt{G(q') - G(q)}},\qquad U = \frac{1}{scale}\int d^2q \sum_j C_j
          \langle\mathrm{Re}K_j\rangle
.. math:: k = x\Psi + x s' + c\,x^2\,(x s' - x\Psi),\qquad c = \frac{\sqrt\pi}{2}\frac{P^3}{X^3}e^{X^2}

This is the derivative of the mean separation of the roughness above q under the pressure sigma_0 / P; s = S
P. The separations of that area have a Gaussian distribution about u1 with the width of the heights above q,
reflected at contact [Almqvist, Campana, Prodanov & Persson, J. Mech. Phys. Solids 59, 2355 (2011),
doi:10.1016/j.jmps.2011.08.004].
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax.scipy.special import erf, erfc

from rubberfric.base.compilation import exact_products
from rubberfric.base.quadrature import gauss, typed
from rubberfric.theory.area.partial_contact import TWO_OVER_ROOT_PI, contact_fraction, separation_weight

# X above which no area can leave contact (1 - P = 2e-17, float32: 1e-7) and c would overflow.
_NOTHING_LOST = 6.0

# Argument above which erfcx is its asymptotic series.
_BORDER = 8.0

# Number of terms of this series: its error at the border is 1e-15.
_TERMS = 14

# ln x of the first entry of the table of k, x = 4e-18, below the area that the lightest load leaves.
_LOWEST = -40.0

# Step of the table in ln x.
_STEP = 0.01

# Number of entries, up to x = 5.4, where k is 1e-12 of its maximum.
_ENTRIES = 4170


def loss_factor(X: jax.Array) -> jax.Array:
    """Return the factor c, which is 4/pi at light load and constant above X = 6."""
    X = jnp.minimum(X, _NOTHING_LOST)
    return 0.5 * math.sqrt(math.pi) * (contact_fraction(X) / X) ** 3 * jnp.exp(X * X)


def loss_weight(x: jax.Array, c: jax.Array, gamma: jax.Array | float) -> jax.Array:
    """Return the weight k(x), which is 0 at x = 27."""
    P = erf(x)
    slope = x * TWO_OVER_ROOT_PI * jnp.exp(-x * x) * (gamma + 3 * (1 - gamma) * P * P)
    gap = separation_weight(x, gamma)
    return gap + slope + c * x * x * (slope - gap)


def cubic(t: jax.Array, f0: jax.Array, f1: jax.Array, d0: jax.Array, d1: jax.Array) -> jax.Array:
    """Evaluate a cubic Hermite polynomial at the share t of a cell.

    f0 and f1 are the values at the ends of the cell. d0 and d1 are the slopes times the width of the cell.
    """
    rise = f1 - f0
    return f0 + t * (d0 + t * (3 * rise - 2 * d0 - d1 + t * (d0 + d1 - 2 * rise)))


class LossTable(NamedTuple):
    """Table of -dk / d ln x at uniform steps of ln x.

    -dk / d ln x is linear in c. The first row is the part without c, and the second row is the factor of c.
    """

    gamma: jax.Array
    value: jax.Array  # for one gamma, (2, entries)
    slope: jax.Array  # derivative of value times the step, (2, entries)

    def __call__(self, log_x: jax.Array, c: jax.Array) -> jax.Array:
        """Return -dk / d ln x, which is 0 for x > 5.4. The error is 3e-8 of the maximum."""
        table = jax.lax.stop_gradient((self.value, self.slope))
        without, times_c = (_part(i, 0, self.gamma, table, log_x) for i in range(2))
        return without + c * times_c


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _part(row, order, gamma, table, log_x):
    """Return the derivative of the given order by ln x of one row of a table for gamma."""
    # Only the derivative uses gamma.
    del gamma
    return _derivative(order, table, row, log_x)


@_part.defjvp
@exact_products
def _part_jvp(row, order, primals, tangents):
    # The table is linear in gamma. The derivative with respect to each entry would cost a scatter per node.
    (gamma, table, log_x), (by_gamma, _, by_log_x) = primals, tangents
    low, high = typed(_loss_tables(), log_x)
    rise, value = _part(row, order + 1, gamma, table, log_x), _part(row, order, gamma, table, log_x)
    return value, rise * by_log_x + _part(row, order, gamma, high - low, log_x) * by_gamma


def _derivative(order, table, row, log_x):
    """Evaluate a derivative of the polynomials of one row.

    Beyond the ends of the table, the polynomials are evaluated at the first or the last entry.
    """
    place = (log_x - _LOWEST) / _STEP
    k = jnp.clip(place, 0, _ENTRIES - 2).astype(int)
    value, slope = (values[row] for values in table)
    polynomial = functools.partial(cubic, f0=value[k], f1=value[k + 1], d0=slope[k], d1=slope[k + 1])
    for _ in range(order):
        polynomial = functools.partial(_by_share, polynomial)
    return polynomial(jnp.clip(place - k, 0.0, 1.0)) / _STEP**order


def _by_share(function, t):
    return jax.jvp(function, (t,), (jnp.ones_like(t),))[1]


def loss_table(gamma: jax.Array) -> LossTable:
    """Return the `LossTable` for one gamma in 0 ... 1."""
    tables = typed(_loss_tables(), gamma)
    return LossTable(gamma, *(tables[0] + gamma * (tables[1] - tables[0])))


@functools.cache
def _loss_tables():
    """Return values and slopes of both parts of `LossTable` for gamma = 0 and gamma = 1.

    The array has the axes (gamma, value or slope, part, entry).
    """
    log_x = _LOWEST + _STEP * np.arange(_ENTRIES)
    x = np.exp(log_x)
    node, weight = gauss(12)
    tables = []
    for gamma in (0.0, 1.0):
        s1, s2, s3 = _energy_slopes(x, gamma)
        between = np.exp(log_x[:-1, None] + _STEP * node)
        # The slope is 0 beyond the last entry.
        steps = _STEP * _energy_slopes(between, gamma)[0] @ weight
        gap = x * np.append(np.cumsum(steps[::-1])[::-1], 0.0)
        s1, s2, s3 = x * s1, x**2 * s2, x**3 * s3
        fall, turn = gap - s1, 2 * s2 + s3
        without = -(gap + s2), -(fall + turn)
        times_c = -(4 * s1 + s2 - 3 * gap), -(4 * (s1 + s2) + turn - 3 * fall)
        times_c = x**2 * times_c[0], x**2 * (2 * times_c[0] + times_c[1])
        tables.append(np.stack([without, times_c], 1) * np.array([1.0, _STEP])[:, None, None])
    return np.stack(tables)


def _energy_slopes(x, gamma):
    """Return the first three derivatives of s = S P with respect to x."""
    P, bell = scipy.special.erf(x), TWO_OVER_ROOT_PI * np.exp(-x * x)
    s1 = bell * (gamma + 3 * (1 - gamma) * P**2)
    s2 = -2 * x * s1 + 6 * (1 - gamma) * P * bell**2
    return s1, s2, -2 * s1 - 2 * x * s2 + 6 * (1 - gamma) * bell**2 * (bell - 4 * x * P)


def spread(separation: jax.Array, width: jax.Array, reach: jax.Array) -> jax.Array:
    r"""Return the mean of exp(-u / reach) over a Gaussian about a separation, reflected at 0.

    .. math:: \tfrac12 e^{-t^2/2}\big[\mathrm{erfcx}\tfrac{a - t}{\sqrt2}
              + \mathrm{erfcx}\tfrac{a + t}{\sqrt2}\big],\qquad a = \frac{h}{r},\quad t = \frac{u}{h}

    Parameters
    ----------
    separation, width : u >= 0 and h > 0 [m]
    reach : r > 0 [m]
    """
    a, t = width / reach, separation / width
    # The square must be finite in float32; the exponential is 0 for much smaller arguments.
    bell = jnp.exp(-0.5 * jnp.minimum(t, 1e3) ** 2)
    below = t < a
    near = bell * scaled_erfc(jnp.where(below, a - t, 0.0) / math.sqrt(2))
    # Otherwise the two exponents are added before they overflow.
    joined = jnp.where(below, 0.0, a * (0.5 * a - t))
    far = jnp.exp(joined) * erfc(jnp.where(below, 0.0, a - t) / math.sqrt(2))
    return 0.5 * (jnp.where(below, near, far) + bell * scaled_erfc((a + t) / math.sqrt(2)))


def scaled_erfc(z: jax.Array) -> jax.Array:
    """Return erfcx(z) = exp(z^2) erfc(z) for z >= 0."""
    # jax.scipy.special.erfcx of jax 0.10 is 0 above z = 26.6, in float32 above 9.4.
    low = jnp.minimum(z, _BORDER)
    high = jnp.maximum(z, _BORDER)
    step, series = -0.5 / (high * high), jnp.ones_like(high)
    for n in range(_TERMS, 0, -1):
        series = 1 + (2 * n - 1) * step * series
    return jnp.where(z < _BORDER, jnp.exp(low * low) * erfc(low), series / (math.sqrt(math.pi) * high))
