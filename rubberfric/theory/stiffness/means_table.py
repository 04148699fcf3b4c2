r"""Angular means of a solid without a Prony series, on a uniform grid of ln(q v).

With a constant spring k the series stiffness F = f k / (f + k) depends only on q v. Its means are
convolutions over ln(q v), computed once (`rubberfric.theory.stiffness.circle_means`). Splines evaluate them
at every node and velocity.

The grid begins at a multiple of its step and has a fixed length. The position of the grid carries no
derivative.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.logarithms import floored_log
from rubberfric.base.quadrature import typed
from rubberfric.materials.material import Material
from rubberfric.materials.tabulated_modulus import LONGEST_TABLE, REACH
from rubberfric.theory.stiffness.angular_means import Harmonics, Means
from rubberfric.theory.stiffness.circle_means import LEAD, Weights, circle_means, circle_weights, lead_in
from rubberfric.theory.stiffness.splines import BEFORE, BESIDE, MARGIN, at, splines
from rubberfric.theory.stiffness.tabulated_means import (
    PER_DETAIL,
    Tabulated,
    constant_shares,
    far_below,
    kinds_of,
    log_range,
    of_direction,
    stiffness_parts,
)
from rubberfric.theory.structure import RequiredMeans

# Extension of the grid beyond the table of the modulus at either end, in ln(q v). There the means are two
# powers of q v; a third one contributes e^-32 and e^-27.
_BELOW, _ABOVE = 8.0, 9.0  # plus the width of a rounded knot

# Logarithm of the largest factor by which q or v alone can lie beyond a table.
_LARGEST = 60.0

# Position where the limits of the means are evaluated: beyond the table by more than the circle extends.
_FAR = 40.0


class MeansTable(NamedTuple):
    """Splines of the means over a uniform grid of ln(q v), with one or several rows for each kind."""

    material: Material
    first: jax.Array  # the first cell begins at step * first
    ends: jax.Array  # ln(q v) where the means become powers, below and above
    cells: jax.Array  # `splines` of the rows, for positive rows of their square root
    limits: jax.Array  # the rows far beyond the ends, (rows, 2)

    by_node = False

    def means(
        self,
        q: jax.Array,
        velocity: jax.Array,
        log_shift: jax.Array | None,
        needs: RequiredMeans,
        split: bool = False,
        harmonics: Harmonics | None = None,
    ) -> Means:
        """Return the means of F for roughness of wavevectors q that passes with a velocity.

        Parameters
        ----------
        q, velocity : [1/m], [m/s], shapes that broadcast
        log_shift : ln a_T, broadcastable with q and velocity; None: 0
        needs, split, harmonics : arguments with which the table was built; see `PronyStiffness.means`
        """
        passing, sign = _passing(self, jnp.log(q), velocity, log_shift)
        return of_direction(_by_table(self, passing, needs, split, harmonics), sign, harmonics)


def means_table(F: Tabulated, needs: RequiredMeans, split: bool, harmonics: Harmonics | None) -> MeansTable:
    """Return a table of the means of F, which must depend only on q v.

    The other arguments are as in `Tabulated.means`.
    """
    material, (count_of_harmonics, mix) = F.material, constant_shares(harmonics)
    step, reach = material.detail / PER_DETAIL, REACH * material.detail
    kinds, before = kinds_of(needs, split, material.loss_beyond), lead_in(step, count_of_harmonics)
    low, high = log_range(material)
    ends = jax.lax.stop_gradient(jnp.stack([low - _BELOW - reach, high + _ABOVE + reach]))
    # Includes entries beyond the ends that the splines and the circle need.
    first = jnp.floor(ends[0] / step) - BEFORE
    count = math.ceil((LONGEST_TABLE + _BELOW + _ABOVE + 2 * reach) / step) + 12 + 2 * MARGIN
    moduli = material.storage_and_loss_on_grid(first - before, step, before + count + LEAD)
    parts = stiffness_parts(F, *moduli)
    weights = _mixed_weights(circle_weights(step, count_of_harmonics), mix)
    of_kinds = [weights[kind.weights] for kind in kinds]
    weights = Weights(
        _stack([one.near for one in of_kinds]),
        _stack([one.far for one in of_kinds]),
        np.stack([one.parity for one in of_kinds]),
    )
    begin = np.array([1.0 if material.loss_beyond == "fall" and kind.odd else 0.0 for kind in kinds])
    rows = circle_means(jnp.stack([kind.of(parts) for kind in kinds]), weights, step, begin, before)
    # Only the first row of a kind has one sign.
    positive = np.zeros(rows.shape[:2], bool)
    positive[:, 0] = [kind.positive for kind in kinds]
    positive = positive[..., None]
    rows = jnp.where(positive, _root(jnp.where(positive, rows, 1.0)), rows)
    # Under jit a table may be longer than the grid.
    rows = jnp.where(high - low <= LONGEST_TABLE, rows, jnp.nan).reshape(-1, rows.shape[-1])
    # E' and E'' at the ends; beyond them E'' is a power.
    entry = jnp.floor(ends / step)
    storage, loss = (x[(entry - first).astype(int) + before] for x in moduli)
    if material.loss_beyond == "fall":
        loss = loss * jnp.exp(jnp.array([1.0, -1.0], ends.dtype) * (ends - step * entry))
    at_ends = storage, loss
    return MeansTable(
        material,
        first + MARGIN + BESIDE,
        ends,
        splines(rows),
        _limits(F, kinds, at_ends, count_of_harmonics, mix),
    )


def _mixed_weights(weights, mix):
    """Join all rows of each result of `circle_weights` into one row, if the shares `mix` are given."""
    if mix is None:
        return weights
    even, along, across = weights
    return even.mixed(mix[0]), along.mixed(mix[0]), across.mixed(mix[1])


def _root(power):
    """Return the square root of <|F|^2>, with a positive floor. F and G are 0 if two liquids are at rest."""
    floor = float(jnp.finfo(power.dtype).tiny) ** 0.8
    above = power > floor
    return jnp.where(above, jnp.sqrt(jnp.where(above, power, 1.0)), floor**0.5)


def _stack(arrays):
    return np.stack(arrays) if isinstance(arrays[0], np.ndarray) else jnp.stack(arrays)


def _limits(F, kinds, at_ends, harmonics, mix):
    """Return the limits of the rows below and above the table, of shape (rows, 2).

    A row may vanish like e^x below the table and like e^-x above the table. The limits of such a row are the
    factors of e^x and e^-x.
    """
    outside = F.material.loss_beyond
    storage, loss = at_ends
    far = stiffness_parts(F, storage, loss * (math.exp(-_FAR) if outside == "fall" else 1.0))
    moments = [typed(m, storage) for m in _moments(harmonics, outside)]  # NumPy's would widen float32
    if mix is not None:
        shares = mix[0], mix[0], mix[1]
        moments = [m[:, :1] + m[:, 1:] @ c[:, None] for m, c in zip(moments, shares, strict=True)]
    rows = []
    for kind in kinds:
        back = math.exp(_FAR) if outside == "fall" and kind.odd else 1.0
        rows.append((kind.of(far) * back)[:, None] * moments[kind.weights])
    return jnp.concatenate(rows, 1).T


def _moments(harmonics, outside):
    """Return the limits of the three groups of angular means, each of shape (2, 1 + harmonics).

    The first row is the limit below the table, and the second row is the limit above the table. If E''
    vanishes far from the table, E'' is proportional to cos(phi) below the table and to 1 / cos(phi) above the
    table.
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


