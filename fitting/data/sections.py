"""Sections of the records of friction rigs: parts with one direction, velocity and pressure."""

import itertools
from collections.abc import Sequence

import numpy as np

from rubberfric.base import warn_caller

Table = dict[str, np.ndarray]  # quantity in SI -> values of all rows

# Relative change of velocity or pressure between successive rows, at which a new section begins.
_STEP = 0.1
# Part of the range of positions by which a stroke turns back at its end, and within which it may rest there.
_TURN = 0.05
# Relative standard deviation of the velocity of a section, beyond which its mean is doubtful.
_VARYING = 0.2


def velocity_of_strokes(t: np.ndarray, x: np.ndarray, history: list[str]) -> np.ndarray:
    """Return the median of dx/dt in the stroke of each row [m/s], from times [s] and positions [m].

    A stroke ends where the position turns back by more than 5 % of its range, so that noise does not end it.
    Rows within 5 % of the ends of a stroke, where the sample may rest, do not count.
    """
    ends, extreme, direction = [0], 0, 0.0
    limit = _TURN * np.ptp(x)
    for i in range(1, x.size):
        if direction == 0 and abs(x[i] - x[0]) > limit:
            direction, extreme = np.sign(x[i] - x[0]), i
        if direction * (x[i] - x[extreme]) >= 0:
            extreme = i
        elif direction and direction * (x[extreme] - x[i]) > limit:
            ends.append(extreme)
            direction, extreme = -direction, i
    ends.append(x.size)
    v = np.empty(x.size)
    for first, last in itertools.pairwise(ends):
        stroke = x[first:last]
        speeds = np.diff(stroke) / np.diff(t[first:last])
        part = (stroke[1:] - stroke.min()) / max(np.ptp(stroke), np.finfo(float).tiny)
        moving = speeds[(part > _TURN) & (part < 1 - _TURN)]
        v[first:last] = np.median(moving) if moving.size else 0.0
    history.append(f"v = median of dx / dt in each of {len(ends) - 1} strokes")
    return v


def sections_of(where: str, table: Table, history: list[str]) -> list[np.ndarray]:
    """Return the rows of each section of a record: one direction, velocity and pressure. Rests are left out.

    The direction is the sign of v, or of the friction if v has one sign. A section ends where v or p changes
    by more than 10 % from a row to the next.
    """
    v, sign = table["v"], direction_of(table)
    moving = v != 0
    if not moving.all():
        history.append(f"{np.count_nonzero(~moving)} of {v.size} rows at rest left out")
    if not moving.any():
        raise ValueError(f"{where}: v is 0 in all rows; must have rows that slide")
    new = sign[1:] != sign[:-1]
    for values in (np.abs(v), table.get("p")):
        if values is not None:
            new |= np.abs(np.diff(values)) > _STEP * np.maximum(values[1:], values[:-1])
    sections = np.split(np.arange(v.size), np.flatnonzero(new) + 1)
    return [rows for rows in sections if moving[rows[0]]]


def direction_of(table: Table) -> np.ndarray:
    """Return the direction of sliding of every row, 1 or -1, and 0 at rest."""
    v = np.sign(table["v"])
    if v.min() < 0 < v.max():
        return v
    friction = table["F_t"] if "F_t" in table else table["mu"]
    return np.where(friction < 0, -1.0, 1.0) * np.abs(v)


def warn_of_varying_velocity(
    where: str, table: Table, sections: Sequence[np.ndarray], history: list[str]
) -> None:
    """Warn if the velocity changes much within a section, as in sinusoidal motion, before means are taken."""
    speed = np.abs(table["v"])
    largest = max(float(speed[rows].std() / speed[rows].mean()) for rows in sections)
    if largest > _VARYING:
        text = f"the velocity varies by up to {100 * largest:.0f} % within a section, whose mean is used"
        history.append(text)
        warn_caller(f"{where}: {text}; constant velocities are more accurate", UserWarning)
