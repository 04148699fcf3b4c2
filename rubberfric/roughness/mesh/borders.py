"""Borders of the panels of a radial mesh.

Panels have borders at every kink of the spectra. The borders move with q0, q_r and q1, so that gradients are
right. Between these borders the panels are even, and they are graded towards the first wavevector of each
spectrum.
"""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import Quadrature, typed
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio

# sqrt(G) has a branch point a quarter of an e-fold below the end of a plateau. Equal panels cannot resolve
# it. A border of a contact panel at this distance beyond the end can.
_BEYOND_ROLLOFF = 0.6

# Weight of the exponent of q^2 C in a piece's share of the panels.
_STEEPNESS = 0.5


class Borders(NamedTuple):
    """Borders of panels as t = ln(q / first), and the pieces of the spectra in each panel."""

    t: jax.Array  # borders of the contact panels, ascending
    first: jax.Array  # first wavevector of all roughness [1/m]
    start: jax.Array  # ln(first / (1/m))
    kinks: tuple[jax.Array, ...]  # t of the ends and kinks of every spectrum
    edges: jax.Array  # t of the borders of the angular panels, ends included
    panel: jax.Array  # angular panel of each contact panel
    pieces: tuple[jax.Array, ...]  # piece of every spectrum in each contact panel, -1 before the first
    panels_below: jax.Array | None  # number of contact panels below each requested border


def place_borders(
    laws: Sequence[BrokenPowerLaw],
    quadrature: Quadrature,
    graded: bool,
    borders: jax.Array | None,
    moving: bool,
) -> Borders:
    """Return the `Borders` of the panels.

    `build_mesh` describes the arguments.
    """
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
    if not moving:  # also not with the first wavevector, from which t is measured
        uniform = uniform - (start - jax.lax.stop_gradient(start))
    fixed, graded_ones = [uniform], []
    fixed += [
        jnp.minimum(_rolloff(law, kink) + _BEYOND_ROLLOFF, end)[None]
        for law, kink in zip(laws, followed, strict=True)
        if law.exponent.size > 1
    ]
    if graded:
        fractions = typed(quadrature.ratio ** (-2.0 * np.arange(1, quadrature.graded + 1)), end)
        # These move with the beginning. If fixed, the innermost panel, which is 1e-10 wide, would stretch
        # with q0, and its quadrature error would change.
        grades = [width(begin[0]) * fractions for begin in followed]
        graded_ones = [jnp.minimum(kink[0] + grade, end) for kink, grade in zip(kinks, grades, strict=True)]
        if quadrature.graded and not moving:
            fixed = [_among_graded(border, kinks, grades) for border in fixed]
    groups = [fixed[0], *kinks, *fixed[1:], *graded_ones]
    if borders is not None:
        # `where`, because a clip would halve the derivative of a border at an end.
        distance = log_ratio(jnp.where(borders >= first, borders, first), first)
        groups.append(jnp.where(distance <= end, distance, end))
    t = jnp.concatenate(groups)
    ranks = jnp.split(_ranks(jax.lax.stop_gradient(t)), np.cumsum([group.size for group in groups])[:-1])
    # The outer angular nodes move with the ends of the roughness. If fixed, contact nodes there would move
    # along the interpolant, whose slope is 1e3 times less accurate than its values.
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
        panels_below=None if borders is None else ranks[-1],
    )


def _passed(ranks, panels):
    """Return, for each panel, how many borders with the given `ranks` lie before the panel.

    `ranks` are positions in the sorted list of all borders. A comparison of values would lose the one-sided
    derivatives of borders that coincide, such as the ends of two spectra with equal q1.
    """
    return jnp.sum(ranks <= np.arange(panels)[:, None], -1)


def _among_graded(border, kinks, grades):
    """Let fixed borders within the graded panels of a spectrum move with its first wavevector.

    A fixed border may be one ulp from the first wavevector of a second spectrum. If this border did not move,
    the panel between the border and the wavevector would grow from zero width, and contact would change
    between the nodes of the panel.
    """
    for kink, grade in zip(kinks, grades, strict=True):
        distance = jax.lax.stop_gradient(border - kink[0])
        border = jnp.where(jnp.abs(distance) < grade[0], kink[0] + distance, border)
    return border


def _rolloff(law, kink):
    """Return t of the kink where the exponent of a law decreases most."""
    return kink[1:-1][jnp.argmin(jnp.diff(jax.lax.stop_gradient(law.exponent)))]


def _from_first(q, first, leads):
    """Return ln(q / first), whose first entry is a constant 0 if `leads` is True.

    `leads` is True if q[0] is `first`. In reverse mode, the difference of these two equal numbers would leave
    a rounding error, divided by the width 1e-14 of the innermost panel.
    """
    t = log_ratio(q, first)
    return jnp.concatenate([jnp.where(leads, 0.0, t[:1]), t[1:]])


def _ranks(values):
    """Return the position of every value in the sorted list, in which equal values keep their order."""
    index = np.arange(values.shape[0])
    before = (values < values[:, None]) | ((values == values[:, None]) & (index < index[:, None]))
    return jnp.sum(before, -1)


def _uniform_borders(kinks, exponents, panels):
    """Divide the range of t = ln(q / q_start) into panels that are narrower where the roughness rises.

    On the plateau G ~ q^4, so that P may change within a quarter of an e-fold. Where q^2 C rises with an
    exponent e (2 on the plateau), panels are narrower by the factor 1 + e/2.

    Returns
    -------
    width : function that returns the width of a panel that begins at t
    uniform : borders between the `panels` panels, shape (panels - 1,)
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
    """Evaluate the continuous piecewise linear function with given slopes that is 0 at the first knot.

    For the few knots of a spectrum, a sum over all pieces is faster than a search.
    """
    return jnp.sum(slopes * jnp.clip(t[..., None] - knots[:-1], 0.0, jnp.diff(knots)), -1)
