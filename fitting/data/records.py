r"""Records of friction rigs: zero of the load cells, sections, start-up parts, and reciprocating runs.

A record has rows in the order of time. A section is a part of it with one direction, velocity and pressure.
The steps below are done in this order, and each describes its effect in one line.

1. `without_zero` subtracts the line through the readings without load, before and after the run.
2. `without_start` removes the start of each section, a time, a length, or the part before mu settles.
3. `folded` combines sections of opposite directions, of which fold="middle" and fold="speeds" take parts
   (`fitting.data.strokes`),

   .. math:: \mu = \frac{F_t^+ - F_t^-}{F_n^+ + F_n^-}, \qquad
             \tan\beta = \frac{F_t^+ + F_t^-}{F_n^+ + F_n^-}

   which is exact for force axes that are turned by \beta from the sliding plane, and for a zero error of F_t
   [Burris and Sawyer, Tribol. Lett. 35, 17 (2009), doi:10.1007/s11249-009-9438-2].
4. `section_means` replaces each section by its mean.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.data.averages import student_factor
from fitting.data.sections import (
    Table,
    amount_of,
    direction_of,
    sections_of,
    velocity_of_strokes,
    warn_of_varying_velocity,
    without_start,
)
from fitting.data.strokes import (
    FOLDS,
    MIDDLE,
    PER_DECADE,
    SAME_SPEED,
    SLOWEST,
    Sinusoid,
    middle_of,
    motion,
    slowing_hysteresis,
    speeds_of,
    strokes_of,
)
from rubberfric.base import either, shown
from rubberfric.io import COLUMNS, Frame, as_frame, read_names, read_table

# Quantities of a record.
QUANTITIES = ("v", "F_t", "F_n", "mu", "p", "A", "T", "t", "x")
# Part of the largest change of the load, below which a row at either end of a record is without load.
_UNLOADED = 0.1
# Largest ratio of a reading without load to the largest reading.
_LARGEST_ZERO = 0.5
# Part of the median load, from which a row belongs to the run.
_LOADED = 0.9


class Steps(NamedTuple):
    """Options of `fitting.read` for records. `stroke` is the length of sinusoidal strokes [m]."""

    zero: bool = False
    discard: str | None = None
    fold: bool | str = False
    average: bool = False
    stroke: float | None = None

    def chosen(self) -> dict[str, Any]:
        """Return the options that differ from their defaults."""
        return {name: value for name, value in self._asdict().items() if value}

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, if an option has a wrong type or value."""
        for name in ("zero", "fold", "average"):
            value = getattr(self, name)
            if name == "fold" and isinstance(value, str) and value in FOLDS:
                continue
            if not isinstance(value, bool):
                also = f", {either([repr(way) for way in FOLDS])}" if name == "fold" else ""
                raise ValueError(f"{where}: {name} = {shown(value)}: must be True or False{also}")
        if self.discard is not None:
            amount_of(where, self.discard)
        if self.discard == "settling" and self.fold in FOLDS:
            raise ValueError(
                f'{where}: discard = "settling": must be a length or a time with fold = {self.fold!r},'
                " because the velocity varies"
            )
        if self.stroke is not None and self.fold not in FOLDS:
            raise ValueError(
                f'{where}: stroke = {shown(self.stroke)}: must come with fold="middle" or fold="speeds"'
            )


