"""Profiles over the wavevector by the law fitted to boundary elements.

The friction up to q is the part of the law's friction that comes from displacements with wavevectors up to q.
The area at the resolution q is the area of the law for the roughness up to q.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.quadrature import Quadrature, gauss, typed
from rubberfric.roughness.mesh.nodes import interpolation, locate
from rubberfric.roughness.spectra import BrokenPowerLaw, log_shape
from rubberfric.theory.area.boundary_elements_law import State, solve_law
from rubberfric.theory.area.law_roughness import END, Law, prepare_law, roughness_density
from rubberfric.theory.structure import RoughSurface


class OverWavevectors(NamedTuple):
    """Fields of `Profile` by the law, of shape (points, wavevectors)."""

    area: jax.Array
    friction_density: jax.Array
    friction: jax.Array
    share: jax.Array
    converged: jax.Array  # (points,)


def last_wavevector(spectrum: BrokenPowerLaw) -> jax.Array:
    """Return the largest wavevector of the displacements [1/m]."""
    return END * spectrum.q[-1]


def over_wavevectors(
    surface: RoughSurface,
    quadrature: Quadrature,
    q: jax.Array,
    velocity: jax.Array,
    pressure: jax.Array,
    temperature: jax.Array | None = None,
) -> OverWavevectors:
    """Evaluate the law at wavevectors.

    Parameters
    ----------
    surface : the rough surface
    quadrature : Quadrature
    q : wavevectors [1/m], shape (wavevectors,)
    velocity, pressure, temperature : conditions, shape (points,)
    """
    law = prepare_law(surface, quadrature)
    state = solve_law(law, velocity, pressure, temperature)

    def area(q):
        cut = prepare_law(surface._replace(law=_until(surface.law, q)), quadrature)
        return solve_law(cut, velocity, pressure, temperature).area

    spectrum = surface.law
    within = jnp.clip(q, spectrum.q[0], spectrum.q[-1])
    areas = jax.lax.map(area, within).T
    areas = jnp.where(q <= spectrum.q[0], 1.0, areas)
    return OverWavevectors(areas, *_contributions(law, state, spectrum, q, within), state.converged)


def _contributions(law: Law, state: State, spectrum, q, within):
    """Return the density of the friction, the friction up to q, and W, by interpolation between the nodes."""
    shape = law.shape
    panels, order = shape.weight.shape
    panel, at = locate(shape.mesh, within)
    here, there = jnp.split(state.mu_of_q, [panels * order], -1)
    here = here.reshape(-1, panels, order)
    # Over q^4 C, which is exact at q.
    has = shape.weight > 0
    smooth = jnp.where(has, here / jnp.where(has, shape.weight, 1.0), 0.0)
    values, until = _rules(at, order)
    density = jnp.einsum("wk,pwk->pw", values, smooth[:, panel]) * roughness_density(spectrum, within)
    share = jnp.einsum("wk,pwk->pw", values, state.share.reshape(-1, panels, order)[:, panel])
    whole = jnp.sum(here, -1)
    friction = (jnp.cumsum(whole, -1) - whole)[:, panel] + jnp.einsum("wk,pwk->pw", until, here[:, panel])

    # Beyond q1; the first node has no weight.
    width, count = math.log(END), shape.beyond.size - 1
    values, until = _rules(jnp.clip(jnp.log(q / spectrum.q[-1]) / width, 0.0, 1.0), count)
    there = there[:, 1:]
    inside, beyond = (q >= spectrum.q[0]) & (q <= spectrum.q[-1]), q > spectrum.q[-1]
    tail = there / (width * typed(gauss(count)[1], there)) @ values.T
    tail = jnp.where(beyond & (q <= last_wavevector(spectrum)), tail, 0.0)
    density = jnp.where(inside, density, tail)
    return density, friction + there @ until.T, jnp.where(beyond, 0.0, share)


def _rules(at, order):
    """Return weights of values at `at`, and of integrals from 0 to `at`, for the Gauss nodes of 0 ... 1.

    The weights of integrals apply to values that are multiplied by the weights of the nodes. Both have the
    shape (positions, order).
    """
    node, weight = (typed(table, at) for table in gauss(order))
    ends = jnp.zeros((1,), at.dtype), jnp.ones((1,), at.dtype)
    values = interpolation(at[None], *ends, order)[0]
    inner = interpolation((at[:, None] * node).reshape(1, -1), *ends, order)
    until = at[:, None] * jnp.einsum("wmk,m->wk", inner.reshape(-1, order, order), weight) / weight
    return values, until


def _until(spectrum, q):
    """Remove the roughness above q from a power law; its pieces above q get zero width."""
    above = spectrum.q > q
    log_value = jnp.where(above, log_shape(spectrum, q) + 2 * jnp.log(q), spectrum.log_value)
    return spectrum._replace(q=jnp.where(above, q, spectrum.q), log_value=log_value)
