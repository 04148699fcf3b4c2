r"""Records of friction rigs: zero of the load cells, sections, start-up parts, and reciprocating runs.

A record has rows in the order of time. A section is a part of it with one direction, velocity and pressure.
The steps below are done in this order, and each describes its effect in one line.

1. `without_zero` subtracts the line through the readings without load, before and after the run.
2. `without_start` removes the start of each section, a time, a length, or the part before mu settles.
3. `folded` combines sections of opposite directions,

   .. math:: \mu = \frac{F_t^+ - F_t^-}{F_n^+ + F_n^-}, \qquad
             \tan\beta = \frac{F_t^+ + F_t^-}{F_n^+ + F_n^-}

   which is exact for force axes that are turned by \beta from the sliding plane, and for a zero error of F_t
   [Burris and Sawyer, Tribol. Lett. 35, 17 (2009), doi:10.1007/s11249-009-9438-2].
4. `section_means` replaces each section by its mean.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.data.averages import student_factor
from fitting.data.sections import (
    Table,
    direction_of,
    sections_of,
    velocity_of_strokes,
    warn_of_varying_velocity,
)
from rubberfric.base import shown
from rubberfric.io import COLUMNS, Frame, as_frame, read_names, read_table

# Quantities of a record.
QUANTITIES = ("v", "F_t", "F_n", "mu", "p", "A", "T", "t", "x")
# Part of the largest change of the load, below which a row at either end of a record is without load.
_UNLOADED = 0.1
# Largest ratio of a reading without load to the largest reading.
_LARGEST_ZERO = 0.5
# Part of the median load, from which a row belongs to the run.
_LOADED = 0.9
# Largest relative difference of the speeds of two strokes that are folded.
_SAME_SPEED = 0.1
# Part of a section that the rule for settling may remove. Beyond it, the rule has too few rows to judge.
_MOST_SETTLING = 0.5
_AMOUNT = re.compile(r"\s*([-+.\deE]+)\s*([a-z]+)\s*")


class Steps(NamedTuple):
    """Options of `reduced`, which are those of `fitting.read`."""

    zero: bool = False
    discard: str | None = None
    fold: bool = False
    average: bool = False

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults."""
        return {name: value for name, value in self._asdict().items() if value}

    def check(self, where: str) -> None:
        """Raise ValueError, beginning with `where`, if an option has a wrong type or value."""
        for name in ("zero", "fold", "average"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"{where}: {name} = {shown(getattr(self, name))}: must be True or False")
        if self.discard is not None:
            _amount(where, self.discard)


def read_record(path: Any, steps: Steps, layout: Mapping[str, Any], history: list[str]) -> Frame:
    """Return the record of a rig in a table after the given steps, as a data frame.

    Parameters
    ----------
    path : file or data frame
    layout : options of `fitting.read`, of which columns, block and bad_rows are used
    history : receives a line about each step

    Raises
    ------
    ValueError : as for `rubberfric.io.read_table` and `reduced`
    """
    own = {name: layout[name] for name in ("columns", "block", "bad_rows") if name in layout}
    names = read_names(path, layout.get("columns"), block=layout.get("block"))
    known = {COLUMNS[name].name for name in names if name in COLUMNS}
    forces = {"F_t", "F_n"} <= known
    wanted = [name for name in QUANTITIES if name in known and name != ("mu" if forces else "F_t")]
    from_position = {"t", "x"} <= known and not {"v", "v_travel"} & known
    needed = ("t", "x") if from_position else ("v",)
    needed += () if forces else ("mu",)
    # "v" is optional, so that the time of the record may be 0.
    table = read_table(path, needed, (*wanted, "v"), increasing=False, history=history, **own)
    if from_position:
        table["v"] = velocity_of_strokes(table["t"], table["x"], history)
    table, done = reduced(str(path), table, steps)
    history += done
    return as_frame({f"{name} [{next(iter(COLUMNS[name].units))}]": values for name, values in table.items()})


