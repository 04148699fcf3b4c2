"""The command `rubberfric explore`: serve the page of a scene until a signal ends it."""

import argparse
import json
import math
import threading
import warnings
import webbrowser
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import jax
import numpy as np

from rubberfric.base.checks import UnitWarning
from rubberfric.commands.explorer.curves import BESIDE, EVERY, Explorer
from rubberfric.commands.explorer.exports import COMMAND, Download, fit_download, scene_download
from rubberfric.commands.explorer.points import read_points
from rubberfric.commands.explorer.server import Answer, Server
from rubberfric.commands.explorer.sliders import read_values
from rubberfric.commands.phases import Phases
from rubberfric.io.files import read_computable

# Parts of the page, in the folder page.
_PARTS = ("style.css", "plots.js", "page.js")


def run(arguments: argparse.Namespace, show: Phases) -> tuple[str, None]:
    """`rubberfric explore`: ends by a signal only."""
    show(f"reading {arguments.scene}")
    scene, conditions, title = read_computable(arguments.scene)
    measured = None if arguments.data is None else read_points(arguments.data, scene, conditions)
    explorer = Explorer(scene, conditions, title, measured)
    try:
        server = Server(arguments.port, page, routes(explorer))
    except OSError as error:
        raise OSError(f"--port {arguments.port}: {error.strerror}") from None
    with server, warnings.catch_warnings():
        # What a slider makes of a scene may be far from any solid.
        warnings.simplefilter("ignore", UnitWarning)
        show(f"compiling {', '.join(explorer.quantities)} at {explorer.count} points")
        explorer.compile()
        show.end()
        print(f"{server.url}\nCtrl-C ends it; d ln {explorer.sensitive} is being compiled", flush=True)
        threading.Thread(target=explorer.compile_sensitivities, daemon=True).start()
        if not arguments.no_browser:
            webbrowser.open(server.entrance)
        server.serve_forever()
    return "", None


def page(nonce: str) -> str:
    """The page, with its style and scripts in it."""
    folder = files("rubberfric.commands.explorer") / "page"
    style, *scripts = ((folder / name).read_text(encoding="utf-8") for name in _PARTS)
    whole = (folder / "page.html").read_text(encoding="utf-8")
    for key, value in {"STYLE": style, "SCRIPT": "\n".join(scripts), "NONCE": nonce}.items():
        whole = whole.replace(f"{{{{{key}}}}}", value)
    return whole


def routes(explorer: Explorer) -> dict[str, Callable[[Any], Answer]]:
    """What the page may post, by route."""

    def with_values(work: Callable[[dict[str, float]], Answer]) -> Callable[[Any], Answer]:
        return lambda content: work(read_values(explorer.sliders, content))

    def sensitivities(values):
        if not explorer.is_ready:
            return _json({"pending": True})
        if explorer.failure:
            raise ValueError(f"sensitivities cannot be computed: {explorer.failure}")
        return _json({"sensitivities": explorer.sensitivities(values)})

    return {
        "start": lambda _: _json(_start(explorer)),
        "curves": with_values(lambda values: _json(explorer.curves(values))),
        "drafts": with_values(lambda values: _json(explorer.curves(values, draft=True))),
        "sensitivities": with_values(sensitivities),
        "scene": with_values(lambda values: _download(scene_download(explorer, values))),
        "fit": with_values(lambda values: _download(fit_download(explorer, values))),
    }


def _start(explorer: Explorer) -> dict[str, Any]:
    """What the page must know once."""
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
        "drafts": explorer.has_drafts,
        "omega": explorer.omega,
        "points": points,
        "command": COMMAND,
        "sliders": [
            {name: x for name, x in one._asdict().items() if name not in ("targets", "free")}
            | {"fits": bool(one.free)}
            for one in explorer.sliders
        ],
    }


def _download(found: Download) -> Answer:
    return Answer(found.kind, found.content, {"Content-Disposition": f'attachment; filename="{found.name}"'})


def _json(content: Any) -> Answer:
    return Answer("application/json", json.dumps(_plain(content), allow_nan=False).encode())


def _plain(value: Any) -> Any:
    """What JSON can hold: lists for arrays, null for what is no finite number."""
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
