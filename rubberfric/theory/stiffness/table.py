r"""Means over the direction of sliding as a table over ln(q v).

If the stiffness F depends on q v only, its means are convolutions over ln(q v), computed once
(`rubberfric.theory.stiffness.circle`). Splines evaluate them at every node and velocity.

The grid begins at a multiple of its step and has a fixed length. The position of the grid carries no
derivative.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import typed
from rubberfric.base.splines import BEFORE, BESIDE, MARGIN, at, splines
from rubberfric.materials.in_series import times
from rubberfric.materials.material import Material
from rubberfric.materials.tabulated_modulus import LONGEST_TABLE, REACH
from rubberfric.theory.stiffness.circle import LEAD, Weights, circle_means, circle_weights, lead_in
from rubberfric.theory.stiffness.closed_form import Harmonics, Means
from rubberfric.theory.stiffness.complex_stiffness import (
    MOST_EXCESS_OF_TABLE,
    bare,
    facing,
    frequency_range,
)
from rubberfric.theory.stiffness.kinds import MeanKind, kinds_of, passing
from rubberfric.theory.structure import RequiredMeans, RoughSurface

# Steps of the grid per finest detail of E over ln omega.
PER_DETAIL = 4

# Step for a relaxation spectrum, whose singularities are pi/2 from the real axis of ln omega: error 1e-13.
# It is 3e-11 for a step of 0.15.
STEP = 0.1

# Length of the grid for a relaxation spectrum in ln omega: relaxation times over 31 decades.
_LONGEST = 104.0

# If relaxation times span more, the grid begins at this ln omega or at the slowest time, and slower terms are
# relaxed: 1e-26 rad/s are never reached.
_SLOWEST = -60.0

# Parts of the grid beyond a table of moduli at both ends together, in ln omega.
_BEYOND = 17.0

# Logarithm of the largest factor by which q or v alone can lie beyond a table.
_LARGEST = 60.0

# Position where the limits of the means are evaluated: beyond the table by more than the circle extends.
_FAR = 40.0


class BetweenKnots(NamedTuple):
    """Position of wavevectors between the knots of the harmonics, as from `between_nodes`."""

    knot: jax.Array  # index of the knot below
    share: jax.Array  # of the knot above, 0 ... 1


class MeansTable(NamedTuple):
    """Splines of the means over a uniform grid of ln(q v).

    If the harmonics of the roughness depend on q, each kind has a row for every knot between which the
    harmonics are linear. Otherwise it has one row.
    """

    material: Material  # of the strained solid
    first: jax.Array  # the first cell begins at step * first
    ends: jax.Array  # ln(q v) where the means become powers, below and above
    rest: jax.Array  # ln(q v) below which E'' < 1e-9 E'
    cells: jax.Array  # `splines` of the rows, for positive rows of their square root
    limits: jax.Array  # the rows far beyond the ends, (rows, 2)

    def means(
        self,
        q: jax.Array,
        velocity: jax.Array,
        log_shift: jax.Array | None,
        needs: RequiredMeans,
        split: bool = False,
        grooved: bool = False,
        knots: BetweenKnots | None = None,
    ) -> Means:
        """Return the means of F for roughness of wavevectors q that passes with a velocity.

        Parameters
        ----------
        q, velocity : [1/m], [m/s], shapes that broadcast
        log_shift : ln a_T, broadcastable with q and velocity; None: 0
        needs : RequiredMeans
        split : True if <F'^2> and <F''^2> are needed separately
        grooved : True if the table has harmonics
        knots : BetweenKnots of q if the harmonics depend on q, broadcastable with q v, or None

        `needs` and `split` are those of the table.
        """
        position, sign = _position(self, jnp.log(q), velocity, log_shift)
        means = _by_table(self, position, needs, split, grooved, knots)
        odd = {kind: means[kind] for kind in ("mean_cos_loss", "mean_sin_loss") if kind in means}
        return means | {kind: tuple(x * sign for x in values) for kind, values in odd.items()}


def step_of(material: Material) -> float:
    """Return the step of the grid of ln omega for a material."""
    return STEP if material.detail is None else material.detail / PER_DETAIL


def means_table(
    surface: RoughSurface,
    scale: jax.Array,
    needs: RequiredMeans,
    split: bool = False,
    harmonics: Harmonics | None = None,
) -> MeansTable:
    """Return a table of the means of F of two half-spaces in units of `scale` [Pa].

    The coefficients of the harmonics have the shape (harmonics,), or (harmonics, knots) if they depend on q.
    The other arguments are as in `MeansTable.means`.
    """
    surface = bare(surface)
    material, step = surface.strained.material, step_of(surface.strained.material)
    if harmonics is not None:
        harmonics = harmonics[0].reshape(len(harmonics[0]), -1), harmonics[1].reshape(len(harmonics[1]), -1)
    count_of_harmonics = 0 if harmonics is None else len(harmonics[0])
    kinds = _kinds(material, needs, split, harmonics is not None)
    before = lead_in(step, count_of_harmonics)
    extent = frequency_range(surface)
    ends, length = jnp.stack([extent.low, extent.high]), _LONGEST
    if material.detail is not None:
        # Under jit a table of moduli may be longer than the grid; its means are then NaN.
        length = LONGEST_TABLE + _BEYOND + 2 * REACH * material.detail + MOST_EXCESS_OF_TABLE
    else:
        slow = jnp.maximum(ends[0], jnp.minimum(_SLOWEST, ends[1] - length))
        ends = jnp.stack([slow, jnp.minimum(ends[1], slow + length)])
    # Includes entries beyond the ends that the splines and the circle need.
    first = jnp.floor(ends[0] / step) - BEFORE
    count = math.ceil(length / step) + 12 + 2 * MARGIN

    def F_of(E_r):
        return facing(surface, jnp.ones_like(scale), times(1 / scale, E_r), unit=scale)

    F = F_of(material.reduced_on_grid(first - before, step, before + count + LEAD))
    weights = _mixed_weights(circle_weights(step, count_of_harmonics), harmonics)
    of_kinds = [weights[kind.weights] for kind in kinds]
    weights = Weights(
        _stack([of_kind.near for of_kind in of_kinds]),
        _stack([of_kind.far for of_kind in of_kinds]),
        np.stack([of_kind.parity for of_kind in of_kinds]),
    )
    begin = np.array([1.0 if material.loss_beyond == "fall" and kind.odd else 0.0 for kind in kinds])
    rows = circle_means(jnp.stack([kind.of(F) for kind in kinds]), weights, step, begin, before)
    positive = np.array([kind.positive for kind in kinds])[:, None, None]
    rows = jnp.where(positive, _root(jnp.where(positive, rows, 1.0)), rows)
    rows = jnp.where(ends[1] - ends[0] <= length, rows, jnp.nan).reshape(-1, rows.shape[-1])
    # Beyond the ends E' is constant, and E'' is a power.
    E_r = material.reduced_modulus(jnp.exp(ends))
    storage = jnp.stack([material.static_reduced(), jnp.real(E_r)[1]])
    far = math.exp(-_FAR) if material.loss_beyond == "fall" else 1.0
    F_far = F_of(jax.lax.complex(storage, far * jnp.imag(E_r)))
    limits = _limits(F_far, far, kinds, material.loss_beyond, harmonics)
    return MeansTable(material, first + MARGIN + BESIDE, ends, extent.rest, splines(rows), limits)


def _kinds(material: Material, needs: RequiredMeans, split: bool, grooved: bool) -> list[MeanKind]:
    """Return the kinds of means in a table. Only harmonics give a transverse mean."""
    kinds = kinds_of(needs, split, material.loss_beyond)
    return [kind for kind in kinds if grooved or kind.name != "mean_sin_loss"]


def _mixed_weights(weights, harmonics):
    """Join the rows of each result of `circle_weights` into one row for each knot of the harmonics."""
    if harmonics is None:
        return weights
    (even, along, across), (cosine, sine) = weights, harmonics
    return even.mixed(cosine), along.mixed(cosine), across.mixed(sine)


def _root(power):
    """Return the square root of <|F|^2>, with a positive floor. F and G are 0 if two liquids are at rest."""
    floor = float(jnp.finfo(power.dtype).tiny) ** 0.8
    above = power > floor
    return jnp.where(above, jnp.sqrt(jnp.where(above, power, 1.0)), floor**0.5)


def _stack(arrays):
    return np.stack(arrays) if isinstance(arrays[0], np.ndarray) else jnp.stack(arrays)


def _limits(F, far, kinds, outside, harmonics):
    """Return the limits of the rows below and above the table, of shape (rows, 2).

    A row may vanish like e^x below the table and like e^-x above the table. The limits of such a row are the
    factors of e^x and e^-x. F is the stiffness below and above, where E'' is smaller by the factor `far`.
    """
    # NumPy arrays would widen float32.
    moments = [
        typed(m, jnp.real(F)) for m in _moments(0 if harmonics is None else len(harmonics[0]), outside)
    ]
    if harmonics is not None:
        cosine, sine = harmonics
        moments = [m[:, :1] + m[:, 1:] @ c for m, c in zip(moments, (cosine, cosine, sine), strict=True)]
    rows = [(kind.of(F) / (far if kind.odd else 1.0))[:, None] * moments[kind.weights] for kind in kinds]
    return jnp.concatenate(rows, 1).T


def _moments(harmonics, outside):
    """Return the limits of the three groups of angular means, each of shape (2, 1 + harmonics).

    The first row is the limit below the table, and the second row is the limit above the table. If E''
    vanishes far from the table, E'' is proportional to cos(phi) below the table and to 1 / cos(phi) above the
    table.
    """
    m = np.arange(1, harmonics + 1)
    sign = -((-1.0) ** m)
    none, unity = np.zeros(harmonics), np.ones((2, 1))
    even = np.hstack([unity, [none, none]])
    if outside == "fall":
        first = np.where(m == 1, 0.25, 0.0)
        return even, np.hstack([[[0.5], [1.0]], [first, none]]), np.hstack([0 * unity, [first, sign]])
    along, across = sign / (4 * m**2 - 1), 2 * m * sign / (4 * m**2 - 1)
    return even, 2 / np.pi * np.hstack([unity, [along] * 2]), 2 / np.pi * np.hstack([0 * unity, [across] * 2])


class _Position(NamedTuple):
    """Position of a look-up in a table, and its distance beyond the ends."""

    inside: jax.Array  # ln(q v), or the nearest end of the table
    lower: jax.Array  # True below the table
    away: jax.Array  # e^-(distance from the table)


def _position(table, log_q, velocity, log_shift):
    """Return the `_Position`, and the sign factor of means that are odd in v.

    ln(q v) is a sum of logarithms of q and v. A logarithm and an exponential of every q v would take longer
    than the splines.
    """
    low, high = table.ends
    least = jax.lax.stop_gradient(table.rest - jnp.max(log_q))
    shifted, sign = passing(velocity, log_shift, least, table.material.loss_at_rest)
    log_qv = log_q + shifted
    lower, higher = log_qv < low, log_qv > high
    inside = jnp.where(lower, low, jnp.where(higher, high, log_qv))
    if log_shift is not None and log_shift.ndim == log_qv.ndim:
        return _Position(inside, lower, jnp.exp(-jnp.abs(log_qv - inside))), sign
    # Separately for q and v, so that each factor is finite.
    middle = jax.lax.stop_gradient(jnp.mean(log_q))

    def product(sign, end):
        of_speed = jnp.exp(jnp.minimum(sign * (shifted + middle - end), _LARGEST))
        return jnp.exp(sign * (log_q - middle)) * of_speed

    above = jnp.where(higher, product(-1.0, high), 1.0)
    return _Position(inside, lower, jnp.where(lower, product(1.0, low), above)), sign


def _by_table(table, position, needs, split, grooved, knots):
    r"""Return means from the splines of a table, and from powers of e^x beyond the table.

    With x = ln(q v) and vanishing E'', the means below the table are even or odd in e^x,

    .. math:: P + P' e^{2x},\qquad D e^x + D' e^{3x}

    and above it, where the share e^-x of the circle lies within the table, P + P' e^-x and D e^-x + D' e^-2x.
    """
    outside, kinds = table.material.loss_beyond, _kinds(table.material, needs, split, grooved)
    inside, lower, away = position
    cell = inside * (1 / step_of(table.material)) - table.first
    if knots is None:
        rows, limits = at(table.cells, cell), table.limits
    else:
        # The rows of each kind at the knots below and above, (kinds, 2, ...).
        first = np.arange(len(kinds)) * (len(table.limits) // len(kinds))
        which = jnp.add.outer(first, jnp.stack([knots.knot, knots.knot + 1]))
        rows, limits = at(table.cells, cell, which), jnp.moveaxis(table.limits[which], -1, 1)
    up = jnp.where(lower, 1.0, away)

    def part(value, limit, share):
        # Where the limit is not used it may be 1e8 times the value.
        return value * share + limit * (1 - share)

    def even(value, ends):
        """Return <|F|^2> or <Re F>, which tend to a constant beyond the table."""
        limit = jnp.where(lower, ends[0], ends[1])
        return part(value, limit, up if outside == "hold" else jnp.where(lower, away * away, away))

    def odd(value, ends):
        """Return a mean of Im F, which vanishes where E'' vanishes."""
        if outside == "hold":
            return part(value, ends[1], up * up)
        if outside == "none":
            return value * up * up
        # The mean as the first of the two powers alone.
        leading = jnp.where(lower, ends[0], ends[1])
        return part(value, leading, jnp.where(lower, away * away, away)) * away

    means: Means = {kind: () for kind in needs.kinds}
    for kind, row, ends in zip(kinds, rows, limits, strict=True):
        value = row**2 if kind.positive else row
        if kind.name == "mean_cos_loss" and outside == "none" and not grooved:
            # Where E'' vanishes, a spline oscillates about 0 by 1e-60 of its maximum.
            value = jnp.where(value < 0, 0.0, value)
        mean = (odd if kind.odd else even)(value, ends)
        if knots is not None:
            mean = (1 - knots.share) * mean[0] + knots.share * mean[1]
        means[kind.name] += (mean,)
    return means
