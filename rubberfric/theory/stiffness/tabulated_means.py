r"""Angular means of a solid that is no Prony series: of E(omega) as its own law has it.

With a constant spring k the series F = f k / (f + k) depends on q v alone: its means are convolutions over
ln(q v), taken once on a uniform grid (`rubberfric.theory.stiffness.uniform_grid`), and splines for every
node and velocity. If the spring or a layer varies with q, every node has an integral of its own.

The grid begins at a whole multiple of its step, has the same length whatever the table, and no derivative
goes through where it lies: a value depends on nothing but its own q v.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.materials.material import Material
from rubberfric.materials.tabulated_modulus import LONGEST, REACH
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.angular_means import Harmonics, Means
from rubberfric.theory.stiffness.uniform_grid import (
    LEAD,
    MARGIN,
    Weights,
    at,
    circle_means,
    circle_rule,
    circle_weights,
    depth,
    harmonic,
    splines,
)

# Steps of the grid in the finest detail of E over ln omega, and of the integral of a node.
_PER_DETAIL, _PER_DETAIL_OF_A_NODE = 7, 2

# How far the grid goes beyond the table of the modulus at either end, in ln(q v): there the
# means are two powers of q v, and what is left of a third is e^-32 and e^-27.
_BELOW, _ABOVE = 8.0, 9.0  # and the reach of a rounded knot

# Where the limits of the means are taken: beyond all of the table, and all of the circle within reach.
_FAR = 40.0


class Tabulated(NamedTuple):
    """F = f k / (f + k) with f(omega) the scaled E_r and a spring k, its means taken at every node."""

    material: Material  # without a series
    scale: jax.Array  # f = scale * E [1/Pa], shape () or (nodes,)
    spring: jax.Array | None  # [-], shape () or (nodes,); None: rigid

    @property
    def by_node(self) -> bool:
        """Whether every node has its own."""
        return self.scale.ndim > 0

    def means(
        self, qv: jax.Array, needs: Needs, split: bool = False, harmonics: Harmonics | None = None
    ) -> Means:
        """Means of F for roughness passing at q v; arguments as `Relaxing.means`."""
        log_qv, sign = held_below(self.material, qv)
        return _signed(_mixed(_by_node(self, log_qv, needs, split, harmonics), harmonics), sign)


class MeansTable(NamedTuple):
    """Splines over a uniform grid of ln(q v) through the means, each kind a row or several."""

    material: Material
    first: jax.Array  # the first coefficient is that at step * first
    ends: jax.Array  # ln(q v) where the means become powers, below and above
    coefficients: jax.Array  # `splines` of the rows, of ln of those that are positive
    limits: jax.Array  # the rows far beyond the ends, (rows, 2)

    by_node = False

    def means(
        self, qv: jax.Array, needs: Needs, split: bool = False, harmonics: Harmonics | None = None
    ) -> Means:
        """Means of F for roughness passing at q v; arguments as for the table, and `Relaxing.means`."""
        log_qv, sign = held_below(self.material, qv)
        return _signed(_mixed(_by_table(self, log_qv, needs, split, harmonics), harmonics), sign)


def held_below(material: Material, omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """ln |omega|, not far below the frequencies of a material, and what is odd in omega over its value there.

    Far below, E is E(0) and E'' linear in omega: so v = 0 keeps its derivative. If E'' does not vanish at
    v = 0+, only the sign is left.
    """
    floor = _log_range(material)[0] - math.log(1e9)
    tiny = float(jnp.finfo(omega.dtype).tiny)
    log_omega = jnp.maximum(jnp.log(jnp.maximum(jnp.abs(omega), tiny)), floor)
    return log_omega, jnp.sign(omega) if material.loss_at_rest else omega * jnp.exp(-log_omega)


def _log_range(material):
    """ln of the lowest and highest frequency of what a modulus does [rad/s]."""
    ends = material.frequency_range()
    if ends is None:
        raise ValueError(
            f"{type(material).__name__} has neither a series nor a frequency range: must have one"
        )
    return jnp.log(jnp.stack(ends))


def _vary(harmonics):
    """Whether the shares of the harmonics depend on q."""
    return harmonics is not None and harmonics[0].ndim > 1


def _shares(harmonics):
    """How many harmonics; their shares if they are constant. Those of others are kept apart till later."""
    if harmonics is None:
        return 0, None
    return harmonics[0].shape[0], None if _vary(harmonics) else harmonics


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


class Parts(NamedTuple):
    """Of a complex stiffness F."""

    storage: jax.Array  # F'
    loss: jax.Array  # F''
    power: jax.Array  # |F|^2


def _parts(F, storage, loss):
    """`Parts` of F for E' and E'', for a spring that is constant or has their shape."""
    storage, loss = F.scale * storage, F.scale * loss
    power = storage**2 + loss**2
    if F.spring is None:
        return Parts(storage, loss, power)
    # F = f k / (f + k), by parts; a liquid at rest is a spring of k = 0.
    share = F.spring / ((storage + F.spring) ** 2 + loss**2)
    return Parts(share * (F.spring * storage + power), share * F.spring * loss, share * F.spring * power)


