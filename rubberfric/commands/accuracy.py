"""The command `rubberfric accuracy`: error against run time of a scene file at its conditions."""

import numpy as np

from rubberfric.analysis.error_and_time.settings import check_error
from rubberfric.analysis.error_and_time.sweep import accuracy
from rubberfric.base.atomic import check_writable
from rubberfric.commands.terminal import progress
from rubberfric.io.files import read_computable
from rubberfric.plot.save import check_plot, save_accuracy_plot

# More points make the sweep slower, and tell hardly more.
_POINTS = 60


def add(commands):
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
    parser.add_argument("--out", metavar="FILE.csv", help="write the table")
    parser.add_argument("--plot", metavar="FILE.png", help="draw error over run time (.png, .pdf or .svg)")
    parser.set_defaults(run=run)


def run(arguments):
    """`rubberfric accuracy`: sweep over settings for a scene file at its conditions."""
    check_error(arguments.error)
    if arguments.out is not None:
        check_writable(arguments.out, (".csv",))
    if arguments.plot is not None:
        check_plot(arguments.plot)
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


def thinned(conditions):
    """Velocities of the conditions, equally spread over them and few enough; at least 5 if there are."""
    temperatures = 1 if conditions.temperature is None else conditions.temperature.size
    count = max(5, _POINTS // (temperatures * conditions.pressure.size))
    velocity = conditions.velocity
    if velocity.size <= count:
        return velocity
    return velocity[np.linspace(0, velocity.size - 1, count).round().astype(int)]
