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
from collections.abc import Callable, Iterator
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
# An element nearer to its bound than `_NEAR` in x is tried on the bound, which is `_FAR` beyond it in z.
# Steps alone would converge slowly, because the residuals depend less and less on z there.
_NEAR, _FAR = 0.2, 30.0
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
        one, other = (places.get(end, (None, None)) for end in pair)
        # A number that follows the rms slope has no bounds; `in_order` refuses values out of order.
        if one is None or other is None or one[0] == other[0]:
            continue
        (low, low_ratio), (high, high_ratio) = one, other
        # Tied numbers that bound each other in a cycle have no bounds either.
        if high is not None and (low is None or high not in chain(low)):
            below.setdefault(high, []).append(_Bound(low, pair.low, (low_ratio, high_ratio)))
        if low is not None and (high is None or high not in chain(low)):
            above.setdefault(low, []).append(_Bound(high, pair.high, (high_ratio, low_ratio)))
    order = dict.fromkeys(k for i in (*below, *above) for k in chain(i))
    return tuple(_Step(i, tuple(below.get(i, ())), tuple(above.get(i, ()))) for i in order)


class _Bounds(NamedTuple):
    """Lower bound a and upper bound b of the x of an element, as yielded by `_Walk`."""

    element: int
    source: _Bound | None  # the bound below
    a: Any
    b: Any


class _Walk:
    """Iterator over the bounds of the elements of x.

    The caller must store the x of an element in the attribute `x` before the next iteration, because bounds
    of later elements depend on it.
    """

    def __init__(self, variables: Variables, constants: Constants, given: Array, moving: Array):
        self.xp: Any = np if isinstance(given, np.ndarray) else jnp
        self.constants = jax.tree.map(np.asarray, constants) if self.xp is np else constants
        self.moving = moving
        self.steps, self.x = _steps(variables), {}
        self.kinds = variables.kinds
        margin = _ROUNDING * float(jnp.finfo(given.dtype).eps)
        # Bounds from above are fixed numbers, and the upper bounds of free neighbours above.
        top: dict[int, Any] = {}
        # Number of free elements in the longest chain above; each needs a margin.
        self.above: dict[int, int] = {}
        for step in reversed(self.steps):
            limits = [self._range(step.element)[1]]
            for bound in step.above:
                value = self._value(bound, given)
                if bound.element is not None and bound.element in top:
                    chain = max(self.above.get(step.element, 0), 1 + self.above[bound.element])
                    self.above[step.element] = chain
                    value = self._times(bound, top[bound.element])
                    value = self.xp.where(moving[bound.element], value, self._value(bound, given))
                limits.append(value)
            self.above.setdefault(step.element, 0)
            top[step.element] = functools.reduce(self.xp.minimum, limits)
        self.top, self.margin = top, margin

    def __iter__(self) -> Iterator[_Bounds]:
        xp = self.xp
        for step in self.steps:
            i, source, low = step.element, None, None
            for bound in step.below:
                value = self._value(bound, self.x)
                if xp is np and (low is None or value > low):
                    source = bound
                low = value if low is None else xp.maximum(low, value)
            a = -np.inf if low is None else self._inverse(i, low)
            b = self._inverse(i, self.top[i])
            # A margin for rounding, so that no value crosses its bound.
            a, b = a + self._clear(a), b - (1 + 2 * self.above[i]) * self._clear(b)
            yield _Bounds(i, source, a, b)

    def _clear(self, end):
        finite = self.xp.isfinite(end)
        return self.margin * self.xp.where(finite, 1 + abs(self.xp.where(finite, end, 0.0)), 0.0)

    def _range(self, i):
        if self.kinds[i] == "Bounded":
            return self.constants.low[i], self.constants.low[i] + self.constants.width[i]
        return (0.0 if self.kinds[i] == "Positive" else -np.inf), np.inf

    def _times(self, bound, value):
        ratios, xp = self.constants.ratios, self.xp
        theirs, own = (1.0 if r is None else xp.asarray(ratios[r[0]])[r[1]] for r in bound.ratios)
        return value * theirs / own

    def _value(self, bound, x):
        """Return the value of a bound, where `x` contains the x of the element that is the bound."""
        if bound.element is None:
            return self._times(bound, self.xp.asarray(bound.end.value(self.constants.leaves)))
        j = bound.element
        return self._times(bound, from_x(self.kinds[j], self.constants.low[j], self.constants.width[j], x[j]))

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
    """Return x for the variables z of a solver. `moving` is 0 for fixed elements, and 1 for all others."""
    if not variables.order:
        return z
    walk = _Walk(variables, constants, z, moving)
    for i, _, a, b in walk:
        start_z = _between(walk.xp, a, b, z[i])
        walk.x[i] = walk.xp.where(moving[i], start_z, z[i])
    return _put(z, walk.x)


