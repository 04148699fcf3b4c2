r"""Maps that collapse onto one curve: without heating, velocity and temperature enter as v a_T alone.

Time-temperature superposition E(omega, T) = E(a_T omega) [Ferry, Viscoelastic Properties of Polymers, 3rd
edition, Wiley 1980, chapter 11] reduces a map over v and T to one curve if all relaxing materials have the
same a_T and no b_T. Contact shear has its own shift and is added afterwards.

The curve is a piecewise Chebyshev series in ln(v a_T), and for many pressures a series in ln p. The
coefficients of a function that is analytic within the ellipse of parameter rho fall like rho^-n [Trefethen,
Approximation Theory and Approximation Practice, SIAM 2013, chapters 2, 3 and 8]. Panels with large last
coefficients are halved. Finally the interpolation is compared with the model at points of the map.
"""

import itertools
import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander

from rubberfric.base.compilation import quick_jit
from rubberfric.base.quadrature import chebyshev_transform
from rubberfric.io.results import Conditions, Interpolation, result_shape
from rubberfric.scene.interface import shear_friction
from rubberfric.scene.scene import Scene, temperature_by_scale
from rubberfric.theory.structure import MeansMethod, quantity_parts, rough_surfaces_of

_LEAST = 4096  # smaller maps are computed point by point
_PIECE = 2**20  # points of a map that are interpolated at once, to bound memory

# Width of a panel in e-folds of v a_T. A relaxation has poles at i pi / 2, so that rho = 2.9.
_WIDTH = 2.5

# Nodes of a panel. The last coefficient is about 2.9^-24 = 8e-12, just below `_TAIL`.
_NODES = 24

# Points at which a panel is evaluated at once, so that their Chebyshev polynomials stay in the cache.
_AT_ONCE = 2**12

# Largest last coefficient over ln(v a_T), relative to the values. A panel with a larger one is halved.
_TAIL = 1e-11

# Largest last coefficient over ln p, relative to the values. With a larger one, each pressure is computed.
_PRESSURE_TAIL = 1e-10

# Largest relative difference from the model. With a larger one, the map is computed point by point.
_AGREEMENT = 2e-10

# Most halvings of a panel. Panels at a kink never converge, and the interpolation is given up after these.
_HALVINGS = 6

# Most evaluations as a share of the points of the map. With more, the interpolation saves too little time.
_EVALUATED_SHARE = 0.4

# Nodes over ln p at equal pressures. Each pressure is computed if there are hardly more pressures than nodes.
_PRESSURE_NODES = 18

# Additional nodes per e-fold of p, because a wider range needs more nodes for the same error.
_NODES_PER_E_FOLD = 9.0

# Most nodes or pressures of an interpolation. It bounds the time and memory of one evaluation.
_MOST_PRESSURES = 128

_COMPARED = 8  # values of each condition at which the interpolation is compared with the model

_ODD = ("viscoelastic_friction", "transverse_friction")  # change sign with the velocity

Quantities = dict[str, np.ndarray]

# Function (names of quantities, conditions) -> values of the model, [temperature, pressure, velocity].
MapModel = Callable[[tuple[str, ...], Conditions], Quantities]


class PressureSeries(NamedTuple):
    """n functions of ln p, each a power of p times a Chebyshev series, or known at the map's pressures."""

    nodes: np.ndarray  # ln p, (m,)
    values: np.ndarray  # at the nodes, divided by the powers of p, (m, n)
    exponents: np.ndarray | None  # of the powers, (n,); None: values at the pressures of the map

    @classmethod
    def of(cls, nodes: np.ndarray, values: np.ndarray) -> "PressureSeries":
        """Return the series through values of shape (m, n) at the nodes.

        The exponent is the slope of ln |value| between the end nodes, or 0 if their signs differ.
        """
        same_sign = np.sign(values[0]) * np.sign(values[-1]) > 0
        first, last = (np.log(np.abs(np.where(same_sign, x, 1.0))) for x in (values[0], values[-1]))
        exponents = (last - first) / (nodes[-1] - nodes[0])
        powers = np.exp(np.multiply.outer(nodes - 0.5 * (nodes[0] + nodes[-1]), exponents))
        return cls(nodes, values / powers, exponents)

    def at(self, log_pressure: np.ndarray) -> np.ndarray:
        """Return the values at ln p of shape (k,), as an array of shape (k, n)."""
        if self.exponents is None:
            return self.values[np.argmin(np.abs(self.nodes[:, None] - log_pressure), 0)]
        size, middle = self.nodes.size, 0.5 * (self.nodes[0] + self.nodes[-1])
        place = (log_pressure - middle) / (0.5 * (self.nodes[-1] - self.nodes[0])) * chebpts1(size)[-1]
        basis = chebvander(place, size - 1) @ chebyshev_transform(size)
        return basis @ self.values * np.exp(np.multiply.outer(log_pressure - middle, self.exponents))


