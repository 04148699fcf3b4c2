"""Sections of the records of friction rigs: parts with one direction, velocity and pressure."""

import itertools
import re
from collections.abc import Sequence

import numpy as np

from rubberfric.base import shown, warn_caller
from rubberfric.io import COLUMNS

Table = dict[str, np.ndarray]  # quantity in SI -> values of all rows

# Relative change of velocity or pressure between successive rows, at which a new section begins.
_STEP = 0.1
# Part of the range of positions by which a stroke turns back at its end, and within which it may rest there.
_TURN = 0.05
# Relative standard deviation of the velocity of a section, beyond which its mean is doubtful.
_VARYING = 0.2
# Ratio of the speeds in the middle and near the ends of strokes, beyond which the motion is not of constant
# velocity. It is 1.48 for a sinusoid.
_SINUSOIDAL = 1.25
# Smallest number of rows in the middle of the strokes for this ratio.
_ENOUGH = 10
# Part of a section that the rule for settling may remove. Beyond it, the rule has too few rows to judge.
_MOST_SETTLING = 0.5
_AMOUNT = re.compile(r"\s*([-+.\deE]+)\s*([a-z]+)\s*")


def turns_of(x: np.ndarray) -> list[int]:
    """Return the first row of each stroke of positions x, and the number of rows.

    A stroke ends where the position turns back by more than 5 % of its range, so that noise does not end it.
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
    return [*ends, x.size]


def velocity_of_strokes(where: str, t: np.ndarray, x: np.ndarray, history: list[str]) -> np.ndarray:
    """Return the median of dx/dt in the stroke of each row [m/s], from times [s] and positions [m].

    Rows within 5 % of the ends of a stroke, where the sample may rest, do not count. Warn if the sample is
    much faster in the middle of the strokes, as in sinusoidal motion.
    """
    ends = turns_of(x)
    v, slow, fast = np.empty(x.size), 0, 0
    for first, last in itertools.pairwise(ends):
        stroke = x[first:last]
        speeds = np.diff(stroke) / np.diff(t[first:last])
        part = (stroke[1:] - stroke.min()) / max(np.ptp(stroke), np.finfo(float).tiny)
        moving = speeds[(part > _TURN) & (part < 1 - _TURN)]
        v[first:last] = np.median(moving) if moving.size else 0.0
        from_middle = np.abs(part - 0.5)
        fast += np.count_nonzero(from_middle < 0.1)
        slow += np.count_nonzero((from_middle > 0.25) & (from_middle < 0.45))
    history.append(f"v = median of dx / dt in each of {len(ends) - 1} strokes")
    # Both ranges of x hold equal numbers of rows at constant velocity, as their lengths are 0.2 and 2 x 0.2.
    if slow > 2 * _SINUSOIDAL * fast > 2 * _SINUSOIDAL * _ENOUGH:
        _warn_of_strokes(where, "the velocity varies along the strokes, whose median is used", history)
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
        _warn_of_strokes(where, text, history)


def _warn_of_strokes(where: str, text: str, history: list[str]) -> None:
    history.append(text)
    advice = 'fold="middle" or fold="speeds" is for sinusoidal strokes'
    warn_caller(f"{where}: {text}; {advice}", UserWarning)


def friction_of(table: Table) -> np.ndarray:
    """Return mu of each row, with its sign."""
    return table["F_t"] / table["F_n"] if "F_t" in table else table["mu"]


def without_start(
    where: str, table: Table, sections: Sequence[np.ndarray], discard: str, history: list[str]
) -> list[np.ndarray]:
    """Return the rows of each section without its start.

    Parameters
    ----------
    discard : a length such as "10 mm", a time such as "2 s", or "settling"
        "settling" removes the rows before the number d of rows for which the marginal standard error of the
        rest, sum((mu - mean)^2) / (n - d)^2, is smallest (MSER) [White, Simulation 69, 323 (1997)].
    """
    amount, quantity = amount_of(where, discard)
    kept, removed = [], []
    for rows in sections:
        if quantity is None:
            count = _settling_rows(where, friction_of(table)[rows])
        else:
            # Sums of steps have rounding errors, so that a row at the end of the start may seem to be inside.
            inside = _distance(where, table, rows, quantity) < (1 - 1e-9) * amount
            count = int(np.count_nonzero(inside))
        removed.append(count)
        kept.append(rows[count:])
    sections_left = [rows for rows in kept if rows.size]
    if not sections_left:
        raise ValueError(
            f"{where}: discard = {discard!r}: leaves no row of {len(kept)} sections; must be less"
        )
    what = "rows before mu settles (MSER)" if quantity is None else f"first {discard.strip()}"
    lost = len(kept) - len(sections_left)
    short = f"; {lost} shorter sections left out" if lost else ""
    every = sum(rows.size for rows in sections)
    history.append(f"{what} of each of {len(kept)} sections discarded: {sum(removed)} of {every} rows{short}")
    return sections_left


def amount_of(where: str, discard: str) -> tuple[float, str | None]:
    """Return an amount in SI and its quantity, "x" or "t", or None for "settling"."""
    units = {unit: (name, factor) for name in ("x", "t") for unit, factor in COLUMNS[name].units.items()}
    if discard == "settling":
        return 0.0, None
    try:
        match = _AMOUNT.fullmatch(discard)
        name, factor = units[match[2]]  # pyright: ignore[reportOptionalSubscript]
        amount = factor * float(match[1])  # pyright: ignore[reportOptionalSubscript]
        if not 0 < amount < np.inf:
            raise ValueError
    except (TypeError, KeyError, ValueError):
        raise ValueError(
            f'{where}: discard = {shown(discard)}: must be "settling", or a length or time > 0 such as'
            f' "10 mm" or "2 s", in {", ".join(units)}'
        ) from None
    return amount, name


def _distance(where: str, table: Table, rows: np.ndarray, quantity: str) -> np.ndarray:
    """Return the sliding distance [m] or the time [s] from the start of a section."""
    if quantity == "t" and "t" not in table:
        raise ValueError(f"{where}: discard: must be a length, because the table has no column t")
    if quantity in table:
        return np.abs(table[quantity][rows] - table[quantity][rows[0]])
    if "t" not in table:
        raise ValueError(f"{where}: discard: a length needs a column x or t: the table must have one")
    steps = np.diff(table["t"][rows]) * np.abs(table["v"][rows[1:]])
    return np.concatenate([[0.0], np.cumsum(steps)])


def _settling_rows(where: str, friction: np.ndarray) -> int:
    """Return the number of rows before mu settles, by the marginal standard error rule."""
    n = friction.size
    if n < 3:
        return 0
    count = np.arange(n, 0, -1)
    # Deviations from the last value, so that the sums of squares do not cancel.
    rest = (friction - friction[-1])[::-1]
    total, square = np.cumsum(rest)[::-1], np.cumsum(rest**2)[::-1]
    error = (square - total**2 / count) / count.astype(float) ** 2
    allowed = int(_MOST_SETTLING * n)
    settled = int(np.argmin(error[: allowed + 1]))
    if settled == allowed:
        raise ValueError(
            f'{where}: discard = "settling": mu does not settle within half of a section of {n} rows; it must'
            " be a length or a time, or measure longer"
        )
    return settled
