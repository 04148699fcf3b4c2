r"""Strokes of sinusoidal motion: velocity, middle of the stroke, and bins of the speed.

The position of a rig such as SRV, TE77 or a crank drive is x = a sin(2 pi f t), with the stroke 2 a. `motion`
adds the velocity that the table lacks:

    t, x               dx/dt, the slope of a cubic that is fitted to the rows within 1/20 of a cycle
                       [Savitzky and Golay, Anal. Chem. 36, 1627 (1964)]
    x, frequency       v = +- 2 pi f sqrt((x - x_min) (x_max - x)) in each stroke
    t, frequency       v = pi f stroke cos(2 pi f t - phi), with the phase phi of the friction, which has the
    and stroke         sign of v. The given f is corrected so that phi does not drift.

`fold="middle"` takes the middle 20 % of each stroke, in which a sinusoidal velocity is within 2 % of its
largest value. `fold="speeds"` takes bins of \|v\|, five per decade, down to 10 % of the largest value. Both
leave out the turning points, where the friction is static and the rig deforms.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fitting.data.sections import Table, direction_of, friction_of, turns_of
from rubberfric.base import POSITIVE, as_leaf, check_values
from rubberfric.io import stated_frequency, stated_stroke

# Phase of a full period [rad].
_TURN = 2 * np.pi
# Values of `fold` for strokes whose velocity varies.
FOLDS = ("middle", "speeds")
# Part of a stroke, around its middle, that is "middle": |v| >= 0.98 of its largest value in a sinusoid.
MIDDLE = 0.2
# Bins of the speed per decade. Friction varies by some percent within a bin.
PER_DECADE = 5
# Smallest speed that is used, relative to the largest one of the stroke.
SLOWEST = 0.1
# Largest relative difference of the speeds of two strokes that are folded.
SAME_SPEED = 0.1
# Part of a cycle on both sides of a row, whose rows give its velocity. The error of a cubic is 0.01 % there.
_WINDOW = 1 / 20
# Smallest number of rows of a stroke, so that the window of a cubic contains five.
_ROWS = 20
# Part of the largest speed below which the sign of v does not end a stroke, because it may be noise.
_NO_SPEED = 0.05
# A stroke at an end of the record is complete if it has this part of the length of its neighbour.
_COMPLETE = 0.9
# Largest relative difference between the given frequency and that of the friction.
_FREQUENCY = 0.05


class Sinusoid(NamedTuple):
    """Motion that the caller states, or the lines above the table: frequency [Hz] and stroke [m], or None."""

    frequency: float | None = None
    stroke: float | None = None

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, unless the numbers are > 0."""
        for name, value in self._asdict().items():
            if value is not None:
                check_values(f"{where}: {name}", as_leaf(f"{where}: {name}", value, 0), POSITIVE)


class Stroke(NamedTuple):
    """Rows of a stroke, its path [m] from the turning point, and its direction, 1 or -1."""

    rows: np.ndarray
    path: np.ndarray
    direction: float


def motion(where: str, table: Table, sinusoid: Sinusoid, path: object, history: list[str]) -> Table:
    """Return the table of a record with the velocity v [m/s], from its columns or the given motion.

    Parameters
    ----------
    where : file or data frame in messages
    path : file whose lines above the table may state frequency and stroke, or None

    Raises
    ------
    ValueError : the columns and the given motion do not determine v, or state it twice
    """
    known = "v" if "v" in table else "t and x" if {"t", "x"} <= table.keys() else None
    unused = {"stroke": sinusoid.stroke} if known or "x" in table else {}
    unused |= {"frequency": sinusoid.frequency} if known else {}
    for name, value in unused.items():
        if value is not None:
            raise ValueError(f"{where}: {name} = {value:g}: must not be given; the table has {known or 'x'}")
    if known == "v":
        return table
    if known:
        return table | {"v": _derivative(where, table["t"], table["x"], history)}
    frequency = sinusoid.frequency or _stated(stated_frequency, path, _TURN)
    stroke = sinusoid.stroke or _stated(stated_stroke, path)
    if "x" in table and frequency is not None:
        return table | {"v": _harmonic(where, table["x"], frequency, history)}
    if "t" in table and frequency is not None and stroke is not None:
        return table | {"v": _in_phase(where, table, frequency, stroke, history)}
    missing = [name for name, value in (("frequency", frequency), ("stroke", stroke)) if value is None]
    if "x" in table:
        what = "give frequency=... [Hz]"
    elif "t" in table:
        units = {"frequency": "[Hz]", "stroke": "[m], from one turning point to the other"}
        what = "give " + " and ".join(f"{name}=... {units[name]}" for name in missing)
    else:
        what = "add v, t and x, x with frequency=... [Hz], or t with frequency=... [Hz] and stroke=... [m]"
    raise ValueError(f"{where}: the columns do not determine v: {what}")


