r"""Unconstrained variables z of the solvers, which keep the order of numbers such as q0 <= qr <= q1.

Solvers use z instead of x (`fitting.parameters.variables`). Let a and b be the x of the nearest neighbours
below and above (`fitting.parameters.scenes`). Then

.. math:: x = a + s(z - a) - s(z - b),\qquad s(t) = \frac1k \ln(1 + e^{kt})

lies between a and b. Far from both, x equals z: at a distance of 3 their difference is of the order of
rounding (k = 12). A free neighbour is a bound from below only, and its x is computed first. The bound from
above is the next fixed number. A number that is fixed in one fit, as in a profile, is a bound in that fit and
has z = x. Only the solvers use z.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.scenes import End
from fitting.parameters.variables import Array, Constants, Variables, from_x, slopes_of, to_scene, to_x

# k: farther from a bound than a few times 1/k in x, z equals x.
_SHARP = 12.0
# A start value at its bound, where no step would move it, is moved inside by this distance in x.
INSIDE = 0.05
# An element nearer to its bound than this in x is tried on the bound. Steps alone would converge slowly,
# because the residuals depend less and less on z there.
_NEAR = 0.2
# Distance in z beyond a bound at which x equals the bound to rounding.
_FAR = 30.0
# A number counts as equal to its neighbour if their relative difference is below this.
AT_EDGE = 1e-4
# Rounding error of a value and its x, divided by the spacing of floating-point numbers. Bounds are moved
# inside by this margin.
_ROUNDING = 100.0


class _Bound(NamedTuple):
    """Bound of an element of x: a ratio times the value of another element or of a fixed leaf."""

    element: int | None  # index of the other element of x; None for a fixed leaf
    end: End
    ratios: tuple[tuple[int, int] | None, tuple[int, int] | None]  # of tied numbers: (the bound's, its own)


class _Step(NamedTuple):
    element: int
    below: tuple[_Bound, ...]
    above: tuple[_Bound, ...]


def _places(variables):
    """Return a dict from every number of the scene with a rule to its element of x and its ratio.

    The ratio is a pair of indices for Tied numbers, else None. The entry of an RmsSlope number is None.
    """
    places: dict[End, tuple[int, tuple[int, int] | None] | None] = {}
    ratio = -1  # counts the groups that have one
    for group in variables.groups:
        ratio += group.kind in ("Tied", "RmsSlope")
        slots = range(*group.slot)
        for k, element in enumerate(group.elements or (None,)):
            place = None
            if group.kind != "RmsSlope":
                place = slots[min(k, len(slots) - 1)], (ratio, k) if group.kind == "Tied" else None
            places[End(group.leaf, element)] = place
    return places


@functools.lru_cache(maxsize=64)
def _steps(variables: Variables) -> tuple[_Step, ...]:
    """Return the elements of x that have bounds, each after all free elements that bound it from below."""
    places = _places(variables)
    below: dict[int, list[_Bound]] = {}
    above: dict[int, list[_Bound]] = {}

    def chain(i):
        """Return the free elements that bound element `i` from below, lowest first, followed by `i`."""
        free = [bound.element for bound in below.get(i, []) if bound.element is not None]
        return [*dict.fromkeys(k for j in free for k in chain(j)), i]

    for pair in variables.order:
        lower, upper = (places.get(end, (None, None)) for end in pair)
        # A number that follows the rms slope has no bounds; `in_order` refuses values out of order.
        if lower is None or upper is None or lower[0] == upper[0]:
            continue
        (low, low_ratio), (high, high_ratio) = lower, upper
        # Tied numbers that bound each other in a cycle have no bounds either.
        if high is not None and (low is None or high not in chain(low)):
            below.setdefault(high, []).append(_Bound(low, pair.low, (low_ratio, high_ratio)))
        if low is not None and (high is None or high not in chain(low)):
            above.setdefault(low, []).append(_Bound(high, pair.high, (high_ratio, low_ratio)))
    order = dict.fromkeys(k for i in (*below, *above) for k in chain(i))
    return tuple(_Step(i, tuple(below.get(i, ())), tuple(above.get(i, ()))) for i in order)


class _Bounds(NamedTuple):
    """Lower bound a and upper bound b of the x of an element."""

    element: int
    below: list[tuple[_Bound, Any]]  # bounds below, with their values
    a: Any
    b: Any


class _Order:
    """Bounds of the elements of x that must be in order, for solver variables or start values `values`.

    `values` and `moving` have the shape (size,). As NumPy arrays of several fits, they have the shape
    (fits, size), and the bounds and x of each element have the shape (fits,).
    """

    def __init__(self, variables: Variables, constants: Constants, values: Array, moving: Array):
        self.xp: Any = np if isinstance(values, np.ndarray) else jnp
        self.constants = jax.tree.map(np.asarray, constants) if self.xp is np else constants
        self.values, self.moving = (self.xp.asarray(a).T.copy() for a in (values, moving))
        self.steps, self.kinds = _steps(variables), variables.kinds
        self.margin = _ROUNDING * float(jnp.finfo(values.dtype).eps)
        # Bounds from above are fixed numbers, and the upper bounds of free neighbours above.
        self.top: dict[int, Any] = {}
        # Number of free elements in the longest chain above; each needs a margin.
        self.above: dict[int, int] = {}
        for step in reversed(self.steps):
            limits = [self._range(step.element)[1]]
            for bound in step.above:
                value = self._value(bound, self.values)
                if bound.element is not None and bound.element in self.top:
                    chain = max(self.above.get(step.element, 0), 1 + self.above[bound.element])
                    self.above[step.element] = chain
                    value = self.times(bound, self.top[bound.element])
                    value = self.xp.where(self.moving[bound.element], value, self._value(bound, self.values))
                limits.append(value)
            self.above.setdefault(step.element, 0)
            self.top[step.element] = functools.reduce(self.xp.minimum, limits)

    def placed(self, place: Callable[[_Bounds, dict[int, Any]], Any]) -> dict[int, Any]:
        """Return the x of all elements in order, where `place` returns the x of each element that moves.

        Elements are placed after their free neighbours below, whose x bound them. `place` receives the bounds
        of an element and the x so far.
        """
        x: dict[int, Any] = {}
        # The place of an element that does not move may not be a number, and is not used.
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for step in self.steps:
                i = step.element
                x[i] = self.xp.where(self.moving[i], place(self._bounds(step, x), x), self.values[i])
        return x

    def _bounds(self, step, x):
        xp, i = self.xp, step.element
        below = [(bound, self._value(bound, x)) for bound in step.below]
        a = self._inverse(i, functools.reduce(xp.maximum, [v for _, v in below])) if below else -np.inf
        b = self._inverse(i, self.top[i])
        # A margin for rounding, so that no value crosses its bound.
        return _Bounds(i, below, a + self._clear(a), b - (1 + 2 * self.above[i]) * self._clear(b))

    def _clear(self, end):
        finite = self.xp.isfinite(end)
        return self.margin * self.xp.where(finite, 1 + abs(self.xp.where(finite, end, 0.0)), 0.0)

    def _range(self, i):
        if self.kinds[i] == "Bounded":
            return self.constants.low[i], self.constants.low[i] + self.constants.width[i]
        return (0.0 if self.kinds[i] == "Positive" else -np.inf), np.inf

    def times(self, bound: _Bound, value: Any) -> Any:
        """Convert a value of the element that is a bound to the bound of the other element."""
        ratios, xp = self.constants.ratios, self.xp
        theirs, own = (1.0 if r is None else xp.asarray(ratios[r[0]])[r[1]] for r in bound.ratios)
        return value * theirs / own

    def _value(self, bound, x):
        """Return the value of a bound, where `x` contains the x of the element that is the bound."""
        if bound.element is None:
            return self.times(bound, self.xp.asarray(bound.end.value(self.constants.leaves)))
        j = bound.element
        return self.times(bound, from_x(self.kinds[j], self.constants.low[j], self.constants.width[j], x[j]))

    def _inverse(self, i, value):
        """Return the x of element `i` at a value, or -inf or inf outside the limits of the rule."""
        xp, (low, high) = self.xp, self._range(i)
        within = (value > low) & (value < high)
        # A value inside the range, so that the branch that is not used has a finite derivative.
        safe = low + 0.5 * self.constants.width[i] if self.kinds[i] == "Bounded" else 1.0
        x = to_x(self.kinds[i], self.constants.low[i], self.constants.width[i], xp.where(within, value, safe))
        return xp.where(within, x, xp.where(value <= low, -np.inf, np.inf))


def _between(xp, a, b, z):
    # The formula for x in the docstring of this module.
    return (xp.logaddexp(_SHARP * a, _SHARP * z) - xp.logaddexp(0.0, _SHARP * (z - b))) / _SHARP


def x_of(variables: Variables, constants: Constants, z: Array, moving: Array) -> Array:
    """Return x for the variables z of a solver. `moving` is 0 for fixed elements, and 1 for all others.

    NumPy arrays z and `moving` may have the shape (fits, size).
    """
    if not variables.order:
        return z
    order = _Order(variables, constants, z, moving)
    return _put(z, order.placed(lambda at, _: _between(order.xp, at.a, at.b, order.values[at.element])))


def z_of(variables: Variables, constants: Constants, x: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Return z for start values x of one or several fits, computed with NumPy.

    An element outside a bound is reflected at the bound, and an element on a bound is moved inside.
    """
    order, z = _Order(variables, constants, x, moving), {}

    def place(at, _):
        i, a, b = at.element, at.a, at.b
        there, near = order.values[i], np.minimum(INSIDE, 0.25 * (b - a))
        for end, sign in ((a, 1), (b, -1)):
            away = np.abs(there - end)
            inside = end + sign * np.where(away > AT_EDGE, away, near)
            there = np.where(np.isfinite(end), inside, there)
        there = np.where((a < there) & (there < b), there, a + 0.5 * (b - a))
        below, above = (np.log(-np.expm1(_SHARP * t)) for t in (a - there, there - b))
        z[i] = np.where(order.moving[i], there + (below - above) / _SHARP, order.values[i])
        return there

    order.placed(place)
    return _put(x, z)


