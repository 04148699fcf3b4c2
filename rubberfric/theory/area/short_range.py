r"""Contact with adhesion of short range: detachment stress, energy and area as one fixed point.

.. math:: \gamma_\mathrm{eff}(q)\, A(q) = \Delta\gamma\,(1 + \tfrac12 h'^2) A(q_1) - U_\mathrm{el}(q),\qquad
          U_\mathrm{el}(q) = \frac12\int_q^{q_1} d^2q' \sum_j C_j\,\mathrm{Re}K_j\, S P
.. math:: \sigma_a(q)^2 = c\,E_r\,q\,\gamma_\mathrm{eff}(q)

and A(q) from sigma_a(q) by `rubberfric.theory.area.first_passage`
[Persson, Eur. Phys. J. E 8, 385 (2002), doi:10.1140/epje/i2002-10025-1]. The energy is the one of which
the separation of the theory is the derivative [Scaraggi & Persson, eq. (14)], with S P of the
area that adheres; gamma = 1 is Persson's of 2002.

Seen from gamma_eff of all the roughness, gamma_eff A grows with the energy of what is coarser than q, and
both follow from the areas there: what is iterated is that one number, and areas that depend on those before
them. Where it is below 0, sigma_a = 0 up to the wavevector at which the energy of contact without adhesion
makes up for it, begins there as a square root, and the panels of a point with it
(`rubberfric.theory.area.own_panels`).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.fixed_points.anderson import fixed_point, implicit
from rubberfric.base.fixed_points.bracketed import bracketed
from rubberfric.base.quadrature import gauss, typed
from rubberfric.roughness.mesh.radial_mesh import Mesh
from rubberfric.scene.adhesion import PREFACTOR, Adhesion
from rubberfric.theory.area.first_passage import NOTHING, at_end, from_nodes_on, passage
from rubberfric.theory.area.own_panels import Panels, Table, inverse, panels_from, root, table
from rubberfric.theory.area.partial_contact import contact_argument, contact_fraction, energy_factor

# Panels of a point, besides those between kinks, and their nodes.
PANELS, ORDER = 6, 12

# Of the iteration, for second derivatives are the worse for what it leaves, and of their linear systems.
_TOLERANCE, _LINEAR_TOLERANCE = 1e-12, 1e-11

# Functions of the table that say where sigma_a begins: energy, g, energy of A = P up to q.
_RISE = slice(1, 4)

# 1 / (2 sqrt t) where nothing is absorbed.
_BEFORE_ALL = 27.0


class Detachment(NamedTuple):
    """Contact with adhesion; axes (panels, points, order) where there are three."""

    area: jax.Array  # A(q) at the contact nodes [-]
    final: jax.Array  # A(q1) [-], (points,)
    work: jax.Array  # gamma_eff(q) [J/m^2]
    whole: jax.Array  # gamma_eff of all the roughness [J/m^2], (points,)
    stress: jax.Array  # sigma_a(q) [Pa]
    converged: jax.Array  # whether the fixed point was reached, (points,)


class Plain(NamedTuple):
    """The contact without adhesion; at the nodes of the mesh (panels, points or 1, order)."""

    g: jax.Array
    end: jax.Array  # g of all, (points or 1,)
    energy: jax.Array  # of full contact, terms of its integral [J/m^2]
    roughness: jax.Array  # 2 pi q^4 C, terms of its integral, (panels, 1, order)
    stiffness: jax.Array  # modulus scale over sigma_0, (points,)
    pressure: jax.Array  # sigma_0 [Pa], (points,)


class _Nodes(NamedTuple):
    """At the nodes of the panels of points, (panels, order, points), and of points alone."""

    panels: Panels
    t: jax.Array
    plain: jax.Array  # A without adhesion
    energy: jax.Array  # of full contact, terms of its integral [J/m^2]
    pull: jax.Array  # (sigma_a / sigma_0)^2 over gamma_eff [m^2/J]
    begun: jax.Array  # energy of the roughness before the panels [J/m^2], (points,)
    first: jax.Array  # gamma_eff A where the panels begin, 0 where it is sigma_a that does [J/m^2], (points,)
    x: jax.Array  # where the panels begin with sigma_a, (points,)


class Balance(NamedTuple):
    """The function of which the contact is a fixed point; arrays (points,) and of numbers."""

    # Of roughness and energy by the coordinate of a panel, g, and energies up to q of A = P and of A = 1.
    table: Table
    log_g: jax.Array  # at the positions of the table, (nodes, points)
    energy: jax.Array  # of contact without adhesion up to there [J/m^2], (nodes, points)
    last: jax.Array  # A(q1) without adhesion
    stiffness: jax.Array
    pull: jax.Array  # pull of a node over (q / q0)^2 energy / roughness [m^4/J^2]
    modulus: jax.Array  # energy / roughness at q0 [J/m^2]
    work: jax.Array  # that could be gained, with all of the true area [J/m^2]
    unit: jax.Array  # that and the energy of full contact [J/m^2]
    gamma: jax.Array

    def start(self) -> jax.Array:
        """Contact without adhesion."""
        count = (PANELS + self.table.kinks.shape[0]) * ORDER
        whole = (self.work * self.last - self.energy[-1]) / self.unit
        return jnp.concatenate([jnp.repeat(self.last[:, None], count, 1), whole[:, None]], 1)

    def __call__(self, state: jax.Array) -> jax.Array:
        """A over that without adhesion, times A(q1) without, and gamma_eff of all over the unit.

        So they are of one size at light loads as well: residuals are measured by the largest.
        """
        ratio, whole = self.parts(state)
        at = jax.lax.optimization_barrier(self.nodes(whole))
        # Beyond what can be a solution lies nothing that an iteration should come back from.
        ratio = jnp.where(ratio < 0.9, 0.9, ratio)
        ratio = jnp.where(ratio * at.plain > 1.1, 1.1 / at.plain, ratio)
        _, work, whole = self.energies(ratio, at)
        found = passage(at.t, at.pull * work / (ratio * at.plain), at.x) / at.plain * self.last
        return jnp.concatenate([found.reshape(-1, found.shape[-1]), (whole / self.unit)[None]]).T

    def parts(self, state: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Areas over those without adhesion, and gamma_eff of all roughness."""
        ratio = state[:, :-1].T.reshape(-1, ORDER, state.shape[0]) / self.last
        return ratio, state[:, -1] * self.unit

    def nodes(self, whole: jax.Array) -> _Nodes:
        """The panels that belong to gamma_eff of all roughness."""
        begin, origin = self._begin(whole)
        panels = panels_from(begin, origin, self.table, self.log_g, PANELS, ORDER)
        shape = panels.log_q.shape
        places = jnp.concatenate([begin[None], panels.log_q.reshape(-1, shape[-1])])
        found, stretch = self.table(places, slice(None))
        g_begin, plain, full = found[2:, 0]
        roughness, energy, g = found[:3, 1:].reshape(-1, *shape)
        stretch = stretch[1:].reshape(shape)
        x = contact_argument(jnp.maximum(g, 0.0), self.stiffness)
        some = stretch > 0
        x_begin = contact_argument(jnp.maximum(g_begin, 0.0), self.stiffness)
        begun = jnp.where(whole < 0, plain, full)
        return _Nodes(
            panels,
            t=0.25 / (x * x),
            plain=contact_fraction(x),
            energy=jnp.where(some, energy / jnp.where(some, stretch, 1.0), 0.0) * panels.weight,
            pull=self.pull * jnp.exp(2 * panels.log_q) * _over(energy, roughness),
            begun=begun,
            first=jnp.where((whole < 0) & (begin == origin), 0.0, whole + begun),
            x=jnp.where(whole < 0, x_begin, _BEFORE_ALL),
        )

    def _begin(self, whole):
        """Where the panels begin: before, nothing is absorbed or sigma_a = 0; where sigma_a does, or q0."""
        end = self.table.borders[-1]
        # sigma_a grows with q: before, it is no less than at q0.
        root_t = (1 + root(self.pull * self.modulus * whole)) / (2 * NOTHING * self.stiffness)
        position = jnp.broadcast_to(self.table.position[:, None], self.energy.shape)
        idle = inverse(position, self.log_g, 2 * jnp.log(root_t)[None])[0]
        wanted = jnp.maximum(-whole, 0.0)

        def newton(place, _):
            # From between two nodes; the derivatives are those of the last step.
            place = jax.lax.stop_gradient(place)
            (energy, g, upto), stretch = (values[..., 0, :] for values in self.table(place[None], _RISE))
            area = contact_fraction(contact_argument(jnp.maximum(g, 0.0), self.stiffness))
            slope = energy * energy_factor(area, self.gamma) * area
            further = place - (upto - wanted) * _over(stretch, slope)
            place = jnp.where(further < 2 * place, further, 2 * place)
            return jnp.where(place > 0, jnp.where(place < end, place, end), 0.0), None

        place = jax.lax.scan(newton, inverse(position, self.energy, wanted[None])[0], None, 2)[0]
        begin = jnp.where((whole < 0) & (place > idle), place, idle)
        # In full contact it is the end, and moves with it.
        begin = jnp.where(begin < end, begin, end)
        return begin, jnp.where(whole < 0, jnp.where(place > idle, begin, place), 0.0)

    def energies(self, ratio: jax.Array, at: _Nodes) -> tuple[jax.Array, jax.Array, jax.Array]:
        """A(q1), gamma_eff A at the nodes, and gamma_eff of all roughness from the other end."""
        # A ratio near one is extrapolated, not an area that falls by decades.
        final = jnp.minimum(at_end(ratio) * self.last, 1.0)
        area = ratio * at.plain
        terms = at.energy * energy_factor(area, self.gamma) * area
        # From the side where sigma_a begins, whose root is the worse for what a difference leaves.
        backwards = jnp.moveaxis(terms, 2, 1)[::-1, :, ::-1]
        since = jnp.moveaxis(from_nodes_on(backwards)[::-1, :, ::-1], 1, 2)
        return final, at.first + since, self.work * final - jnp.sum(terms, (0, 1)) - at.begun


