"""Files that an input of a command names: scenes and data of a job, tables and cards of a scene."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rubberfric.base.atomic import StrPath, read_text

# Keys whose values are names of files, relative to the folder of the TOML file.
_KEYS = ("file", "scene")


def named_files(path: StrPath) -> Iterator[Path]:
    """Yield the files that a TOML file names, and the files that these name; nothing for another file.

    A file that cannot be read names no files; reading it gives the error message.
    """
    path = Path(path)
    if path.suffix.lower() != ".toml":
        return
    try:
        content = tomllib.loads(read_text(path))
    except (ValueError, RecursionError):
        return
    for name in _names(content):
        yield path.parent / name
        # Only a job names other TOML files.
        if {"free", "scenes"} & set(content):
            yield from named_files(path.parent / name)


def _names(content: Any) -> Iterator[str]:
    for name, value in content.items() if isinstance(content, dict) else enumerate(content):
        if name in _KEYS and isinstance(value, str):
            yield value
        elif isinstance(value, dict | list):
            yield from _names(value)