def read_record(
    path: Any, steps: Steps, frequency: float | None, layout: Mapping[str, Any], history: list[str]
) -> Frame:
    """Return the record of a rig in a table after the given steps, as a data frame.

    Parameters
    ----------
    path : file or data frame
    frequency : of sinusoidal strokes [Hz], or None
    layout : options of `fitting.read`, of which columns, block and bad_rows are used
    history : receives a line about each step

    Raises
    ------
    ValueError : as for `rubberfric.io.read_table`, a step needs a column that is missing, or no row is left
    """
    where, sinusoidal = str(path), steps.fold in FOLDS
    sinusoid = Sinusoid(frequency, steps.stroke)
    sinusoid.check(where)
    own = {name: layout[name] for name in ("columns", "block", "bad_rows") if name in layout}
    known = _quantities(path, layout)
    forces = {"F_t", "F_n"} <= known
    wanted = [name for name in QUANTITIES if name in known and name != ("mu" if forces else "F_t")]
    from_position = {"t", "x"} <= known and not {"v", "v_travel"} & known
    has_velocity = not (from_position or (sinusoidal and not {"v", "v_travel"} & known))
    if frequency is not None and not sinusoidal:
        raise ValueError(
            f'{where}: frequency = {frequency:g}: must not be given without fold="middle" or fold="speeds"'
        )
    needed = ("v",) if has_velocity else ("t", "x") if from_position else ()
    needed += () if forces else ("mu",)
    # "v" is optional, so that the time of the record may be 0.
    table = read_table(path, needed, (*wanted, "v"), increasing=False, history=history, **own)
    if steps.zero:
        table = without_zero(where, table, history)
    if sinusoidal:
        table = motion(where, table, sinusoid, None if isinstance(path, Frame) else path, history)
        table = _folded_strokes(where, table, steps, history)
    else:
        if from_position:
            table["v"] = velocity_of_strokes(where, table["t"], table["x"], history)
        table = _reduced(where, table, steps, history)
    return as_frame({f"{name} [{next(iter(COLUMNS[name].units))}]": values for name, values in table.items()})


def check_velocity(path: Any, layout: Mapping[str, Any]) -> None:
    """Raise ValueError, which names the options of records, if times and positions stand for the velocity."""
    known = _quantities(path, layout)
    if {"t", "F_t"} <= known and not {"v", "v_travel"} & known:
        stated = "" if "x" in known else ", frequency=... [Hz] and stroke=... [m]"
        constant = ", or fold=True or average=True if it is constant" if "x" in known else ""
        raise ValueError(
            f'{path}: no column v: add it to the table, or give fold="middle" or fold="speeds"{stated} if'
            f" the velocity is sinusoidal{constant}"
        )


def _quantities(path: Any, layout: Mapping[str, Any]) -> set[str]:
    names = read_names(path, layout.get("columns"), block=layout.get("block"))
    return {COLUMNS[name].name for name in names if name in COLUMNS}


def _reduced(where: str, table: Table, steps: Steps, history: list[str]) -> Table:
    """Return a record of constant velocities after the steps except `zero`."""
    sections = sections_of(where, table, history)
    if steps.discard is not None:
        sections = without_start(where, table, sections, steps.discard, history)
    over_time = steps.average and bool({"t", "x"} & table.keys())
    if steps.fold or over_time:
        warn_of_varying_velocity(where, table, sections, history)
    if steps.fold:
        return folded(table, sections, _cycles(where, table, sections), history)
    if over_time:
        return section_means(table, sections, history)
    rows = np.concatenate(sections)
    return {name: values[rows] for name, values in table.items()}


