r"""Contribution of each rough surface to the integrals over ln q: G, friction and separation.

The density of G is the product of q^4 C_j, known at every contact node, and <|F_j|^2>, known where its
angular means are taken; likewise friction and separation. The rules that join the two depend on the scene
alone, so each velocity takes one small matrix product a panel. The structure of the pair decides where the
means are taken:

- `StaticContribution`: nothing depends on the velocity;
- `InterpolatedContribution`: at the angular nodes, because they are smooth in ln q;
- `LogarithmicContribution`: the same, interpolated in the logarithm of <|F|^2>, which may rise by 1e9
  within a panel: with two deformable solids and a layer, or a coating;
- `DirectContribution`: at the contact nodes themselves, because they have kinks over q.
"""

import dataclasses
import functools
import operator
from collections.abc import Iterable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import cumulative, typed, weights_between
from rubberfric.roughness.radial_mesh import Mesh
from rubberfric.scene.pairs import Pair, PairTemperatures
from rubberfric.theory.quantities import RequiredMeans
from rubberfric.theory.stiffness.angular_means import Means
from rubberfric.theory.stiffness.means_table import MeansTable
from rubberfric.theory.stiffness.series import factors_at, static_stiffness
from rubberfric.theory.stiffness.stiffness_means import StiffnessMeans, stiffness_means
from rubberfric.theory.stiffness.tabulated_means import log_power


class Terms(NamedTuple):
    """Terms of the integrals at points; axes (panels, points or 1, order)."""

    panels: jax.Array  # integral of the density of g over every panel, (panels, points or 1)
    within: jax.Array | None  # the same from the left border of the panel to every contact node
    # By kind: of the friction, "dissipation" and "transverse", before the factor S P, and of the separation,
    # "storage", before the factor x Psi [m].
    densities: dict[str, jax.Array]


class StaticContribution(NamedTuple):
    """Roughness on a solid that does not relax."""

    fixed: Terms  # whatever the velocity

    def terms(self, mesh: Mesh, velocity: jax.Array, temperatures: PairTemperatures) -> Terms:
        """`Terms` at points; see `InterpolatedContribution.terms`."""
        del mesh, velocity, temperatures
        return self.fixed


class InterpolatedContribution(NamedTuple):
    """Roughness whose angular means are smooth in ln q; tuples have an entry for each mean of a kind."""

    stiffness: StiffnessMeans  # at the angular nodes
    power: tuple[jax.Array, ...]  # weights of <|F|^2> at nodes i in the integral over a panel, (panels, i)
    within: tuple[jax.Array, ...] | None  # in that up to every contact node, (panels, order, i)
    others: Means  # weights of the other means at the contact nodes, (panels, order)

    def terms(self, mesh: Mesh, velocity: jax.Array, temperatures: PairTemperatures) -> Terms:
        """`Terms` at points.

        Parameters
        ----------
        mesh : Mesh
        velocity : [m/s], shape (points,)
        temperatures : of the two solids [K]: None, (points,), or (angular panels, points, angular
            order) if it differs from scale to scale
        """
        means = self.stiffness.means(mesh.angular_q, velocity, temperatures)
        # Without integrals up to the nodes the weights are those of the angular panels themselves.
        power = means["power"] if self.within is None else tuple(map(mesh.serving, means["power"]))
        return _terms(*_integrated(self.power, self.within, power), self.others, means, mesh.to_contact)


class LogarithmicContribution(NamedTuple):
    """Roughness whose <|F|^2> is smooth in its logarithm.

    Interpolated in the logarithm and summed with positive weights, the small end keeps its digits and G
    stays positive.
    """

    stiffness: StiffnessMeans  # at the angular nodes
    power: tuple[jax.Array, ...]  # weights of <|F|^2> at the contact nodes, (panels, order)
    between: tuple[jax.Array, ...] | None  # at the nodes between them, (panels, nodes between)
    others: Means  # as of `InterpolatedContribution`

    def terms(self, mesh: Mesh, velocity: jax.Array, temperatures: PairTemperatures) -> Terms:
        """`Terms` at points; see `InterpolatedContribution.terms`."""
        means = self.stiffness.means(mesh.angular_q, velocity, temperatures)
        logarithms = [log_power(mesh.serving(mean)) for mean in means["power"]]

        def interpolated(basis):
            return [jnp.exp(jnp.einsum("kvi,kci->kvc", logarithm, basis)) for logarithm in logarithms]

        within, (panels, _) = None, _integrated(self.power, None, interpolated(mesh.interpolate))
        if self.between is not None and mesh.between is not None:
            order = mesh.q.shape[1]
            between = zip(self.between, interpolated(mesh.between.interpolate), strict=True)
            shape = (*panels.shape, order, -1)
            gaps = total((w[:, None] * mean).reshape(shape).sum(-1) for w, mean in between)
            within = gaps @ np.triu(np.ones((order, order), gaps.dtype))
        return _terms(panels, within, self.others, means, mesh.to_contact)


