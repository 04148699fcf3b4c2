r"""Strain softening of filled rubber (Payne effect) [J. Appl. Polym. Sci. 6 (1962) 57] at each length scale.

.. math:: E' \to f(\varepsilon)\,E',\qquad E'' \to g(\varepsilon)\,E'',\qquad
          \varepsilon(q) = factor \times h'(q),\qquad
          h'(q)^2 = 2\pi\int_{q_0}^{q} q'^3 \sum_j C_j\,dq'

Asperities up to q strain the rubber in proportion to their rms slope.
"""

import functools
import operator
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.checks import POSITIVE, check_table
from rubberfric.base.logarithms import floored_log
from rubberfric.base.objects.fields import Number, Vector, leaf
from rubberfric.base.objects.physical import PhysicalObject, physical
from rubberfric.roughness.moments import cumulative_moment
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio

# Bisections of ln t from 1e-40 to the whole range leave an error of 1e-10, which each Newton step squares.
_HALVINGS, _NEWTON_STEPS = 40, 3


@physical
class Softening(PhysicalObject):
    r"""Softening of all viscoelastic solids of a scene, or of one body.

    f and g are linear in ln(strain) between the entries and constant beyond them.

    Parameters
    ----------
    strain : strictly increasing [-], > 0, shape (n,), n >= 2
    storage, loss : f and g [-], > 0, shape (n,)
    factor : strain divided by rms slope [-], > 0

    Limits: elastic solids do not soften. If both solids deform, the angular integrals have no closed form and
    use quadrature, which is slower.
    """

    rising: ClassVar = (("strain",),)

    strain: Vector = leaf(POSITIVE, unit="-", column="strain")
    storage: Vector = leaf(POSITIVE, unit="-", column="storage_factor", over="strain")
    loss: Vector = leaf(POSITIVE, unit="-", column="loss_factor", over="strain")
    factor: Number = leaf(POSITIVE, unit="-", default=1.0)

    def _check(self):
        check_table("Softening", strain=self.strain, storage=self.storage, loss=self.loss)


class Softened(NamedTuple):
    """Softening together with the roughness of a scene, which determines the strain."""

    softening: Softening
    laws: tuple[BrokenPowerLaw, ...]  # spectra of the rough solids


def strain(softened: Softened, q: jax.Array) -> jax.Array:
    """Return the strain [-] at wavevectors q [1/m] of any shape; 0 below the first wavevector."""
    return softened.softening.factor * jnp.sqrt(_square_slope(softened.laws, q))


def softening_factors(softened: Softened, q: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the factors f of E' and g of E'' at wavevectors q [1/m] of any shape."""
    softening = softened.softening
    # The slope is 0 below the roughness, and it may underflow.
    log_strain = jnp.log(softening.factor) + 0.5 * floored_log(_square_slope(softened.laws, q))
    knots = jnp.log(softening.strain)
    return jnp.interp(log_strain, knots, softening.storage), jnp.interp(log_strain, knots, softening.loss)


def knots(softened: Softened) -> jax.Array:
    """Return the wavevectors [1/m] at which the strain equals an entry of the table.

    f and g have kinks at these wavevectors. If the strain does not reach an entry, the nearer end of the
    roughness is returned.
    """
    laws, softening = softened.laws, softened.softening
    first = jax.lax.stop_gradient(functools.reduce(jnp.minimum, [law.q[0] for law in laws]))
    last = jax.lax.stop_gradient(functools.reduce(jnp.maximum, [law.q[-1] for law in laws]))
    log_target = 2 * (jnp.log(softening.strain) - jnp.log(softening.factor))
    target = jax.lax.stop_gradient(jnp.exp(log_target))
    end = jnp.log(last / first)
    tiny = jnp.log(jnp.asarray(1e-30, end.dtype))

    def square(t):
        return _square_slope(laws, first * jnp.exp(t))

    def halve(_, bounds):
        low, high = bounds
        middle = 0.5 * (low + high)
        below = square(jnp.exp(middle)) < target
        return jnp.where(below, middle, low), jnp.where(below, high, middle)

    bounds = jnp.full_like(target, tiny), jnp.full_like(target, jnp.log(end))
    low, high = jax.lax.fori_loop(0, _HALVINGS, halve, jax.lax.stop_gradient(bounds))
    t = jax.lax.stop_gradient(jnp.exp(0.5 * (low + high)))
    inside = jax.lax.stop_gradient((target > square(jnp.exp(tiny))) & (target < square(end)))
    # Far outside, the square and its derivative overflow.
    target = jnp.exp(jnp.where(inside, log_target, 0.0))
    for _ in range(_NEWTON_STEPS):
        value, slope = jax.jvp(square, (t,), (jnp.ones_like(t),))
        # Outside there is neither a root nor a slope.
        t = jnp.where(inside, t - (value - target) / jnp.where(inside, slope, 1.0), t)
    return first * jnp.exp(t)


def _square_slope(laws, q):
    return functools.reduce(operator.add, [cumulative_moment(law, 2, log_ratio(q, law.q[0])) for law in laws])
