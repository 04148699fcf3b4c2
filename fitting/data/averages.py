r"""Mean of several runs at equal conditions, with a standard error from their scatter.

.. math:: \sigma = t\, \frac{s}{\sqrt{n}}, \qquad s^2 = \frac{\sum (\mu_i - \bar\mu)^2}{n - 1}

t is the quantile at 0.8413 of Student's distribution with n - 1 degrees of freedom, which tends to 1. It is
1.84 for two runs, 1.32 for three, 1.20 for four and 1.06 for ten. The mean plus or minus sigma contains the
true value with the probability 68.3 % [Student, Biometrika 6, 1 (1908)].

The scatter of two or three runs is known badly, and conditions whose runs agree by chance would dominate a
fit. Therefore the relative scatter is pooled over all conditions by default,

.. math:: s_\mathrm{rel}^2 = \frac{\sum_c \sum_i (\mu_{ci} / \bar\mu_c - 1)^2}{\sum_c (n_c - 1)}
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from fitting.data.kinds import FrictionData
from rubberfric.base import POSITIVE, as_leaf, check_values, shown

# Default of the largest relative difference of velocities, and of pressures, of one condition.
_TOLERANCE = 0.05
# Default of the largest difference of temperatures of one condition [K].
_KELVIN = 2.0


def student_factor(freedom: float) -> float:
    """Return the factor on a standard error that was estimated with the given degrees of freedom.

    The interval of plus or minus the product contains the true value with the probability 68.3 %.
    """
    below_one_sigma = scipy.special.ndtr(1.0)
    return float(scipy.special.stdtrit(freedom, below_one_sigma))


def average(
    runs: FrictionData | Sequence[FrictionData],
    *,
    pooled: bool = True,
    tolerance: float = _TOLERANCE,
    temperature_tolerance: float = _KELVIN,
) -> FrictionData:
    r"""Return the mean friction at each condition, with the scatter of the runs as error.

    .. math:: \sigma = t_{n-1}\, s / \sqrt{n}

    See `fitting.data.averages` for the formulas and their sources.

    Parameters
    ----------
    runs : data sets, or one that contains repeated conditions
        Every point is a run. Errors of the runs are used only if no condition was measured twice.
    pooled : bool
        If True, one relative scatter is estimated from all conditions, and the result has `relative`. If
        False, each condition has its own `sigma`, and needs at least two runs.
    tolerance : largest relative difference of velocities, and of pressures, of one condition [-]
    temperature_tolerance : largest difference of temperatures of one condition [K]

    Returns
    -------
    FrictionData with a point for each condition, by rising velocity, and the steps in `history`

    Raises
    ------
    ValueError : `runs` are not friction data, only some of them have temperatures, a mean is not > 0 and
        `pooled` is True, or a condition has one run and `pooled` is False

    Examples
    --------
    >>> runs = [fitting.FrictionData([0.1], [mu], pressure=2e5) for mu in (0.80, 0.82, 0.87)]
    >>> data = fitting.average(runs, pooled=False)
    >>> round(float(data.friction[0]), 4), round(float(data.sigma[0]), 4)
    (0.83, 0.0275)
    """
    sets = [runs] if isinstance(runs, FrictionData) else runs
    if not isinstance(sets, list | tuple) or not sets or not all(isinstance(r, FrictionData) for r in sets):
        raise ValueError(f"runs = {shown(runs)}: must be FrictionData, or a list of them")
    if not isinstance(pooled, bool):
        raise ValueError(f"pooled = {shown(pooled)}: must be True or False")
    for name, value in (("tolerance", tolerance), ("temperature_tolerance", temperature_tolerance)):
        check_values(name, as_leaf(name, value, 0), POSITIVE)
    points = _points(sets)
    groups = _groups(points, tolerance, temperature_tolerance)
    counts = np.array([rows.size for rows in groups])
    means = {name: np.array([values[rows].mean() for rows in groups]) for name, values in points.items()}
    scatter = _scatter(points["friction"], means["friction"], groups, counts, pooled)
    kept = {name: means.pop(name) for name in ("sigma", "relative") if name in means}
    errors = kept if scatter is None else {scatter.field: scatter.error}
    own = [line for line in sets[0].history if all(line in run.history for run in sets)]
    text = f"mean of {_range(counts)} at {counts.size} condition{'s' * (counts.size > 1)}"
    own_errors = "errors of the runs are kept" if kept else "errors are unknown"
    about = f"no scatter, {own_errors}" if scatter is None else scatter.text
    names = dict.fromkeys(run.name for run in sets)
    name = next(iter(names)) if len(names) == 1 else ""
    history = (*own, f"{text}; {about}")
    return FrictionData(**means, **errors, name=name, history=history, check_units=False)


class _Scatter(NamedTuple):
    field: str  # of FrictionData
    error: np.ndarray
    text: str


def _points(sets: Sequence[FrictionData]) -> dict[str, np.ndarray]:
    known = {run.temperature is not None for run in sets}
    if len(known) > 1:
        raise ValueError("runs: only some of them have a temperature: all or none must have one")
    names = ("velocity", "friction", "pressure", *(("temperature",) if known == {True} else ()))
    errors = [name for name in ("sigma", "relative") if all(getattr(r, name) is not None for r in sets)]
    points = {name: np.concatenate([getattr(run, name) for run in sets]) for name in (*names, *errors)}
    return points | {"velocity": np.abs(points["velocity"])}


def _groups(points, tolerance, kelvin) -> list[np.ndarray]:
    """Return the indices of the points of each condition, by rising velocity."""
    groups = [np.arange(points["velocity"].size)]
    for name in ("velocity", "pressure", "temperature"):
        if name in points:
            relative = name != "temperature"
            split = [
                _split(points[name], rows, tolerance if relative else kelvin, relative) for rows in groups
            ]
            groups = [rows for parts in split for rows in parts]
    return groups


def _split(values, rows, tolerance, relative) -> list[np.ndarray]:
    """Split rows where a value exceeds the smallest value of the group by more than the tolerance."""
    rows = rows[np.argsort(values[rows], kind="stable")]
    starts = [0]
    for i, value in enumerate(values[rows]):
        low = values[rows[starts[-1]]]
        if value - low > tolerance * (low if relative else 1.0):
            starts.append(i)
    return np.split(rows, starts[1:])


def _scatter(friction, means, groups, counts, pooled) -> _Scatter | None:
    freedom = int((counts - 1).sum())
    if freedom == 0 and pooled:
        return None
    if pooled:
        check_values(
            "mean friction of pooled runs", means, (f"{POSITIVE[0]}; pass pooled=False", POSITIVE[1])
        )
        ratios = [friction[rows] / mean - 1 for rows, mean in zip(groups, means, strict=True)]
        spread = np.sqrt(sum((ratio**2).sum() for ratio in ratios) / freedom)
        factor = student_factor(freedom)
        if spread == 0:
            return None
        text = (
            f"scatter of a run {100 * spread:.3g} %, pooled, degrees of freedom: {freedom}; relative ="
            f" {factor:.4g} x scatter / sqrt(runs)"
        )
        return _Scatter("relative", factor * spread / np.sqrt(counts), text)
    if counts.min() < 2:
        raise ValueError(
            f"pooled=False: {np.count_nonzero(counts < 2)} of {counts.size} conditions have one run: must"
            " have two or more; measure again, or pass pooled=True"
        )
    spreads = np.array([friction[rows].std(ddof=1) for rows in groups])
    factors = np.array([student_factor(n - 1) for n in counts])
    text = f"sigma = t x scatter / sqrt(runs) of each condition, t = {_numbers(factors)}"
    return _Scatter("sigma", factors * spreads / np.sqrt(counts), text)


def _range(counts) -> str:
    low, high = int(counts.min()), int(counts.max())
    return f"{low} run{'s' * (low > 1)}" if low == high else f"{low} to {high} runs"


def _numbers(values) -> str:
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return low if low == high else f"{low} to {high}"
