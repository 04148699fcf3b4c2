r"""Borders of the panels that the integrals over t = ln(q / q_start) are cut into.

Borders stand at every kink of the spectra and move with q0, q_r and q1, so that gradients are right; the
range between is shared out evenly; and towards every beginning of roughness, where the contact factors
P, S, Psi fall within ln(q/q0) ~ 1e-18 ... 1, they are graded.
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import Quadrature, typed
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio

# Beyond the end of a plateau sqrt(G) has a branch point a quarter of an e-fold below it, so near that no
# number of equal panels is enough: a border of a contact panel so far beyond it is.
_BEYOND_ROLLOFF = 0.6

# What the exponent of q^2 C adds to a piece's share of the panels.
_STEEPNESS = 0.5


class Borders(NamedTuple):
    """Borders of panels, as t = ln(q / first), and what lies in which panel."""

    t: jax.Array  # of the contact panels, rising
    first: jax.Array  # the wavevector that all roughness begins at [1/m]
    start: jax.Array  # ln(first / (1/m))
    kinks: tuple[jax.Array, ...]  # t of the ends and kinks of every spectrum
    edges: jax.Array  # t of the borders of the angular panels, from end to end
    panel: jax.Array  # the angular panel that each contact panel lies in
    pieces: tuple[jax.Array, ...]  # the power law of every spectrum that it lies in, -1 before them
    panels_below: jax.Array | None  # how many contact panels lie below each border that was asked for


def place_borders(
    laws: Sequence[BrokenPowerLaw],
    quadrature: Quadrature,
    graded: bool,
    asked: jax.Array | None,
    moving: bool,
) -> Borders:
    """Borders for one or two broken power laws; `asked` [1/m] and the rest as for `build_mesh`."""
    begins = jnp.stack([law.q[0] for law in laws])
    leader = jnp.argmin(jax.lax.stop_gradient(begins))
    first = begins[leader]
    start = jnp.log(first)
    kinks = [_from_first(law.q, first, leader == j) for j, law in enumerate(laws)]
    end = functools.reduce(jnp.maximum, [kink[-1] for kink in jax.lax.stop_gradient(kinks)])
    followed, exponents = kinks, [law.exponent for law in laws]
    if not moving:
        followed, exponents = jax.lax.stop_gradient((followed, exponents))
    width, uniform = _uniform_borders(followed, exponents, quadrature.panels)
    if not moving:  # and not with the first wavevector either, from which t counts
        uniform = uniform - (start - jax.lax.stop_gradient(start))
    fixed, graded_ones = [uniform], []
    fixed += [
        jnp.minimum(_rolloff(law, kink) + _BEYOND_ROLLOFF, end)[None]
        for law, kink in zip(laws, followed, strict=True)
        if law.exponent.size > 1
    ]
    if graded:
        fractions = typed(quadrature.ratio ** (-2.0 * np.arange(1, quadrature.graded + 1)), end)
        # These hang on the beginning and move with it: fixed, the innermost panel, 1e-10
        # wide, would stretch with q0, and its quadrature error with it.
        grades = [width(begin[0]) * fractions for begin in followed]
        graded_ones = [jnp.minimum(kink[0] + grade, end) for kink, grade in zip(kinks, grades, strict=True)]
        if quadrature.graded and not moving:
            fixed = [_among_graded(border, kinks, grades) for border in fixed]
    groups = [fixed[0], *kinks, *fixed[1:], *graded_ones]
    if asked is not None:
        # Selected, not clipped: a clip would give half the derivative to a border at an end.
        distance = log_ratio(jnp.where(asked >= first, asked, first), first)
        groups.append(jnp.where(distance <= end, distance, end))
    t = jnp.concatenate(groups)
    ranks = jnp.split(_ranks(jax.lax.stop_gradient(t)), np.cumsum([group.size for group in groups])[:-1])
    # The outer angular nodes move with the ends of the roughness: fixed, the contact nodes there
    # would move along the interpolant, whose slope is 1e3 times less accurate than its values.
    begin = functools.reduce(jnp.minimum, [kink[0] for kink in kinks])
    last = functools.reduce(jnp.maximum, [kink[-1] for kink in kinks])
    return Borders(
        t=jnp.sort(t),
        first=first,
        start=start,
        kinks=tuple(kinks),
        edges=jnp.concatenate([begin[None], uniform, last[None]]),
        panel=_passed(ranks[0], t.size - 1),
        pieces=tuple(_passed(rank, t.size - 1) - 1 for rank in ranks[1 : 1 + len(kinks)]),
        panels_below=None if asked is None else ranks[-1],
    )


def _passed(ranks, panels):
    """How many borders of one kind lie before each panel.

    Rank in the sorted list, not comparison of values, says what lies inside what: borders that coincide
    (two spectra with equal q1) keep their one-sided derivatives.
    """
    return jnp.sum(ranks <= np.arange(panels)[:, None], -1)


def _among_graded(border, kinks, grades):
    """Fixed borders, but those that lie among the graded ones of a beginning, which move with it.

    They do by chance, an ulp from where a second roughness begins: a panel between the two that grew from
    no width would have nodes before and after it at which the contact is another by then.
    """
    for kink, grade in zip(kinks, grades, strict=True):
        distance = jax.lax.stop_gradient(border - kink[0])
        border = jnp.where(jnp.abs(distance) < grade[0], kink[0] + distance, border)
    return border


def _rolloff(law, kink):
    """Where the exponent of a law falls most."""
    return kink[1:-1][jnp.argmin(jnp.diff(jax.lax.stop_gradient(law.exponent)))]


def _from_first(q, first, leads):
    """ln(q / first) of the wavevectors of a law, which `leads` if its first is that of all.

    Then that one is 0 whatever moves. Written as a difference of two that move alike, it would
    leave their rounding, times 1 over the innermost panel's width of 1e-14, in reverse mode.
    """
    t = log_ratio(q, first)
    return jnp.concatenate([jnp.where(leads, 0.0, t[:1]), t[1:]])


def _ranks(values):
    """Position of every value in the sorted list, equal ones in the order given."""
    index = np.arange(values.shape[0])
    before = (values < values[:, None]) | ((values == values[:, None]) & (index < index[:, None]))
    return jnp.sum(before, -1)


def _uniform_borders(kinks, exponents, panels):
    """Borders that share out the range, closer where the roughness rises steeply.

    On the plateau G ~ q^4, so that P may switch within a quarter of e-fold: there a
    piece counts 1 + 1/2 of its exponent of q^2 C (2 on the plateau), elsewhere 1.

    Returns
    -------
    width : function, width of one share that begins at t
    uniform : the borders between `panels` equal shares, shape (panels - 1,)
    """
    slopes = [_STEEPNESS * jnp.clip(exponent, 0.0, 2.0) for exponent in exponents]

    def share(t):
        steep = [_ramps(t, kink, slope) for kink, slope in zip(kinks, slopes, strict=True)]
        return t + functools.reduce(jnp.add, steep)

    knots = kinks[0] if len(kinks) == 1 else jnp.sort(jnp.concatenate(kinks))
    shares = share(knots)
    rise = jnp.diff(shares)
    back = jnp.diff(knots) / jnp.where(rise > 0, rise, 1.0)
    step = shares[-1] / panels

    def width(begin):
        return _ramps(jnp.minimum(share(begin) + step, shares[-1]), shares, back) - begin

    return width, _ramps(step * np.arange(1, panels), shares, back)


def _ramps(t, knots, slopes):
    """Continuous piecewise linear function, 0 at the first knot, with given slopes.

    A sum over pieces: for the few knots of a spectrum quicker than a search.
    """
    return jnp.sum(slopes * jnp.clip(t[..., None] - knots[:-1], 0.0, jnp.diff(knots)), -1)
