"""Write a scene into the text of an existing scene file, and keep its other lines.

The title, comments, the tables [run] and [map], and every line whose value is unchanged stay as they are. A
changed number replaces its line. An object of another kind, or with another table, replaces all its lines.
Lines that are only a comment stay. The text is read as TOML after every change. A text with other content
than intended is replaced by one without comments.
"""

import copy
import itertools
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rubberfric.base.atomic import StrPath, as_path, read_text
from rubberfric.base.checks import warn_caller
from rubberfric.base.objects.fields import Child, Leaf
from rubberfric.base.objects.physical import PhysicalObject, fields_of
from rubberfric.io.results import SceneFile, check_plausible, default_conditions
from rubberfric.io.toml import (
    TABLES,
    object_lines,
    read_conditions,
    read_scene_toml,
    read_toml,
    scene_texts,
    string,
)
from rubberfric.scene.plausible import doubts_of_conditions, doubts_of_scene
from rubberfric.scene.scene import Scene, check_background, takes_temperature

KeyPath = tuple[str, ...]
# Strings, comments, brackets and line ends of a TOML text.
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*|[=\[\]{}\n]', re.S
)
_MISSING: Any = object()


class _Statement(NamedTuple):
    """A header or a key with its value, in the text from `start` to `end`."""

    start: int
    end: int
    table: KeyPath  # of the header above, or of this header
    key: KeyPath  # () for a header
    value: int  # where the text behind "=" begins

    @property
    def full(self) -> KeyPath:
        return self.table + self.key


def scene_file_texts(place: Path, content: SceneFile, like: StrPath | None) -> dict[str, str]:
    """Return the texts of a scene file and its tables, by file name.

    No table has the name of an existing file that does not belong to the scene file.

    Parameters
    ----------
    place : path of the scene file (.toml), which may exist
    content : scene, conditions and title
    like : scene file (.toml) whose other lines are kept, see `edited_scene`; None writes a new text
    """
    scene, conditions, title = content
    own = _tables_of(place)
    for number in itertools.count(1):
        prefix = f"{place.stem}_" if number == 1 else f"{place.stem}_{number}_"
        if like is not None:
            texts = edited_scene(like, scene, place, prefix)
        else:
            texts = scene_texts(scene, conditions, title, name=place.name, prefix=prefix)
        tables = [name for name in texts if name != place.name]
        needed = _tables_in(tomllib.loads(texts[place.name]))
        others = [name for name in tables if needed.count(name) > 1 or name not in own]
        if not any((place.parent / name).exists() for name in others):
            return texts
    raise AssertionError


def _tables_of(path: Path) -> list[str]:
    """Return the names of the tables of an existing TOML file; [] if it cannot be read."""
    try:
        return _tables_in(read_toml(path))
    except ValueError:
        return []


def _tables_in(content: object) -> list[str]:
    """Return all values of the keys `file` in the content of a TOML file."""
    if not isinstance(content, dict):
        return []
    names = [value for name, value in content.items() if name == "file" and isinstance(value, str)]
    return names + [name for value in content.values() for name in _tables_in(value)]


def edited_scene(like: StrPath, scene: Scene, place: StrPath, prefix: str) -> dict[str, str]:
    """Return the text of a scene file in which `scene` replaces the scene, and texts of its new tables.

    Parameters
    ----------
    like : scene file (.toml) with the title, the comments and the conditions to keep
    scene : new scene
    place : path at which the text will be written
        In another folder than `like`, every table is written again, because paths are relative.
    prefix : beginning of the names of new CSV files

    Returns
    -------
    dict from file name to text, in which the TOML file comes first

    Raises
    ------
    ValueError : `like` is no valid scene file, or its conditions do not suit the new scene.

    Notes
    -----
    If the new scene depends on temperature and the old one does not, or vice versa, the temperature in [run]
    and [map] is added or removed, and a warning says so.
    """
    like, place = as_path(like), as_path(place)
    old, content, text = read_scene_toml(like).scene, read_toml(like), read_text(like)
    line_end = "\r\n" if "\r\n" in text else "\n"
    text = text.replace("\r\n", "\n")
    moved = like.resolve().parent != place.resolve().parent
    tables: dict[str, str] = {}
    for path in _changed(old, scene, content, (), moved):
        text, content = _with(text, content, path, *_written(scene, path, tables, prefix))
    for table in TABLES:
        if table in content:
            text, content = _with_temperature(like, text, content, table, scene)
    if "plausible" not in content and not _is_plausible(like, content, scene):
        text, content = _with(text, content, ("plausible",), False, ["plausible = false"])
    return {place.name: text.replace("\n", line_end)} | tables