def detach(mesh: Mesh, plain: Plain, adhesion: Adhesion, gamma: jax.Array) -> Detachment:
    """Solve for the contact.

    Parameters
    ----------
    mesh : Mesh, graded
    plain : Plain
    adhesion : Adhesion of short range
    gamma : of S

    Returns
    -------
    Detachment, derivatives implicit
    """
    P = contact_fraction(contact_argument(plain.g, plain.stiffness[:, None]))
    partial = plain.energy * energy_factor(P, gamma) * P
    energies = _up_to(partial), _up_to(plain.energy)
    balance = _balance(mesh, plain, adhesion, gamma, energies, jnp.sum(partial, (0, 2)))
    still = jax.lax.stop_gradient(balance)
    start = still.start()
    solution, converged = fixed_point(still, start, tolerance=_TOLERANCE)
    # Where solids nearly jump into contact the areas hang on the one number too steeply for that.
    again = jnp.where(converged[:, None], solution, start)
    solution, converged = bracketed(still, again, converged, _TOLERANCE)
    ratio, whole = balance.parts(implicit(balance, solution, tolerance=_LINEAR_TOLERANCE))
    at = balance.nodes(whole)
    final, work, _ = balance.energies(ratio, at)
    # At the nodes of the mesh.
    log_q = jnp.log(mesh.q / mesh.first)
    rows = jnp.broadcast_to(log_q.reshape(-1, 1), (log_q.size, whole.shape[0]))

    def at_contact(values):
        return jnp.moveaxis(at.panels.interpolated(values, rows).reshape(*log_q.shape, -1), 2, 1)

    begun = log_q[:, None] >= at.panels.borders[0][:, None]
    whole = whole[:, None]
    area = jnp.where(begun, at_contact(ratio) * P, jnp.where(whole < 0, P, 1.0))
    work = jnp.where(begun, at_contact(work), whole + jnp.where(whole < 0, *energies)) / area
    pull = balance.pull[:, None] * jnp.exp(2 * log_q[:, None]) * _over(plain.energy, plain.roughness)
    stress = root(pull * work) * plain.pressure[:, None]
    whole = jnp.maximum(whole[:, 0], 0.0)
    return Detachment(area, final, jnp.maximum(work, 0.0), whole, stress, converged)


