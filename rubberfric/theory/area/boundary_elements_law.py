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

import dataclasses
import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf

from rubberfric.base.fixed_points import implicit
from rubberfric.base.quadrature import Quadrature, gauss, typed
from rubberfric.materials.in_series import in_series
from rubberfric.materials.material import E_r, poisson_of
from rubberfric.roughness.anisotropy import slope_anisotropy
from rubberfric.roughness.moments import cumulative_moment
from rubberfric.roughness.radial_mesh import Mesh, build_mesh
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio
from rubberfric.scene.scene import Body
from rubberfric.theory.area.circle_matrices import CircleMatrices, Directions, circle_matrices
from rubberfric.theory.structure import RoughSurface


class LawConstants(NamedTuple):
    """Constants of the law, fitted to area and friction of boundary-element cases."""

    c_0: float = -0.5612
    c_D: float = 1.3603
    c_f: float = 0.9126
    c_A: float = 10.3965
    h_0: float = 0.8383
    h_D: float = 0.8062
    h_F: float = 0.9096
    c_T: float = 1.7475
    c_r: float = 4.1060
    c_alpha: float = 0.3293
    c_e: float = -0.3533
    k: float = 0.1313
    s: float = 0.8171
    s_0: float = 1.5632
    s_alpha: float = 0.2101
    a: float = 13.5378
    c_v: float = 1.2951
    c_w: float = 5.3132
    c_phi: float = 1.3741
    c_b: float = 1.2164
    c_n: float = 0.5253
    c_g: float = 0.3356  # this and the next three: anisotropic roughness
    c_eS: float = 0.3779
    c_e0: float = 0.5298
    c_eT: float = 0.5582
    n: float = 32.0  # sharpness of the bound W_m < 1, not fitted


CONSTANTS = LawConstants()

# End of the displacements beyond q1, over q1.
END = 6.0

# Gauss nodes in ln q beyond q1.
_BEYOND = 10

# Gauss nodes in ln q beyond q1 for tabulated moduli. With 10 nodes, noisy tables have errors of 1e-6.
_BEYOND_OF_TABLE = 24

# Most secant steps of a fixed point. A point that needs more is reported as not converged.
_STEPS = 30


class Shape(NamedTuple):
    """Roughness at the nodes, independent of velocity, pressure and temperature."""

    mesh: Mesh
    weight: jax.Array  # q^4 C / height2 times d ln q, (panels, order)
    log_F: jax.Array  # at the nodes, (nodes,)
    log_D: jax.Array  # (nodes,)
    N2: jax.Array  # N^2, (nodes,)
    log_D_end: jax.Array  # ln D(q1)
    height2: jax.Array  # scale of the roughness [m^2]
    total: jax.Array  # integral of q^3 C / height2 over q
    slope: jax.Array  # h'
    log_alpha: jax.Array
    beyond: jax.Array  # ln(q / q1) above q1, (nodes beyond,)
    step: jax.Array  # d ln q above q1, (nodes beyond,)
    circle: CircleMatrices  # at the nodes and beyond; rows for g, and for the light contact if anisotropic
    e2: jax.Array | None  # e^2, None if isotropic
    log_slab: jax.Array  # ln of slab over half-space stiffness, or 0, (all nodes,)


class Law(NamedTuple):
    """The law for one scene, prepared for many points."""

    shape: Shape
    strained: Body
    rough: Body
    constants: LawConstants


class State(NamedTuple):
    """The contact at points. Arrays have the shape (points,) unless a comment gives another shape."""

    area: jax.Array
    mu: jax.Array  # viscoelastic friction, with the part beyond q1
    mu_of_q: jax.Array  # part from every node, (points, all nodes)
    across: list[jax.Array]  # friction across the sliding; empty if isotropic
    share: jax.Array  # W where abs(E) = E_W, (points, nodes)
    converged: jax.Array


def prepare_law(surface: RoughSurface, quadrature: Quadrature, constants: LawConstants = CONSTANTS) -> Law:
    """Prepare the law for two solids with one rough surface."""
    # W is smooth near q0, so fewer nodes than in the theory suffice. The rounded kinks of a tabulated modulus
    # need a finer grid of frequencies, but not more nodes, because means over phi are smooth over q.
    share = 0.75 if surface.detail is None else 0.45
    panels = max(3, math.ceil(share * quadrature.panels))
    quadrature = dataclasses.replace(quadrature, order=min(quadrature.order, 10), panels=panels, graded=2)
    law = surface.law._replace(height2=jnp.ones_like(surface.law.height2))
    mesh = build_mesh([law], quadrature, graded=True)
    weight = mesh.roughness[0]
    total = jnp.sum(weight)
    F = cumulative_moment(law, 2, log_ratio(mesh.q, law.q[0])) / (2 * jnp.pi * total)
    # In panels of zero width at q0, F is 0. ln F must be finite there, because derivatives contain it.
    F = jnp.where(F > 0, F, jnp.finfo(F.dtype).tiny)
    q1 = law.q[-1]
    relative = mesh.q / q1
    m0, m4 = jnp.sum(weight / relative**2), jnp.sum(weight * relative**2)
    # The first node is q1, with zero weight.
    count = _BEYOND if surface.detail is None else _BEYOND_OF_TABLE
    node, dln = (typed(np.append(0.0, table), weight) for table in gauss(count))
    beyond = math.log(END) * node
    log_q = jnp.concatenate([jnp.log(mesh.q).reshape(-1), jnp.log(q1) + beyond])
    log_D = jnp.log(roughness_density(law, jnp.append(mesh.q, q1)) / total)
    panels = quadrature.panels if surface.relaxes else None
    densities, e2 = None, None
    if surface.spectrum.harmonic_count():
        cosines, sines = surface.spectrum.harmonics_at(q1)
        densities = functools.partial(_densities, constants.c_g, cosines, sines)
        e2 = slope_anisotropy(surface.spectrum)
    body = surface.strained if surface.strained.material.deforms else surface.rough
    log_slab = jnp.zeros_like(log_q)
    if body.layer is not None:
        log_slab = jnp.log(body.layer.stiffening(poisson_of(body.material), jnp.exp(log_q)))
    return Law(
        Shape(
            mesh=mesh,
            weight=weight,
            log_F=jnp.log(F).reshape(-1),
            log_D=log_D[:-1],
            N2=jnp.log(F.reshape(-1) / jnp.exp(log_D[:-1]) + 0.25) ** 2,
            log_D_end=log_D[-1],
            height2=surface.law.height2,
            total=total,
            slope=jnp.sqrt(2 * jnp.pi * total) * surface.spectrum.height_scale(),
            log_alpha=jnp.log(m0 / total) + jnp.log(m4 / total),
            beyond=beyond,
            step=math.log(END) * dln,
            circle=circle_matrices(log_q, panels, surface.detail, _log_range(surface), densities),
            e2=e2,
            log_slab=log_slab,
        ),
        surface.strained,
        surface.rough,
        constants,
    )