class Interpolant(NamedTuple):
    """Quantities over ln(v a_T) and pressure, for v > 0 and at rest."""

    edges: np.ndarray  # of the panels, in ln(v a_T), ascending
    values: dict[str, PressureSeries]  # at the nodes of all panels, and last at rest
    evaluations: int  # points at which the model was evaluated

    def at(self, log_speed: np.ndarray, log_pressure: np.ndarray) -> Quantities:
        """Return the quantities at ln(v a_T) of shape (t, v), -inf at rest, and ln p of shape (k,).

        The arrays have the shape (t, k, v).
        """
        flat = log_speed.reshape(-1)
        x = np.maximum(flat, self.edges[0])
        panel = np.clip(np.searchsorted(self.edges, x, "right") - 1, 0, self.edges.size - 2)
        panel = panel.astype(np.int16)  # short integers take less memory and are sorted faster
        order = np.argsort(panel, kind="stable")
        ends = np.searchsorted(panel[order], np.arange(self.edges.size, dtype=np.int16))
        values = {name: series.at(log_pressure) for name, series in self.values.items()}
        coefficients = {
            name: table[:, :-1].reshape(log_pressure.size, -1, _NODES) @ chebyshev_transform(_NODES).T
            for name, table in values.items()
        }
        arrays = {name: np.empty((log_pressure.size, x.size)) for name in values}
        for k, (first, last) in enumerate(itertools.pairwise(ends)):
            for begin in range(first, last, _AT_ONCE):
                some = order[begin : min(begin + _AT_ONCE, last)]
                place = 2 * (x[some] - self.edges[k]) / (self.edges[k + 1] - self.edges[k]) - 1
                basis = chebvander(place, _NODES - 1).T
                for name, array in arrays.items():
                    array[:, some] = coefficients[name][:, k] @ basis
        for name, array in arrays.items():
            array[:, np.isneginf(flat)] = values[name][:, -1:]
        shape = log_pressure.size, *log_speed.shape
        return {name: np.moveaxis(array.reshape(shape), 0, 1) for name, array in arrays.items()}


class CollapsedMap(NamedTuple):
    """The curve on which all points of a map without heating lie."""

    scene: Scene
    quantities: tuple[str, ...]  # of the map
    series: Interpolant  # of the quantities that depend on v a_T and pressure alone
    interpolation: Interpolation


def collapse(
    scene: Scene, conditions: Conditions, quantities: tuple[str, ...], model: MapModel
) -> CollapsedMap | None:
    """Interpolate a map along one curve, from values of the `MapModel`.

    The result is None if the map does not collapse, or if the curve would cost as much as the map.
    """
    log_speed = log_speeds(scene, conditions)
    names = _on_curve(scene, quantities)
    moving = np.flatnonzero(conditions.velocity)
    if log_speed is None or not names or not moving.size or math.prod(result_shape(conditions)) < _LEAST:
        return None
    first_temperature = None if conditions.temperature is None else conditions.temperature[:1]
    # Nodes are in v a_T; the model takes v at the first temperature.
    unshifted = abs(conditions.velocity[moving[0]]) / np.exp(log_speed[0, moving[0]])

    def evaluate(speed: np.ndarray, pressure: np.ndarray) -> Quantities:
        collapsed = model(names, Conditions(speed * unshifted, pressure, first_temperature))
        return {name: values[0] for name, values in collapsed.items()}

    series = interpolant(log_speed, np.log(conditions.pressure), evaluate)
    if series is None:
        return None
    some = Conditions(*(None if x is None else _a_few(x) for x in conditions))  # pyright: ignore[reportArgumentType]
    collapsed = CollapsedMap(scene, names, series, Interpolation(series.evaluations, 0.0))
    error = _difference(whole(collapsed, some), model(names, some))
    if not error <= _AGREEMENT:
        return None
    evaluations = series.evaluations + math.prod(result_shape(some))
    return CollapsedMap(scene, quantities, series, Interpolation(evaluations, error))


