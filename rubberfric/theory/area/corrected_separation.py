r"""Separation with S in G: how far solids are apart where they leave contact at a length scale.

With dG = S dg, the share of the area in contact, P = erf X with G = 1/(4 X^2), is a function of g = 1/(4 x^2)
(`rubberfric.theory.area.area_correction`). The elastic energy of partial contact is proportional to s = S P,
so that area and separation belong to the same contact. With w(x) in place of x Psi(x), the derivation of
`rubberfric.theory.area.separations` gives

.. math:: u_1 = \frac{d[\bar u P]}{dP} = \frac{1}{2\sigma_0} P\int_q^{q_1} k(x)\, dU,\qquad
          w = x\int_x^\infty \frac{s'(t)}{t}\,dt,\qquad
          k = w + x s' + c\,x^2\,(x s' - w),\qquad c = \frac{\sqrt\pi}{2}\frac{P^3}{S X^3}e^{X^2}

where s' is the derivative of s = S P by x, x = 1 / (2 P sqrt(g(q') - g(q))) within the integral, and c
belongs to q. The integral over s' is a table over ln x, which depends on gamma alone.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import gauss, typed
from rubberfric.theory.area.area_correction import (
    UniformTable,
    correct_argument,
    correction_table,
    quintic_table,
)
from rubberfric.theory.area.partial_contact import TWO_OVER_ROOT_PI, contact_fraction, energy_factor

# x above which k is negligible: e^(-x^2) is 1e-14 of its maximum.
CLOSEST = 5.7

# ln x of the first entry of the table. Below it, the integral over s' is linear in ln x.
_LOWEST = -20.0

# Number of entries of the table.
_ENTRIES = 551

# Gauss nodes of the integral between two entries.
_ORDER = 6


class CorrectedSeparation(NamedTuple):
    """Functions of the contact with S in G for one gamma."""

    gamma: jax.Array
    correction: UniformTable  # ln(G/g) over ln g
    gap: UniformTable  # w / x over ln x

    def corrected(self, x: jax.Array) -> jax.Array:
        """Return X, given x <= 27."""
        return correct_argument(self.correction, x)

    def loss_weight(self, x: jax.Array, c: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return k and dk / d ln x, given x <= 27."""
        s1, s2 = _energy_slopes(x, self.corrected(x), self.gamma)
        w = x * self.gap(jnp.log(x))
        fall = s1 - w
        return w + s1 + c * x * x * fall, s2 - fall + c * x * x * (3 * fall + s2)


def corrected_separation(gamma: jax.Array) -> CorrectedSeparation:
    """Return the `CorrectedSeparation` for one gamma in 0 ... 1."""
    gamma = jnp.asarray(gamma)
    correction = correction_table(gamma)
    step = (math.log(CLOSEST) - _LOWEST) / (_ENTRIES - 1)
    entry = typed(_LOWEST + step * np.arange(_ENTRIES), gamma)
    node, weight = (typed(table, gamma) for table in gauss(_ORDER))
    # One pass over entries and nodes compiles in half the time of two.
    place = jnp.append(entry, (entry[:-1, None] + step * node).reshape(-1))
    x = jnp.exp(place)
    s1, s2 = _energy_slopes(x, correct_argument(correction, x), gamma)
    parts = step * (s1 / x)[_ENTRIES:].reshape(-1, _ORDER) @ weight
    # From the largest x on, where the smallest parts are.
    value = jnp.append(jnp.cumsum(parts[::-1])[::-1], 0.0)
    s1, s2, x = s1[:_ENTRIES], s2[:_ENTRIES], x[:_ENTRIES]
    gap = quintic_table(entry[0], typed(step, gamma), value, -s1 / x, (s1 - s2) / x)
    return CorrectedSeparation(gamma, correction, gap)


def corrected_loss_factor(X: jax.Array, gamma: jax.Array) -> jax.Array:
    """Return the factor c at the corrected argument X, which is 4 / (pi gamma) at light load."""
    P = contact_fraction(X)
    # Above 6 no area leaves contact, and the exponential would overflow.
    X = jnp.minimum(X, 6.0)
    return 0.5 * math.sqrt(math.pi) * (P / X) ** 3 * jnp.exp(X * X) / energy_factor(P, gamma)


def _energy_slopes(x, X, gamma):
    """Return the first two derivatives of s = S P by ln x, given the corrected argument X."""
    P, bell = contact_fraction(X), TWO_OVER_ROOT_PI * jnp.exp(-X * X)
    S, steep = energy_factor(P, gamma), gamma + 3 * (1 - gamma) * P * P
    # d ln X / d ln x, because dG = S dg.
    growth = S * (X / x) ** 2
    rise = bell * X * growth  # dP / d ln x
    s1 = steep * rise
    curl = 2 * (1 - gamma) * P * rise * (1 / S + 3 / steep)
    return s1, s1 * (growth * (3 - 2 * X * X) - 2 + curl)