def put_in_order(variables: Variables, constants: Constants, x: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Return points x, shape (points, size), with values moved into the order that the scene requires."""
    return np.asarray(x_of(variables, constants, z_of(variables, constants, x, moving), moving))


def slopes_of_x(variables: Variables, constants: Constants, z: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Return the derivatives dx / dz, computed with NumPy, as an array of shape (..., size, size)."""
    order, size = _Order(variables, constants, z, moving), z.shape[-1]
    kinds, width = order.kinds, np.asarray(order.constants.width)
    slopes = np.zeros((size, *order.values.shape), z.dtype)
    slopes[range(size), range(size)] = 1

    def place(at, x):
        i, a, b, own_z = at.element, at.a, at.b, order.values[at.element]
        above, near = (1 / (1 + np.exp(np.clip(_SHARP * (end - own_z), -700, 700))) for end in (a, b))
        row = np.zeros_like(slopes[i])
        row[i] = above - near
        for k, (bound, _) in enumerate(at.below):
            if (j := bound.element) is not None:
                is_highest = np.argmax(np.broadcast_arrays(*[value for _, value in at.below]), 0) == k
                theirs, own = (slopes_of(kinds[m], width[m], there) for m, there in ((j, x[j]), (i, a)))
                along = (1 - above) * order.times(bound, 1.0) * theirs / own
                row += np.where(is_highest & np.isfinite(a), along, 0.0) * slopes[j]
        slopes[i] = np.where(order.moving[i], row, slopes[i])
        return _between(np, a, b, own_z)

    order.placed(place)
    return np.moveaxis(slopes, (0, 1), (-2, -1))


def put_on_bounds(
    variables: Variables, constants: Constants, before: np.ndarray, z: np.ndarray, moving: np.ndarray
) -> np.ndarray:
    """Return z with elements moved onto a bound if they are near it and came closer since `before`."""
    order, there = _Order(variables, constants, z, moving), {}
    closer = np.sign(np.floor(_SHARP * z) - np.floor(_SHARP * before)).T

    def place(at, _):
        i, a, b = at.element, at.a, at.b
        own = order.values[i]
        x = _between(np, a, b, own)
        down = (x - a < _NEAR) & (a - _FAR < own) & (closer[i] < 0)
        up = (b - x < _NEAR) & (own < b + _FAR) & (closer[i] > 0)
        moved = np.where(down, a - _FAR, np.where(up, b + _FAR, own))
        there[i] = np.where(order.moving[i], moved, own)
        return x

    order.placed(place)
    return _put(z, there)


class Edge(NamedTuple):
    """An element of x whose value equals the value of a neighbour within the relative limit `AT_EDGE`."""

    element: int
    side: str  # "lower" or "upper", side of the neighbour
    neighbour: End


def edges(variables: Variables, constants: Constants, x: np.ndarray) -> list[Edge]:
    """Return the elements of x whose values differ by at most `AT_EDGE` from the value of a neighbour."""
    if not variables.order:
        return []
    leaves = jax.tree.leaves(to_scene(variables, constants, np.asarray(x)))
    own, edges_found = {}, []
    for group in variables.own:
        ends = (End(group.leaf, element) for element in group.elements or (None,))
        own |= dict(zip(ends, range(*group.slot), strict=True))
    for low, high in variables.order:
        below, above = (float(end.value(leaves)) for end in (low, high))
        if above - below <= AT_EDGE * abs(above):
            edges_found += [Edge(own[high], "lower", low)] if high in own else []
            edges_found += [Edge(own[low], "upper", high)] if low in own else []
    return edges_found


def _put(x, elements):
    """Return x with other elements, as an array of the same kind."""
    if isinstance(x, np.ndarray):
        x = x.copy()
        for i, value in elements.items():
            x[..., i] = value
        return x
    which = np.array(list(elements))
    return x.at[which].set(jnp.stack([jnp.asarray(v, x.dtype) for v in elements.values()]))