def _balance(mesh, plain, adhesion, gamma, energies, stored):
    """`Balance`, of the energies up to the nodes and of that of all of them without adhesion."""
    weight = typed(gauss(mesh.q.shape[1])[1], mesh.q)
    points = plain.pressure.shape[0]

    def in_a_row(values, end):
        values = jnp.broadcast_to(values, (values.shape[0], points, values.shape[2]))
        end = jnp.broadcast_to(end, (1, points))
        return jnp.concatenate([jnp.moveaxis(values, 2, 1).reshape(-1, points), end])

    values = [plain.roughness / weight, plain.energy / weight, plain.g, *energies]
    # The true area is larger by half the square of the rms slope.
    work = adhesion.work * (1 + 0.5 * jnp.sum(plain.roughness))
    # Where the roughness begins g may be too small for its logarithm.
    row = jnp.log(jnp.maximum(in_a_row(plain.g, plain.end), jnp.finfo(mesh.q.dtype).tiny))
    # E_r, of both spectra the mean, is 4 q energy / roughness.
    prefactor = PREFACTOR if adhesion.prefactor is None else adhesion.prefactor
    pull = 4 * prefactor * (mesh.first / plain.pressure) ** 2
    P = contact_fraction(contact_argument(plain.end, plain.stiffness))
    return Balance(
        table=table(mesh, values),
        log_g=row,
        energy=in_a_row(energies[0], stored),
        last=P,
        stiffness=plain.stiffness,
        pull=pull,
        modulus=plain.energy[0, :, 0] / plain.roughness[0, :, 0],
        work=work,
        unit=work + jnp.sum(plain.energy, (0, 2)),
        gamma=gamma,
    )


def _up_to(terms):
    return jnp.sum(terms, (0, 2))[:, None] - from_nodes_on(terms)


def _over(values, by):
    """A quotient, 0 where there is nothing: in a gap between two spectra there is nothing to detach."""
    return jnp.where(by > 0, values / jnp.where(by > 0, by, 1.0), 0.0)