def log_speeds(scene: Scene, conditions: Conditions) -> np.ndarray | None:
    """Return ln|v a_T| (-inf at rest), of shape (temperatures, velocities), or None without a collapse."""
    if temperature_by_scale(scene):
        return None
    T, shift = conditions.temperature, np.zeros(1)
    if T is not None and T.size > 1:
        factors = _log_factors(scene, T)
        if factors is None:
            return None
        shift, *others = map(np.asarray, factors or [np.zeros(T.size)])
        if not all(np.array_equal(other, shift) for other in others):
            return None
    with np.errstate(divide="ignore"):
        return np.log(np.abs(conditions.velocity)) + shift[:, None]


@quick_jit()
def _log_factors(scene, temperature):
    """Return ln a_T for each surface that is not static; None if temperature changes more than a_T."""
    factors = []
    for surface in rough_surfaces_of(scene):
        if surface.static:
            continue
        shift = surface.strained.material.shift
        if surface.method is MeansMethod.AT_POINTS or (shift is not None and shift.vertical is not None):
            return None
        factors.append(jnp.zeros(temperature.shape) if shift is None else shift.log_factor(temperature))
    return factors


def whole(collapsed: CollapsedMap, conditions: Conditions) -> Quantities:
    """Return the quantities at conditions of the map, as arrays [temperature, pressure, velocity]."""
    values = {name: np.empty(result_shape(conditions)) for name in collapsed.quantities}
    for T, p, piece in pieces(collapsed, conditions):
        for name, array in piece.items():
            values[name][T, p] = array
    return values