class Kind(NamedTuple):
    """One of the functions that means are taken of, and of which there is a row or several in a table."""

    name: str
    part: str  # of `Parts`
    weights: int  # which of those of `circle_weights`
    squared: bool = False
    positive: bool = False  # the first of its rows

    def of(self, parts):
        """The function."""
        values = getattr(parts, self.part)
        return values**2 if self.squared else values


def _kinds(needs, split, loss_beyond):
    """`Kind` of everything that is wanted, in the order of `Means`."""
    # Where E' steps up, a spline of <|F|^2> itself would swing below 0.
    powers = [Kind("power", "power", 0, positive=True)]
    if split:
        falls = loss_beyond != "none"
        powers = [Kind("power", "storage", 0, True, True), Kind("power", "loss", 0, True, falls)]
    others = [Kind("dissipation", "loss", 1), Kind("storage", "storage", 0), Kind("transverse", "loss", 2)]
    return [kind for kind in (*powers, *others) if kind.name in needs.kinds]


def means_table(F: Tabulated, needs: Needs, split: bool, harmonics: Harmonics | None) -> MeansTable:
    """Table of the means of an F that depends on q v alone; arguments as of `Tabulated.means`."""
    material, (count_of_harmonics, mix) = F.material, _shares(harmonics)
    step, reach = material.detail / _PER_DETAIL, REACH * material.detail
    kinds, before = _kinds(needs, split, material.loss_beyond), depth(step)
    low, high = _log_range(material)
    ends = jax.lax.stop_gradient(jnp.stack([low - _BELOW - reach, high + _ABOVE + reach]))
    # With what the splines hang on beside the ends, and the circle before and after.
    first = jnp.floor(ends[0] / step) - 4 - MARGIN
    count = math.ceil((LONGEST + _BELOW + _ABOVE + 2 * reach) / step) + 12 + 2 * MARGIN
    moduli = material.storage_and_loss_on_grid(first - before, step, before + count + LEAD)
    parts = _parts(F, *moduli)
    weights = _mixed_weights(circle_weights(step, count_of_harmonics), mix)
    weights = Weights(*(_stack([one[kind.weights] for kind in kinds]) for one in zip(*weights, strict=True)))
    rows = circle_means(jnp.stack([kind.of(parts) for kind in kinds]), weights, step)[..., before:]
    # Only the first of a kind has one sign.
    positive = np.zeros(rows.shape[:2], bool)
    positive[:, 0] = [kind.positive for kind in kinds]
    positive = positive[..., None]
    rows = jnp.where(positive, log_power(jnp.where(positive, rows, 1.0)), rows)
    # A table under jit that is longer than the grid.
    rows = jnp.where(high - low <= LONGEST, rows, jnp.nan).reshape(-1, rows.shape[-1])
    # E' and E'' at the ends themselves, of which E'' is a power.
    entry = jnp.floor(ends / step)
    storage, loss = (x[(entry - first).astype(int) + before] for x in moduli)
    if material.loss_beyond == "fall":
        loss = loss * jnp.exp(jnp.array([1.0, -1.0], ends.dtype) * (ends - step * entry))
    at_ends = storage, loss
    return MeansTable(
        material, first + MARGIN, ends, splines(rows), _limits(F, kinds, at_ends, count_of_harmonics, mix)
    )


