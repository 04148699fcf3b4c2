"""Sheets with a block of columns for each temperature, pressure, frequency or run.

::

    f     20 °C         40 °C               v [mm/s]   µ, 0.2 MPa   µ, 0.4 MPa   µ, 0.8 MPa
          E'     E''    E'     E''          0.5        0.61         0.58         0.55
    Hz    MPa    MPa    MPa    MPa          ...

The label of a block stands in the titles of its columns, in the row above its first column, or in the row of
units. Conditions without a label belong to all blocks. Blocks of samples have equal titles, so the caller
selects one of them by its number.
"""

import collections
import re
from collections.abc import Sequence
from typing import NamedTuple

from rubberfric.base.atomic import is_number
from rubberfric.base.checks import shown
from rubberfric.io.columns import COLUMNS, LONGEST_TITLE, known_name, known_unit, quantities_of

# Quantities that a label can state, by the unit of the label.
_LABELLED = {unit: COLUMNS[name] for name in ("v", "p", "omega", "f", "T") for unit in COLUMNS[name].units}
_CONDITIONS = ("v", "p", "omega", "t", "x", "T", "strain", "E_stress", "G_stress", "q")
_VALUE = re.compile(
    r"[\s_,;:@(\[]*(?:\b(?:at|bei|[TpvfF]\s*=)\s*)?([+-]?\d+(?:[.,]\d+)?)\s*([^\s\d()\[\],;]+)[)\]]*"
)
_RUN = re.compile(
    r"[\s_,;:(\[]*(?:(?:\b|_)(?:run|trial|test|repeat|lauf|messung|versuch|essai|mesure)|#)[\s._]*(\d+)[)\]]*",
    re.IGNORECASE,
)


class Label(NamedTuple):
    """Label of a block of columns."""

    name: str | None  # quantity in SI, or None for a run
    value: str


class LabelledTitle(NamedTuple):
    """Name and unit of a column as from `known_name`, and the label in its title."""

    name: str | None
    unit: str | None
    label: Label | None = None


def read_title(title: str, generic: str = "E") -> LabelledTitle:
    """Return name, unit and label in the title of a column.

    For example, "E' 20 °C [MPa]" gives the name E_stor, the unit MPa, and the label T = 293.15 K.
    """
    if is_number(title):
        return LabelledTitle(None, None)
    name, unit = known_name(title, generic)
    if name is None or known_unit(unit, name) not in getattr(COLUMNS.get(name), "units", ()):
        rest, label = _split_label(title)
        quantity, own = known_name(rest, generic) if label is not None else (None, None)
        if quantity in COLUMNS and label is not None and COLUMNS[quantity].name != label.name:
            return LabelledTitle(quantity, own, label)
    return LabelledTitle(name, unit)


def labels_above(titles: Sequence[LabelledTitle], above: Sequence[str]) -> list[LabelledTitle]:
    """Return titles with labels from the row above, which stand above the first column of each block.

    Only columns whose name occurs several times without a label get a label.
    """
    names = [title.name for title in titles]
    labelled, label = [], None
    for title, text in zip(titles, [*above, *[""] * len(titles)], strict=False):
        label = _split_label(text)[1] if text else label
        repeated = title.name is not None and title.label is None and names.count(title.name) > 1
        labelled.append(title._replace(label=label) if repeated else title)
    return labelled


def labels_in_units(
    titles: Sequence[LabelledTitle], units: Sequence[str]
) -> tuple[list[LabelledTitle], list[str]]:
    """Return titles with labels from the row of units, and the units without labels.

    For example, three columns "Reibwert" have the labels "Lauf 1", "Lauf 2" and "Lauf 3" in the row of units.
    Only columns whose name occurs several times without a label get a label.
    """
    names = [title.name for title in titles if title.label is None]
    labelled, own = [], []
    for title, text in zip(titles, units, strict=False):
        rest, label = _split_label(text)
        if (
            title.label is None
            and title.name is not None
            and names.count(title.name) > 1
            and label is not None
        ):
            title, text = title._replace(label=label), rest.strip()
        labelled.append(title)
        own.append(text)
    return labelled, own


def unlabelled_blocks(titles: Sequence[LabelledTitle]) -> int:
    """Return how often each of the repeated titles occurs, or 1 if titles occur differently often."""
    counts = collections.Counter(title for title in titles if title.name is not None)
    repeated = {count for count in counts.values() if count > 1}
    return repeated.pop() if len(repeated) == 1 else 1


def selected_block(where: str, titles: Sequence[LabelledTitle], block: int | None) -> list[LabelledTitle]:
    """Return the titles of one block of columns with equal titles. The other blocks become unknown.

    Parameters
    ----------
    where : file and line in messages
    titles : titles of all columns
    block : number of the block from 1, or None for all columns

    Raises
    ------
    ValueError : no titles are equal, or `block` is not the number of a block
    """
    if block is None:
        return list(titles)
    count = unlabelled_blocks(titles)
    if count < 2:
        raise ValueError(f"{where}: block = {shown(block)}: must not be given; no columns have equal titles")
    if isinstance(block, bool) or not isinstance(block, int) or not 1 <= block <= count:
        raise ValueError(f"{where}: block = {shown(block)}: must be a whole number from 1 to {count}")
    seen: collections.Counter[LabelledTitle] = collections.Counter()
    selected = []
    for title in titles:
        seen[title] += 1
        repeated = titles.count(title) > 1
        selected.append(LabelledTitle(None, None) if repeated and seen[title] != block else title)
    return selected


def blocks_of(titles: Sequence[LabelledTitle]) -> dict[Label, list[int]]:
    """Return the places of the columns of each block, or {} if the titles do not describe equal blocks."""
    blocks: dict[Label, list[int]] = {}
    for place, title in enumerate(titles):
        if title.name is not None and title.label is not None:
            blocks.setdefault(title.label, []).append(place)
    names = [title.name if title.label is None else None for title in titles]
    for name in set(names) - {None}:
        places = [place for place, other in enumerate(names) if other == name]
        if len(places) == len(blocks) > 1:  # a condition of each block
            for place, label in zip(places, blocks, strict=True):
                blocks[label].append(place)
                names[place] = None
    shared = quantities_of(names)
    columns = {tuple(titles[place].name for place in places) for places in blocks.values()}
    kinds = {label.name for label in blocks}
    return blocks if len(columns) == len(kinds) == 1 and set(shared) <= set(_CONDITIONS) else {}


def _split_label(text: str) -> tuple[str, Label | None]:
    """Return a text without its label, and the label or None."""
    if len(text) > LONGEST_TITLE:
        return text, None
    for match in _VALUE.finditer(text):
        unit = known_unit(match[2], None)
        if unit in _LABELLED:
            column = _LABELLED[unit]
            value = column.value(float(match[1].replace(",", ".")), unit)
            return text[: match.start()] + text[match.end() :], Label(column.name, f"{value:.15g}")
    match = _RUN.search(text)
    if match:
        return text[: match.start()] + text[match.end() :], Label(None, match[1])
    return text, None
