"""What the page hands out: the scene as it is now, and a fit that begins there.

Both are files that lie beside each other, with no path in them: of several a ZIP archive is made. No file is
written, and none read but the table of measured points that the command was given.
"""

import io
import zipfile
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from rubberfric.commands.explorer.curves import Explorer, Values
from rubberfric.commands.explorer.points import Measured
from rubberfric.commands.explorer.sliders import Slider
from rubberfric.io.toml import scene_texts

FOLDER, SCENE, JOB = "explored", "scene.toml", "job.toml"
_INSIDE = 0.01  # how far within its bounds a number begins, of what is between them
COMMAND = f"rubberfric-fit {FOLDER}/{JOB}"


class Download(NamedTuple):
    """A file for who reads the page."""

    name: str
    kind: str  # of its content
    content: bytes


def scene_download(explorer: Explorer, values: Values) -> Download:
    """The scene where the sliders are: a TOML file, with its tables in an archive if it has any."""
    texts = _scene(explorer, values)
    if len(texts) == 1:
        return Download(SCENE, "application/toml", texts[SCENE].encode())
    return _archive({name: text.encode() for name, text in texts.items()})


def fit_download(explorer: Explorer, values: Values) -> Download:
    """A job of `rubberfric-fit` that begins where the sliders are, those that were moved being free.

    Raises
    ------
    ValueError : there are no measured points, or no number of the scene was moved.
    """
    measured = explorer.measured
    if measured is None:
        raise ValueError("no measured points: the command must be given some, --data FILE")
    table = f"data{measured.path.suffix}"
    job = job_text(explorer, values, measured, table)
    files = {JOB: job.encode()} | {n: text.encode() for n, text in _scene(explorer, values).items()}
    return _archive(files | {table: measured.content})


def job_text(explorer: Explorer, values: Values, measured: Measured, table: str) -> str:
    """The text of the job; see `fit_download`."""
    away = [one for one in explorer.sliders if one.targets and values[one.name] != one.start]
    rules = dict(pair for one in away for pair in _rules(one, values[one.name]))
    if not rules:
        raise ValueError("no number of the scene was moved that a fit can have free: move one")
    # What is free as a whole cannot be so in parts as well.
    rules = {
        path: rule for path, rule in rules.items() if path.partition("[")[0] not in rules or "[" not in path
    }
    lines = [
        f"# Unpacked beside this file: {COMMAND}",
        f'scene = "{SCENE}"',
        "",
        "[[data]]",
        f'file = "{table}"',
    ]
    if measured.pressure is None:
        lines.append(f"pressure = {values['pressure']!r}  # Pa")
    if measured.temperature is None and "temperature" in values:
        lines.append(f"temperature = {values['temperature']!r}  # K")
    lines += ["", "[free]", *(f'"{path}" = {rule}' for path, rule in rules.items())]
    left = [one.name for one in away if not one.free]
    lines += [f"# {name}: was moved, but is not a number that a fit can have free" for name in left]
    return "\n".join(lines) + "\n"


def _rules(slider: Slider, value: float) -> list[tuple[str, str]]:
    """(key path, rule) of what is to be free in a fit."""
    rule = '"positive"'
    if slider.unit == "rad":
        rule = '{ rule = "free", scale = 0.1 }'
    elif not slider.logarithmic:
        low, high = slider.low, slider.high
        rule = f'{{ rule = "bounded", low = {low!r}, high = {high!r}'
        # A fit begins within the bounds, not at one.
        least = _INSIDE * (high - low)
        start = min(max(value, low + least), high - least)
        rule += " }" if start == value else f", start = {start!r} }}"
    return [(path, rule) for path in slider.free]


def _scene(explorer: Explorer, values: Values) -> dict[str, str]:
    """The scene file and its tables."""
    scene = explorer.moved(values)
    given = {name: np.array([x]) for name, x in values.items() if name in ("pressure", "temperature")}
    return scene_texts(scene, explorer.conditions._replace(**given), explorer.title, name=SCENE)


def _archive(files: Mapping[str, bytes]) -> Download:
    """Files in a folder of a ZIP archive."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(f"{FOLDER}/{name}", text)
    return Download(f"{FOLDER}.zip", "application/zip", content.getvalue())
