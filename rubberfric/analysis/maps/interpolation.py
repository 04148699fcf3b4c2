r"""Quantities of a map as series in ln(v a_T) and ln p.

They are found on panels of ln(v a_T) as Chebyshev series, and over many pressures as one in ln p. Panels
whose last coefficients are too large are halved, and the whole is compared with the model at points of the
map: where it is not good enough, or no less work than the map, there is none.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from rubberfric.analysis.maps.chebyshev import CELLS, COEFFICIENTS, last_coefficients, roots, series, to_cells

# Nodes of a panel, of so many e-folds of v a_T: a relaxation has poles at i pi / 2, and rho = 2.9.
NODES, WIDTH = 24, 2.5

# What the last coefficients may be, relative to the values, over ln(v a_T) and over ln p; and what the
# difference from the model in the end.
TAIL, PRESSURE_TAIL, AGREEMENT = 1e-11, 1e-10, 2e-10

# Halvings of a panel, at most; points evaluated, at most, of those of the map.
_HALVINGS, _SHARE = 6, 0.4

# Nodes over ln p, and for every e-fold of it; each pressure by itself where there are no more of them.
_PRESSURES, _PRESSURES_EACH, _MOST_PRESSURES = 18, 9.0, 128

# Values of each condition at which the interpolation is compared with the model.
_COMPARED = 8

Quantities = dict[str, np.ndarray]


class OverPressure(NamedTuple):
    """Values over ln p: powers of p times series, or at the pressures of a map alone."""

    nodes: np.ndarray  # ln p, (m,)
    values: np.ndarray  # at the nodes, over the powers of p, (m, n)
    slope: np.ndarray | None  # exponents of the powers, (n,); None: there are no series

    def at(self, log_pressure: float) -> np.ndarray:
        """Values at ln p, (n,)."""
        if self.slope is None:
            return self.values[np.argmin(np.abs(self.nodes - log_pressure))]
        middle, half = 0.5 * (self.nodes[0] + self.nodes[-1]), 0.5 * (self.nodes[-1] - self.nodes[0])
        place = (log_pressure - middle) / half * roots(self.nodes.size)[-1]
        basis = chebyshev.chebvander(np.array([place]), self.nodes.size - 1)[0] @ series(self.nodes.size)
        return basis @ self.values * np.exp(self.slope * (log_pressure - middle))


class Interpolant(NamedTuple):
    """Quantities over ln(v a_T) and pressure, for v > 0 and at rest."""

    first: float  # ln(v a_T) where the first of intervals of equal width begins
    width: float
    owner: np.ndarray  # the cell that each of them belongs to
    center: np.ndarray  # of the cells, in ln(v a_T)
    half: np.ndarray  # half the width of each
    values: dict[str, OverPressure]  # at the nodes of all panels, and last at rest
    evaluations: int  # points at which the model was evaluated

    def places(self, log_speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The cell of every ln(v a_T), any shape, and where in the cell it lies, -1 ... 1."""
        log_speed = np.maximum(log_speed, self.first)  # -inf at rest
        interval = ((log_speed - self.first) / self.width).astype(np.intp)
        cell = self.owner.take(interval, mode="clip")
        return cell, (log_speed - self.center.take(cell)) / self.half.take(cell)

    def at_pressure(self, name: str, log_pressure: float) -> tuple[np.ndarray, float]:
        """A quantity at ln p: polynomials of the cells, and its value at rest."""
        values = self.values[name].at(log_pressure)
        cells = values[:-1].reshape(-1, NODES) @ to_cells(NODES).T
        return np.ascontiguousarray(cells.reshape(-1, COEFFICIENTS).T), float(values[-1])


def interpolant(
    log_speed: np.ndarray, log_pressure: np.ndarray, evaluate: Callable[[np.ndarray, np.ndarray], Quantities]
) -> Interpolant | None:
    """Quantities of a map; None if series do not fall fast enough or are no less work than the map.

    Parameters
    ----------
    log_speed : ln|v a_T| of the map, any shape; -inf at rest
    log_pressure : ln p of the map, one-dimensional
    evaluate : function of v a_T (n,) and p (m,) to the quantities there, (m, n)
    """
    moving = log_speed[np.isfinite(log_speed)]
    if moving.size == 0:
        return None
    low, high = float(moving.min()), float(moving.max())
    count = max(1, math.ceil((high - low) / WIDTH))
    # A little wider than the map, lest rounding puts a point outside.
    width = (high - low) / count + 1e-9
    waiting = [(low + k * width, width) for k in range(count)]
    budget = _SHARE * log_speed.size * log_pressure.size
    for nodes in (_pressure_nodes(log_pressure), log_pressure):
        if nodes is not None and nodes.size <= _MOST_PRESSURES:
            made = _over_panels(waiting, nodes, nodes is not log_pressure, budget, evaluate)
            if made is not None:
                return made
    return None


