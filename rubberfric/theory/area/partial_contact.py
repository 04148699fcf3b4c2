r"""Universal functions of partial contact: P, S and Psi of one argument.

At wavevector q everything depends on load and roughness through

.. math:: x(q) = \frac{1}{2\sqrt{G(q)}},\qquad P = \mathrm{erf}\,x,\qquad S = \gamma + (1-\gamma)P^2

[Scaraggi & Persson, eqs. (10), (14)].
"""

import functools
import itertools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf

from rubberfric.base.quadrature import chebyshev_fit, gauss, typed

# Slope of erf at 0, the factor of exp(-x^2) in its derivative.
TWO_OVER_ROOT_PI = 2 / math.sqrt(math.pi)
# Euler's constant in the exponential integral, E_1(z) = Ein(z) - ln z - EULER.
_EULER = 0.57721566490153286


class AdhesiveLoad(NamedTuple):
    """Adhesion as an equivalent load. Arrays have the shape (points,)."""

    load: jax.Array  # load / sigma_0 that gives the same contact without adhesion
    converged: jax.Array
    lift: jax.Array | None = None  # excess of the separation over that under this load [m]


def _largest(dtype):
    """Return the x above which 1 - P, e^(-x^2) and Psi are zero to the last bit of the dtype."""
    return 27.0 if dtype == jnp.float64 else 10.0


@jax.custom_jvp
def contact_argument(G: jax.Array) -> jax.Array:
    r"""Return x = 1 / (2 sqrt(G)).

    x is limited to 27 (10 in float32), where P = 1.

    Parameters
    ----------
    G : >= 0 [-], any shape
    """
    dtype = jnp.result_type(G)
    # G = 0 (no roughness) gives the largest x.
    root = jnp.maximum(jnp.sqrt(G), 0.5 / _largest(dtype))
    if dtype == jnp.float32:
        # At very light load G is infinite there: x must not be 0, because the separation takes its logarithm.
        root = jnp.minimum(root, float(jnp.finfo(dtype).max) ** 0.5)
    return 0.5 / root


@contact_argument.defjvp
def _contact_argument_jvp(primals, tangents):
    # dx = -2 x^3 dG stays finite at G = 0, where the chain rule has 0 * inf and e^(-x^2) = 0 follows.
    # This order of factors does not underflow in float32 for small x and large dG.
    x = contact_argument(*primals)
    return x, -2 * (x * tangents[0] * x) * x


def energy_factor(P: jax.Array, gamma: jax.Array | float) -> jax.Array:
    """Return S, the ratio of the elastic energy of partial contact to the energy of full contact."""
    return gamma + (1 - gamma) * P * P  # (14)


def contact_fraction(x: jax.Array) -> jax.Array:
    """Return P, the share of the nominal area in contact at the resolution q."""
    return jnp.minimum(erf(x), 1.0)  # (10); JAX's erf reaches 1 + 2e-7 in float32


@jax.custom_jvp
def separation_weight(x: jax.Array, gamma: jax.Array | float) -> jax.Array:
    r"""Return x Psi(x), the pressure integral of the mean separation times 2 sigma_0.

    .. math:: \int_{\sigma_0}^\infty \frac{dp}{2p} \frac{\partial (SP)}{\partial p}
              = \frac{x}{2\sigma_0}\Psi(x), \qquad
              \Psi = \int_x^\infty \frac{s'(t)}{t} dt,\quad
              s = \gamma\,\mathrm{erf} + (1-\gamma)\,\mathrm{erf}^3

    P depends on the pressure p only through x = p / (2 sigma_0 sqrt G).

    Limits: error 1e-11 relative to Psi(1); 0 < x <= 27.
    """
    tables = {name: typed(table, x) for name, table in _psi_tables().items()}
    z = x * x
    # Each branch is evaluated inside its own range only, so that neither overflows.
    low = jnp.minimum(z, 2.0)
    small = _polynomial((1 - gamma) * tables["Q"] + gamma * tables["Ein"], low - 1)
    # Compare x, because its square overflows float32.
    log_low = 2 * jnp.log(jnp.minimum(x, math.sqrt(2)))
    small = small - gamma / math.sqrt(math.pi) * (_EULER + log_low)
    high = jnp.maximum(z, 2.0)
    decay = jnp.exp(-high)
    u = _to_unit((high - 2) / (high + 2), *tables["h1_range"])
    plain = _polynomial(tables["h1"], u)
    # Above x = 5.5 the next term is e^-30 of the first.
    u = _to_unit(jnp.clip(x, math.sqrt(2), 5.5), *tables["h3_range"])
    root = jnp.maximum(x, math.sqrt(2))
    correction = _polynomial(tables["h3"], u) * decay / root
    large = decay / high * ((3 - 2 * gamma) * plain - (1 - gamma) * correction)
    return x * jnp.where(z < 2, small, large)


