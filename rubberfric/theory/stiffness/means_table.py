r"""Angular means of a modulus without a Prony series, tabulated over ln(q v).

For a half-space the means of `rubberfric.theory.stiffness.tabulated_means` depend on q v alone: they are
tabulated once, about where the modulus is, and interpolated for every node and velocity.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.materials.material import Material
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.angular_means import Harmonics, Means
from rubberfric.theory.stiffness.tabulated_means import (
    Tabulated,
    angular_integrals,
    ends_of,
    log_power,
    means_of_log,
)

# Entries of the table over ln(q v), for one node of the angular integral.
_ENTRIES_PER_NODE = 8

# How far the table of means goes beyond that of the modulus at either end, in ln(q v): there the
# means are two powers of q v, and what is left of a third is e^-24 and e^-27.
_BELOW, _ABOVE = 6.0, 9.0

# Where the limits of the means are taken.
_FAR = 40.0


class MeansTable(NamedTuple):
    """Angular means over a uniform grid of ln(q v), arrays of shape (entries,).

    The grid depends on the ends of the modulus' own table and on nothing else, so that no point of a
    call has a say in the value at another one. Its step is a power of 2^(1/4) and its entries are whole
    multiples of it: it does not move with the ends but leaps, and no derivative is to go through it.
    """

    material: Material
    first: jax.Array  # which multiple of the step the first entry is
    step: jax.Array
    entries: Means  # <|F|^2> as its logarithm
    slopes: Means  # the same of their differences from entry to entry
    limits: Means  # the means at two entries, far below and far above

    by_node = False

    def means(
        self, qv: jax.Array, needs: Needs, split: bool = False, harmonics: Harmonics | None = None
    ) -> Means:
        """Means of F for roughness passing at q v; arguments as for the table, and `Relaxing.means`."""
        del needs
        return means_of_log(self.material, qv, harmonics, lambda x: _interpolated(self, x, split))


def means_table(F: Tabulated, needs: Needs, split: bool, harmonics: Harmonics | None) -> MeansTable:
    """Table of the means of an F that depends on q v alone; arguments as of `Tabulated.means`."""
    count = _ENTRIES_PER_NODE * F.angle
    low, high = jax.lax.stop_gradient(jnp.log(jnp.stack(ends_of(F.material))))
    step = (high - low + _BELOW + _ABOVE) / (count - 6)
    step = jnp.exp2(jnp.ceil(4 * jnp.log2(step)) / 4)
    first = jnp.floor((low - _BELOW) / step) - 2
    grid = step * (first + np.arange(count))
    grid = jnp.concatenate([grid, jnp.stack([grid[2] - _FAR, grid[-3] + _FAR])])
    found = angular_integrals(F, grid, needs, split, harmonics)
    entries, limits = (jax.tree.map(lambda x, part=part: x[part], found) for part in (np.s_[:-2], np.s_[-2:]))
    # Where E' steps up, a cubic of <|F|^2> itself would swing below 0.
    entries = _of_positive(entries, log_power, split)
    return MeansTable(F.material, first, step, entries, jax.tree.map(_slopes, entries), limits)


def _slopes(values):
    """Derivative by the index, to fourth order but for two entries at either end."""
    inner = (8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / 12
    return jnp.pad(inner, 2)


def _of_positive(means, function, split):
    """Means with a function of those of <|F|^2> that are positive: harmonics have any sign."""
    if "power" not in means:
        return means
    power, count = means["power"], len(means["power"]) if split else 1
    return means | {"power": (*map(function, power[:count]), *power[count:])}


def _interpolated(table, log_qv, split):
    r"""Means from a table: cubic between its entries, beyond them the powers that the means follow.

    Their derivatives are continuous, so that a temperature at an entry has one like any other.

    With x = ln(q v) and E'' that falls, the means are below the table even or odd in e^x,

    .. math:: P + P' e^{2x},\qquad D e^x + D' e^{3x}

    and above it, where a share e^-x of the circle is within it, P + P' e^-x and D e^-x + D' e^-2x.
    """
    beyond, count = table.material.loss_beyond, jax.tree.leaves(table.entries)[0].shape[0]
    position = log_qv / table.step - table.first
    below, above = (table.step * x for x in (position - 2, position - (count - 3)))
    below, above = jnp.minimum(below, 0.0), jnp.maximum(above, 0.0)
    position = jnp.clip(position, 2, count - 3)
    index = jnp.clip(jnp.floor(jax.lax.stop_gradient(position)).astype(int), 2, count - 4)
    t = position - index
    # Hermite's weights of the two entries and of their slopes.
    rise = t * t * (3 - 2 * t)
    weights = (1 - rise, rise), (t * (1 - t) ** 2, -t * t * (1 - t))

    def interpolate(values, slopes):
        pairs = zip((values, slopes), weights, strict=True)
        return sum(left * x[index] + right * x[index + 1] for x, (left, right) in pairs)

    lower = below < 0

    def even(value, ends):
        """<|F|^2> and <Re F>, which go to a constant."""
        limit = jnp.where(lower, ends[0], ends[1])
        return limit + (value - limit) * jnp.exp((0.0 if beyond == "hold" else 2.0) * below - above)

    def odd(value, ends):
        """The dissipation, which goes to 0 if E'' does."""
        if beyond == "hold":
            return ends[1] + (value - ends[1]) * jnp.exp(-2.0 * above)
        if beyond == "none":
            return value * jnp.exp(-2.0 * above)
        # What is left of the mean where it is the first of the two powers alone.
        leading = jnp.exp(_FAR) * jnp.where(lower, ends[0], ends[1])
        return (leading + (value - leading) * jnp.exp(2.0 * below - above)) * jnp.exp(below - above)

    found = _of_positive(jax.tree.map(interpolate, table.entries, table.slopes), jnp.exp, split)
    rules = {"power": even, "dissipation": odd, "storage": even, "transverse": odd}
    return {kind: tuple(map(rules[kind], values, table.limits[kind])) for kind, values in found.items()}