def _folded_strokes(where: str, table: Table, steps: Steps, history: list[str]) -> Table:
    """Return a row for each cycle of a sinusoidal record, or for each cycle and bin of the speed."""
    strokes = strokes_of(where, table, history)
    whole = [stroke.rows for stroke in strokes]
    kept = whole
    if steps.discard is not None:
        kept = without_start(where, table, whole, steps.discard, history)
        if len(kept) < len(whole):
            raise ValueError(f"{where}: discard = {steps.discard!r}: must be shorter than all strokes")
    count = sum(rows.size for rows in whole)
    if steps.fold == "middle":
        middle = [
            np.intersect1d(middle_of(where, stroke), rows) for stroke, rows in zip(strokes, kept, strict=True)
        ]
        if not all(rows.size for rows in middle):
            raise ValueError(f"{where}: discard = {steps.discard!r}: must leave the middle of the strokes")
        used = sum(rows.size for rows in middle)
        history.append(f"middle {MIDDLE:.0%} of each of {len(strokes)} strokes: {used} of {count} rows")
        return folded(table, middle, _cycles(where, table, middle), history)
    bins = speeds_of(where, table, strokes, kept)
    used = sum(rows.size for own in bins.rows for rows in own.values())
    numbers = {k for own in bins.rows for k in own}
    history.append(
        f"{len(numbers)} bins of |v|, {PER_DECADE} per decade, in each of {len(strokes)} strokes; turning"
        f" points below {SLOWEST:.0%} of the largest |v| left out: {count - used} of {count} rows"
    )
    sections, pairs, speeds, places = [], [], [], []
    for i, j in _cycles(where, table, [middle_of(where, stroke) for stroke in strokes]):
        for k in sorted(bins.rows[i].keys() & bins.rows[j].keys(), reverse=True):
            pairs.append((len(sections), len(sections) + 1))
            sections += [bins.rows[i][k], bins.rows[j][k]]
            speeds.append(bins.speed[i][k])
            places.append((strokes[i], strokes[j]))
    cycle = folded(table, sections, pairs, history, ("bin of a cycle", "bins of cycles"))
    history += slowing_hysteresis(table, sections, places, np.array(speeds))
    return cycle | {"v": np.array(speeds)}


def without_zero(where: str, table: Table, history: list[str]) -> Table:
    """Return the loaded rows of a record, with the zero of F_n and F_t subtracted.

    Rows at the start and at the end are without load if F_n differs from the first or last value by less than
    10 % of the largest difference. The zero is the line between the means of these two groups. With only one
    group, the zero is its mean. A zero above half of the largest reading is refused. The run begins and ends
    at 90 % of the median load.
    """
    if "F_n" not in table:
        raise ValueError(f"{where}: zero=True: the table must have F_n, and readings without load")
    load = table["F_n"]
    time = table.get("t", np.arange(load.size, dtype=float))
    zero = min(load[0], load[-1], key=abs)
    change = np.abs(load - zero)
    if abs(zero) > _LARGEST_ZERO * np.abs(load).max():
        raise ValueError(
            f"{where}: zero=True: must have rows without load before or after the run: F_n begins with"
            f" {load[0]:g} N and ends with {load[-1]:g} N; leave zero out, or keep the readings without load"
        )
    above = np.flatnonzero(change > 0.5 * change.max())
    first, last = above[0], above[-1] + 1
    limit = _UNLOADED * change.max()
    groups = {
        "before": np.flatnonzero(np.abs(load[:first] - load[0]) < limit),
        "after": last + np.flatnonzero(np.abs(load[last:] - load[-1]) < limit),
    }
    groups = {name: rows for name, rows in groups.items() if rows.size}
    at = [time[rows].mean() for rows in groups.values()]
    table, texts = dict(table), []
    for name in ("F_n", "F_t"):
        if name not in table:
            continue
        zeros = [table[name][rows].mean() for rows in groups.values()]
        table[name] = table[name] - np.interp(time, at, zeros)
        drift = f", drift {zeros[1] - zeros[0]:+.3g} N" if len(zeros) == 2 else ""
        texts.append(f"{name} {zeros[0]:.3g} N{drift}")
    run = np.abs(table["F_n"][first:last])
    loaded = first + np.flatnonzero(run >= _LOADED * np.median(run))
    rows = slice(loaded[0], loaded[-1] + 1)
    counts = " and ".join(f"{len(rows)} rows {name}" for name, rows in groups.items())
    unknown = "" if len(groups) == 2 else "; the drift is unknown"
    mean = np.abs(table["F_n"][rows]).mean()
    zeros = ", ".join(texts)
    history.append(f"zero ({counts} the run) subtracted: {zeros}; mean load {mean:.4g} N{unknown}")
    return {name: values[rows] for name, values in table.items()}