def z_of(variables: Variables, constants: Constants, x: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Return z for start values x, computed with NumPy.

    An element outside a bound is reflected at the bound, and an element on a bound is moved inside.
    """
    walk, z = _Walk(variables, constants, x, moving), {}
    for i, _, a, b in walk:
        if not moving[i]:
            walk.x[i] = z[i] = x[i]
            continue
        there = float(x[i])
        near = min(INSIDE, 0.25 * float(b - a))
        if np.isfinite(a):
            there = a + (abs(there - a) if abs(there - a) > AT_EDGE else near)
        if np.isfinite(b):
            there = b - (abs(there - b) if abs(there - b) > AT_EDGE else near)
        if not a < there < b:
            there = a + 0.5 * (b - a)
        walk.x[i] = there
        below, above = (np.log(-np.expm1(_SHARP * t)) for t in (a - there, there - b))
        z[i] = there + (below - above) / _SHARP
    return _put(x, z)


def each_fit(
    function: Callable[..., Any], variables: Variables, constants: Constants, points: Array, moving: Array
) -> np.ndarray:
    """Return the results of `x_of`, `z_of` or `slopes_of_x` for several fits, at points (fits, size)."""
    if not variables.order:
        return np.asarray(points)
    pairs = zip(points, np.asarray(moving), strict=True)
    return np.stack([function(variables, constants, *pair) for pair in pairs])


def slopes_of_x(variables: Variables, constants: Constants, z: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Return the derivatives dx / dz, computed with NumPy, as an array of shape (size, size)."""
    found, width = np.eye(z.size, dtype=z.dtype), np.asarray(constants.width)
    walk = _Walk(variables, constants, z, moving)
    for i, source, a, b in walk:
        if not moving[i]:
            walk.x[i] = z[i]
            continue
        walk.x[i] = _between(np, a, b, z[i])
        above, near = (1 / (1 + np.exp(np.clip(_SHARP * t, -700, 700))) for t in (a - z[i], b - z[i]))
        found[i, i] = above - near
        j = None if source is None else source.element
        if j is not None and np.isfinite(a):
            part = [slopes_of(walk.kinds[k], width[k], at) for k, at in ((j, walk.x[j]), (i, a))]
            found[i] += (1 - above) * walk._times(source, 1.0) * part[0] / part[1] * found[j]
    return found


def put_on_bounds(
    variables: Variables, constants: Constants, before: np.ndarray, z: np.ndarray, moving: np.ndarray
) -> np.ndarray:
    """Return z with elements moved onto a bound if they are near it and came closer since `before`."""
    walk, there = _Walk(variables, constants, z, moving), z.copy()
    closer = np.sign(np.floor(_SHARP * z) - np.floor(_SHARP * before))
    for i, _, a, b in walk:
        walk.x[i] = z[i]
        if not moving[i]:
            continue
        walk.x[i] = _between(np, a, b, z[i])
        if walk.x[i] - a < _NEAR and a - _FAR < z[i] and closer[i] < 0:
            there[i] = a - _FAR
        elif b - walk.x[i] < _NEAR and z[i] < b + _FAR and closer[i] > 0:
            there[i] = b + _FAR
    return there


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
    own, found = {}, []
    for group in variables.own:
        ends = (End(group.leaf, element) for element in group.elements or (None,))
        own |= dict(zip(ends, range(*group.slot), strict=True))
    for low, high in variables.order:
        below, above = (float(end.value(leaves)) for end in (low, high))
        if above - below <= AT_EDGE * abs(above):
            found += [Edge(own[high], "lower", low)] if high in own else []
            found += [Edge(own[low], "upper", high)] if low in own else []
    return found


def _put(x, elements):
    if isinstance(x, np.ndarray):
        x = x.copy()
        for i, value in elements.items():
            x[i] = value
        return x
    which = np.array(list(elements))
    return x.at[which].set(jnp.stack([jnp.asarray(v, x.dtype) for v in elements.values()]))
