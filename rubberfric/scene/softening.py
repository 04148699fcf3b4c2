r"""Strain softening of filled rubber (Payne effect) [J. Appl. Polym. Sci. 6 (1962) 57] at each length scale.

.. math:: E' \to f(\varepsilon)\,E',\qquad E'' \to g(\varepsilon)\,E'',\qquad
          \varepsilon(q) = factor \times h'(q),\qquad
          h'(q)^2 = 2\pi\int_{q_0}^{q} q'^3 \sum_j C_j\,dq'

Asperities up to q strain the rubber in proportion to their rms slope.
"""

import functools
import math
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.checks import POSITIVE, check_table
from rubberfric.base.logarithms import floored_log
from rubberfric.base.objects.fields import Number, Vector, leaf
from rubberfric.base.objects.physical import PhysicalObject, physical
from rubberfric.base.roots import root
from rubberfric.roughness.moments import cumulative_moment
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio

# Smallest distance ln(q / q0) from the first wavevector at which an entry is found. Rounding of q is 1e-16.
_NEAREST = 1e-30

# Distance from the largest wavevector at which entries end, relative to ln(q1 / q0). Borders of panels at
# the end itself would lose second derivatives by q1. A kink beyond has an effect of 1e-16.
_MARGIN = 1e-8


@physical
class Softening(PhysicalObject):
    r"""Softening of all viscoelastic solids of a scene, or of one body.

    f and g are linear in ln(strain) between the entries and constant beyond them.

    Parameters
    ----------
    strain : strictly increasing [-], > 0, shape (n,), n >= 2
    storage, loss : f and g [-], > 0, shape (n,)
    factor : strain divided by rms slope [-], > 0

    Limits: elastic solids do not soften.

    Examples
    --------
    >>> softening = rf.Softening(strain=[1e-3, 1e-1], storage=[1.0, 0.33], loss=[1.0, 0.33])
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> softer = scene.replace(softening=softening)
    >>> round(float(rf.contact_area(softer, 1e-2, 5e4) / rf.contact_area(scene, 1e-2, 5e4)), 2)
    3.03
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

    def strain_at(self, slope: jax.Array) -> jax.Array:
        """Return the strain [-] where the roughness up to q has this rms slope [-]."""
        return self.softening.factor * slope


def strain(softened: Softened, q: jax.Array) -> jax.Array:
    """Return the strain [-] at wavevectors q [1/m] of any shape; 0 below the first wavevector."""
    return softened.strain_at(jnp.sqrt(_square_slope(softened.laws, q)))


def softening_factors(softened: Softened, q: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the factors f of E' and g of E'' at wavevectors q [1/m] of any shape."""
    softening = softened.softening
    # The slope is 0 below the roughness, and it may underflow.
    log_strain = jnp.log(softening.factor) + 0.5 * floored_log(_square_slope(softened.laws, q))
    knots = jnp.log(softening.strain)
    return jnp.interp(log_strain, knots, softening.storage), jnp.interp(log_strain, knots, softening.loss)


def knots(softened: Softened) -> jax.Array:
    """Return the wavevectors [1/m] at which the strain equals an entry of the table.

    f and g have kinks at these wavevectors. If the strain does not reach an entry, the result is close to
    the nearer end of the roughness.
    """
    laws, softening = softened.laws, softened.softening
    first = jax.lax.stop_gradient(functools.reduce(jnp.minimum, [law.q[0] for law in laws]))
    last = jax.lax.stop_gradient(functools.reduce(jnp.maximum, [law.q[-1] for law in laws]))
    log_target = 2 * (jnp.log(softening.strain) - jnp.log(softening.factor))
    beyond = [log_ratio(first, law.q[0]) for law in laws]
    farthest = jnp.log(last / first) * (1 - _MARGIN)

    def excess(log_distance):
        distance = jnp.exp(log_distance)
        moments = [cumulative_moment(law, 2, more + distance) for law, more in zip(laws, beyond, strict=True)]
        return floored_log(functools.reduce(jnp.add, moments)) - log_target

    # The logarithm of the strain is nearly linear in the logarithm of the distance.
    ends = jnp.full_like(log_target, math.log(_NEAREST)), jnp.full_like(log_target, jnp.log(farthest))
    return first * jnp.exp(jnp.exp(root(excess, *ends)[0]))


def _square_slope(laws, q):
    return functools.reduce(jnp.add, [cumulative_moment(law, 2, log_ratio(q, law.q[0])) for law in laws])