class DirectContribution(NamedTuple):
    """Roughness whose angular means have kinks over q; as `InterpolatedContribution`, at contact nodes."""

    stiffness: StiffnessMeans
    power: tuple[jax.Array, ...]
    within: tuple[jax.Array, ...] | None
    others: Means

    def terms(self, mesh: Mesh, velocity: jax.Array, temperatures: PairTemperatures) -> Terms:
        """`Terms` at points; see `InterpolatedContribution.terms`."""
        at_nodes = jax.tree.map(lambda T: mesh.to_contact(T) if T.ndim > 1 else T, temperatures)
        means = self.stiffness.means(mesh.q, velocity, at_nodes)
        return _terms(*_integrated(self.power, self.within, means["power"]), self.others, means)


Contribution = StaticContribution | InterpolatedContribution | LogarithmicContribution | DirectContribution


def contribution(
    pair: Pair, mesh: Mesh, j: int, scale: jax.Array, needs: RequiredMeans, table: MeansTable | None = None
) -> Contribution:
    """What the roughness of a pair contributes.

    Parameters
    ----------
    pair : Pair
    mesh : Mesh
    j : which of the spectra of the mesh it is
    scale : modulus scale [Pa]
    needs : RequiredMeans
    table : see `stiffness_means`
    """
    weights, between = mesh.roughness[j], None
    if pair.static:
        return _static(pair, mesh, j, scale, needs)
    if not pair.relaxes:
        needs = dataclasses.replace(needs, dissipation=False, transverse=False)
    factors = factors_at(pair, mesh.q)
    power = factors.of("power", weights)
    others = {
        kind: factors.of(kind, weights / mesh.q if kind == "storage" else weights)
        for kind in needs.kinds
        if kind != "power" and (kind != "transverse" or pair.harmonics)
    }
    excited = stiffness_means(pair, scale, mesh.q if pair.kinked else mesh.angular_q, needs, table)
    if mesh.between is not None:
        between = factors_at(pair, mesh.between.q).of("power", mesh.between.roughness[j])
    if pair.steep:
        if between is not None:
            gaps = typed(weights_between(mesh.q.shape[1]), weights).reshape(-1)
            between = tuple(density * gaps for density in between)
        return LogarithmicContribution(excited, power, between, others)
    within = None
    if between is not None:
        rule = typed(cumulative(mesh.q.shape[1]), weights)
        within = tuple(jnp.tensordot(density, rule, 1) for density in between)
    if pair.kinked:
        return DirectContribution(excited, power, within, others)
    power = tuple(jnp.einsum("kc,kci->ki", one, mesh.interpolate) for one in power)
    if within is not None:
        within = tuple(rule @ mesh.interpolate for rule in within)
    else:
        # Only the whole integral is needed: the contact nodes have done their part.
        power = tuple(jnp.zeros_like(mesh.angular_q).at[mesh.panel].add(one) for one in power)
    return InterpolatedContribution(excited, power, within, others)


def _static(pair, mesh, j, scale, needs):
    """A stiffness that does not relax is known at every q, and part of the weights."""
    F, within = static_stiffness(pair, scale, mesh.q), None
    if mesh.between is not None:
        density = mesh.between.roughness[j] * static_stiffness(pair, scale, mesh.between.q) ** 2
        within = (density @ typed(cumulative(mesh.q.shape[1]), density).sum(-1))[:, None]
    densities = {"storage": (mesh.roughness[j] / mesh.q * F)[:, None]} if needs.storage else {}
    panels = jnp.sum(mesh.roughness[j] * F**2, -1)[:, None]
    return StaticContribution(Terms(panels, within, densities))


def _integrated(power, within, means):
    """Integrals over every panel and up to every contact node, of the means of <|F|^2> at their nodes.

    Weights of the latter are exact in the roughness and in all its factors (`cumulative`). They may
    change by 1e6 within a panel, and g, where it matters most, is what the small end adds up to: a rule
    for the product of all would lose it, or make it < 0.
    """
    panels = total(jnp.einsum("kvi,ki->kv", mean, w) for mean, w in zip(means, power, strict=True))
    if within is None:
        return panels, None
    nodes = total(jnp.einsum("kvi,kci->kvc", mean, w) for mean, w in zip(means, within, strict=True))
    # Over a panel of five e-folds and more, where <|F|^2> rises by 1e5, its interpolant may
    # swing below 0 at the small end: there G is that of the panels before. Selected: where two borders
    # coincide all are 0, and a maximum would give them half their derivatives.
    return panels, jnp.where(nodes < 0, 0.0, nodes)


def _terms(panels, within, others, means, at_contact=lambda mean: mean):
    """`Terms` of means that `at_contact` takes to the contact nodes."""
    densities = {}
    for kind, weights in others.items():
        pairs = zip(weights, means[kind], strict=True)
        densities[kind] = total(w[:, None] * at_contact(mean) for w, mean in pairs)
    return Terms(panels, within, densities)


def total(terms: Iterable[jax.Array]) -> jax.Array:
    """Sum of arrays, without a zero to begin with."""
    return functools.reduce(operator.add, terms)