def _over_panels(waiting, nodes, between, budget, evaluate):
    """`Interpolant` over panels (start, width), halved where they must be; None if that is not enough."""
    done: list[tuple[float, float, Quantities]] = []
    found: Quantities = {}
    evaluations = 0
    for _ in range(_HALVINGS + 1):
        x = np.concatenate([start + 0.5 * width * (1 + roots(NODES)) for start, width in waiting])
        evaluations += (x.size + 1) * nodes.size
        if evaluations > budget:
            return None
        found = evaluate(np.append(np.exp(x), 0.0), np.exp(nodes))
        if not all(np.isfinite(values).all() for values in found.values()):
            return None  # the model itself says where
        if between and not all(_falls(_over_pressure(nodes, values)) for values in found.values()):
            return None
        panels = {name: values[:, :-1].reshape(-1, len(waiting), NODES) for name, values in found.items()}
        good = np.all([np.max(last_coefficients(values), 0) <= TAIL for values in panels.values()], 0)
        done += [
            (*waiting[k], {name: values[:, k] for name, values in panels.items()})
            for k in np.flatnonzero(good)
        ]
        halves = [(*waiting[k], part) for k in np.flatnonzero(~good) for part in (0, 1)]
        waiting = [(start + part * width / 2, width / 2) for start, width, part in halves]
        if not waiting:
            break
    else:
        return None
    done.sort(key=lambda panel: panel[0])
    # What is at rest is the last of each evaluation.
    values = {
        name: np.concatenate([*(panel[2][name] for panel in done), found[name][:, -1:]], 1) for name in found
    }
    starts, widths = (np.array([panel[i] for panel in done]) for i in (0, 1))
    finest = widths.min()
    center = (starts[:, None] + widths[:, None] * (np.arange(CELLS) + 0.5) / CELLS).reshape(-1)
    return Interpolant(
        first=float(starts[0]),
        width=float(finest / CELLS),
        owner=np.repeat(np.arange(center.size), np.repeat(np.rint(widths / finest).astype(int), CELLS)),
        center=center,
        half=np.repeat(0.5 * widths / CELLS, CELLS),
        values={
            name: _over_pressure(nodes, x) if between else OverPressure(nodes, x, None)
            for name, x in values.items()
        },
        evaluations=evaluations,
    )


def _falls(found):
    """Whether series over ln p fall fast enough."""
    return np.max(last_coefficients(found.values.T)) <= PRESSURE_TAIL


def difference(found: Quantities, exact: Quantities) -> float:
    """Largest relative difference, of a quantity that changes its sign of its largest value; inf if none."""
    worst = 0.0
    for name, values in exact.items():
        changes = values.min() < 0 < values.max()
        scale = np.max(np.abs(values)) if changes else np.abs(values)
        off = np.abs(found[name] - values)
        ratio = off / np.where(scale > 0, scale, 1.0)
        ratio = np.where((scale > 0) | (off == 0), ratio, np.inf)
        worst = max(worst, float(np.max(np.where(np.isnan(ratio), np.inf, ratio))))
    return worst


def a_few(values: np.ndarray) -> np.ndarray:
    """A few of the values, equally spread in their order, the smallest and the largest among them."""
    chosen = np.unique(np.linspace(0, values.size - 1, _COMPARED).round().astype(int))
    return np.sort(values)[chosen]


def _over_pressure(nodes, values):
    """`OverPressure` of values (m, n) at nodes of a series; the powers lead from the first to the last."""
    alike = np.sign(values[0]) * np.sign(values[-1]) > 0
    ends = (np.log(np.abs(np.where(alike, x, 1.0))) for x in (values[0], values[-1]))
    slope = -np.subtract(*ends) / (nodes[-1] - nodes[0])
    powers = np.exp(np.multiply.outer(nodes - 0.5 * (nodes[0] + nodes[-1]), slope))
    return OverPressure(nodes, values / powers, slope)


def _pressure_nodes(log_pressure):
    """ln p of the nodes; None where there are hardly more pressures."""
    low, high = log_pressure.min(), log_pressure.max()
    count = math.ceil(_PRESSURES + _PRESSURES_EACH * (high - low))
    if log_pressure.size <= 1.3 * count:
        return None
    return low + 0.5 * (high - low) * (1 + roots(count))
