r"""Tables of mu(v, p, T) with as few points as multilinear interpolation needs for a given error.

The scene is computed on a fine grid, uniform in ln v, ln p and T. The error of linear interpolation along
each axis bounds the total,

.. math:: e = \sup \left| \frac{\tilde\mu - \mu}{\mu} \right|,\qquad
          e_{vpT} \lesssim e_v + e_p + e_T

so each axis gets a share of the error. After each kept point of an axis, the next kept point is the farthest
one that this share allows. The returned error is the error on the fine grid, plus a quarter of the error of
leaving out every second fine point (linear interpolation is of second order), which estimates the error
between fine points.
"""

from collections.abc import Sequence

import numpy as np

from rubberfric.analysis.maps import friction_map
from rubberfric.base.checks import POSITIVE, as_leaf, between, check_values, shown
from rubberfric.base.quadrature import Quadrature
from rubberfric.io.results import AXES, FrictionTable
from rubberfric.scene.scene import Scene, iterates
from rubberfric.theory.structure import iterated

AxisRange = float | Sequence[float]

# Points of the initial grid per decade of velocity, so that no peak of the friction is missed.
_PER_DECADE = 16
# Fewest points of the initial grid along an axis, whose odd points estimate the error of the even points.
_AT_FIRST = 9
# Number of points along an axis from which no axis is refined further: eight doublings of the initial grid.
_MOST = 2049
_DEFAULT = Quadrature()


def friction_table(
    scene: Scene,
    velocity: AxisRange,
    pressure: AxisRange,
    temperature: AxisRange | None = None,
    *,
    error: float = 0.01,
    quadrature: Quadrature = _DEFAULT,
    title: str = "",
) -> FrictionTable:
    """Tabulate mu(v, p, T) for programs that interpolate it, on a grid refined to a given error.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : (lowest, highest), or a number [m/s], [Pa], [K]
        temperature None: every shift at its reference temperature.
    error : largest relative error of mu by multilinear interpolation, in v, p and T themselves
    quadrature : Quadrature, static
    title : title of the table in the file

    Returns
    -------
    FrictionTable with the estimated `error`; `rubberfric.io.write_friction` writes it

    Raises
    ------
    ValueError
        as `friction_map`; a range that is not (lowest, highest); no friction; temperatures of a heated scene
        that do not converge; an error that 2049 points per axis do not reach, for example across a jump.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> table = rf.analysis.friction_table(scene, (1e-3, 1e-1), 0.15e6, error=0.02)
    >>> table.velocity.size, table.error < 0.02
    (4, True)
    >>> bool(abs(table.at(0.05, 0.15e6) / rf.friction(scene, 0.05, 0.15e6) - 1) < 0.02)
    True
    """
    check_values("error", as_leaf("error", error, 0), between(1e-5, 0.5))
    ranges = {"velocity": velocity, "pressure": pressure, "temperature": temperature}
    ends = [_ends(name, x) for name, x in ranges.items() if x is not None]
    counts = [1 if low == high else _AT_FIRST for low, high in ends]
    if counts[0] > 1:
        decades = np.log10(ends[0][1] / ends[0][0])
        counts[0] = max(_AT_FIRST, 2 * int(np.ceil(0.5 * _PER_DECADE * decades)) + 1)
    shares = sum(count > 1 for count in counts)
    while True:
        axes = [_points(name, at, n) for name, at, n in zip(AXES, ends, counts, strict=False)]
        mu, area = _computed(scene, axes, quadrature)
        own = [_halved(axis, mu, 2 - k) / 4 for k, axis in enumerate(axes)]
        worst = [k for k, here in enumerate(own) if here > error / (4 * shares)]
        if not worst:
            break
        if max(counts[k] for k in worst) >= _MOST:
            raise ValueError(
                f"error = {error:g} is not reached: {_MOST} points of {AXES[worst[0]]} leave an"
                f" error of {4 * max(own):.2g}; increase error, or narrow the ranges so that mu does not jump"
            )
        counts = [2 * n - 1 if k in worst else n for k, n in enumerate(counts)]
    share = (error - sum(own)) / max(shares, 1)
    kept = [np.array(_kept(axis, mu, 2 - k, share)) for k, axis in enumerate(axes)]
    coarse = mu
    for k, keep in enumerate(kept):
        coarse, area = (np.take(values, keep, 2 - k) for values in (coarse, area))
    v, p, *T = (axis[keep] for axis, keep in zip(axes, kept, strict=True))
    table = FrictionTable(v, p, T[0] if T else None, coarse, area=area, title=title)
    interpolated = table.at(*(axis.reshape(-1, *[1] * k) for k, axis in enumerate(axes)))
    return table._replace(error=float(np.max(np.abs(interpolated / mu - 1))) + sum(own))


def _ends(name, axis_range):
    values = np.asarray(as_leaf(name, axis_range, np.ndim(axis_range)), float).ravel()
    check_values(name, values, POSITIVE)
    if values.size not in (1, 2) or values[0] > values[-1]:
        raise ValueError(f"{name} = {shown(axis_range)}: {name} must be (lowest, highest) or a number")
    return float(values[0]), float(values[-1])


def _points(name: str, ends: tuple[float, float], count: int) -> np.ndarray:
    return (np.linspace if name == "temperature" else np.geomspace)(*ends, count)


def _computed(scene, axes, quadrature):
    """Return mu and A/A0 on a grid, as arrays [temperature, pressure, velocity]."""
    whether = ("converged",) if iterates(scene) else ()
    solution = friction_map(
        scene, *axes, quantities=("friction", "area", *whether), quadrature=quadrature
    ).solution
    if solution.converged is not None and not np.all(solution.converged):
        bad = int(np.count_nonzero(~np.asarray(solution.converged)))
        raise ValueError(
            f"the {iterated(scene)} of the scene do not converge at {bad} points; narrow the ranges"
        )
    mu = np.asarray(solution.friction, float)
    if not (mu > 0).all():
        raise ValueError("friction is 0 at some points; it must be > 0 for a relative error")
    return mu, np.asarray(solution.area, float)


def _halved(axis, mu, place):
    """Return the largest relative error if every second point is interpolated from its neighbours."""
    if axis.size == 1:
        return 0.0
    values = np.moveaxis(mu, place, 0)
    part = ((axis[1:-1:2] - axis[:-2:2]) / (axis[2::2] - axis[:-2:2]))[:, None, None]
    between = (1 - part) * values[:-2:2] + part * values[2::2]
    return float(np.max(np.abs(between / values[1:-1:2] - 1)))


def _kept(axis, mu, place, share):
    """Return the indices of kept points of an axis, each as far from the previous as `share` allows."""
    values = np.moveaxis(mu, place, 0).reshape(axis.size, -1)
    kept = [0]
    while kept[-1] < axis.size - 1:
        first = last = kept[-1]
        while last < axis.size - 1:
            inside = slice(first + 1, last + 1)
            part = ((axis[inside] - axis[first]) / (axis[last + 1] - axis[first]))[:, None]
            between = (1 - part) * values[first] + part * values[last + 1]
            if last > first and np.max(np.abs(between / values[inside] - 1)) > share:
                break
            last += 1
        kept.append(last)
    return kept