class _Passing(NamedTuple):
    """Position of a look-up in a table, and its distance beyond the ends."""

    inside: jax.Array  # ln(q v), or the nearest end of the table
    lower: jax.Array  # True below the table
    away: jax.Array  # e^-(distance from the table)


def _passing(table, log_q, velocity, log_shift):
    """Return `_Passing`, and the sign factor of means that are odd in v.

    ln(q v) is a sum of logarithms of q and v. A logarithm and an exponential of every q v would take longer
    than the splines.
    """
    low, high = table.ends
    # |v a_T| is bounded below such that all q lie far below the table. There E is E(0) and E'' is linear in
    # omega, so the derivative at v = 0 is right. If E'' does not vanish at v = 0+, only the sign remains.
    least = jax.lax.stop_gradient(low - far_below(table.material) - jnp.max(log_q))
    log_speed = floored_log(jnp.abs(velocity))
    shifted = log_speed if log_shift is None else log_speed + log_shift
    sign = jnp.sign(velocity)
    if not table.material.loss_at_rest:
        log_factor = -least if log_shift is None else log_shift - least
        log_factor = jnp.minimum(log_factor, 0.85 * math.log(float(jnp.finfo(velocity.dtype).max)))
        sign = jnp.clip(velocity * jnp.exp(log_factor), -1.0, 1.0)
    shifted = jnp.maximum(shifted, least)
    log_qv = log_q + shifted
    lower, higher = log_qv < low, log_qv > high
    inside = jnp.where(lower, low, jnp.where(higher, high, log_qv))
    if log_shift is not None and log_shift.ndim == log_qv.ndim:
        return _Passing(inside, lower, jnp.exp(-jnp.abs(log_qv - inside))), sign
    # Separately for q and v, so that each factor is finite.
    middle = jax.lax.stop_gradient(jnp.mean(log_q))

    def product(sign, end):
        of_speed = jnp.exp(jnp.minimum(sign * (shifted + middle - end), _LARGEST))
        return jnp.exp(sign * (log_q - middle)) * of_speed

    above = jnp.where(higher, product(-1.0, high), 1.0)
    return _Passing(inside, lower, jnp.where(lower, product(1.0, low), above)), sign


def _by_table(table, passing, needs, split, harmonics):
    r"""Return means from the splines of a table, and from powers of e^x beyond the table.

    With x = ln(q v) and vanishing E'', the means below the table are even or odd in e^x,

    .. math:: P + P' e^{2x},\qquad D e^x + D' e^{3x}

    and above it, where the share e^-x of the circle lies within the table, P + P' e^-x and D e^-x + D' e^-2x.
    """
    outside, (count, mix) = table.material.loss_beyond, constant_shares(harmonics)
    step = table.material.detail / PER_DETAIL
    inside, lower, away = passing
    rows = at(table.cells, inside * (1 / step) - table.first)
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
    size = 1 if mix is not None else 1 + count
    for k, kind in enumerate(kinds_of(needs, split, outside)):
        rule = odd if kind.odd else even
        # The transverse mean has no term without sin 2 m phi.
        begin = 1 if kind.name == "mean_sin_loss" and mix is None else 0
        for i in range(begin, size):
            row = k * size + i
            value = rows[row] ** 2 if kind.positive and i == 0 else rows[row]
            if kind.name == "mean_cos_loss" and outside == "none" and mix is None and i == 0:
                # Where E'' vanishes, a spline oscillates about 0 by 1e-60 of its maximum.
                value = jnp.where(value < 0, 0.0, value)
            means[kind.name] += (rule(value, table.limits[row]),)
    return means
