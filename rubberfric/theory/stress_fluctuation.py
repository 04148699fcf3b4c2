r"""G(q), the fluctuation of the contact stress, and what follows from it, for given temperatures.

With d^2q = q^2 d ln q dphi and K_j = (q/2) scale factor_j F_j (`rubberfric.theory.stiffness.series`)
[Scaraggi & Persson, eqs. (10), (A11), (A17)]

.. math:: G(q) = \left(\frac{scale}{\sigma_0}\right)^2 g(q),\qquad
          g = \frac{\pi}{4}\int d\ln q \sum_j q^4 C_j\, factor_j^2 \langle|F_j|^2\rangle
.. math:: P = \mathrm{erf}\,x,\qquad x = \frac{1}{2\sqrt G},\qquad
          \mu = \pi\frac{scale}{\sigma_0}\int d\ln q\; S P
          \sum_j q^4 C_j\, factor_j \langle\cos\varphi\,\mathrm{Im}F_j\rangle
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import legendre

from rubberfric.base.quadrature import gauss, legendre_transform, typed
from rubberfric.roughness.mesh.radial_mesh import Mesh
from rubberfric.scene.adhesion import Adhesion
from rubberfric.scene.correlation import Correlation
from rubberfric.scene.pairs import PairTemperatures
from rubberfric.theory.area.area_correction import CorrectionTable, correct_argument
from rubberfric.theory.area.constant_area import Unloading, hold, work_of_separation
from rubberfric.theory.area.long_range import Gaps, attract, attraction
from rubberfric.theory.area.partial_contact import (
    Pressed,
    contact_argument,
    contact_fraction,
    friction_weight,
)
from rubberfric.theory.area.separations import loss_table
from rubberfric.theory.contributions import Contribution, Terms, total


class Contact(NamedTuple):
    """What the roughness does at points; axes (panels, points, order) where there are three."""

    terms: list[Terms]  # of every contribution
    stiffness: jax.Array  # modulus scale over the pressure that the contact bears, (points,)
    panels: jax.Array  # g of every panel, (panels, points); of all together, (1, points), if not graded
    x: jax.Array | None  # 1 / (2 sqrt G), plain; None if the mesh is not graded
    gamma: jax.Array
    correction: CorrectionTable | None
    pressed: Pressed | None = None  # with adhesion: the load that makes the same contact without it

    def area(self, panels: jax.Array | None = None) -> jax.Array:
        """P after the first `panels` panels (None: after all, A/A0), (points,)."""
        g = self.panels
        if panels is not None:
            g = jnp.where(np.arange(g.shape[0])[:, None] < panels, g, 0.0)
        return contact_fraction(self.corrected(contact_argument(jnp.sum(g, 0), self.stiffness)))

    def friction_terms(self, kind: str = "dissipation") -> dict[int, jax.Array]:
        """Viscoelastic friction of every contribution that dissipates, by contact nodes.

        Parameters
        ----------
        kind : "dissipation", or "transverse" for the friction across the direction of sliding

        Returns
        -------
        dict from the number of the contribution to an array (panels, points, order), whose sum is mu [-]
        """
        found = {j: one.densities[kind] for j, one in enumerate(self.terms) if kind in one.densities}
        if not found or self.x is None:
            return {}
        share = friction_weight(self.corrected(self.x), self.gamma)
        stiffness = self.stiffness
        if self.pressed is not None:  # friction is over the load alone
            stiffness = stiffness * self.pressed.load
        weight = jnp.pi * stiffness[:, None] * share
        return {j: weight * density for j, density in found.items()}

    def corrected(self, x: jax.Array) -> jax.Array:
        """X with S in G, where the scene asks for it."""
        return x if self.correction is None else correct_argument(self.correction, x)


class Roughness(NamedTuple):
    """The rough surfaces of a scene, ready for many points."""

    mesh: Mesh
    contributions: tuple[Contribution, ...]
    strained: tuple[str, ...]  # which solid each of them strains: "lower" or "upper"
    scale: jax.Array  # unit of all moduli [Pa]
    gamma: jax.Array
    correction: CorrectionTable | None  # of S in G
    adhesion: Adhesion | None = None
    correlation: Correlation | None = None  # in the roughness already, which is that of solids at rest

    def contact(
        self, velocity: jax.Array, pressure: jax.Array, temperatures: Sequence[PairTemperatures]
    ) -> Contact:
        """`Contact` at points.

        Parameters
        ----------
        velocity, pressure : shape (points,) [m/s], [Pa]
        temperatures : for each contribution those of its two solids [K]: None, (points,), or
            (angular panels, points, angular order)
        """
        contact, g = self._without_adhesion(velocity, pressure, temperatures)
        if g is None or self.adhesion is None:
            return contact
        if self.adhesion.limit == "short":
            pressed = hold(self._unloading(self.adhesion, contact, pressure))
        else:
            pressed = attract(self._gaps(self.adhesion, contact, g, pressure), self.mesh.q.shape[1])
        stiffness = contact.stiffness / pressed.load
        x = contact_argument(g, stiffness[:, None])
        return contact._replace(stiffness=stiffness, x=x, pressed=pressed)

    def attraction(
        self, velocity: jax.Array, pressure: jax.Array, temperatures: Sequence[PairTemperatures]
    ) -> tuple[Contact, jax.Array]:
        """`Contact` of a scene with adhesion of long range as without it, and the attraction in it.

        That is over the work over the range, shape (points,); arguments as of `contact`.
        """
        contact, g = self._without_adhesion(velocity, pressure, temperatures)
        assert g is not None and self.adhesion is not None
        return contact, attraction(self._gaps(self.adhesion, contact, g, pressure), self.mesh.q.shape[1])

    def work_of_separation(
        self, velocity: jax.Array, pressure: jax.Array, temperatures: Sequence[PairTemperatures]
    ) -> jax.Array:
        """What separates the solids from where adhesion holds them by its energy [J/m^2], as of `contact`."""
        contact, _ = self._without_adhesion(velocity, pressure, temperatures)
        assert self.adhesion is not None
        return pressure * work_of_separation(self._unloading(self.adhesion, contact, pressure))

    def _without_adhesion(self, velocity, pressure, temperatures):
        """`Contact`, and g at the nodes where it is known there, else None."""
        found = [
            one.terms(self.mesh, velocity, T) for one, T in zip(self.contributions, temperatures, strict=True)
        ]
        stiffness = self.scale / pressure
        if self.correlation is not None:
            stiffness = jnp.where(velocity == 0, stiffness, jnp.nan)
        within = [terms.within for terms in found if terms.within is not None]
        if not within:
            # Contributions have panels of their own where nothing but the whole integral is needed.
            whole = jnp.pi / 4 * total(jnp.sum(terms.panels, 0, keepdims=True) for terms in found)
            return Contact(found, stiffness, whole, None, self.gamma, self.correction), None
        panels = jnp.pi / 4 * total(terms.panels for terms in found)
        g = _sum_before(panels)[..., None] + jnp.pi / 4 * total(within)
        x = contact_argument(g, stiffness[:, None])
        return Contact(found, stiffness, panels, x, self.gamma, self.correction), g

    def _gaps(self, adhesion, contact, g, pressure):
        """`Gaps` of the contact without adhesion."""
        end = jnp.sum(contact.panels, 0)
        storage = total(terms.densities["storage"] for terms in contact.terms)
        heights = 2 * jnp.pi * total(self.mesh.roughness) / self.mesh.q**2

        def in_a_row(values, last):
            last = jnp.broadcast_to(last, pressure.shape)[:, None]
            return jnp.concatenate([_in_a_row(values, pressure, g.shape), last], -1)

        # Where the roughness begins g may be too small for its logarithm.
        knots = jnp.log(jnp.maximum(in_a_row(g, end), jnp.finfo(g.dtype).tiny))
        return Gaps(
            knots=knots,
            storage=in_a_row(_from_nodes_on(storage), 0 * end),
            heights=in_a_row(_from_nodes_on(heights[:, None]), 0 * end),
            stiffness=contact.stiffness,
            strength=adhesion.work / (adhesion.range * pressure),
            reach=adhesion.range,
            gamma=self.gamma,
            correction=self.correction,
            lost=loss_table(self.gamma),
        )

    def _unloading(self, adhesion, contact, pressure):
        """`Unloading` of the contact without adhesion."""
        storage = total(terms.densities["storage"] for terms in contact.terms)
        return Unloading(
            x=_in_a_row(contact.x, pressure),
            storage=_in_a_row(storage, pressure, contact.x.shape),
            end=contact_argument(jnp.sum(contact.panels, 0), contact.stiffness),
            stiffness=contact.stiffness,
            gain=2 * adhesion.work / pressure,
            gamma=self.gamma,
            correction=self.correction,
        )


def _sum_before(panels):
    """Sum over the panels before each one, without subtracting: a panel 1e20 times larger loses nothing."""
    return np.tril(np.ones((panels.shape[0],) * 2, panels.dtype), -1) @ panels


def _in_a_row(values, pressure, shape=None):
    """Values at the nodes, of each point in a row; for values of all points, the shape of the nodes."""
    panels, _, order = values.shape if shape is None else shape
    values = jnp.broadcast_to(values, (panels, pressure.shape[0], order))
    return jnp.moveaxis(values, 1, 0).reshape(pressure.shape[0], -1)


def _from_nodes_on(values):
    """Integrals from every node (panels, points, order) to the end, of terms of the whole integral."""
    rule = typed(_integrals_to_the_end(values.shape[-1]), values)
    after = jnp.cumsum(jnp.sum(values, -1)[::-1], 0)[::-1]
    after = jnp.concatenate([after[1:], jnp.zeros_like(after[:1])])
    return after[..., None] + jnp.einsum("kpj,ij->kpi", values, rule)


@functools.cache
def _integrals_to_the_end(order):
    """Weights of integrals from every Gauss node to the end of a panel, for weighted terms at the nodes."""
    node, weight = gauss(order)
    y = node[:, None] + (1 - node[:, None]) * node
    values = legendre.legvander(2 * y - 1, order - 1) @ legendre_transform(order)
    return np.einsum("imj,m->ij", values, weight) * (1 - node[:, None]) / weight
