"""Holes in measured heights: numbers such as -9999, 32767 and 1e38 for missing heights, and outliers."""

import numpy as np

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import POSITIVE, as_leaf, check_values, warn_caller
from rubberfric.io.text_tables.units import plain_unit
from rubberfric.roughness.heights import find_outliers
from rubberfric.roughness.topography import LENGTH_UNITS

# A spectrum of interpolated heights is too low. Above this share of holes it says little about the surface.
MOST_HOLES = 0.25
# Units of lengths in the spelling of `plain_unit` [m].
LENGTHS = {unit: length for unit, length in LENGTH_UNITS.items() if unit == plain_unit(unit)}
# No height in any unit is as large. 1.7e38 and 3.4e38 stand for holes.
_NO_HEIGHT = 1e30
# Numbers that often stand for holes.
_USUAL_SENTINELS = frozenset((-999.0, 9999.0, -9999.0, 99999.0, -99999.0, 999999.0, -999999.0))
# Largest numbers of 16 bits, at which detectors saturate.
_LIMITS = frozenset((-32768.0, -32767.0, 32767.0, 65535.0))
# A usual number is a hole if its distance from the heights exceeds this share of their range.
_GAP = 0.05
# Fewer different heights, as of a step, do not tell a hole from a height.
LEAST_DIFFERENT = 8


def without_sentinels(path: StrPath, heights: np.ndarray) -> np.ndarray:
    """Return heights with NaN in place of numbers that stand for holes, and warn about them.

    The smallest or largest number of the heights stands for holes if

    - its absolute value is at least 1e30,
    - it occurs twice or more, and is further from the other heights than their whole range,
    - it is a usual one (-9999, 9999, ...), and is further from the others than 5 % of their range,
    - it is a limit of 16 bits (32767, -32768, 65535), and occurs twice or more.

    Except for the first rule, at least eight different heights must remain.

    Parameters
    ----------
    path : name of the file in the warning
    heights : any shape, in the unit of the file
    """
    huge = np.abs(heights) >= _NO_HEIGHT
    counts = {float(heights[huge][0]): int(huge.sum())} if huge.any() else {}
    heights = np.where(huge, np.nan, heights)
    while (value := _sentinel(heights[np.isfinite(heights)])) is not None:
        counts[value] = int(np.sum(heights == value))
        heights[heights == value] = np.nan
    for value, count in counts.items():
        warn_caller(f"{path}: {count} heights {value:g} are taken as holes", UserWarning)
    return heights


def _sentinel(heights: np.ndarray) -> float | None:
    """Return the smallest or largest of finite heights if it stands for holes, otherwise None."""
    values, counts = np.unique(heights, return_counts=True)
    if values.size <= LEAST_DIFFERENT:
        return None
    for value, count, nearest, rest in (
        (values[0], counts[0], values[1], values[1:]),
        (values[-1], counts[-1], values[-2], values[:-1]),
    ):
        gap, size = abs(value - nearest), rest[-1] - rest[0]
        usual = float(value) in _USUAL_SENTINELS and gap > _GAP * size
        if usual or (count > 1 and (gap > size or float(value) in _LIMITS)):
            return float(value)
    return None


def outliers_of(
    path: StrPath, heights: np.ndarray, threshold: float | None, profiles: bool = False
) -> np.ndarray:
    """Return a mask of outliers, and warn about them. All False if the threshold is None."""
    if threshold is None:
        return np.zeros(heights.shape, bool)
    name = f"{path}: outliers"
    check_values(name, as_leaf(name, threshold, 0), POSITIVE)
    mask = find_outliers(heights, threshold, profiles=profiles)
    if mask.any():
        warn_caller(
            f"{path}: {mask.mean():.2%} of the heights are outliers and are interpolated", UserWarning
        )
    return mask
