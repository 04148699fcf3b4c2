"""The command `rubberfric explore`, which serves the page of a scene until a signal ends the command.

The page offers two downloads: the present scene, and a fit that begins at the present scene. The downloaded
files lie in one folder and contain no paths of this machine. Several files are packed into a ZIP archive. The
command writes no file.
"""

import argparse
import io
import json
import math
import threading
import warnings
import webbrowser
import zipfile
from collections.abc import Callable, Mapping
from importlib.resources import files
from typing import Any

import jax
import numpy as np

from rubberfric.base.checks import UnitWarning
from rubberfric.base.progress import Progress
from rubberfric.commands.explorer.curves import (
    BESIDE,
    EVERY,
    CurveValues,
    Explorer,
    MeasuredPoints,
    read_points,
)
from rubberfric.commands.explorer.server import Answer, Server
from rubberfric.commands.explorer.sliders import Slider, slider_values
from rubberfric.io.files import read_computable
from rubberfric.io.toml import literal, scene_texts

# Parts of the page, in the folder page.
_PARTS = ("style.css", "plots.js", "page.js")

# Folder in the archive of the scene and its fit, and name of the archive.
FOLDER = "explored"
# Name of the scene file in downloads.
SCENE = "scene.toml"
# Name of the job file in the archive.
JOB = "job.toml"
_INSIDE = 0.01  # smallest distance of a start value from its bounds, as a share of their distance
COMMAND = f"rubberfric-fit {FOLDER}/{JOB}"


def run_explorer(arguments: argparse.Namespace, show: Progress) -> tuple[str, None]:
    """Serve the page of `rubberfric explore` until a signal ends the command."""
    show(f"reading {arguments.scene}")
    scene, conditions, title = read_computable(arguments.scene, default=True)
    reading = {name: getattr(arguments, name) for name in ("columns", "bad_rows")}
    reading = {name: value for name, value in reading.items() if value is not None}
    measured = None
    if arguments.data is not None:
        measured = read_points(arguments.data, scene, conditions, **reading)
    explorer = Explorer(scene, conditions, title, measured)
    try:
        server = Server(arguments.port, page, routes(explorer))
    except OSError as error:
        raise OSError(f"--port {arguments.port}: {error.strerror}") from None
    with server, warnings.catch_warnings():
        # Sliders may reach values far from any solid.
        warnings.simplefilter("ignore", UnitWarning)
        show.end()
        print(f"{server.url}\nCtrl-C ends it; curves and sensitivities are being compiled", flush=True)
        failures: list[Exception] = []

        def compile_all():
            try:
                explorer.compile()
            except Exception as error:  # raised again when the server has ended
                failures.append(error)
                server.shutdown()
            else:
                explorer.compile_sensitivities()

        threading.Thread(target=compile_all, daemon=True).start()
        if not arguments.no_browser:
            webbrowser.open(server.entrance)
        server.serve_forever()
    if failures:
        raise failures[0]
    return "", None


def page(nonce: str) -> str:
    """Return the HTML page, including style and scripts, for one nonce."""
    folder = files("rubberfric.commands.explorer") / "page"
    style, *scripts = ((folder / name).read_text(encoding="utf-8") for name in _PARTS)
    whole = (folder / "page.html").read_text(encoding="utf-8")
    for key, value in {"STYLE": style, "SCRIPT": "\n".join(scripts), "NONCE": nonce}.items():
        whole = whole.replace(f"{{{{{key}}}}}", value)
    return whole


def routes(explorer: Explorer) -> dict[str, Callable[[Any], Answer]]:
    """Return a dict from route to the function that answers a POST request of the page."""

    def with_values(work: Callable[[dict[str, float]], Answer]) -> Callable[[Any], Answer]:
        return lambda content: work(slider_values(explorer.sliders, content))

    def curves(values, draft=False):
        if not explorer.ready.is_set():
            return _json({"pending": True})
        return _json(explorer.curves(values, draft) | {"drafts": explorer.has_drafts})

    def sensitivities(values):
        if not explorer.compiled.is_set():
            return _json({"pending": True, "sensitivities": explorer.differences(values)})
        if explorer.failure:
            raise ValueError(f"sensitivities cannot be computed: {explorer.failure}")
        return _json({"sensitivities": explorer.sensitivities(values)})

    return {
        "start": lambda _: _json(_start(explorer)),
        "curves": with_values(curves),
        "drafts": with_values(lambda values: curves(values, draft=True)),
        "sensitivities": with_values(sensitivities),
        "scene": with_values(lambda values: scene_download(explorer, values)),
        "fit": with_values(lambda values: fit_download(explorer, values)),
    }


