r"""Contact area and friction by a law that was fitted to boundary elements.

In the theory a solid in partial contact follows the share P S of the roughness. In boundary elements the
share W(q, phi) is different, and there are displacements beyond q1. The law describes both. E stands for
E / (1 - nu^2) of both solids in series, <> for the mean over phi, and D = dF / d ln q:

.. math:: F = \frac{\int_{q_0}^q q^3 C\,dq}{\int_{q_0}^{q_1} q^3 C\,dq},\qquad
          \alpha = \frac{m_0 m_4}{m_2^2},\qquad h' = \sqrt{m_2},\qquad B = 1 - A
.. math:: \ln E_g = \langle\ln|E|\rangle,\qquad E_r^2 = \langle|E|^2\rangle,\qquad
          E_h^{-2} = \langle|E|^{-2}\rangle,\qquad
          E_A = E_g^{B^a} E_r^{1 - B^a},\qquad E_W = E_h^{B^a} E_r^{1 - B^a}
.. math:: \ln\psi = B^{c_A}\,[c_0 - c_D\ln D + c_f\ln F - c_n N^2]
          + A B\,[h_0 - h_D\ln D + h_F\ln F - c_n N^2],
.. math:: N = \ln(F / D + 1/4),\qquad W_m = \big[1 + (A\psi)^{-n/B}\big]^{-B/n}
.. math:: T = \frac{c_T\,A B\,D(q_1)^{c_e}}{(1 + c_r A)^2 (1 + c_\alpha\ln\alpha)}
.. math:: E_\mathrm{eff}^2 = \text{mean of } E_A^2 \text{ with weights per } d\ln q\quad
          D\,W_m\ (q < q_1),\quad k\,D(q_1)\,T\ (q_1 < q < 6 q_1)
.. math:: A = \mathrm{erf}\frac{\sqrt2\,\sigma_0}{E_\mathrm{eff}\,h'\sqrt{S_0 + (1 - S_0) A^{s}}},\qquad
          S_0 = 1 - \frac{1}{s_0 + s_\alpha\ln\alpha}
.. math:: \frac{W}{1 - W} = \frac{W_m}{1 - W_m}\Big(\frac{E_\mathrm{eff}}{E_W}\Big)^{c_v B + c_w A}
          \Big(\frac{E_W}{|E|}\Big)^{c_\varphi B}
.. math:: \mu = \frac{1}{2\sigma_0}\int d^2q\,q^2\cos\varphi\,\mathrm{Im}E \times
          \begin{cases} C W & q < q_1 \\ T\,C(q_1)\Big(\dfrac{q}{q_1}\Big)^{-7}
          \Big(\dfrac{E_\mathrm{eff}}{E_h}\Big)^{c_b}\Big(\dfrac{E_h}{|E|}\Big)^{c_\varphi}
          & q_1 < q < 6 q_1\end{cases}

The exponent c_phi = 1.4 means that the stress in light contact depends little on the direction: with 2 it
would be isotropic. For a slab, E contains the factor by which the slab is stiffer than a half-space, a
function of q.

Anisotropic roughness has the density g(phi) over the directions, with the mean 1. All means <> and the
integrals over phi then contain the density g_B, S_0 a factor, and ln(psi) and ln(T) a term:

.. math:: g_B = B\,\frac{g^{1 - c_g}}{\langle g^{1 - c_g}\rangle} + (1 - B)\,g,\qquad
          e = |\langle g\,e^{2i\varphi}\rangle|
.. math:: S_0 \to S_0\,(1 - c_{eS}\,e^2),\qquad c_0 \to c_0 - c_{e0}\,e^2,\qquad T \to T\,e^{-c_{eT}\,e^2}

e is the difference of the mean square slopes along the two principal directions over their sum. The
displacements in light contact are less anisotropic than the roughness.

In full contact W = 1 and T = 0, so that area and friction are the paper's. At light load W and T are
proportional to A, so that mu does not depend on the load. The constants were fitted in
`tests/rubberfric/theory/area/test_law_and_boundary_elements.py`, to cases with q1/q0 = 4 to 512 and
A/A0 = 0.2 to 100 %. Other cases test them (notebooks/law_table.md). N describes how fast F grows: the power
of the displacements decreases towards q1 if F grows slowly, as for H = 1.

The numerical errors of area and friction are below 1e-7 for Prony series with moduli that rise by up to 1e4,
compared with an independent quadrature of 60 random scenes (`test_law_quadrature.py`). For tabulated moduli
they are below 1e-6 with the default quadrature, and 1e-8 with `Quadrature()`. For a liquid (E_inf = 0) E_h is
0 in sliding, because <1/|E|^2> diverges. The law then contains E_h of a circle that ends at cos(phi) = e^-45,
so its friction has no accurate value. At rest the area of a liquid and the derivative of the friction are
right.
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.special import erf

from rubberfric.base.fixed_points import implicit
from rubberfric.materials.in_series import in_series
from rubberfric.materials.material import E_r
from rubberfric.theory.area.law_roughness import Law

# Most secant steps of a fixed point. A point that needs more is reported as not converged.
_STEPS = 30


class State(NamedTuple):
    """The contact at points. Arrays have the shape (points,) unless a comment gives another shape."""

    area: jax.Array
    mu: jax.Array  # viscoelastic friction, with the part beyond q1
    mu_of_q: jax.Array  # part from every node, (points, all nodes)
    across: list[jax.Array]  # friction across the sliding; empty if isotropic
    share: jax.Array  # W where abs(E) = E_W, (points, nodes)
    converged: jax.Array


class Means(NamedTuple):
    """Logarithms of means over phi, with the factor of the slab, (points, all nodes)."""

    log_E_g: jax.Array
    log_E_r: jax.Array
    log_E_h: jax.Array


class Moduli(NamedTuple):
    """E of both solids in series over a scale, so that no square overflows, and its means over phi."""

    loss: jax.Array  # Im E of the half-space, (points, grid)
    log_E: jax.Array  # ln |E| of the half-space, (points, grid)
    softest: jax.Array  # smallest log_E, (points, 1)
    # Means of log_E, E^2 and (softest / E)^2 for each density over phi, (3, points, all nodes).
    circle: list[jax.Array]
    means: Means | None  # None if anisotropic, where they depend on B


def solve_law(law: Law, velocity: jax.Array, pressure: jax.Array, temperature: jax.Array | None) -> State:
    """Return the `State` at points.

    The conditions have the shape (points,). The modulus is evaluated on the grid of ln(q cos(phi)), on which
    the integrals over the circle are matrices.
    """
    shape = law.shape
    T = None if temperature is None else temperature[:, None]
    # For v < 0 the frequencies are negative, so derivatives at v = 0 are right.
    E = _modulus(law, velocity[:, None] * shape.circle.grid, T)  # (points, grid) [Pa]
    scale = _scale(E)
    moduli = _moduli(E / scale[:, None], shape)
    log_load = jnp.log(math.sqrt(2) * pressure / scale) - jnp.log(shape.slope)

    def balance(log_load, moduli, law, y):
        # y is the logarithm of the argument of erf.
        A, B = _area(y)
        return log_load - _log_E_eff(A, B, moduli, law) - _log_slope(A, law)

    # Derivatives are stopped before the loop, because a loop has no derivatives in reverse mode.
    still = jax.lax.stop_gradient((log_load, moduli, law))
    y, converged = _fixed_point(functools.partial(balance, *still), still[0])
    y = implicit(lambda y: balance(log_load, moduli, law, y[:, 0])[:, None], y[:, None])[:, 0]
    A, B = _area(y)
    log_E_eff = log_load - y - _log_slope(A, law)
    share, here = _below_q1(A, B, log_E_eff, moduli, law)
    there = _beyond_q1(A, B, log_E_eff, moduli, law)
    factor = shape.height2 * shape.total * scale / (2 * pressure)
    mu_of_q, *across = (factor[:, None] * jnp.concatenate(both, -1) for both in zip(here, there, strict=True))
    return State(
        A, jnp.sum(mu_of_q, -1), mu_of_q, [jnp.sum(density, -1) for density in across], share, converged
    )


def _scale(E):
    """Return the largest |E| along the last axis, > 0 and without derivatives; a liquid at rest has E = 0."""
    least = float(jnp.finfo(E.dtype).tiny) ** (1 / 3)
    return jax.lax.stop_gradient(jnp.maximum(jnp.max(jnp.abs(E), -1), least))


def _moduli(E, shape):
    log_E = _log_abs(E)
    softest = jax.lax.stop_gradient(jnp.min(log_E, 1, keepdims=True))
    powers = jnp.stack([log_E, jnp.exp(2 * log_E), jnp.exp(2 * (softest - log_E))])
    moduli = Moduli(jnp.imag(E), log_E, softest, [powers @ mean.T for mean in shape.circle.mean], None)
    return moduli if shape.e2 is not None else moduli._replace(means=_means(None, moduli, shape))


def _log_abs(E):
    """Return ln|E|, which is finite for E = 0."""
    return 0.5 * jnp.log(jnp.real(E) ** 2 + jnp.imag(E) ** 2 + float(jnp.finfo(E.dtype).tiny) ** 0.8)


def _means(B, moduli, shape):
    if moduli.means is not None:
        return moduli.means
    log_E, E2, over_E2 = _at(B, moduli.circle)
    return Means(
        log_E + shape.log_S_bar,
        0.5 * jnp.log(E2) + shape.log_S_bar,
        moduli.softest - 0.5 * jnp.log(over_E2) + shape.log_S_bar,
    )


def _log_W_m(A, B, law):
    shape, c = law.shape, law.constants
    A, B = A[:, None], B[:, None]
    slow = c.c_n * shape.N2
    light = c.c_0 - c.c_D * shape.log_D + c.c_f * shape.log_F - slow
    heavy = c.h_0 - c.h_D * shape.log_D + c.h_F * shape.log_F - slow
    if shape.e2 is not None:
        light = light - c.c_e0 * shape.e2
    # ln(A psi) / B is finite in full contact.
    some = B > 1e-8
    log_A = jnp.where(some, jnp.log(jnp.where(some, A, 0.5)) / jnp.where(some, B, 0.5), -1.0)
    return -B * _softplus(-c.n * (log_A + B ** (c.c_A - 1) * light + A * heavy)) / c.n


def _T(A, B, law):
    shape, c = law.shape, law.constants
    log_T = c.c_e * shape.log_D_end
    if shape.e2 is not None:
        log_T = log_T - c.c_eT * shape.e2
    below = (1 + c.c_r * A) ** 2 * (1 + c.c_alpha * shape.log_alpha)
    return c.c_T * A * B * jnp.exp(log_T) / below


def _log_E_eff(A, B, moduli, law):
    shape, c = law.shape, law.constants
    partial, means = B[:, None] ** c.a, _means(B, moduli, shape)
    log_E_A = partial * means.log_E_g + (1 - partial) * means.log_E_r
    here = _weight(shape) * jnp.exp(_log_W_m(A, B, law))
    there = (c.k * jnp.exp(shape.log_D_end) * _T(A, B, law))[:, None] * shape.step
    weights = jnp.concatenate([here, there], -1)
    return 0.5 * jnp.log(jnp.sum(weights * jnp.exp(2 * log_E_A), -1) / jnp.sum(weights, -1))


def _log_slope(A, law):
    # ln of the square root in the equation for A
    shape, c = law.shape, law.constants
    S_0 = 1 - 1 / (c.s_0 + c.s_alpha * shape.log_alpha)
    if shape.e2 is not None:
        S_0 = S_0 * (1 - c.c_eS * shape.e2)
    return 0.5 * jnp.log(S_0 + (1 - S_0) * A**c.s)


def _below_q1(A, B, log_E_eff, moduli, law):
    """Return W where |E| = E_W, and the integrals of D W Im E cos(phi), and sin(phi) if anisotropic.

    All have the shape (points, nodes).
    """
    shape, c = law.shape, law.constants
    inside = shape.weight.size
    partial, means = B[:, None] ** c.a, _means(B, moduli, shape)
    log_E_W = (partial * means.log_E_h + (1 - partial) * means.log_E_r)[:, :inside]
    odds = jnp.expm1(-_log_W_m(A, B, law))  # (1 - W) / W
    odds = odds * jnp.exp((c.c_v * B + c.c_w * A)[:, None] * (log_E_W - log_E_eff[:, None]))
    log_S_bar = shape.log_S_bar[:inside]
    # |E| of the half-space in the factor that depends on phi.
    around = odds * jnp.exp(-c.c_phi * B[:, None] * (log_E_W - log_S_bar))
    stiff = jnp.exp(c.c_phi * B[:, None] * moduli.log_E)
    kinds = _along_and_across(shape, slice(inside))

    # Point by point, because W has an entry for every node and grid point; computed again in reverse mode.
    @jax.checkpoint
    def ring(point):
        loss, odds, stiff = point
        lost = loss / (1 + odds[:, None] * stiff)
        return [[jnp.sum(weights * lost, -1) for weights in kind] for kind in kinds]

    lost = [_at(B, kind) for kind in jax.lax.map(ring, (moduli.loss, around, stiff))]
    return 1 / (1 + odds), [_weight(shape) * jnp.exp(log_S_bar) * mean for mean in lost]


def _beyond_q1(A, B, log_E_eff, moduli, law):
    """Return the integrals of the power beyond q1 times Im E cos(phi), and sin(phi) if anisotropic.

    They have the shape (points, nodes beyond).
    """
    shape, c = law.shape, law.constants
    inside = shape.weight.size
    log_S_bar, log_E_h = shape.log_S_bar[inside:], _means(B, moduli, shape).log_E_h[:, inside:]
    loss = moduli.loss * jnp.exp(-c.c_phi * moduli.log_E)
    log_factor = c.c_b * (log_E_eff[:, None] - log_E_h) + c.c_phi * (log_E_h - log_S_bar) + log_S_bar
    height = jnp.exp(shape.log_D_end) * _T(A, B, law)
    factor = height[:, None] * jnp.exp(log_factor - 3 * shape.beyond) * shape.step
    kinds = _along_and_across(shape, slice(inside, None))
    return [factor * _at(B, [loss @ weights.T for weights in kind]) for kind in kinds]


def _along_and_across(shape, nodes):
    """Return the weights with cos(phi), and with sin(phi) if anisotropic, as lists over the densities."""
    kinds = shape.circle.along, shape.circle.across
    return [[weights[nodes] for weights in kind] for kind in kinds if len(kind)]


def _at(B, values):
    """Return the value with the density g_B from the values with each density, (..., points, nodes)."""
    full, *light = values
    return full + B[:, None] * (light[0] - full) if light else full


def _weight(shape):
    # d F at the nodes
    return shape.weight.reshape(-1) / shape.total


def _modulus(law, omega, T):
    """Return E / (1 - nu^2) of both solids in series [Pa]."""
    E = E_r(law.strained.material, omega, T) if law.strained.material.deforms else None
    if not law.rough.material.deforms:
        assert E is not None
        return E
    own = E_r(law.rough.material, None, T) + jnp.zeros_like(omega)
    return own if E is None else in_series(E, own)


def _area(y):
    # y is the logarithm of the argument of erf.
    A = erf(jnp.exp(jnp.minimum(y, 3.5)))  # A = 1 to the last bit from exp(1.8) on
    return A, 1 - A


def _fixed_point(balance, start):
    """Solve y = balance(y) by secants, and return (y, converged).

    y and `converged` have the shape (points,). `balance` and `start` must not carry derivatives.
    """
    tolerance = 1e-13 if start.dtype == jnp.float64 else 1e-5

    def ended(y, change):
        return change <= tolerance * (1 + jnp.abs(y))

    def step(progress):
        k, y, before, residual_before, last = progress
        residual = balance(y) - y
        moved = y != before
        slope = (residual - residual_before) / jnp.where(moved, y - before, 1.0)
        change = residual / jnp.where(moved, jnp.clip(-slope, 0.5, 6.0), 1.0)
        # A point ends at its own convergence, so that its result does not depend on the others.
        still = ended(y, last)
        following = y + change, y, residual, jnp.abs(change)
        kept = zip((y, before, residual_before, last), following, strict=True)
        return k + 1, *(jnp.where(still, old, new) for old, new in kept)

    def going(progress):
        k, y, *_, change = progress
        return (k < _STEPS) & ~jnp.all(ended(y, change))

    begin = 0, start, start, start, jnp.full_like(start, jnp.inf)
    _, y, *_, change = jax.lax.while_loop(going, step, begin)
    return y, change <= 10 * tolerance * (1 + jnp.abs(y))


@jax.custom_jvp
def _softplus(x):
    return jnp.maximum(x, 0.0) + jnp.log1p(jnp.exp(-jnp.abs(x)))


@_softplus.defjvp
def _softplus_jvp(primals, tangents):
    # JAX's derivatives of max and abs have cases for ties, 5 % of the code of a compiled gradient of the law.
    return _softplus(*primals), jax.nn.sigmoid(primals[0]) * tangents[0]
