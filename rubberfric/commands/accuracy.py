"""The command `rubberfric accuracy`, which measures errors and run times of accuracy settings."""

import argparse

import numpy as np

from rubberfric.analysis.reference import check_error
from rubberfric.analysis.sweep import accuracy
from rubberfric.base.progress import Phases
from rubberfric.commands.arguments import write_outputs
from rubberfric.io.files import MOST_POINTS, read_computable
from rubberfric.io.results import Conditions
from rubberfric.plot.choice import save_accuracy_plot

# More points make the sweep slower without changing the errors.
_POINTS = 60


def run_accuracy(arguments: argparse.Namespace, show: Phases) -> tuple[str, OSError | None]:
    """Run `rubberfric accuracy`, and return the text to print and the error of a file or None."""
    check_error(arguments.error)
    show(f"reading {arguments.scene}")
    scene, conditions, title = read_computable(arguments.scene, most=MOST_POINTS)
    velocity = thinned(conditions)
    at = conditions._replace(velocity=velocity).grid()
    found = accuracy(
        scene,
        *at,
        error=arguments.error,
        progress=show,
        told=lambda row, k, of: show.line(f"{k} of {of}: {row.told()}"),
    )
    failure = write_outputs(
        show,
        ("writing", arguments.out, found.write),
        ("drawing", arguments.plot, lambda path: save_accuracy_plot(path, found, title)),
    )
    lines = [title] * bool(title)
    if velocity.size < conditions.velocity.size:
        lines.append(f"{velocity.size} of {conditions.velocity.size} velocities, equally spread")
    return "\n".join([*lines, found.report()]), failure


def thinned(conditions: Conditions) -> np.ndarray:
    """Return at least 5 of the velocities, evenly spread, so that a sweep has few points."""
    temperatures = 1 if conditions.temperature is None else conditions.temperature.size
    count = max(5, _POINTS // (temperatures * conditions.pressure.size))
    velocity = conditions.velocity
    if velocity.size <= count:
        return velocity
    return velocity[np.linspace(0, velocity.size - 1, count).round().astype(int)]
