r"""Contact with adhesion of short range: detachment stress, energy and area as one fixed point.

.. math:: \gamma_\mathrm{eff}(q)\, A(q) = \Delta\gamma\,(1 + \tfrac12 h'^2) A(q_1) - U_\mathrm{el}(q),\qquad
          U_\mathrm{el}(q) = \frac12\int_q^{q_1} d^2q' \sum_j C_j\,\mathrm{Re}K_j\, S P
.. math:: \sigma_a(q)^2 = c\,E_r\,q\,\gamma_\mathrm{eff}(q)

and A(q) from sigma_a(q) by `rubberfric.theory.area.first_passage`
[Persson, Eur. Phys. J. E 8, 385 (2002), doi:10.1140/epje/i2002-10025-1]. The energy is the one of which
the separation of the theory is the derivative [Scaraggi & Persson, eq. (14)], with S P of the
area that adheres; gamma = 1 is Persson's of 2002. Where it outweighs the work of adhesion, sigma_a = 0.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.fixed_point import fixed_point, implicit
from rubberfric.theory.area.first_passage import at_end, from_nodes_on, passage, root
from rubberfric.theory.area.partial_contact import contact_fraction, energy_factor


class Detachment(NamedTuple):
    """Contact with adhesion; axes (panels, points, order) where there are three."""

    area: jax.Array  # A(q) at the contact nodes [-]
    final: jax.Array  # A(q1) [-], (points,)
    work: jax.Array  # gamma_eff(q) [J/m^2]
    whole: jax.Array  # gamma_eff of all the roughness [J/m^2], (points,)
    stress: jax.Array  # sigma_a(q) [Pa]
    converged: jax.Array  # whether the fixed point was reached, (points,)


class Balance(NamedTuple):
    """What the fixed point depends on; axes (panels, points, order) where there are three."""

    x: jax.Array  # 1 / (2 sqrt G)
    last: jax.Array  # the same at q1, (points,)
    energy: jax.Array  # of full contact, terms of its integral over ln q [J/m^2]
    pull: jax.Array  # c E_r q / sigma_0^2 [m^2/J]
    work: jax.Array  # that could be gained, with all of the true area [J/m^2]
    gamma: jax.Array

    def __call__(self, state: jax.Array) -> jax.Array:
        """The areas over those without adhesion, from themselves; (points, panels times order)."""
        ratio = self._by_panel(state)
        plain = contact_fraction(self.x)
        # Beyond what can be a solution lies nothing that an iteration should come back from.
        ratio = jnp.where(ratio < 0.9, 0.9, ratio)
        ratio = jnp.where(ratio * plain > 1.1, 1.1 / plain, ratio)
        _, _, work, _ = self._energies(ratio)
        return _by_point(passage(self.x, self.pull * work) / plain)

    def found(self, state: jax.Array, pressure: jax.Array, converged: jax.Array) -> Detachment:
        """`Detachment` of a fixed point."""
        area, final, work, whole = self._energies(self._by_panel(state))
        stress = root(self.pull * work) * pressure[:, None]
        return Detachment(area, final, jnp.maximum(work, 0.0), jnp.maximum(whole, 0.0), stress, converged)

    def _energies(self, ratio):
        """A(q), A(q1), gamma_eff(q) and gamma_eff of all roughness."""
        area = ratio * contact_fraction(self.x)
        # A ratio near one is extrapolated, not an area that falls by decades.
        final = jnp.minimum(at_end(ratio) * contact_fraction(self.last), 1.0)
        terms = self.energy * energy_factor(area, self.gamma) * area
        gained = self.work * final
        work = (gained[:, None] - from_nodes_on(terms)) / area
        whole = gained - jnp.sum(terms, (0, 2))
        return area, final, work, whole

    def _by_panel(self, state):
        panels, _, order = self.x.shape
        return jnp.moveaxis(state.reshape(-1, panels, order), 0, 1)


def _by_point(values):
    """(panels, points, order) as (points, panels times order)."""
    return jnp.moveaxis(values, 1, 0).reshape(values.shape[1], -1)


def detach(balance: Balance, pressure: jax.Array) -> Detachment:
    """Solve for the contact.

    Parameters
    ----------
    balance : Balance
    pressure : sigma_0 [Pa], (points,)

    Returns
    -------
    Detachment, derivatives implicit
    """
    still = jax.lax.stop_gradient(balance)
    solution, converged = fixed_point(still, _by_point(jnp.ones_like(still.x)))
    # Once more, for second derivatives are the worse for what a tolerance leaves.
    return balance.found(implicit(balance, still(solution)), pressure, converged)