def reduced(where: str, table: Table, steps: Steps) -> tuple[Table, tuple[str, ...]]:
    """Return a record after the given steps, and a line about each step.

    Parameters
    ----------
    where : file or data frame in messages
    table : columns in SI of equal length; v, and F_t and F_n or mu, must be present

    Returns
    -------
    table with the columns that were given, and with sigma if the record was folded; and the history

    Raises
    ------
    ValueError : a step needs a column that is missing, or no row is left
    """
    history: list[str] = []
    if steps.zero:
        table = without_zero(where, table, history)
    sections = sections_of(where, table, history)
    if steps.discard is not None:
        sections = without_start(where, table, sections, steps.discard, history)
    if steps.fold or (steps.average and {"t", "x"} & table.keys()):
        warn_of_varying_velocity(where, table, sections, history)
    if steps.fold:
        return folded(where, table, sections, history), tuple(history)
    if steps.average and {"t", "x"} & table.keys():
        return section_means(table, sections, history), tuple(history)
    rows = np.concatenate(sections)
    return {name: values[rows] for name, values in table.items()}, tuple(history)


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
    amount, quantity = _amount(where, discard)
    kept, removed = [], []
    for rows in sections:
        if quantity is None:
            count = _settling_rows(where, _friction(table)[rows])
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


def _amount(where: str, discard: str) -> tuple[float, str | None]:
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
    found = int(np.argmin(error[: allowed + 1]))
    if found == allowed:
        raise ValueError(
            f'{where}: discard = "settling": mu does not settle within half of a section of {n} rows; it must'
            " be a length or a time, or measure longer"
        )
    return found


def _friction(table: Table) -> np.ndarray:
    return table["F_t"] / table["F_n"] if "F_t" in table else table["mu"]


def section_means(table: Table, sections: Sequence[np.ndarray], history: list[str]) -> Table:
    """Return the mean of each section, with forces in the direction of sliding."""
    sign = direction_of(table)
    oriented = {
        name: values * sign if name in ("F_t", "mu") else np.abs(values) if name == "v" else values
        for name, values in table.items()
    }
    history.append(f"means of {len(sections)} sections of {sum(rows.size for rows in sections)} rows")
    return {name: np.array([values[rows].mean() for rows in sections]) for name, values in oriented.items()}


def folded(where: str, table: Table, sections: Sequence[np.ndarray], history: list[str]) -> Table:
    """Return a row for each cycle of two strokes in opposite directions, with the hysteresis as sigma.

    The offset of mu, which is equal for both directions, cancels. sigma is the scatter of the offset between
    cycles, which is also the scatter of mu if the strokes are independent, times `student_factor`. With one
    cycle, sigma is the offset itself.
    """
    sign = direction_of(table)
    means = {name: np.array([values[rows].mean() for rows in sections]) for name, values in table.items()}
    direction, speed = np.array([sign[rows[0]] for rows in sections]), np.abs(means["v"])
    backward = [int(i) for i in np.flatnonzero(direction < 0)]
    cycles = []
    for i in np.flatnonzero(direction > 0):
        near = [j for j in backward if abs(speed[j] - speed[i]) <= _SAME_SPEED * speed[i]]
        if near:
            partner = min(near, key=lambda j: abs(j - i))
            backward.remove(partner)
            cycles.append((int(i), partner))
    if not cycles:
        raise ValueError(
            f"{where}: fold=True: no sections in opposite directions at equal speeds; v or F_t must change"
            " its sign, or leave fold out"
        )
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
        error = f"hysteresis {sigma:.2g} is sigma" + ("" if several else ", the offset of the only cycle")
    history.append(
        f"folded, {len(cycles)} cycle{'s' * several}: mu = {formula}; offset of mu {offset.mean():+.3g}, a"
        f" misalignment of {angle:+.3g} deg or a zero error; {error}"
        + (f"; {left} sections without a partner left out" if left else "")
    )
    return cycle
