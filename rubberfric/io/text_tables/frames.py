"""Data frames of pandas, polars, xarray and Arrow, and mappings of titles to numbers, as tables.

A column has the title `name [unit]`, or a name with the unit in `attrs`, in the argument `units`, or in a
second level of the titles, as `pandas.read_csv(path, header=[0, 1])` gives it. A column without a unit is in
SI. No library is imported: the methods of the objects are used.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import shown
from rubberfric.io.columns import COLUMNS, SET_VALUES, known_name, known_unit, settled_axis
from rubberfric.io.exports import TextTable

# pandas.DataFrame, polars.DataFrame or LazyFrame, xarray.Dataset or DataArray, pyarrow.Table, or a mapping of
# titles to numbers. No common type describes them.
DataFrame: TypeAlias = Any
# An object with one of these is a data frame. polars.LazyFrame.columns warns, so it is the last one.
_METHODS = ("data_vars", "to_dataset", "to_pydict", "collect_schema", "columns")
# Attributes of a column that state its unit.
_UNIT_ATTRIBUTES = ("units", "unit")


class Frame(NamedTuple):
    """Columns of a data frame.

    Examples
    --------
    >>> frame = rf.io.as_frame({"Sliding speed [mm/s]": [5.0, 10.0], "COF": [0.8, 0.9]})
    >>> frame.titles, frame.columns[1]
    (['Sliding speed [mm/s]', 'COF'], [0.8, 0.9])
    >>> frame.table().names
    ['v', 'mu']
    """

    titles: list[str]
    units: list[str | None]  # stated beside the titles
    columns: list[Sequence[Any]]  # of equal length

    def __str__(self) -> str:
        return "data frame"

    def table(self, titles: list[str] | None = None, generic: str = "E") -> TextTable:
        """Return the frame as a table of texts.

        Parameters
        ----------
        titles : "name [unit]" of every column, which replaces its title; "-" leaves out a column
        generic : "E" or "G", the meaning of "storage modulus"

        Raises
        ------
        ValueError : `titles` are not as many as the columns, or a title and a unit beside it disagree
        """
        own, units = self.titles, self.units
        if titles is not None:
            if not isinstance(titles, list | tuple) or len(titles) != len(own):
                raise ValueError(
                    f"{self}: columns = {shown(titles)}: must be a list of {len(own)} texts, one for each of"
                    f" the columns {', '.join(own)}"
                )
            own, units = [str(title) for title in titles], [None] * len(titles)
        known = [_name_and_unit(title, unit, generic) for title, unit in zip(own, units, strict=True)]
        rows = [(i, [str(cell) for cell in row]) for i, row in enumerate(zip(*self.columns, strict=True), 1)]
        names, spelled = [name for name, _ in known], [unit for _, unit in known]
        return TextTable(f"{self}", own, names, spelled, rows, place="row")


def as_source(source: StrPath | DataFrame) -> Any:
    """Return a path unchanged, and a data frame as a `Frame`.

    Examples
    --------
    >>> rf.io.as_source("table.csv"), rf.io.as_source({"v [mm/s]": [5.0], "mu": [0.8]}).titles
    ('table.csv', ['v [mm/s]', 'mu'])
    """
    return as_frame(source) if _is_frame(source) else source


def as_frame(frame: DataFrame, units: Mapping[str, str] | None = None) -> Frame:
    """Return the columns of a data frame, for `read_table`, `read_columns` and `fitting.read`.

    Parameters
    ----------
    frame : pandas, polars or xarray object, pyarrow.Table, or a mapping of titles to numbers
        A title is a name of a column in files (v, mu, T, ...), a name that instruments and other programs use
        (`known_name`), or "name [unit]". Named levels of the index of a pandas.DataFrame, and coordinates of
        an xarray object, are columns, too. One number in a mapping belongs to all rows.
    units : units of columns whose titles state no unit, such as {"v": "mm/s"}; the default is SI
        They replace the units in `attrs`.

    Raises
    ------
    ValueError : `frame` is no data frame, its columns differ in length, or a key of `units` is no column

    Examples
    --------
    >>> import rubberfric as rf
    >>> frame = rf.io.as_frame({"v [mm/s]": [1.0, 2.0], "mu": [0.5, 0.6]})
    >>> rf.io.read_table(frame, ["v", "mu"])["v"]
    array([0.001, 0.002])
    """
    if isinstance(frame, Frame):
        return frame
    if not _is_frame(frame):
        kind = type(frame).__name__
        raise ValueError(f"frame must be a data frame, or a mapping of title -> numbers, got a {kind}")
    titles, stated, columns = _parts(frame)
    mapping: Mapping[str, str] = {} if units is None else units
    if not isinstance(mapping, Mapping) or not all(isinstance(unit, str) for unit in mapping.values()):
        raise ValueError(f"units = {shown(units)}: must be a mapping of title -> unit, or None")
    for key in mapping:
        places = [i for i, title in enumerate(titles) if key in (title, known_name(title)[0])]
        if not places:
            raise ValueError(f"units: {key!r} is not a column that is read")
        for i in places:
            stated[i] = mapping[key]
    return Frame(titles, stated, _equally_long(titles, columns))


def _is_frame(source: object) -> bool:
    if isinstance(source, str | bytes | os.PathLike):
        return False
    return isinstance(source, Mapping) or any(hasattr(source, name) for name in _METHODS)


def _parts(frame: DataFrame) -> tuple[list[str], list[str | None], list[Any]]:
    """Return titles, units beside the titles, and columns of a data frame."""
    if hasattr(frame, "to_dataset") and not hasattr(frame, "data_vars"):  # xarray.DataArray
        frame = frame.to_dataset(name=frame.name or "values")
    if hasattr(frame, "data_vars"):  # xarray.Dataset
        units = {str(name): _unit_of(variable) for name, variable in frame.variables.items()}
        frame = frame.to_dataframe().reset_index()
        named = [(str(title), units.get(str(title)), frame[title]) for title in frame.columns]
        return _unzipped(named)
    if hasattr(frame, "collect_schema") and hasattr(frame, "collect"):  # polars.LazyFrame
        frame = frame.collect()
    if hasattr(frame, "to_pydict"):  # pyarrow.Table
        frame = frame.to_pydict()
    if hasattr(frame, "reset_index"):  # pandas.DataFrame
        levels = [name for name in frame.index.names if isinstance(name, str)]
        frame = frame.reset_index(level=levels) if levels else frame
        own = getattr(frame, "attrs", {}).get("units", {})
        own = own if isinstance(own, Mapping) else {}
        named = [(*_split(frame.columns[i], own), frame.iloc[:, i]) for i in range(len(frame.columns))]
        return _unzipped(named)
    titles = frame.keys() if isinstance(frame, Mapping) else frame.columns
    return _unzipped([(*_split(title, {}), frame[title]) for title in titles])


def _unzipped(named: Iterable[tuple[str, str | None, Any]]) -> tuple[list[str], list[str | None], list[Any]]:
    titles, units, columns = [], [], []
    for title, unit, column in named:
        titles.append(title)
        units.append(unit or _unit_of(column))
        columns.append(column)
    return titles, units, columns


def _unit_of(column: object) -> str | None:
    attributes = getattr(column, "attrs", {})
    stated = [attributes[key] for key in _UNIT_ATTRIBUTES if isinstance(attributes.get(key), str)]
    return stated[0] if stated else None


def _split(title: object, units: Mapping[Any, Any]) -> tuple[str, str | None]:
    """Return the text of a title, and its unit if the title has the two levels name and unit."""
    unit = units.get(title)
    if isinstance(title, tuple) and len(title) == 2:
        name, below = map(str, title)
        return name.strip(), None if below.startswith("Unnamed") else below
    return str(title), unit if isinstance(unit, str) else None


def _equally_long(titles: list[str], columns: list[Any]) -> list[Sequence[Any]]:
    lists = [_cells(column) for column in columns]
    lengths = {len(cells) for cells in lists if isinstance(cells, list)}
    if len(lengths) > 1:
        pairs = [f"{t!r} has {len(c)}" for t, c in zip(titles, lists, strict=True) if isinstance(c, list)]
        raise ValueError(f"data frame: columns differ in length ({', '.join(pairs)}): must be equal")
    length = lengths.pop() if lengths else 1
    return [cells if isinstance(cells, list) else [cells] * length for cells in lists]


def _cells(column: Any) -> Any:
    """Return the cells of a column as a list, or one number."""
    if isinstance(column, np.ma.MaskedArray):
        return ["" if cell is None else cell for cell in column.tolist()]
    if hasattr(column, "to_list"):  # Series of pandas and polars
        return column.to_list()
    array = np.asarray(column)
    return array.ravel().tolist() if array.ndim else array.item()


def _name_and_unit(title: str, beside: str | None, generic: str) -> tuple[str | None, str]:
    """Return the name and the unit of a column, whose unit may be stated beside its title."""
    name, own = known_name(title, generic)
    unit = own if beside is None else beside
    if own is not None and beside is not None and known_unit(own, name) != known_unit(beside, name):
        raise ValueError(f"column {shown(title)}: unit {shown(beside)} contradicts the title; must be equal")
    name = settled_axis(name, unit)
    column = COLUMNS.get(SET_VALUES.get(name or "", name or ""))
    if column is None:
        return None, "-"
    return name, next(iter(column.units)) if unit is None else known_unit(unit, name)