def _start(explorer: Explorer) -> dict[str, Any]:
    """Return the constants that the page reads when it starts."""
    measured = explorer.measured
    points = None
    if measured is not None:
        names = ("velocity", "friction", "error")
        points = {name: getattr(measured, name) for name in names}
        points["curves"] = [curve._asdict() for curve in explorer.curves_of_points]
    return {
        "title": explorer.title,
        "axis": explorer.axis,
        "at": explorer.at,
        "beside": explorer.at[::BESIDE],
        "every": EVERY,
        "sensitive": explorer.sensitive,
        "omega": explorer.omega,
        "points": points,
        "command": COMMAND,
        "sliders": [
            {name: x for name, x in slider._asdict().items() if name not in ("targets", "free")}
            | {"fits": bool(slider.free)}
            for slider in explorer.sliders
        ],
    }


def _download(name: str, kind: str, content: bytes) -> Answer:
    return Answer(kind, content, {"Content-Disposition": f'attachment; filename="{name}"'})


def _json(content: Any) -> Answer:
    return Answer("application/json", json.dumps(_plain(content), allow_nan=False).encode())


def _plain(value: Any) -> Any:
    """Convert arrays to lists, and numbers that are not finite to None, for JSON."""
    if isinstance(value, dict):
        return {name: _plain(x) for name, x in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(x) for x in value]
    if isinstance(value, np.ndarray | jax.Array):
        array = np.asarray(value)
        if array.dtype == bool or np.isfinite(array).all():
            return array.tolist()
        return _plain(array.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def scene_download(explorer: Explorer, values: CurveValues) -> Answer:
    """Return the scene at the sliders' values as a TOML file, or with its tables as a ZIP archive."""
    texts = _scene(explorer, values)
    if len(texts) == 1:
        return _download(SCENE, "application/toml", texts[SCENE].encode())
    return _archive({name: text.encode() for name, text in texts.items()})


def fit_download(explorer: Explorer, values: CurveValues) -> Answer:
    """Return a ZIP archive with a `rubberfric-fit` job, which varies the numbers that were moved.

    A ValueError is raised if there are no measured points, or if no number of the scene was moved.
    """
    measured = explorer.measured
    if measured is None:
        raise ValueError("no measured points; start the command with --data FILE")
    table = f"data{measured.path.suffix}"
    job = job_text(explorer, values, measured, table)
    files = {JOB: job.encode()} | {n: text.encode() for n, text in _scene(explorer, values).items()}
    return _archive(files | {table: measured.content})


def job_text(explorer: Explorer, values: CurveValues, measured: MeasuredPoints, table: str) -> str:
    """Return the text of the job file of `fit_download`, where `table` is the file of the measured points."""
    away = [slider for slider in explorer.sliders if slider.targets and values[slider.name] != slider.start]
    rules = dict(pair for slider in away for pair in _rules(slider, values[slider.name]))
    if not rules:
        raise ValueError("no number that a fit can vary was moved; move a slider of the scene")
    # A free array cannot have free elements as well.
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
    lines += [f"{name} = {literal(value)}" for name, value in measured.reading.items()]
    if measured.pressure is None:
        lines.append(f"pressure = {values['pressure']!r}  # Pa")
    if measured.temperature is None and "temperature" in values:
        lines.append(f"temperature = {values['temperature']!r}  # K")
    lines += ["", "[free]", *(f'"{path}" = {rule}' for path, rule in rules.items())]
    left = [slider.name for slider in away if not slider.free]
    lines += [f"# {name}: was moved, but cannot be a free parameter of a fit" for name in left]
    return "\n".join(lines) + "\n"


def _rules(slider: Slider, value: float) -> list[tuple[str, str]]:
    """Return (key path, rule as TOML text) for each parameter of a fit that a slider stands for."""
    rule = '"positive"'
    if slider.unit == "rad":
        rule = '{ rule = "free", scale = 0.1 }'
    elif not slider.logarithmic:
        low, high = slider.low, slider.high
        rule = f'{{ rule = "bounded", low = {low!r}, high = {high!r}'
        # A fit cannot begin at a bound.
        least = _INSIDE * (high - low)
        start = min(max(value, low + least), high - least)
        rule += " }" if start == value else f", start = {start!r} }}"
    return [(path, rule) for path in slider.free]


def _scene(explorer: Explorer, values: CurveValues) -> dict[str, str]:
    scene = explorer.moved(values)
    moved = {name: np.array([x]) for name, x in values.items() if name in ("pressure", "temperature")}
    return scene_texts(scene, explorer.conditions._replace(**moved), explorer.title, name=SCENE)


def _archive(files: Mapping[str, bytes]) -> Answer:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(f"{FOLDER}/{name}", text)
    return _download(f"{FOLDER}.zip", "application/zip", content.getvalue())