def _mixed_weights(weights, mix):
    """Rows of the weights over the circle of the means of f, cos(phi) f and sin(phi) f."""
    if mix is None:
        return weights
    even, along, across = weights
    return even.mixed(mix[0]), along.mixed(mix[0]), across.mixed(mix[1])


def _stack(arrays):
    return np.stack(arrays) if isinstance(arrays[0], np.ndarray) else jnp.stack(arrays)


def _limits(F, kinds, at_ends, harmonics, mix):
    """What the rows are far beyond the ends, (rows, 2); of those that go to 0 what e^+-x is multiplied by."""
    outside = F.material.loss_beyond
    storage, loss = at_ends
    far = _parts(F, storage, loss * (math.exp(-_FAR) if outside == "fall" else 1.0))
    moments = _moments(harmonics, outside)
    if mix is not None:
        shares = mix[0], mix[0], mix[1]
        moments = [m[:, :1] + m[:, 1:] @ c[:, None] for m, c in zip(moments, shares, strict=True)]
    rows = []
    for kind in kinds:
        back = math.exp(_FAR) if outside == "fall" and kind.name in ("dissipation", "transverse") else 1.0
        rows.append((kind.of(far) * back)[:, None] * moments[kind.weights])
    return jnp.concatenate(rows, 1).T


def _moments(harmonics, outside):
    """Means over the circle below and above the table of what `circle_weights` is for, (2, 1 + harmonics).

    Of E'' that falls, which is in proportion to cos(phi) below the table and to 1 / cos(phi) above it.
    """
    m = np.arange(1, harmonics + 1)
    sign = -((-1.0) ** m)
    none, one = np.zeros(harmonics), np.ones((2, 1))
    even = np.hstack([one, [none, none]])
    if outside == "fall":
        first = np.where(m == 1, 0.25, 0.0)
        return even, np.hstack([[[0.5], [1.0]], [first, none]]), np.hstack([0 * one, [first, sign]])
    along, across = sign / (4 * m**2 - 1), 2 * m * sign / (4 * m**2 - 1)
    return even, 2 / np.pi * np.hstack([one, [along] * 2]), 2 / np.pi * np.hstack([0 * one, [across] * 2])


def _by_table(table, log_qv, needs, split, harmonics):
    r"""Means from a table: splines, beyond the ends the powers that the means follow.

    With x = ln(q v) and E'' that falls, the means are below the table even or odd in e^x,

    .. math:: P + P' e^{2x},\qquad D e^x + D' e^{3x}

    and above it, where a share e^-x of the circle is within it, P + P' e^-x and D e^-x + D' e^-2x.
    """
    outside, (count, mix) = table.material.loss_beyond, _shares(harmonics)
    step = table.material.detail / _PER_DETAIL
    below = jnp.minimum(log_qv - table.ends[0], 0.0)
    above = jnp.maximum(log_qv - table.ends[1], 0.0)
    inside = jnp.clip(log_qv, table.ends[0], table.ends[1])
    rows = at(table.coefficients, inside / step - table.first)
    lower = below < 0
    down, up = jnp.exp(below), jnp.exp(-above)

    def part(value, limit, share):
        # The limit may be 1e8 times the value where nothing of it is wanted.
        return value * share + limit * (1 - share)

    def even(value, ends):
        """<|F|^2> and <Re F>, which go to a constant."""
        limit = jnp.where(lower, ends[0], ends[1])
        return part(value, limit, up if outside == "hold" else down * down * up)

    def odd(value, ends):
        """The dissipation, which goes to 0 if E'' does."""
        if outside == "hold":
            return part(value, ends[1], up * up)
        if outside == "none":
            return value * up * up
        # What is left of the mean where it is the first of the two powers alone.
        leading = jnp.where(lower, ends[0], ends[1])
        return part(value, leading, down * down * up) * (down * up)

    means: Means = {kind: () for kind in needs.kinds}
    size = 1 if mix is not None else 1 + count
    for k, kind in enumerate(_kinds(needs, split, outside)):
        rule = even if kind.name in ("power", "storage") else odd
        # Across there is no harmonic without sin 2 m phi.
        begin = 1 if kind.name == "transverse" and mix is None else 0
        for i in range(begin, size):
            row = k * size + i
            value = jnp.exp(rows[row]) if kind.positive and i == 0 else rows[row]
            means[kind.name] += (rule(value, table.limits[row]),)
    return means


