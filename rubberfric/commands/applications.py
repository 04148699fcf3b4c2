"""The commands `rubberfric grip` and `rubberfric leak`, which print a table of an application of a scene."""

import argparse
import csv
import itertools
from collections.abc import Iterable, Mapping

import numpy as np

from rubberfric.applications.brush_model import grip, slip_stiffness
from rubberfric.applications.leak import leak_conductivity, leak_rate, percolation_pressure
from rubberfric.base.atomic import replacing
from rubberfric.base.progress import Progress
from rubberfric.commands.arguments import write_outputs
from rubberfric.io.files import read_scene_file
from rubberfric.scene.patch import Patch
from rubberfric.theory.model import contact_area

# Unit of each column of a table, and its heading on the screen.
_UNITS = {
    "slip": ("", "slip"),
    "speed": ("m/s", "V [m/s]"),
    "load": ("N", "load [N]"),
    "force": ("N", "force [N]"),
    "coefficient": ("-", "force/load"),
    "moment": ("N m", "moment [N m]"),
    "sliding": ("-", "sliding"),
    "pressure": ("Pa", "p [Pa]"),
    "area": ("-", "A/A0"),
    "conductivity": ("m3", "K [m3]"),
    "leak": ("m3/s", "leak [m3/s]"),
}


def run_grip(arguments: argparse.Namespace, show: Progress) -> tuple[str, OSError | None]:
    """Run `rubberfric grip`, and return the text to print and the error of a file or None."""
    scene, title = _read(arguments, show)
    patch = _patch(arguments, scene.patch)
    points = itertools.product(arguments.speed, arguments.load, arguments.slip)
    speed, load, slip = np.array(list(points)).T
    show(f"compiling and computing {slip.size} points")
    forces = grip(scene, patch, slip, speed, load, arguments.temperature, arguments.kind)
    columns = {"speed": speed, "load": load, "slip": slip} | forces._asdict()
    unit = "rad" if arguments.kind == "angle" else "-"
    lines = [f"slip stiffness {float(slip_stiffness(patch)):.6g} N per {'rad' if unit == 'rad' else 'slip'}"]
    return _shown(arguments, show, title, columns, lines, unit)


def run_leak(arguments: argparse.Namespace, show: Progress) -> tuple[str, OSError | None]:
    """Run `rubberfric leak`, and return the text to print and the error of a file or None."""
    scene, title = _read(arguments, show)
    pressure, critical = np.array(arguments.pressure), arguments.critical_area
    T = arguments.temperature
    show(f"compiling and computing {pressure.size} points")
    seal = arguments.fluid_pressure, arguments.viscosity, arguments.length, arguments.width
    rate = leak_rate(scene, pressure, *seal, T, critical)
    # The leak is computed in this contact.
    area = contact_area(scene.replace(area_correction=True), 0.0, pressure, T)
    columns = {
        "pressure": pressure,
        "area": area,
        "conductivity": leak_conductivity(scene, pressure, T, critical),
        "leak": rate,
    }
    last = float(percolation_pressure(scene, T, critical))
    lines = [
        f"percolation pressure {last:.6g} Pa, above which nothing leaks (A/A0 = {critical:g})",
        "against the flow through gaps of boundary elements, the leak is within a factor of 1.5\n"
        "for A/A0 < 0.14 and 1.9 for A/A0 < 0.33 (notebooks/how_true.md);\n"
        "it was not compared with measured seals",
    ]
    return _shown(arguments, show, title, columns, lines)


def _patch(arguments: argparse.Namespace, of_scene: Patch | None) -> Patch:
    """Return the patch of the scene, or a new one, with the numbers that the options state."""
    options = {name: getattr(arguments, name) for name in ("length", "width", "stiffness")}
    options["pressure"] = arguments.patch_pressure
    stated = {name: value for name, value in options.items() if value is not None}
    if of_scene is not None:
        return of_scene.replace(**stated)
    missing = [name for name in ("length", "width", "stiffness") if name not in stated]
    if missing:
        raise ValueError(
            f"{arguments.scene}: has no [patch]; add it, or pass {', '.join(f'--{name}' for name in missing)}"
        )
    return Patch(**stated)


def _read(arguments, show):
    show(f"reading {arguments.scene}")
    content = read_scene_file(arguments.scene)
    return content.scene, content.title


def _shown(arguments, show, title, columns, lines, unit_of_slip=""):
    """Write --out, and return the printed table and the error of the file or None."""
    columns = {name: np.asarray(values, float) for name, values in columns.items() if values is not None}
    failure = write_outputs(
        show, ("writing", arguments.out, lambda path: _write(path, columns, unit_of_slip))
    )
    return "\n".join([*[title] * bool(title), *_table(columns, unit_of_slip), "", *lines]), failure


def _table(columns: Mapping[str, np.ndarray], unit_of_slip: str) -> Iterable[str]:
    headings = [_UNITS[name][1] + (f" [{unit_of_slip}]" if name == "slip" else "") for name in columns]
    yield " ".join(f"{heading:>12}" for heading in headings)
    for row in zip(*columns.values(), strict=True):
        yield " ".join(f"{value:12.5g}" for value in row)


def _write(path: str, columns: Mapping[str, np.ndarray], unit_of_slip: str) -> None:
    """Write a table with two header rows, names and units."""
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerow([_UNITS[name][0] or unit_of_slip for name in columns])
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
