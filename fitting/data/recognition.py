"""The kind of data in a table, from its columns."""

import difflib

from fitting.data.kinds import KINDS, TRANSIENTS
from fitting.data.measured import Measured
from fitting.data.slip import MomentData, SlipData
from rubberfric.base import StrPath, closest, listed, shown
from rubberfric.io import COLUMNS, Frame, column_hint, read_names


def kind_of_table(
    path: StrPath | Frame,
    columns: list[str] | None,
    poisson: float | None,
    kind: str | None,
    block: int | None,
    presses: bool,
) -> type[Measured]:
    """Return the class of the data in a table, which `kind` or the names of the columns determine.

    `presses` is True if the caller gives the pressure or the area.
    """
    if kind is not None:
        return named_kind(path, kind)
    names = read_names(path, columns, "E" if poisson is None else "G", block)
    telling = {
        column: cls
        for cls in KINDS.values()
        if cls is not SlipData
        for column in (cls.fields()[cls.values[0]].column, *cls.others)
    }
    quantities = {COLUMNS[name].name for name in names if name in COLUMNS}
    slips, speeds = quantities & {"slip_angle", "slip_ratio"}, quantities & {"v", "v_travel"}
    if slips and speeds and {"F_n", "F_t"} <= quantities and not (presses or quantities & {"mu", "p", "A"}):
        return SlipData
    classes = {cls for column, cls in telling.items() if column in quantities}
    if "F_t" in quantities:  # the force comes before the moment, which `kind` chooses
        classes -= {MomentData}
    # Programs write master curves over time beside those over frequency.
    classes = classes.difference(TRANSIENTS) or classes
    if len(classes) == 1:
        return classes.pop()
    near = [
        (name, match) for name in names[:100] for match in difflib.get_close_matches(name[:100], telling, n=1)
    ]
    hint = f"{shown(near[0][0])}: did you mean {near[0][1]!r}? " if near and not classes else ""
    several = "; or give kind" if len(classes) > 1 else ""
    kinds = "; ".join(f"{cls.quantity} has {', '.join(_spellings(cls))}" for cls in KINDS.values())
    raise ValueError(
        f"{path}: columns {listed(names)}: {hint}must be the columns of one kind of data: {kinds}{several}"
        f"{'' if classes or columns else column_hint(path)}"
    )


def named_kind(path: StrPath | Frame, kind: object) -> type[Measured]:
    """Return the class of a kind of data, or raise ValueError for an unknown one."""
    if not isinstance(kind, str) or kind not in KINDS:
        raise ValueError(f"{path}: kind = {shown(kind)}: {closest(kind, tuple(KINDS))}")
    return KINDS[kind]


def _spellings(cls):
    """Yield the names that a needed column may have in tables as one text, for every needed column."""
    for name in cls.needed():
        column = cls.fields()[name].column
        offered = [name for name, about in COLUMNS.items() if about.offered and about.name == column]
        yield " or ".join(offered or [column])