def _stated(reader, path, unit=1.0):
    """Return the number that the lines above a table state, in the given unit, or None."""
    value = None if path is None else reader(path)
    return None if value is None else value / unit


def _derivative(where, t, x, history):
    """Return dx/dt [m/s] of each row, from a cubic through the rows within 1/20 of a cycle."""
    from scipy.signal import savgol_filter  # its import takes time

    if np.any(np.diff(t) <= 0):
        raise ValueError(f"{where}: t must rise from row to row, to give the velocity with x")
    ends = turns_of(x)
    if min(np.diff(ends[1:-1]), default=np.ptp(ends)) < _ROWS:
        raise ValueError(f"{where}: a stroke must have {_ROWS} rows, so that t and x give the velocity")
    v = np.empty(x.size)
    for first, last in itertools.pairwise(ends):
        half = max(2, round(2 * _WINDOW * (last - first)))
        low, high = max(first - half, 0), min(last + half, x.size)
        length = min(2 * half + 1, (high - low - 1) // 2 * 2 + 1)
        if length < 5:  # an incomplete stroke at an end of the record
            v[first:last] = np.gradient(x[low:high], t[low:high])[first - low : last - low]
            continue
        even = np.linspace(t[low], t[high - 1], high - low)
        own = np.interp(even, t[low:high], x[low:high])
        slopes = np.asarray(savgol_filter(own, length, 3, deriv=1, delta=even[1] - even[0]))
        v[first:last] = np.interp(t[first:last], even, slopes)
    history.append("v = dx/dt, slope of a cubic through the rows within 1/20 of a cycle")
    return v


def _harmonic(where, x, frequency, history):
    """Return the velocity [m/s] of a harmonic motion at the positions x [m], with the sign of dx."""
    ends, v = turns_of(x), np.empty(x.size)
    if len(ends) < 3:
        raise ValueError(f"{where}: x must turn back at least once, so that its frequency gives the velocity")
    for first, last in itertools.pairwise(ends):
        # The turning point belongs to both strokes.
        own = x[first : last + 1]
        speed = _TURN * frequency * np.sqrt((own - own.min()) * (own.max() - own))
        v[first:last] = (speed * np.sign(own[-1] - own[0]))[: last - first]
    history.append(f"v = 2 pi f sqrt((x - x_min) (x_max - x)) in each stroke, f = {frequency:g} Hz")
    return v


def _in_phase(where, table, frequency, stroke, history):
    """Return the velocity [m/s] of a harmonic motion that is in phase with the friction."""
    t, friction = table["t"], friction_of(table)
    time = t - t[0]
    cycles = int(time[-1] * frequency)
    if cycles < 1 or t.size < 2 * _ROWS * cycles or np.any(np.diff(t) <= 0):
        raise ValueError(
            f"{where}: t must rise over at least one cycle of {1 / frequency:g} s, with {2 * _ROWS} rows in"
            " each, so that the friction gives the phase of the motion"
        )
    if not friction.min() < 0 < friction.max():
        raise ValueError(
            f"{where}: the friction has one sign in all rows: must have the sign of the motion; if each row"
            " is the mean of a cycle, add a column v"
        )
    own = frequency
    for _ in range(3 if cycles > 1 else 0):
        of_cycle = np.minimum((time * own).astype(int), cycles - 1)
        turn = friction * np.exp(-1j * _TURN * own * time)
        phases = np.unwrap(np.angle([np.mean(turn[of_cycle == k]) for k in range(cycles)]))
        own += float(np.polyfit(np.arange(cycles) / own, phases, 1)[0]) / _TURN
    if abs(own / frequency - 1) > _FREQUENCY:
        raise ValueError(
            f"{where}: frequency = {frequency:g} Hz: the friction repeats with {own:.4g} Hz; must agree"
            f" within {_FREQUENCY:.0%}"
        )
    angle = _TURN * own * time
    columns = np.stack([np.cos(angle), np.sin(angle), np.ones(t.size)], axis=1)
    cosine, sine, _ = np.linalg.lstsq(columns, friction, rcond=None)[0]
    phase = float(np.arctan2(sine, cosine))
    history.append(
        f"v = pi f stroke cos(2 pi f t - phi), f = {own:.6g} Hz and phi = {np.degrees(phase):.3g} deg from"
        f" the friction, stroke = {stroke:g} m"
    )
    return np.pi * own * stroke * np.cos(angle - phase)


def strokes_of(where: str, table: Table, history: list[str]) -> list[Stroke]:
    """Return the strokes of a record with v, without incomplete ones at its ends.

    A stroke ends where x turns back (`fitting.data.sections.turns_of`), or where v changes its sign if there
    is no x. The path is x, or the integral of v.
    """
    v, size = direction_of(table) * np.abs(table["v"]), table["v"].size
    if "x" in table:
        ends = turns_of(table["x"])
    else:
        moving = np.flatnonzero(np.abs(v) > _NO_SPEED * np.abs(v).max())
        turned = np.flatnonzero(np.diff(np.sign(v[moving]))) + 1
        ends = [0, *moving[turned], size]
    steps = np.diff(table["t"], prepend=table["t"][0]) if "t" in table else np.ones(size)
    strokes = []
    for first, last in itertools.pairwise(ends):
        rows = np.arange(first, last)
        own = table["x"][rows] if "x" in table else np.cumsum(v[rows] * steps[rows])
        direction = np.sign(np.sum(v[rows]))
        if direction:
            strokes.append(Stroke(rows, direction * own, direction))
    lengths = [np.ptp(stroke.path) for stroke in strokes]
    if len(strokes) < 2:
        raise ValueError(f"{where}: the motion does not turn back: fold must be left out")
    # The later one first, so that its index stays valid.
    for end, neighbour in ((-1, -2), (0, 1)):
        if len(strokes) > 2 and lengths[end] < _COMPLETE * lengths[neighbour]:
            del strokes[end], lengths[end]
            history.append(f"incomplete {'last' if end else 'first'} stroke left out")
    return strokes


def middle_of(where: str, stroke: Stroke) -> np.ndarray:
    """Return the rows in the middle of a stroke."""
    low, high = stroke.path.min(), stroke.path.max()
    inside = np.abs(stroke.path - (low + high) / 2) <= MIDDLE / 2 * (high - low)
    if not inside.any():
        raise ValueError(f"{where}: no row in the middle {MIDDLE:.0%} of a stroke; must have more rows")
    return stroke.rows[inside]


class Binned(NamedTuple):
    """Rows of each bin of the speed in each stroke, and mean speeds [m/s]."""

    rows: list[dict[int, np.ndarray]]  # of each stroke: bin -> rows
    speed: list[dict[int, float]]  # of each stroke: bin -> mean over all strokes of this largest speed


def speeds_of(where: str, table: Table, strokes: Sequence[Stroke], kept: Sequence[np.ndarray]) -> Binned:
    """Return the rows `kept` of each stroke in bins of the speed, without slow rows at the turning points."""
    speed = np.abs(table["v"])
    largest = np.array([speed[middle_of(where, stroke)].mean() for stroke in strokes])
    top = largest.max()
    rows: list[dict[int, np.ndarray]] = []
    for own, fastest in zip(kept, largest, strict=True):
        with np.errstate(divide="ignore"):
            number = np.floor(PER_DECADE * np.log10(top / speed[own]))
        # The largest speed of a sinusoid is 0.7 % above the mean in the middle, which is the upper edge.
        number = np.maximum(number, 0)
        slowest = PER_DECADE * np.log10(top / (SLOWEST * fastest)) - 1
        bins = np.unique(number[number <= slowest + 1e-9]).astype(int)
        rows.append({int(k): own[number == k] for k in bins})
    means: list[dict[int, float]] = [{} for _ in rows]
    for i, fastest in enumerate(largest):
        if means[i]:
            continue
        alike = np.flatnonzero(np.abs(largest - fastest) <= SAME_SPEED * fastest)
        for k in {k for j in alike for k in rows[j]}:
            pooled = float(np.concatenate([speed[rows[j][k]] for j in alike if k in rows[j]]).mean())
            for j in alike:
                means[j].setdefault(k, pooled)
    return Binned(rows, means)


def slowing_hysteresis(
    table: Table, sections: Sequence[np.ndarray], strokes: Sequence[tuple[Stroke, Stroke]], speeds: np.ndarray
) -> list[str]:
    """Return a line about mu while slowing down minus mu while speeding up at equal speed, or [].

    Parameters
    ----------
    sections : rows of a bin of the speed, forward and backward in turn
    strokes : stroke forward and backward of each pair of sections
    speeds : of each pair [m/s]
    """
    friction, differences, of = friction_of(table), [], []
    for k, pair in enumerate(strokes):
        halves = []
        for rows, stroke in zip(sections[2 * k : 2 * k + 2], pair, strict=True):
            middle = (stroke.path.min() + stroke.path.max()) / 2
            slowing = stroke.path[np.searchsorted(stroke.rows, rows)] > middle
            if not slowing.any() or slowing.all():
                break
            halves.append(friction[rows[slowing]].mean() - friction[rows[~slowing]].mean())
        if len(halves) == 2:
            differences.append((halves[0] - halves[1]) / 2)
            of.append(speeds[k])
    if not differences:
        return []
    change, of = np.array(differences), np.array(of)
    change *= -1.0 if np.median(friction[sections[0]]) < 0 else 1.0
    mean = {v: change[of == v].mean() for v in np.unique(of)}
    worst = max(mean, key=lambda v: abs(mean[v]))
    return [
        f"mu while slowing down minus mu while speeding up: {change.mean():+.2g} on average,"
        f" {mean[worst]:+.2g} at {worst:.3g} m/s"
    ]