# --- differences of scenes


def _changed(old: Any, new: Any, raw: dict[str, Any], path: KeyPath, moved: bool) -> Iterator[KeyPath]:
    """Yield the paths of the fields of `new` that differ from `old`, which the TOML table `raw` describes.

    An object that must be written as a whole is yielded instead of its fields.
    """
    paths: list[KeyPath] = []
    for name, field in fields_of(type(new)).items():
        a, b, below = getattr(old, name), getattr(new, name), (*path, name)
        if isinstance(field, Child) and type(a) is type(b) and isinstance(b, PhysicalObject):
            paths += _changed(a, b, raw.get(name, {}), below, moved)
        elif isinstance(field, Child):
            paths += [below] * (a is not b)
        elif not _equal(a, b):
            paths.append(below)
    # These keys of a file stand for several fields.
    indirect = {"file", *type(new).alternatives} & set(raw)
    whole = indirect and any(each[len(path)] not in raw or type(new).alternatives for each in paths)
    yield from [path] if whole or (moved and "file" in raw) else paths


def _equal(a: Any, b: Any) -> bool:
    if a is None or b is None or isinstance(a, str | bool) or isinstance(b, str | bool):
        return type(a) is type(b) and a == b
    return np.array_equal(np.asarray(a), np.asarray(b))


def _written(scene: Scene, path: KeyPath, tables: dict[str, str], prefix: str) -> tuple[Any, list[str]]:
    """Return the content of a field of the scene as TOML, and its lines, and add its tables to `tables`."""
    owner: Any = scene
    for name in path[:-1]:
        owner = getattr(owner, name)
    value = getattr(owner, path[-1])
    if value is None:
        return _MISSING, []
    if isinstance(value, PhysicalObject):
        lines = list(object_lines(".".join(path), value, tables, prefix))
        return _at(tomllib.loads("\n".join([f"[{'.'.join(path)}]", *lines])), path), lines
    field = fields_of(type(owner))[path[-1]]
    unit = f"  # {field.unit}" if isinstance(field, Leaf) and field.unit != "-" else ""
    content = value if isinstance(value, bool | int | str) else np.asarray(value, float).tolist()
    return content, [f"{path[-1]} = {_inline(content)}{unit}"]


def _is_plausible(like: Path, content: dict[str, Any], scene: Scene) -> bool:
    conditions = [read_conditions(like, table, content[table], scene) for table in TABLES if table in content]
    try:
        check_plausible("", doubts_of_scene(scene))
        for each in conditions:
            check_plausible("", doubts_of_conditions(**each._asdict()))
    except ValueError:
        return False
    return True


def _with_temperature(like, text, content, table, scene):
    """Return text and content in which the conditions of a table suit the scene."""
    path, has = (table, "temperature"), "temperature" in content[table]
    if has and not takes_temperature(scene):
        warn_caller(f"{table}.temperature is left out: nothing in the scene has a shift", UserWarning)
        text, content = _with(text, content, path, _MISSING, [])
    elif not has:
        try:
            check_background(scene)
        except ValueError:
            temperatures = default_conditions(scene).temperature
            assert temperatures is not None
            T = float(temperatures[0])
            warn_caller(f"{table}.temperature = {T:g} K is added: the scene requires it", UserWarning)
            text, content = _with(text, content, path, T, [f"temperature = {T!r}  # K"])
    read_conditions(like, table, content[table], scene)
    return text, content


# --- changes of the text


def _with(
    text: str, content: dict[str, Any], path: KeyPath, value: Any, lines: list[str]
) -> tuple[str, dict[str, Any]]:
    """Return text and content with another value at a path; `_MISSING` removes it."""
    target = copy.deepcopy(content)
    *above, last = path
    table = target
    for name in above:
        table = table.setdefault(name, {})
    if value is _MISSING:
        table.pop(last, None)
    else:
        table[last] = value
    for candidate in _candidates(text, target, path, lines):
        try:
            if tomllib.loads(candidate) == target:
                return candidate, target
        except ValueError:
            continue
    return "".join(f"{name} = {_inline(each)}\n" for name, each in target.items()), target


