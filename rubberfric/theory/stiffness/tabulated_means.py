r"""Moduli without a Prony series, such as a master curve: angular means by quadrature.

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
from rubberfric.materials.material import Material
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.angular_means import Harmonics, Means

# Panels in y; short ones first, where the weight psi is: e^-25 of the circle is left out.
_EDGES = np.array([0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 11.0, 25.0])

# Entries of the table over ln(q v), for one node of the angular integral.
_ENTRIES_PER_NODE = 8

# How far the table of means goes beyond that of the modulus at either end, in ln(q v): there the
# means are two powers of q v, and what is left of a third is e^-24 and e^-27.
_BELOW, _ABOVE = 6.0, 9.0

# Where the limits of the means are taken.
_FAR = 40.0


class Tabulated(NamedTuple):
    """F = f k / (f + k) with f(omega) the scaled E_r and a spring k, its means taken at every node."""

    material: Material  # without a series
    scale: jax.Array  # f = scale * E [1/Pa], shape () or (nodes,)
    spring: jax.Array | None  # [-], shape () or (nodes,); None: rigid
    angle: int  # nodes of the angular integral

    @property
    def by_node(self) -> bool:
        """Whether every node has its own."""
        return self.scale.ndim > 0

    def means(
        self, qv: jax.Array, needs: Needs, split: bool = False, harmonics: Harmonics | None = None
    ) -> Means:
        """Means of F for roughness passing at q v; arguments as `Relaxing.means`."""
        log_qv, sign = held_below(self.material, qv)
        return _signed(_mixed(_integrals(self, log_qv, needs, split, harmonics), harmonics), sign)


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
        log_qv, sign = held_below(self.material, qv)
        return _signed(_mixed(_interpolated(self, log_qv, split), harmonics), sign)


def means_table(F: Tabulated, needs: Needs, split: bool, harmonics: Harmonics | None) -> MeansTable:
    """Table of the means of an F that depends on q v alone; arguments as of `Tabulated.means`."""
    count = _ENTRIES_PER_NODE * F.angle
    low, high = jax.lax.stop_gradient(jnp.log(jnp.stack(_ends(F.material))))
    step = (high - low + _BELOW + _ABOVE) / (count - 6)
    step = jnp.exp2(jnp.ceil(4 * jnp.log2(step)) / 4)
    first = jnp.floor((low - _BELOW) / step) - 2
    grid = step * (first + np.arange(count))
    grid = jnp.concatenate([grid, jnp.stack([grid[2] - _FAR, grid[-3] + _FAR])])
    found = _integrals(F, grid, needs, split, harmonics)
    entries, limits = (jax.tree.map(lambda x, part=part: x[part], found) for part in (np.s_[:-2], np.s_[-2:]))
    # Where E' steps up, a cubic of <|F|^2> itself would swing below 0.
    entries = _of_positive(entries, log_power, split)
    return MeansTable(F.material, first, step, entries, jax.tree.map(_slopes, entries), limits)


def held_below(material: Material, omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """ln |omega|, not far below the frequencies of a material, and what is odd in omega over its value there.

    Far below, E is E(0) and E'' linear in omega: so v = 0 keeps its derivative. If E'' does not vanish at
    v = 0+, only the sign is left.
    """
    floor = jnp.log(_ends(material)[0]) - math.log(1e9)
    tiny = float(jnp.finfo(omega.dtype).tiny)
    log_omega = jnp.maximum(jnp.log(jnp.maximum(jnp.abs(omega), tiny)), floor)
    return log_omega, jnp.sign(omega) if material.loss_at_rest else omega * jnp.exp(-log_omega)


def _ends(material):
    """Lowest and highest frequency of what a modulus does [rad/s]."""
    ends = material.frequency_range()
    if ends is None:
        raise ValueError(
            f"{type(material).__name__} has neither a series nor a frequency range: must have one"
        )
    return ends


def angular_rule(count: int, dtype: jnp.dtype) -> tuple[jax.Array, jax.Array]:
    """(cos(phi), weight) of a mean over the directions of sliding, of a function even in cos(phi)."""
    psi, weight = _angles(count)
    return jnp.asarray(np.sin(psi), dtype), jnp.asarray(weight, dtype)


def log_power(power: jax.Array) -> jax.Array:
    """ln <|F|^2>; the floor is for F = 0 (two liquids at rest), where G need only be as good as 0."""
    return jnp.log(jnp.maximum(power, float(jnp.finfo(power.dtype).tiny) ** 0.8))


def _vary(harmonics):
    """Whether the shares of the harmonics depend on q."""
    return harmonics is not None and harmonics[0].ndim > 1


def _mixed(means, harmonics):
    """One mean of each kind from those of varying harmonics; the isotropic one is the first of the even."""
    if not _vary(harmonics):
        return means
    mixed = {}
    for kind, found in means.items():
        shares = harmonics[kind == "transverse"]
        isotropic = found[: len(found) - len(shares)]
        mixed[kind] = (sum((c * x for c, x in zip(shares, found[-len(shares) :], strict=True)), *isotropic),)
    return mixed


def _signed(means, sign):
    """The means with the sign of what is odd in q v."""
    odd = ("dissipation", "transverse")
    return {kind: tuple(x * sign for x in found) if kind in odd else found for kind, found in means.items()}


def _angles(count):
    """psi and its weights in a mean over the circle, host arrays."""
    order = max(2, count // (len(_EDGES) - 1))
    node, weight = gauss(order)
    y = (_EDGES[:-1, None] + np.diff(_EDGES)[:, None] * node).ravel()
    psi = 0.5 * np.pi * np.exp(-y)
    weight = (np.diff(_EDGES)[:, None] * weight).ravel() * psi * (2 / np.pi)
    return psi, weight / weight.sum()


def _integrals(F, log_qv, needs, split, harmonics):
    """Means by an angular integral each; those of harmonics that vary one by one, for `_mixed`."""
    psi, weight = _angles(F.angle)
    m = np.arange(1, 1 + (0 if harmonics is None else harmonics[0].shape[0]))[:, None]
    # phi = pi/2 - psi: cos 2 m phi = (-1)^m cos 2 m psi, sin 2 m phi = -(-1)^m sin 2 m psi.
    even = np.concatenate([np.ones((1, psi.size)), (-1.0) ** m * np.cos(2 * m * psi)])
    odd = -((-1.0) ** m) * np.sin(2 * m * psi) * np.cos(psi)
    sine = jnp.asarray(np.sin(psi), log_qv.dtype)
    even, odd = (jnp.asarray(weight * rows, log_qv.dtype) for rows in (even, odd))
    if harmonics is not None and not _vary(harmonics):
        even, odd = even[:1] + harmonics[0] @ even[1:], (harmonics[1] @ odd)[None]
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

    def means(values, rows):
        return tuple(jnp.moveaxis(values @ rows.T, -1, 0))

    found = {}
    if needs.power:
        found["power"] = sum((means(power, even) for power in powers), ())
    if needs.dissipation:
        found["dissipation"] = means(loss * sine, even)
    if needs.storage:
        found["storage"] = means(storage, even)
    if needs.transverse:
        found["transverse"] = means(loss, odd)
    return found


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
