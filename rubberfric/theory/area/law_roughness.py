"""Roughness, nodes and constants of the law that was fitted to boundary elements.

`boundary_elements_law` contains the equations of the law.
"""

import dataclasses
import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import Quadrature, gauss, typed
from rubberfric.roughness.anisotropy import slope_anisotropy
from rubberfric.roughness.mesh.nodes import Mesh, build_mesh
from rubberfric.roughness.moments import cumulative_moment
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio
from rubberfric.scene.body import Body
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
    log_S_bar: jax.Array  # ln of slab over half-space stiffness, or 0, (all nodes,)


class Law(NamedTuple):
    """The law for one scene, prepared for many points."""

    shape: Shape
    strained: Body
    rough: Body
    constants: LawConstants


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
    log_S_bar = jnp.zeros_like(log_q) if body.half_space else jnp.log(body.S_bar(jnp.exp(log_q)))
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
            log_S_bar=log_S_bar,
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
