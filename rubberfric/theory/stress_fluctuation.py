r"""G(q), the fluctuation of the contact stress, and what follows from it, for given temperatures.

With d^2q = q^2 d ln q dphi and K_j = (q/2) scale factor_j F_j (`rubberfric.theory.stiffness.series`)
[Scaraggi & Persson, eqs. (10), (A11), (A17)]

.. math:: G(q) = \left(\frac{scale}{\sigma_0}\right)^2 g(q),\qquad
          g = \frac{\pi}{4}\int d\ln q \sum_j q^4 C_j\, factor_j^2 \langle|F_j|^2\rangle
.. math:: P = \mathrm{erf}\,x,\qquad x = \frac{1}{2\sqrt G},\qquad
          \mu = \pi\frac{scale}{\sigma_0}\int d\ln q\; S P
          \sum_j q^4 C_j\, factor_j \langle\cos\varphi\,\mathrm{Im}F_j\rangle
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.roughness.mesh.radial_mesh import Mesh
from rubberfric.scene.adhesion import Adhesion
from rubberfric.scene.correlation import Correlation
from rubberfric.scene.pairs import PairTemperatures
from rubberfric.theory.area.area_correction import CorrectionTable, correct_argument
from rubberfric.theory.area.constant_area import Unloading, hold, work_of_separation
from rubberfric.theory.area.first_passage import from_nodes_on
from rubberfric.theory.area.long_range import Gaps, evaluate_attraction, solve_dmt_load
from rubberfric.theory.area.partial_contact import (
    Pressed,
    contact_argument,
    contact_fraction,
    energy_factor,
    friction_weight,
)
from rubberfric.theory.area.separations import loss_table
from rubberfric.theory.area.short_range import Detachment, Plain, detach
from rubberfric.theory.contributions import Contribution, Terms, total


class Contact(NamedTuple):
    """What the roughness does at points; axes (panels, points, order) where there are three."""

    terms: list[Terms]  # of every contribution
    stiffness: jax.Array  # modulus scale over the pressure that the contact bears, (points,)
    panels: jax.Array  # g of every panel, (panels, points); of all together, (1, points), if not graded
    x: jax.Array | None  # 1 / (2 sqrt G), plain; None if the mesh is not graded
    gamma: jax.Array
    correction: CorrectionTable | None
    detached: Detachment | None = None  # with adhesion of short range, by its stress
    pressed: Pressed | None = None  # by its energy, or of long range

    def area(self, panels: jax.Array | None = None) -> jax.Array:
        """P after the first `panels` panels (None: after all, A/A0), (points,)."""
        if self.detached is not None:
            return self.detached.final
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
        if self.detached is None:
            share = friction_weight(self.corrected(self.x), self.gamma)
        else:
            share = energy_factor(self.detached.area, self.gamma) * self.detached.area
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
        if self.adhesion.by_stress:
            return contact._replace(detached=self._detached(self.adhesion, contact, g, pressure))
        if self.adhesion.limit == "short":
            pressed = hold(self._unloading(self.adhesion, contact, pressure))
        else:
            pressed = solve_dmt_load(self._gaps(self.adhesion, contact, g, pressure), self.mesh.q.shape[1])
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
        gaps = self._gaps(self.adhesion, contact, g, pressure)
        return contact, evaluate_attraction(gaps, self.mesh.q.shape[1])

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
        storage = total(terms.densities["storage"] for terms in contact.terms)
        heights = (2 * jnp.pi * total(self.mesh.roughness) / self.mesh.q**2)[:, None]

        def in_a_row(begin, values, end):
            begin, end = (jnp.broadcast_to(x, pressure.shape)[:, None] for x in (begin, end))
            return jnp.concatenate([begin, _in_a_row(values, pressure, g.shape), end], -1)

        def beyond(terms):
            return in_a_row(jnp.sum(terms, (0, 2)), from_nodes_on(terms), 0.0)

        return Gaps(
            knots=in_a_row(0.0, g, jnp.sum(contact.panels, 0)),
            storage=beyond(storage),
            heights=beyond(heights),
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

    def _detached(self, adhesion, contact, g, pressure):
        """`Detachment` of the contact without adhesion."""
        storage = total(terms.densities["storage"] for terms in contact.terms)
        plain = Plain(
            g=g,
            end=jnp.sum(contact.panels, 0),
            energy=jnp.pi / 2 * self.scale * storage,
            roughness=2 * jnp.pi * total(self.mesh.roughness)[:, None],
            stiffness=contact.stiffness,
            pressure=pressure,
        )
        return detach(self.mesh, plain, adhesion, self.gamma)


def _sum_before(panels):
    """Sum over the panels before each one, without subtracting: a panel 1e20 times larger loses nothing."""
    return np.tril(np.ones((panels.shape[0],) * 2, panels.dtype), -1) @ panels


def _in_a_row(values, pressure, shape=None):
    """Values at the nodes, of each point in a row; for values of all points, the shape of the nodes."""
    panels, _, order = values.shape if shape is None else shape
    values = jnp.broadcast_to(values, (panels, pressure.shape[0], order))
    return jnp.moveaxis(values, 1, 0).reshape(pressure.shape[0], -1)