def _log_range(surface):
    """Return ln of the glassy over the static modulus of the strained solid, without derivatives.

    The ratio is at most 1e15 (float32: 1e10), also for a liquid. A rough elastic solid in series reduces it.
    """
    if not surface.relaxes:
        return 0.0
    material = surface.strained.material
    glassy = jnp.asarray(material.glassy_reduced())
    softest = material.static_reduced() / glassy
    least = 1e-15 if softest.dtype == jnp.float64 else 1e-10
    return -jax.lax.stop_gradient(jnp.log(jnp.maximum(softest, least)))


def _densities(c_g, cosines, sines, phi):
    """Return the `Directions` of g and of light contact, for roughness with these harmonics."""
    m = 2 * jnp.arange(1, cosines.size + 1)[:, None]

    def light_and_full(phi):
        # The sum of few harmonics may be negative.
        g = jnp.maximum(1 + cosines @ jnp.cos(m * phi) + sines @ jnp.sin(m * phi), 1e-3)
        return jnp.stack([g, g ** (1 - c_g)])

    whole = jnp.mean(light_and_full(typed(np.pi * np.arange(256) / 256, phi)), 1, keepdims=True)
    left, right = light_and_full(phi) / whole, light_and_full(-phi) / whole
    return Directions(0.5 * (left + right), 0.5 * (left - right))


def roughness_density(law: BrokenPowerLaw, q: jax.Array) -> jax.Array:
    """Return q^4 C / height2 [1/m^2]."""
    piece = jnp.clip(jnp.searchsorted(law.q, q, side="left") - 1, 0, law.exponent.shape[0] - 1)
    return q**2 * jnp.exp(law.log_value[piece] + law.exponent[piece] * jnp.log(q / law.q[piece]))


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
    return State(A, jnp.sum(mu_of_q, -1), mu_of_q, [jnp.sum(one, -1) for one in across], share, converged)


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
        log_E + shape.log_slab,
        0.5 * jnp.log(E2) + shape.log_slab,
        moduli.softest - 0.5 * jnp.log(over_E2) + shape.log_slab,
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
    slab = shape.log_slab[:inside]
    # |E| of the half-space in the factor that depends on phi.
    around = odds * jnp.exp(-c.c_phi * B[:, None] * (log_E_W - slab))
    stiff = jnp.exp(c.c_phi * B[:, None] * moduli.log_E)
    kinds = _along_and_across(shape, slice(inside))

    # Point by point, because W has an entry for every node and grid point; computed again in reverse mode.
    @jax.checkpoint
    def ring(point):
        loss, odds, stiff = point
        heat = loss / (1 + odds[:, None] * stiff)
        return [[jnp.sum(weights * heat, -1) for weights in kind] for kind in kinds]

    heat = [_at(B, kind) for kind in jax.lax.map(ring, (moduli.loss, around, stiff))]
    return 1 / (1 + odds), [_weight(shape) * jnp.exp(slab) * one for one in heat]


def _beyond_q1(A, B, log_E_eff, moduli, law):
    """Return the integrals of the power beyond q1 times Im E cos(phi), and sin(phi) if anisotropic.

    They have the shape (points, nodes beyond).
    """
    shape, c = law.shape, law.constants
    inside = shape.weight.size
    slab, log_E_h = shape.log_slab[inside:], _means(B, moduli, shape).log_E_h[:, inside:]
    loss = moduli.loss * jnp.exp(-c.c_phi * moduli.log_E)
    log_factor = c.c_b * (log_E_eff[:, None] - log_E_h) + c.c_phi * (log_E_h - slab) + slab
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

    def step(progress):
        k, y, before, residual_before, _ = progress
        residual = balance(y) - y
        moved = y != before
        slope = (residual - residual_before) / jnp.where(moved, y - before, 1.0)
        change = residual / jnp.where(moved, jnp.clip(-slope, 0.5, 6.0), 1.0)
        return k + 1, y + change, y, residual, jnp.abs(change)

    def going(progress):
        k, y, *_, change = progress
        return (k < _STEPS) & jnp.any(change > tolerance * (1 + jnp.abs(y)))

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
