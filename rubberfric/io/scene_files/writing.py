"""A scene as the text of a TOML file, which `read_scene_toml` reads back to the last bit.

Tables (moduli, spectra, shifts, softening) are CSV files beside it, named by their place in the scene.
"""

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rubberfric.base.objects.fields import Child, Leaf
from rubberfric.base.objects.physical import Kind, PhysicalObject, fields_of
from rubberfric.io.scene_files.conditions import Conditions
from rubberfric.io.tables.writing import write_table
from rubberfric.scene.plausibility import doubts_of_conditions, doubts_of_scene
from rubberfric.scene.scene import Scene


def scene_texts(
    scene: Scene, conditions: Conditions, title: str = "", *, name: str = "scene.toml"
) -> dict[str, str]:
    """The files that say a scene: its TOML file, and a CSV file for each of its tables.

    Parameters
    ----------
    scene : Scene of concrete numbers
    conditions : what [run] is to hold
    title : one line of text
    name : of the TOML file

    Returns
    -------
    dict of file name -> text, the TOML file first
    """
    tables: dict[str, str] = {}
    lines = [f"title = {_string(title)}"] if title else []
    doubts = [*doubts_of_scene(scene), *doubts_of_conditions(**conditions._asdict())]
    if doubts:
        lines.append("plausible = false")
    lines += _object("", scene, tables)
    lines += ["", "[run]", *_conditions(conditions)]
    return {name: "\n".join(lines) + "\n"} | tables


def _object(key: str, value: PhysicalObject, tables: dict[str, str]) -> Iterator[str]:
    """Lines of an object at a key path, those of its numbers before those of objects in it."""
    fields = fields_of(type(value))
    if isinstance(value, Kind):
        yield f"kind = {_string(value.file_kind)}"
    columns = {}
    for name, field in fields.items():
        content = getattr(value, name)
        if isinstance(field, Child) or content is None:
            continue
        if isinstance(field, Leaf) and field.column is not None:
            columns[field.column] = np.asarray(content, float)
            continue
        unit = f"  # {field.unit}" if isinstance(field, Leaf) and field.unit != "-" else ""
        yield f"{name} = {_written(content)}{unit}"
    if columns:
        file = f"{key.replace('.', '_')}.csv"
        tables[file] = _table(columns)
        yield f"file = {_string(file)}"
        if "C" in columns:
            yield 'normalisation = "C"'
    for name, field in fields.items():
        content = getattr(value, name)
        if isinstance(field, Child) and content is not None:
            below = f"{key}.{name}" if key else name
            yield from ("", f"[{below}]", *_object(below, content, tables))


def _conditions(conditions: Conditions) -> Iterator[str]:
    for (name, values), unit in zip(conditions._asdict().items(), ("m/s", "Pa", "K"), strict=True):
        if values is not None:
            yield f"{name} = {_written(values if values.size > 1 else values[0])}  # {unit}"


def _table(columns: dict[str, np.ndarray]) -> str:
    """Columns as CSV text; a matrix over q and the direction with a row for each."""
    for name, values in columns.items():
        if values.ndim == 2:
            count = values.shape[1]
            grown = {other: np.repeat(x, count) for other, x in columns.items() if x.ndim == 1}
            phi = np.tile(np.arange(count) * (math.pi / count), values.shape[0])
            columns = grown | {"phi": phi, name: values.ravel()}
            break
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        write_table(path, columns)
        return path.read_text(encoding="utf-8")


def _written(value: Any) -> str:
    """A number, a list of them or an option, with as many digits as it takes to read the same one back."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, int):
        return repr(value)  # an option; numbers of a scene are none
    return repr(np.asarray(value, float).tolist())


def _string(text: str) -> str:
    """A basic string of TOML."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