def _candidates(text: str, target: dict[str, Any], path: KeyPath, lines: list[str]) -> Iterator[str]:
    """Yield texts with the value of `target` at a path, most readable first; some may be invalid."""
    statements, value = list(_statements(text)), _at(target, path)
    hosts = [s for s in statements if s.key and s.full == path[: len(s.full)] and len(s.full) < len(path)]
    if hosts:  # an inline table
        yield _replaced(text, hosts[:1], _line(text, hosts[0], _at(target, hosts[0].full), []))
        return
    own = [s for s in statements if s.full[: len(path)] == path]
    if value is _MISSING:
        yield _replaced(text, own, "")
        # An empty table is left.
        yield from _candidates(text, target, path[:-1], []) if len(path) > 1 else ()
        return
    if own:
        first = own[0]
        if first.table[: len(path)] == path and isinstance(value, dict):
            yield _replaced(text, own, _section(path, lines))
        if first.full == path and first.key:
            yield _replaced(text, own, _line(text, first, value, lines))
        else:
            rest = ".".join(path[len(first.table) :])
            yield _replaced(text, own, f"{rest} = {_inline(value)}\n")
        yield _replaced(text, own, "") + "\n" + _section(path, lines)
        return
    parent = path[:-1]
    if isinstance(value, dict):
        within = [s for s in statements if s.full[: len(parent)] == parent and s.full[:1] not in _CONDITIONS]
        yield _inserted(text, within, "\n" + _section(path, lines))
        line = f"{path[-1]} = {_inline(value)}\n"
    else:
        line = f"{lines[0]}\n"
    yield _inserted(text, [s for s in statements if s.table == parent], line)
    top = [s for s in statements if not s.table]
    yield _inserted(text, top, f"{'.'.join(path)} = {_inline(value)}\n")
    yield text + ("" if text.endswith("\n") else "\n") + f"\n[{'.'.join(parent)}]\n{line}"


_CONDITIONS = tuple((name,) for name in TABLES)


def _statements(text: str) -> Iterator[_Statement]:
    """Yield the statements of a valid TOML text."""
    table: KeyPath = ()
    depth, start, begun, equals = 0, 0, False, -1
    last = 0
    for token in [*_TOKEN.finditer(text), None]:
        at = len(text) if token is None else token.start()
        begun = begun or bool(text[last:at].strip())
        mark = "\n" if token is None else token[0]
        last = at if token is None else token.end()
        if mark == "\n":
            if depth == 0:
                if begun:
                    if equals < 0:
                        table = _keys(tomllib.loads(text[start:at]))
                        yield _Statement(start, last, table, (), last)
                    else:
                        key = _keys(tomllib.loads(f"{text[start:equals]} = {{}}"))
                        yield _Statement(start, last, table, key, equals + 1)
                start, begun, equals = last, False, -1
        elif not mark.startswith("#"):
            begun = True
            depth += (mark in "[{") - (mark in "]}")
            if mark == "=" and equals < 0:
                equals = at


def _keys(content: dict[str, Any]) -> KeyPath:
    """Return the keys of nested tables that have one key each."""
    keys: KeyPath = ()
    while content:
        ((name, content),) = content.items()
        keys += (name,)
    return keys


def _at(content: Any, path: Sequence[str]) -> Any:
    for name in path:
        if not isinstance(content, dict) or name not in content:
            return _MISSING
        content = content[name]
    return content


def _replaced(text: str, statements: Sequence[_Statement], new: str) -> str:
    """Return the text with `new` in place of the first statement, and without the other statements."""
    for k, statement in reversed(list(enumerate(statements))):
        before, after = text[: statement.start], text[statement.end :]
        put = "" if k else new
        if not put and before.endswith("\n\n") and after.startswith("\n"):
            after = after[1:]
        text = before + put + after
    return text


def _inserted(text: str, behind: Sequence[_Statement], new: str) -> str:
    """Return the text with `new` behind the last of the statements, or at its beginning."""
    at = behind[-1].end if behind else 0
    line_end = "" if text[:at].endswith("\n") or at == 0 else "\n"
    return text[:at] + line_end + new + text[at:]


def _line(text: str, statement: _Statement, value: Any, lines: list[str]) -> str:
    """Return the line of a key with another value."""
    written = lines[0].partition(" = ")[2] if lines and not isinstance(value, dict) else _inline(value)
    return f"{text[statement.start : statement.value]} {written}\n"


def _section(path: KeyPath, lines: Sequence[str]) -> str:
    return "\n".join([f"[{'.'.join(path)}]", *lines]) + "\n"


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        inside = ", ".join(f"{name} = {_inline(each)}" for name, each in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return string(value) if isinstance(value, str) else repr(value)
