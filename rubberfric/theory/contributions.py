r"""Contribution of each rough surface to the integrals over ln q: G, friction and separation.

The density of G is the product of q^4 C_j, known at every contact node, and <|F_j|^2>, known at the angular
nodes (`density_of_K`). Friction and separation are similar. The matrices that combine both sets of nodes
depend only on the scene, so each velocity takes one small matrix product per panel.
"""

import dataclasses
import functools
import math
import operator
from collections.abc import Iterable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import cumulative, typed, weights_between
from rubberfric.materials.tabulated_modulus import log_floored
from rubberfric.roughness.mesh.nodes import Mesh
from rubberfric.theory.stiffness.closed_form import Means
from rubberfric.theory.stiffness.means import StiffnessMeans, factors_at, stiffness_means
from rubberfric.theory.stiffness.table import MeansTable
from rubberfric.theory.structure import MeansInterpolation, RequiredMeans, RoughSurface, SurfaceTemperatures


class Terms(NamedTuple):
    """Terms of the integrals at points.

    Arrays have the axes (panels, points or 1, order), except where stated otherwise.
    """

    panels: jax.Array  # integral of the density of <|K|^2> over every panel, (panels, points or 1)
    within: jax.Array | None  # integral from the left border of the panel to every contact node
    # By kind: densities of the friction, "mean_cos_loss" and "mean_sin_loss", without the factor S P, and of
    # the separation, "mean_storage", without the factor x Psi [m].
    densities: dict[str, jax.Array]


class Contribution(NamedTuple):
    """Contribution of one rough surface to the integrals.

    A tuple has two entries if <F'^2> and <F''^2> are needed separately, otherwise one entry.
    """

    # At the angular nodes, or at the contact nodes if nothing is interpolated. None if F is a constant at
    # every wavevector; the weights then contain it.
    stiffness: StiffnessMeans | None
    interpolation: MeansInterpolation
    # Weights of <|F|^2> in the integral over a panel, (panels, nodes), and in the integral up to every
    # contact node, (panels, order, nodes); with logarithms (panels, nodes between).
    mean_abs2: tuple[jax.Array, ...]
    within: tuple[jax.Array, ...] | None
    others: Means  # weights of the other means at the contact nodes, (panels, order)

    def terms(self, mesh: Mesh, velocity: jax.Array, temperatures: SurfaceTemperatures) -> Terms:
        """Return the `Terms` at points.

        Parameters
        ----------
        mesh : Mesh
        velocity : [m/s], shape (points,)
        temperatures : SurfaceTemperatures [K]. A temperature is None, or has the shape (points,). If the
            temperature depends on the wavevector, the shape is (angular panels, points, angular order).
        """
        if self.stiffness is None:
            within = None if self.within is None else self.within[0][:, None]
            densities = {kind: weights[0][:, None] for kind, weights in self.others.items()}
            return Terms(jnp.sum(self.mean_abs2[0], -1)[:, None], within, densities)
        if self.interpolation is MeansInterpolation.NONE:
            temperatures = jax.tree.map(lambda T: mesh.to_contact(T) if T.ndim > 1 else T, temperatures)
            means = at_contact = self.stiffness.means(mesh.q, velocity, temperatures)
        else:
            means = self.stiffness.means(mesh.angular_q, velocity, temperatures)
            at_contact = {k: tuple(map(mesh.to_contact, means[k])) for k in self.others}
        densities = {
            kind: total(w[:, None] * mean for w, mean in zip(weights, at_contact[kind], strict=True))
            for kind, weights in self.others.items()
        }
        if self.interpolation is MeansInterpolation.LOGARITHMIC:
            return Terms(*self._with_logarithms(mesh, means["mean_abs2"]), densities)
        return Terms(*self._linear(mesh, means["mean_abs2"]), densities)

    def _linear(self, mesh, means):
        """Return the integrals of the density of <|K|^2> over every panel and up to every contact node.

        The integral up to a node begins at the left border of the panel. The weights of the integrals up to
        the nodes are exact in the roughness and the factors (`cumulative`), which may change by 1e6 within a
        panel. A rule for the full product would lose the small terms, which determine G where G matters most.
        """
        if self.interpolation is MeansInterpolation.LINEAR and self.within is not None:
            # If no integrals up to the nodes are needed, use the weights of the angular panels.
            means = tuple(map(mesh.serving, means))
        panels = _sum_products("kvi,ki->kv", means, self.mean_abs2)
        return panels, None if self.within is None else _sum_products("kvi,kci->kvc", means, self.within)

    def _with_logarithms(self, mesh, means):
        """Return the integrals of `_linear`, with interpolated ln <|F|^2> and positive weights.

        Small terms keep all digits, and G stays positive.
        """
        logarithms = [log_floored(mesh.serving(mean)) for mean in means]

        def interpolated(basis):
            return [jnp.exp(jnp.einsum("kvi,kci->kvc", logarithm, basis)) for logarithm in logarithms]

        panels, within = _sum_products("kvi,ki->kv", interpolated(mesh.interpolate), self.mean_abs2), None
        if self.within is not None and mesh.between is not None:
            order = mesh.q.shape[1]
            between = zip(self.within, interpolated(mesh.between.interpolate), strict=True)
            shape = (*panels.shape, order, -1)
            gaps = total((w[:, None] * mean).reshape(shape).sum(-1) for w, mean in between)
            within = gaps @ np.triu(np.ones((order, order), gaps.dtype))
        return panels, within


