"""Data of several scenes that are fitted together."""

import dataclasses
from collections.abc import Collection, Mapping, Sequence

from fitting.data.kinds import as_data_sets
from fitting.data.measured import Measured
from rubberfric.base import closest, shown

DataSets = Measured | Sequence[Measured]


def data_by_scene(
    data: DataSets | Mapping[str, DataSets], names: Collection[str] | None
) -> tuple[list[Measured], list[str]]:
    """Data sets, and the name of the scene that each is of.

    Parameters
    ----------
    data : one set or several; of several scenes a dict of those of each
    names : of the scenes, None of a single one

    Returns
    -------
    (data sets, names of their scenes), "" of a single scene. Of several, labels begin with the scene's name.

    Raises
    ------
    ValueError : the dict is none, or does not have the scenes' names.
    """
    if names is None:
        sets = as_data_sets(data)  # pyright: ignore[reportArgumentType]  # or its error
        return sets, [""] * len(sets)
    if not isinstance(data, Mapping):
        known = ", ".join(f"{name!r}: ..." for name in names)
        raise ValueError(f"data is a {type(data).__name__}: must be a dict by scenes, {{{known}}}")
    for name in data:
        if name not in names:
            raise ValueError(f"data has the name {shown(name)}, which no scene has: {closest(name, names)}")
    sets, of = [], []
    for name in names:
        if name not in data:
            raise ValueError(f"scene {name!r} has no data: must have some, or be left out")
        try:
            own = as_data_sets(data[name])
        except ValueError as error:
            raise ValueError(f"scene {name!r}: {error}") from None
        sets += [_named(one, name) for one in own]
        of += [name] * len(own)
    return sets, of


def _named(data: Measured, scene: str) -> Measured:
    """The same data with the scene's name before its own."""
    if data.name.split(":")[0] == scene:
        return data
    return dataclasses.replace(data, name=f"{scene}: {data.label}", check_units=False)