def _by_node(F, log_qv, needs, split, harmonics):
    """Means at every node by its own integral over the circle; scale and spring of shape () or (nodes,)."""
    count, mix = _shares(harmonics)
    s, psi, weight = rule_of_node(F.material)
    kernels = [np.ones((2, psi.size)), *(np.stack(harmonic(m, psi)) for m in range(1, count + 1))]
    even, across = (jnp.asarray(weight * rows, log_qv.dtype) for rows in np.stack(kernels, 1))
    across = across[1:]
    if mix is not None:
        even, across = even[:1] + mix[0] @ even[1:], (mix[1] @ across)[None]
    along = even * jnp.asarray(np.sin(psi), log_qv.dtype)
    moduli = moduli_on_grid(F.material)

    def of_points(log_qv):
        nodes = F._replace(
            scale=F.scale[..., None] if F.scale.ndim else F.scale,
            spring=None if F.spring is None else F.spring[..., None],
        )
        parts = _parts(nodes, *moduli_at(F.material, moduli, log_qv[..., None] - s))
        by = even, along, across

        def rows(kind):
            return tuple(jnp.moveaxis(kind.of(parts) @ by[kind.weights].T, -1, 0))

        found: Means = {kind: () for kind in needs.kinds}
        for kind in _kinds(needs, split, F.material.loss_beyond):
            found[kind.name] += rows(kind)
        return found

    if log_qv.ndim < 2:
        return of_points(log_qv)
    # Row by row, and again for the gradient: all circles at once would take gigabytes.
    return jax.lax.map(jax.checkpoint(of_points), log_qv)


def rule_of_node(material: Material) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`circle_rule` fine enough for a material without a series."""
    return circle_rule(material.detail / _PER_DETAIL_OF_A_NODE)


class Moduli(NamedTuple):
    """Splines over a uniform grid of ln omega through ln E' and ln E'' of a material without a series."""

    first: jax.Array  # the first coefficient is that at step * first
    ends: jax.Array  # ln omega where the moduli become powers, below and above
    coefficients: jax.Array


def moduli_on_grid(material: Material) -> Moduli:
    """`Moduli`, for `moduli_at`."""
    step, reach = material.detail / _PER_DETAIL, REACH * material.detail
    low, high = _log_range(material)
    ends = jax.lax.stop_gradient(jnp.stack([low - reach, high + reach]))
    first = jnp.floor(ends[0] / step) - 4 - MARGIN
    count = math.ceil((LONGEST + 2 * reach) / step) + 12 + 2 * MARGIN
    logarithms = log_power(jnp.stack(material.storage_and_loss_on_grid(first, step, count)))
    logarithms = jnp.where(high - low <= LONGEST, logarithms, jnp.nan)
    return Moduli(first + MARGIN, ends, splines(logarithms))


def moduli_at(material: Material, moduli: Moduli, log_omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """E' and E'' [Pa] at ln omega, any shape: `material.storage_and_loss` of its `Moduli`, at many points."""
    inside = jnp.clip(log_omega, *moduli.ends)
    storage, loss = jnp.exp(at(moduli.coefficients, inside * (_PER_DETAIL / material.detail) - moduli.first))
    if material.loss_beyond == "fall":
        loss = loss * jnp.exp(-jnp.abs(log_omega - inside))
    elif material.loss_beyond == "none":
        loss = jnp.where(log_omega == inside, loss, 0.0)
    return storage, loss


def log_power(power: jax.Array) -> jax.Array:
    """ln <|F|^2>; the floor is for F = 0 (two liquids at rest), where G need only be as good as 0."""
    return jnp.log(jnp.maximum(power, float(jnp.finfo(power.dtype).tiny) ** 0.8))