def section_means(table: Table, sections: Sequence[np.ndarray], history: list[str]) -> Table:
    """Return the mean of each section, with forces in the direction of sliding."""
    sign = direction_of(table)
    oriented = {
        name: values * sign if name in ("F_t", "mu") else np.abs(values) if name == "v" else values
        for name, values in table.items()
    }
    history.append(f"means of {len(sections)} sections of {sum(rows.size for rows in sections)} rows")
    return {name: np.array([values[rows].mean() for rows in sections]) for name, values in oriented.items()}


def _cycles(where: str, table: Table, sections: Sequence[np.ndarray]) -> list[tuple[int, int]]:
    """Return pairs of sections in opposite directions, forward and backward, at equal speeds."""
    sign = direction_of(table)
    direction = np.array([np.sign(sign[rows].sum()) for rows in sections])
    speed = np.array([np.abs(table["v"][rows].mean()) for rows in sections])
    backward = [int(i) for i in np.flatnonzero(direction < 0)]
    cycles = []
    for i in np.flatnonzero(direction > 0):
        near = [j for j in backward if abs(speed[j] - speed[i]) <= SAME_SPEED * speed[i]]
        if near:
            partner = min(near, key=lambda j: abs(j - i))
            backward.remove(partner)
            cycles.append((int(i), partner))
    if not cycles:
        raise ValueError(
            f"{where}: fold=True: no sections in opposite directions at equal speeds; v or F_t must change"
            " its sign, or leave fold out"
        )
    return cycles


def folded(
    table: Table,
    sections: Sequence[np.ndarray],
    cycles: Sequence[tuple[int, int]],
    history: list[str],
    nouns: tuple[str, str] = ("cycle", "cycles"),
) -> Table:
    """Return a row for each pair of sections in opposite directions, with the hysteresis as sigma.

    The offset of mu, which is equal for both directions, cancels. sigma is the scatter of the offset between
    cycles, which is also the scatter of mu if the strokes are independent, times `student_factor`. With one
    cycle, sigma is the offset itself. `nouns` name a pair, and several pairs, in the history.
    """
    means = {name: np.array([values[rows].mean() for rows in sections]) for name, values in table.items()}
    speed = np.abs(means["v"])
    i, j = np.array(cycles).T
    cycle = {name: (values[i] + values[j]) / 2 for name, values in means.items()}
    cycle["v"] = (speed[i] + speed[j]) / 2
    if "F_t" in table:
        # F_n may be negative. Its sign cancels in mu and in the offset.
        load = cycle["F_n"]
        offset = cycle["F_t"] / load
        cycle["F_t"] = (means["F_t"][i] - means["F_t"][j]) / 2
        mu = cycle["F_t"] / load
        turn = -1.0 if np.median(mu) < 0 else 1.0
        cycle["F_t"] *= turn
        formula = "(F_t forward - F_t backward) / (F_n forward + F_n backward)"
    else:
        offset = cycle["mu"]
        mu = (means["mu"][i] - means["mu"][j]) / 2
        turn = -1.0 if np.median(mu) < 0 else 1.0
        cycle["mu"] = turn * mu
        formula = "(mu forward - mu backward) / 2"
    several = len(cycles) > 1
    if several:
        sigma = float(np.std(offset, ddof=1)) * student_factor(len(cycles) - 1)
    else:
        sigma = float(np.abs(offset[0]))
    if sigma > 0:
        cycle["sigma"] = np.full(len(cycles), sigma)
    angle = np.degrees(np.arctan(offset.mean()))
    left = len(sections) - 2 * len(cycles)
    if sigma == 0:
        error = "no hysteresis, errors unknown"
    else:
        error = f"hysteresis {sigma:.2g} is sigma"
        error += "" if several else f", the offset of the only {nouns[0]}"
    history.append(
        f"folded, {len(cycles)} {nouns[several]}: mu = {formula}; offset of mu {offset.mean():+.3g}, a"
        f" misalignment of {angle:+.3g} deg or a zero error; {error}"
        + (f"; {left} sections without a partner left out" if left else "")
    )
    return cycle
