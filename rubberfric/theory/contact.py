r"""Contact of rough surfaces for given temperatures: G, P and S at every wavevector, and the contact area.

`rubberfric.theory.contributions` has the integrands of K_j in the unit `scale` of all moduli
[Scaraggi & Persson]

.. math:: G(q) = \frac{1}{2\sigma_0^2}\int_{q_0}^q d^2q \sum_j C_j \langle|K_j|^2\rangle,\qquad
          x = \frac{1}{2\sqrt G},\qquad P = \mathrm{erf}\,x,\qquad S = \gamma + (1 - \gamma) P^2
.. math:: \mu = \frac{1}{\sigma_0}\int d^2q\; S P \sum_j C_j\, q \langle\cos\varphi\,\mathrm{Im}K_j\rangle
.. math:: \bar u = \frac{1}{2\sigma_0}\int d^2q\; x\Psi(x) \sum_j C_j \langle\mathrm{Re}K_j\rangle
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.roughness.mesh.nodes import Mesh
from rubberfric.scene.interface import Correlation
from rubberfric.theory.area.area_correction import UniformTable, correct_argument
from rubberfric.theory.area.partial_contact import (
    contact_argument,
    contact_fraction,
    energy_factor,
    separation_weight,
)
from rubberfric.theory.contributions import Contribution, Terms, total
from rubberfric.theory.structure import SurfaceTemperatures

# With too few panels the interpolant of <|F|^2> can be negative. Down to this G, P is 1 to 1e-12. Below it G
# is unknown.
_NO_CONTACT_LOST = -0.01


class Contact(NamedTuple):
    """Contact at points. Arrays with three axes have the shape (panels, points, order)."""

    terms: list[Terms]  # of the contributions of all rough surfaces
    modulus_over_pressure: jax.Array  # scale divided by the pressure on the contact, (points,)
    G_panels: jax.Array  # plain, part from each panel, (panels, points), or from all of them, (1, points)
    G: jax.Array | None  # plain, up to every contact node; None if only the area is needed
    gamma: jax.Array
    correction: UniformTable | None
    # With adhesion: equivalent pressure without adhesion divided by sigma_0, (points,); True where this
    # pressure was found; separation minus the separation without adhesion under this pressure [m].
    load: jax.Array | None = None
    converged: jax.Array | None = None
    lift: jax.Array | None = None

    @property
    def x(self) -> jax.Array:
        """Return x = 1 / (2 sqrt(G)) at the contact nodes, where G does not contain S."""
        if self.G is None:
            raise ValueError("G is known at the largest wavevector only; prepare friction or separation")
        return contact_argument(self.G)

    def area(self, panels: jax.Array | None = None) -> jax.Array:
        """Return the contact fraction P at the end of the first `panels` panels, of shape (points,).

        If `panels` is None, all panels count and P is A/A0.
        """
        G = self.G_panels
        if panels is not None:
            G = jnp.where(np.arange(G.shape[0])[:, None] < panels, G, 0.0)
        return contact_fraction(self.corrected(contact_argument(jnp.sum(G, 0))))

    def friction_terms(self, kind: str = "mean_cos_loss") -> dict[int, jax.Array]:
        """Return the viscoelastic friction from each contribution and contact node.

        Parameters
        ----------
        kind : "mean_cos_loss", or "mean_sin_loss" for the friction across the direction of sliding

        Returns
        -------
        dict from the index of a contribution to an array of shape (panels, points, order). The sum over
        contributions, panels and order is mu [-].
        """
        densities = {j: term.densities[kind] for j, term in enumerate(self.terms) if kind in term.densities}
        if not densities:
            return {}
        modulus_over_load = self.modulus_over_pressure  # friction is divided by sigma_0
        if self.load is not None:
            modulus_over_load = modulus_over_load * self.load
        column = modulus_over_load[:, None]
        P = contact_fraction(self.corrected(self.x))  # (10)
        S = energy_factor(P, self.gamma)  # (14)
        return {j: column * (S * P) * density for j, density in densities.items()}  # (A17)

    def separation(self) -> jax.Array:
        """Return the mean separation [m], of shape (points,)."""
        density = total(terms.densities["mean_storage"] for terms in self.terms)
        weight = 0.5 * separation_weight(self.x, self.gamma)
        u = self.modulus_over_pressure * jnp.sum(weight * density, (0, 2))  # (A18)
        return u if self.lift is None else u + self.lift

    def corrected(self, x: jax.Array) -> jax.Array:
        """Return x with S in G if the scene has `area_correction`, otherwise return x unchanged."""
        return x if self.correction is None else correct_argument(self.correction, x)

    def under(self, load: jax.Array, converged: jax.Array, lift: jax.Array | None = None) -> "Contact":
        """Return the contact with adhesion.

        Contact with adhesion equals the contact without adhesion under the pressure `load` times sigma_0.
        """
        square = load * load
        return self._replace(
            modulus_over_pressure=self.modulus_over_pressure / load,
            G_panels=self.G_panels / square,
            G=None if self.G is None else self.G / square[:, None],
            load=load,
            converged=converged,
            lift=lift,
        )


class Roughness(NamedTuple):
    """The rough surfaces of a scene, prepared for many points."""

    mesh: Mesh
    contributions: tuple[Contribution, ...]
    strained: tuple[str, ...]  # the solid that each surface strains: "lower" or "upper"
    scale: jax.Array  # unit of all moduli [Pa]
    gamma: jax.Array
    correction: UniformTable | None  # of S in G
    correlation: Correlation | None = None  # already included in the roughness; for solids at rest
    approximate: bool = False  # True if another mesh checks the results, so that a failed G may be 0

    def contact(
        self, velocity: jax.Array, pressure: jax.Array, temperatures: Sequence[SurfaceTemperatures]
    ) -> Contact:
        """Return the `Contact` without adhesion.

        Parameters
        ----------
        velocity, pressure : shape (points,) [m/s], [Pa]
        temperatures : `SurfaceTemperatures` [K] of each contribution. A temperature is None, or has the shape
            (points,) or (angular panels, points, angular order).
        """
        terms = [
            contribution.terms(self.mesh, velocity, T)
            for contribution, T in zip(self.contributions, temperatures, strict=True)
        ]
        modulus = self.scale / pressure
        if self.correlation is not None:
            modulus = jnp.where(velocity == 0, modulus, jnp.nan)
        within = [term.within for term in terms if term.within is not None]
        panels = [term.panels for term in terms]
        if not within:
            # If only the whole integral is needed, each contribution has its own panels.
            panels = [jnp.sum(own, 0, keepdims=True) for own in panels]
        # At light loads the derivative by modulus**2 would underflow in single precision.
        G_panels, G = modulus * (modulus * (0.5 * total(panels))), None  # (A11)
        if within:
            column = modulus[:, None]
            G = _sum_before(G_panels)[..., None] + column * (column * (0.5 * total(within)))  # (A11)
            known = True if self.approximate else G > _NO_CONTACT_LOST
            G = jnp.where(G < 0, jnp.where(known, 0.0, jnp.nan), G)
        return Contact(terms, modulus, G_panels, G, self.gamma, self.correction)


def _sum_before(panels: jax.Array) -> jax.Array:
    """Return, for each panel, the sum over all earlier panels.

    Sums are computed without subtractions, so the sums before much larger panels lose no digits.
    """
    return jnp.asarray(np.tri(panels.shape[0], k=-1, dtype=panels.dtype)) @ panels
