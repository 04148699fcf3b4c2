"""The command `rubberfric accuracy`: error against run time of a scene file at its conditions."""

import argparse

import numpy as np

from rubberfric.analysis.error_and_time.settings import check_error
from rubberfric.analysis.error_and_time.sweep import accuracy
from rubberfric.commands.shared import add_outputs, check_outputs, progress
from rubberfric.io.files import read_computable
from rubberfric.io.scene_files.conditions import Conditions
from rubberfric.plot.save import save_accuracy_plot

# More points make the sweep slower, and tell hardly more.
_POINTS = 60


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to argparse's subparsers."""
    parser = commands.add_parser(
        "accuracy",
        help="measure errors and run times of a scene for settings of increasing accuracy",
        description="Print errors of area, friction, separation and of their gradients beside run times, for "
        "accuracy settings in double and single precision and for the textbook method, and the cheapest "
        "setting for a wanted error.",
    )
    parser.add_argument("scene", metavar="SCENE", help="scene file (.toml) or result file (.h5)")
    parser.add_argument("--error", type=float, default=1e-6, help="wanted relative error (default: 1e-6)")
    add_outputs(parser, "FILE.csv", "write the table", "draw error over run time")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """`rubberfric accuracy`: sweep over settings for a scene file at its conditions."""
    check_error(arguments.error)
    check_outputs(arguments, ".csv")
    scene, conditions, title = read_computable(arguments.scene)
    velocity = thinned(conditions)
    with progress() as tell:
        at = conditions._replace(velocity=velocity).grid()
        found = accuracy(scene, *at, error=arguments.error, progress=tell)
    if arguments.out is not None:
        found.write(arguments.out)
    if arguments.plot is not None:
        save_accuracy_plot(arguments.plot, found, title)
    if title:
        print(title)
    if velocity.size < conditions.velocity.size:
        print(f"{velocity.size} of {conditions.velocity.size} velocities, equally spread")
    print(found.report(), flush=True)
    return 0


def thinned(conditions: Conditions) -> np.ndarray:
    """Velocities of the conditions, equally spread over them and few enough; at least 5 if there are."""
    temperatures = 1 if conditions.temperature is None else conditions.temperature.size
    count = max(5, _POINTS // (temperatures * conditions.pressure.size))
    velocity = conditions.velocity
    if velocity.size <= count:
        return velocity
    return velocity[np.linspace(0, velocity.size - 1, count).round().astype(int)]