def pieces(collapsed: CollapsedMap, conditions: Conditions) -> Iterator[tuple[slice, slice, Quantities]]:
    """Yield (slice of temperatures, slice of pressures, arrays [temperature, pressure, velocity])."""
    log_speed = log_speeds(collapsed.scene, conditions)
    assert log_speed is not None
    v, p, T = conditions
    columns = max(1, _PIECE // v.size)
    rows = max(1, columns // p.size)
    parts = quantity_parts(collapsed.quantities)
    for low, begin in itertools.product(range(0, p.size, columns), range(0, len(log_speed), rows)):
        block = slice(begin, min(begin + rows, len(log_speed)))
        some = slice(low, min(low + columns, p.size))
        values = collapsed.series.at(log_speed[block], np.log(p[some]))
        for name in set(_ODD) & set(values):
            values[name] = values[name] * np.sign(v)
        if "shear_friction" in parts:
            shear = np.zeros(())
            if collapsed.scene.shear is not None:
                shear = np.asarray(_shear(collapsed.scene.shear, v, None if T is None else T[block, None]))
                shear = shear[:, None] * values["area"] / p[some, None]
            values["shear_friction"] = shear
        if "friction" in collapsed.quantities:
            values["friction"] = values["viscoelastic_friction"] + values["shear_friction"]
        yield block, some, {name: values[name] for name in collapsed.quantities}


def _on_curve(scene, quantities):
    """Return the quantities to interpolate: the parts without contact shear, and the area that it needs."""
    parts = quantity_parts(quantities)
    needed = parts - {"shear_friction"}
    if scene.shear is not None and "shear_friction" in parts:
        needed.add("area")
    return tuple(sorted(needed))


@jax.jit
def _shear(shear, velocity, temperature):
    """Return mu of the contact shear at A/A0 = 1 and 1 Pa, of shape (temperatures, velocities)."""
    unity = jnp.ones((), velocity.dtype)
    friction = shear_friction(shear, unity, velocity, unity, temperature)
    return jnp.broadcast_to(friction, (1 if temperature is None else temperature.size, velocity.size))


# --- interpolation


def interpolant(
    log_speed: np.ndarray, log_pressure: np.ndarray, evaluate: Callable[[np.ndarray, np.ndarray], Quantities]
) -> Interpolant | None:
    """Interpolate the quantities of a map, or return None if that converges too slowly or costs as much.

    Parameters
    ----------
    log_speed : ln|v a_T| of the map, any shape; -inf at rest
    log_pressure : ln p of the map, one-dimensional
    evaluate : function of v a_T (n,) and p (m,) to the quantities, (m, n)
    """
    moving = log_speed[np.isfinite(log_speed)]
    if moving.size == 0:
        return None
    low, high = float(moving.min()), float(moving.max())
    count = max(1, math.ceil((high - low) / _WIDTH))
    # A little wider than the map, so that rounding puts no point outside.
    width = (high - low) / count + 1e-9
    panels = [(low + k * width, width) for k in range(count)]
    budget = _EVALUATED_SHARE * log_speed.size * log_pressure.size
    for nodes in (_pressure_nodes(log_pressure), log_pressure):
        if nodes is not None and nodes.size <= _MOST_PRESSURES:
            made = _over_panels(panels, nodes, nodes is not log_pressure, budget, evaluate)
            if made is not None:
                return made
    return None


def _over_panels(waiting, nodes, in_series, budget, evaluate):
    """Return the `Interpolant` over panels, halved as needed, or None if it fails or is too expensive."""
    done: list[tuple[float, float, Quantities]] = []
    rest: Quantities = {}
    evaluations = 0
    for _ in range(_HALVINGS + 1):
        x = np.concatenate([start + 0.5 * width * (1 + chebpts1(_NODES)) for start, width in waiting])
        evaluations += (x.size + 1) * nodes.size
        if evaluations > budget:
            return None
        arrays = evaluate(np.append(np.exp(x), 0.0), np.exp(nodes))
        if not all(np.isfinite(values).all() for values in arrays.values()):
            return None  # the map itself reports the point
        if in_series:
            series = (PressureSeries.of(nodes, values).values for values in arrays.values())
            if any(np.max(_last_coefficients(values.T)) > _PRESSURE_TAIL for values in series):
                return None
        rest = {name: values[:, -1:] for name, values in arrays.items()}
        panels = {name: values[:, :-1].reshape(-1, len(waiting), _NODES) for name, values in arrays.items()}
        good = np.all([np.max(_last_coefficients(values), 0) <= _TAIL for values in panels.values()], 0)
        halves = []
        for k, (start, width) in enumerate(waiting):
            if good[k]:
                done.append((start, width, {name: values[:, k] for name, values in panels.items()}))
            else:
                halves += [(start, width / 2), (start + width / 2, width / 2)]
        waiting = halves
        if not waiting:
            break
    else:
        return None
    done.sort(key=lambda panel: panel[0])
    values = {name: np.concatenate([*(panel[2][name] for panel in done), rest[name]], 1) for name in rest}
    edges = np.array([*(start for start, *_ in done), done[-1][0] + done[-1][1]])
    series = {
        name: PressureSeries.of(nodes, x) if in_series else PressureSeries(nodes, x, None)
        for name, x in values.items()
    }
    return Interpolant(edges, series, evaluations)


def _pressure_nodes(log_pressure):
    """Return ln p at the nodes of the series, or None if they are about as many as the pressures."""
    low, high = log_pressure.min(), log_pressure.max()
    count = math.ceil(_PRESSURE_NODES + _NODES_PER_E_FOLD * (high - low))
    if log_pressure.size <= 1.3 * count:
        return None
    return low + 0.5 * (high - low) * (1 + chebpts1(count))


def _difference(interpolated, exact):
    """Return the largest difference of quantities relative to their values, inf for a NaN.

    Differences of a quantity that changes sign are divided by its largest absolute value.
    """
    worst = 0.0
    for name, values in exact.items():
        changes = values.min() < 0 < values.max()
        scale = np.max(np.abs(values)) if changes else np.abs(values)
        off = np.abs(interpolated[name] - values)
        ratio = off / np.where(scale > 0, scale, 1.0)
        ratio = np.where((scale > 0) | (off == 0), ratio, np.inf)
        worst = max(worst, float(np.max(np.where(np.isnan(ratio), np.inf, ratio))))
    return worst


def _a_few(values):
    which = np.unique(np.linspace(0, values.size - 1, _COMPARED).round().astype(int))
    return np.sort(values, kind="stable")[which]  # fast, because conditions are mostly in order


# --- Chebyshev series


def _last_coefficients(values):
    """Return the largest of the last three Chebyshev coefficients over the last axis, relative to the values.

    The scale is the smallest absolute value, or the largest one if the values change sign. The result is
    infinite if only some values are 0 and the values do not change sign.
    """
    size = np.abs(values)
    changes = (values.min(-1) < 0) & (values.max(-1) > 0)
    scale = np.where(changes, size.max(-1), size.min(-1))
    last = np.max(np.abs(values @ chebyshev_transform(values.shape[-1])[-3:].T), -1)
    without = np.where(size.max(-1) > 0, np.inf, 0.0)
    return np.where(scale > 0, last / np.where(scale > 0, scale, 1.0), without)
