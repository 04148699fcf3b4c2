"""Reading TOML strictly: every error is one line naming the file, the key, its value and the rule."""

import tomllib
from collections.abc import Collection
from typing import Any

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import closest, shown
from rubberfric.io.tables.text import read_text


def read_toml(path: StrPath) -> dict[str, Any]:
    """The content of a TOML file as a dict; ValueError if it is missing or is not TOML."""
    text = read_text(path)
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise ValueError(f"{path}: is not TOML: {error}") from None
    except RecursionError:
        raise ValueError(f"{path}: is not TOML: nested too deeply") from None


def check_keys(
    path: StrPath, key: str, content: Any, allowed: Collection[str], needed: Collection[str] = ()
) -> None:
    """ValueError unless the table at `key` has only allowed keys and all needed ones."""
    if not isinstance(content, dict):
        raise ValueError(f"{path}: {key} = {shown(content)}: must be a table")
    for name in content:
        if name not in allowed:
            raise ValueError(f"{path}: {join(key, name)}: unknown key; {closest(name, allowed)}")
    for name in needed:
        if name not in content:
            raise ValueError(f"{path}: {join(key, name)}: is missing; must be given")


def join(key: str, name: str) -> str:
    """Key path of `name` in the table at `key`, "" being the file."""
    return f"{key}.{name}" if key else name


def number(path: StrPath, key: str, value: Any) -> Any:
    """A number or a list of numbers as floats; NaN and signs are the constructors' business."""
    if isinstance(value, list):
        items = [number(path, f"{key}[{i}]", item) for i, item in enumerate(value)]
        if any(isinstance(item, list) for item in items):
            raise ValueError(f"{path}: {key} = {shown(value)}: must be a list of numbers, not of lists")
        return items
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{path}: {key} = {shown(value)}: must be a number")
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"{path}: {key} = {shown(value)}: must be finite") from None