@separation_weight.defjvp
def _separation_weight_jvp(primals, tangents):
    # d(x Psi)/dx = Psi - s'(x), exact; the derivative in gamma is x (Psi(gamma=1) - Psi(gamma=0)).
    x, gamma = primals
    value = separation_weight(x, gamma)
    P = erf(x)
    slope = TWO_OVER_ROOT_PI * jnp.exp(-x * x) * (gamma + 3 * (1 - gamma) * P * P)
    by_gamma = separation_weight(x, 1.0) - separation_weight(x, 0.0)
    return value, (value / x - slope) * tangents[0] + by_gamma * tangents[1]


def _to_unit(value, low, high):
    return (2 * value - (low + high)) / (high - low)


def _polynomial(coefficients, u):
    result = jnp.zeros_like(u)
    for k in range(coefficients.shape[0] - 1, -1, -1):
        result = result * u + coefficients[k]
    return result


@functools.cache
def _psi_tables():
    r"""Return the Chebyshev fits of the parts of Psi, from quadrature on the host; z = x^2.

    z < 2:  Psi = gamma/sqrt(pi) [-C - ln z + Ein(z)] + (1-gamma) Q(z)
    z > 2:  Psi = e^-z/z {(3 - 2 gamma) h1 - (1-gamma) e^-z/x h3}
    with h1 from E1(z) and h3 from the part 1 - erf^2 of erf^2.
    """
    node, weight = gauss(40)
    verf, verfc = np.vectorize(math.erf), np.vectorize(math.erfc)

    def from_zero(z, f):  # int_0^z f
        return np.sum(z[..., None] * weight * f(z[..., None] * node), -1)

    def tail(z, f):  # int_0^inf e^-y f(z + y) dy / (2 (z + y)), panels halving towards y = 0
        total = np.zeros_like(z)
        edges = np.concatenate([[0.0], 2.0 ** np.arange(-6, 6), [45.0]])
        for a, b in itertools.pairwise(edges):
            y = a + (b - a) * node
            total += np.sum((b - a) * weight * np.exp(-y) * f(z[..., None], y) / (2 * (z[..., None] + y)), -1)
        return total

    def integrand_Q(t2):
        t = np.sqrt(t2)
        return 3 / math.sqrt(math.pi) * verf(t) ** 2 * np.exp(-t2) / t2

    def h1(z):
        return z * tail(z, lambda *_: TWO_OVER_ROOT_PI)

    def h3(x):
        def f(z, y):
            t = np.sqrt(z + y)
            return 3 * TWO_OVER_ROOT_PI * verfc(t) * (1 + verf(t)) * np.exp(t * t - y)

        return x**3 * tail(x * x, f)

    whole = np.array([2.0])
    at_two = np.exp(-2.0) / 2 * (3 * h1(whole) - np.exp(-2.0) / math.sqrt(2) * h3(np.sqrt(whole)))
    Q_zero = at_two + from_zero(whole, integrand_Q)
    low, high = 0.0, (729.0 - 2) / (729 + 2)
    return {
        "Q": chebyshev_fit(lambda z: Q_zero - from_zero(z, integrand_Q), 0.0, 2.0, 16),
        "Ein": chebyshev_fit(
            lambda z: from_zero(z, lambda t: -np.expm1(-t) / t) / math.sqrt(math.pi), 0.0, 2.0, 16
        ),
        "h1": chebyshev_fit(lambda u: h1(2 * (1 + u) / (1 - u)), low, high, 18),
        "h1_range": (low, high),
        "h3": chebyshev_fit(h3, math.sqrt(2), 5.5, 20),
        "h3_range": (math.sqrt(2), 5.5),
    }
