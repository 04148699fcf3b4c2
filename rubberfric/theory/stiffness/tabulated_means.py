r"""Tabulated moduli: E(omega) between and beyond the entries, and its angular means.

No closed form here. With cos(phi) = sin(psi), psi = (pi/2) e^-y the structure of E at
cos(phi) ~ omega_i / (q v), whatever decade that is in, becomes structure in y, and

.. math:: \langle h\rangle = \frac{2}{\pi}\int_0^\infty h(q v \sin\psi)\,\psi\,dy

is done by Gauss panels in y. For a half-space the means depend on q v alone: they are
tabulated once over ln(q v), about where the modulus is, and interpolated for every node and velocity.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import gauss

# Panels in y; short ones first, where the weight psi is: e^-25 of the circle is left out.
_EDGES = np.array([0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 11.0, 25.0])

# Entries of the table over ln(q v), for one node of the angular integral.
_ENTRIES_PER_NODE = 8

# How far the table of means goes beyond that of the modulus at either end, in ln(q v): there the
# means are two powers of q v, and what is left of a third is e^-24 and e^-27.
_BELOW, _ABOVE = 6.0, 9.0

# Where the limits of the means are taken.
_FAR = 40.0


class Table(NamedTuple):
    """Angular means over a uniform grid of ln(q v), a tuple of arrays of shape (entries,) each, or None.

    The grid depends on the ends of the modulus' own table and on nothing else, so that no point of a
    call has a say in the value at another one. Its step is a power of 2^(1/4) and its entries are whole
    multiples of it: it does not move with the ends but leaps, and no derivative is to go through it.
    """

    first: jax.Array  # which multiple of the step the first entry is
    step: jax.Array
    means: tuple  # as `tabulated_means`, <|F|^2> as its logarithm
    slopes: tuple  # the same of their differences from entry to entry
    limits: tuple  # the same at two entries, far below and far above


def tabulated_means(F, qv, wanted, angle, split=False, mix=None):
    """(power, dissipation, storage, transverse) of a Tabulated stiffness, as `angular.angular_means`."""
    # Far below the table F is its static value and Im F is linear in q v: the means are
    # taken at the floor and the dissipation scaled, so that v = 0 keeps its derivative.
    floor = jnp.log(F.material.frequency_range()[0]) - math.log(1e9)
    tiny = jnp.finfo(qv.dtype).tiny
    log_qv = jnp.maximum(jnp.log(jnp.maximum(jnp.abs(qv), tiny)), floor)
    harmonics = 0 if mix is None else mix[0].shape[0]
    # Shares that depend on q are not those of a table over q v: the harmonics are kept apart till then.
    late, mix = (mix, None) if mix is not None and mix[0].ndim > 1 else (None, mix)
    if F.table is None:
        means = _direct(F, log_qv, wanted, angle, split, harmonics, mix)
    else:
        means = _by_table(F, log_qv, split)
    if late is not None:
        means = _mixed(means, *late)
    power, dissipation, storage, transverse = means
    # If E'' does not vanish at v = 0+, only the sign is left.
    sign = jnp.sign(qv) if F.material.loss_at_rest else qv * jnp.exp(-log_qv)
    signed = (None if m is None else tuple(mean * sign for mean in m) for m in (dissipation, transverse))
    dissipation, transverse = signed
    return power, dissipation, storage, transverse


def _mixed(means, cosine, sine):
    """One mean of each kind from its harmonics, the isotropic one first but for the transverse."""
    *even, odd = means
    even = (
        None if m is None else (sum((c * x for c, x in zip(cosine, m[1:], strict=True)), m[0]),) for m in even
    )
    return *even, None if odd is None else (sum(s * x for s, x in zip(sine, odd, strict=True)),)


def _angles(count):
    """psi and its weights in a mean over the circle, host arrays."""
    order = max(2, count // (len(_EDGES) - 1))
    node, weight = gauss(order)
    y = (_EDGES[:-1, None] + np.diff(_EDGES)[:, None] * node).ravel()
    psi = 0.5 * np.pi * np.exp(-y)
    weight = (np.diff(_EDGES)[:, None] * weight).ravel() * psi * (2 / np.pi)
    return psi, weight / weight.sum()


def angular_rule(count, dtype):
    """(cos(phi), weight) of a mean over the directions of sliding, of a function even in cos(phi)."""
    psi, weight = _angles(count)
    return jnp.asarray(np.sin(psi), dtype), jnp.asarray(weight, dtype)


def _direct(F, log_qv, wanted, angle, split, harmonics, mix):
    """Means at every node by its own angular integral; scale and spring of shape () or (nodes,)."""
    psi, weight = _angles(angle)
    m = np.arange(1, harmonics + 1)[:, None]
    # phi = pi/2 - psi: cos 2 m phi = (-1)^m cos 2 m psi, sin 2 m phi = -(-1)^m sin 2 m psi.
    even = np.concatenate([np.ones((1, psi.size)), (-1.0) ** m * np.cos(2 * m * psi)])
    odd = -((-1.0) ** m) * np.sin(2 * m * psi) * np.cos(psi)
    sine = jnp.asarray(np.sin(psi), log_qv.dtype)
    even, odd = (jnp.asarray(weight * rows, log_qv.dtype) for rows in (even, odd))
    if mix is not None:
        even, odd = even[:1] + mix[0] @ even[1:], (mix[1] @ odd)[None]
    storage, loss = F.material.storage_and_loss(log_qv[..., None] + jnp.log(sine))
    scale = F.scale[..., None] if F.scale.ndim else F.scale
    storage, loss = scale * storage, scale * loss
    power = storage**2 + loss**2
    if F.spring is not None:
        # F = f k / (f + k), by parts; a liquid at rest is a spring of k = 0.
        spring = F.spring[..., None]
        share = spring / ((storage + spring) ** 2 + loss**2)
        storage = share * (spring * storage + power)
        power, loss = share * spring * power, share * spring * loss
    powers = (storage**2, loss**2) if split else (power,)

    def means(name, values, rows):
        return tuple(jnp.moveaxis(values @ rows.T, -1, 0)) if name in wanted else None

    return (
        sum((means("power", power, even) for power in powers), ()) if "power" in wanted else None,
        means("dissipation", loss * sine, even),
        means("storage", storage, even),
        means("transverse", loss, odd),
    )


def means_table(F, wanted, angle, split=False, mix=None):
    """`Table` of the means of a Tabulated stiffness, for `tabulated_means` of the same arguments.

    None where the means depend on more than q v.
    """
    if F.spring is not None and F.spring.ndim:
        return None
    harmonics = 0 if mix is None else mix[0].shape[0]
    mix = None if mix is not None and mix[0].ndim > 1 else mix
    count = _ENTRIES_PER_NODE * angle
    low, high = jax.lax.stop_gradient(jnp.log(jnp.stack(F.material.frequency_range())))
    step = (high - low + _BELOW + _ABOVE) / (count - 6)
    step = jnp.exp2(jnp.ceil(4 * jnp.log2(step)) / 4)
    first = jnp.floor((low - _BELOW) / step) - 2
    grid = step * (first + np.arange(count))
    grid = jnp.concatenate([grid, jnp.stack([grid[2] - _FAR, grid[-3] + _FAR])])
    power, *others = _direct(F, grid, wanted, angle, split, harmonics, mix)
    if power is not None:
        # Where E' steps up, a cubic of <|F|^2> itself would swing below 0. Harmonics have any sign.
        positive = len(power) if split else 1
        power = (*map(log_power, power[:positive]), *power[positive:])
    found = power, *others
    means, limits = (jax.tree.map(lambda x, part=part: x[part], found) for part in (np.s_[:-2], np.s_[-2:]))
    return Table(first, step, means, jax.tree.map(_slopes, means), limits)


def _slopes(values):
    """Derivative by the index, to fourth order but for two entries at either end."""
    inner = (8 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / 12
    return jnp.pad(inner, 2)


def _by_table(F, log_qv, split):
    r"""Means from the table of F: cubic between its entries, beyond them the powers that the means follow.

    Their derivatives are continuous, so that a temperature at an entry has one like any other.

    With x = ln(q v) and E'' that falls, the means are below the table even or odd in e^x,

    .. math:: P + P' e^{2x},\qquad D e^x + D' e^{3x}

    and above it, where a share e^-x of the circle is within it, P + P' e^-x and D e^-x + D' e^-2x.
    """
    outside, table = F.material.loss_beyond, F.table
    count = jax.tree.leaves(table.means)[0].shape[0]
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
        return limit + (value - limit) * jnp.exp((0.0 if outside == "hold" else 2.0) * below - above)

    def odd(value, ends):
        """The dissipation, which goes to 0 if E'' does."""
        if outside == "hold":
            return ends[1] + (value - ends[1]) * jnp.exp(-2.0 * above)
        if outside == "none":
            return value * jnp.exp(-2.0 * above)
        # What is left of the mean where it is the first of the two powers alone.
        leading = jnp.exp(_FAR) * jnp.where(lower, ends[0], ends[1])
        return (leading + (value - leading) * jnp.exp(2.0 * below - above)) * jnp.exp(below - above)

    found = jax.tree.map(interpolate, table.means, table.slopes)
    rules = even, odd, even, odd
    if found[0] is not None:
        positive = len(found[0]) if split else 1
        found, limits = (
            ((*map(jnp.exp, power[:positive]), *power[positive:]), *others)
            for power, *others in (found, table.limits)
        )
    else:
        limits = table.limits
    return tuple(
        None if means is None else tuple(map(rule, means, ends))
        for rule, means, ends in zip(rules, found, limits, strict=True)
    )


def log_power(power):
    """ln <|F|^2>; the floor is for F = 0 (two liquids at rest), where G need only be as good as 0."""
    return jnp.log(jnp.maximum(power, float(jnp.finfo(power.dtype).tiny) ** 0.8))