def contribution(
    surface: RoughSurface,
    mesh: Mesh,
    j: int,
    scale: jax.Array,
    needs: RequiredMeans,
    table: MeansTable | None = None,
    span: float | None = None,
) -> Contribution:
    """Return the `Contribution` of one rough surface.

    Parameters
    ----------
    surface : RoughSurface
    mesh : Mesh
    j : index of the surface's spectrum in the mesh
    scale : modulus scale [Pa]
    needs : RequiredMeans
    table, span : see `stiffness_means`
    """
    if not surface.relaxes:
        needs = dataclasses.replace(needs, mean_cos_loss=False, mean_sin_loss=False)
    weights, interpolation = mesh.roughness[j], surface.interpolation or MeansInterpolation.NONE
    factors = factors_at(surface, scale, mesh.q)
    mean_abs2 = factors.of("mean_abs2", density_of_K("mean_abs2", weights, mesh.q))
    others = {
        kind: factors.of(kind, density_of_K(kind, weights, mesh.q))
        for kind in needs.kinds
        if kind != "mean_abs2" and (kind != "mean_sin_loss" or surface.harmonics)
    }
    angular = interpolation is not MeansInterpolation.NONE
    means = None
    if not surface.static:
        means = stiffness_means(surface, scale, mesh.angular_q if angular else mesh.q, needs, table, span)
    within = None
    if mesh.between is not None:
        between = density_of_K("mean_abs2", mesh.between.roughness[j], mesh.between.q)
        between = factors_at(surface, scale, mesh.between.q).of("mean_abs2", between)
        logarithmic = interpolation is MeansInterpolation.LOGARITHMIC
        rule = typed((weights_between if logarithmic else cumulative)(mesh.q.shape[1]), weights)
        rule = rule.sum(-1) if surface.static else rule
        within = tuple(
            density * rule.reshape(-1) if logarithmic else jnp.tensordot(density, rule, 1)
            for density in between
        )
    if interpolation is MeansInterpolation.LINEAR and within is not None:
        mean_abs2 = tuple(jnp.einsum("kc,kci->ki", density, mesh.interpolate) for density in mean_abs2)
        within = tuple(rule @ mesh.interpolate for rule in within)
    elif interpolation is MeansInterpolation.LINEAR:
        # Only the whole integral is needed, so the contact nodes are no longer used.
        mean_abs2 = (jnp.einsum("kc,kci->ki", density, mesh.interpolate) for density in mean_abs2)
        mean_abs2 = tuple(jnp.zeros_like(mesh.angular_q).at[mesh.panel].add(density) for density in mean_abs2)
    return Contribution(means, interpolation, mean_abs2, within, others)


def density_of_K(kind: str, roughness: jax.Array, q: jax.Array) -> jax.Array:
    r"""Return the factor of a mean of F_j in the integral over ln q of the same mean of K_j = (q/2) F_j.

    With d^2q = 2 pi q^2 d ln q, the integrals are

    .. math:: \int d^2q\, C_j \langle|K_j|^2\rangle,\qquad
              \int d^2q\, C_j\, q \langle\cos\varphi\,\mathrm{Im}K_j\rangle,\qquad
              \int d^2q\, C_j \langle\mathrm{Re}K_j\rangle

    Parameters
    ----------
    kind : "mean_abs2"; "mean_cos_loss" or "mean_sin_loss"; "mean_storage"
    roughness : q^4 C_j [-]
    q : [1/m]
    """
    if kind == "mean_abs2":
        return 2 * math.pi * 0.5**2 * roughness
    return 2 * math.pi * 0.5 * (roughness / q if kind == "mean_storage" else roughness)


def _sum_products(subscripts, means, weights):
    return total(jnp.einsum(subscripts, mean, w) for mean, w in zip(means, weights, strict=True))


def total(terms: Iterable[jax.Array]) -> jax.Array:
    """Sum arrays without an initial zero."""
    return functools.reduce(operator.add, terms)
