"""The command `rubberfric`.

Exit status: 0 done; 2 bad input, with one line on stderr and nothing written; 1 the work failed;
130 interrupted by Ctrl-C (SIGINT), 143 by SIGTERM, within a second, with one line on stderr.
"""

import argparse
import importlib.metadata
import os
import sys

import jax
import numpy as np

from rubberfric.base.atomic import check_writable
from rubberfric.base.quadrature import Quadrature
from rubberfric.commands import accuracy as accuracy_command
from rubberfric.commands import map as map_command
from rubberfric.commands.interrupts import LOST, Interrupts
from rubberfric.commands.reliability import convergence_note, outside_note
from rubberfric.io.files import read_computable
from rubberfric.io.results import Result, result_shape, save_result
from rubberfric.plot.save import check_plot, save_plot
from rubberfric.theory.model import solve
from rubberfric.theory.quantities import Solution, quantities_of

PROGRAM = "rubberfric"


def main(argv=None):
    """Run the command with arguments `argv`; returns the exit status.

    None: those of the process, which a signal then ends (`rubberfric.commands.interrupts`).
    """
    arguments = _parser().parse_args(argv)
    # The library never does this: the precision of a program is its own choice.
    jax.config.update("jax_enable_x64", True)
    with Interrupts(PROGRAM, lambda: arguments.left(arguments), process=argv is None) as interrupts:
        try:
            return arguments.run(arguments)
        except BrokenPipeError:
            return reader_left()
        except ValueError as error:
            return complain(PROGRAM, error, 2)
        except KeyboardInterrupt:
            return interrupts.complain()
        except (OSError, FloatingPointError) as error:
            return complain(PROGRAM, error, 1)


def run(arguments):
    """`rubberfric run`: compute a scene file at its conditions."""
    if arguments.out is not None:
        check_writable(arguments.out, (".h5",))
    if arguments.plot is not None:
        check_plot(arguments.plot)
    scene, conditions, title = read_computable(arguments.scene)
    result = Result(scene, conditions, compute(scene, conditions), Quadrature(), title)
    if arguments.out is not None:
        save_result(arguments.out, result)
    if arguments.plot is not None:
        save_plot(arguments.plot, result)
    for line in table(result):
        print(line)
    for note in (outside_note(result), convergence_note(result)):
        if note:
            print(f"\n{note}")
    sys.stdout.flush()
    return 0


def compute(scene, conditions):
    """All quantities at all conditions, NumPy arrays of shape [temperature, pressure, velocity].

    Which they are follows from the scene (`model.quantities_of`).
    FloatingPointError if one of them is not finite.
    """
    quantities = quantities_of(scene)
    solution = solve(scene, *conditions.grid(), quantities=quantities)
    shape = result_shape(conditions)
    found = {name: np.broadcast_to(np.asarray(getattr(solution, name)), shape) for name in quantities}
    for name, values in found.items():
        bad = np.argwhere(~np.isfinite(values))
        if bad.size:
            _, j, k = bad[0]
            v, p = conditions.velocity[k], conditions.pressure[j]
            raise FloatingPointError(
                f"{name} = {values[tuple(bad[0])]} at v = {v:g} m/s, p = {p:g} Pa: not finite"
            )
    return Solution(**found)


# Columns of the printed table: heading and scale.
COLUMNS = {
    "area": ("A/A0 [-]", 1.0),
    "friction": ("mu [-]", 1.0),
    "separation": ("u_bar [um]", 1e6),
    "viscoelastic_friction": ("mu_visc [-]", 1.0),
    "shear_friction": ("mu_shear [-]", 1.0),
    "transverse_friction": ("mu_side [-]", 1.0),
    "flash_temperature": ("T_flash [K]", 1.0),
}


def table(result):
    """Lines of the printed table: a block for every temperature and pressure."""
    solution = result.solution._asdict()
    columns = {name: solution[name] for name in COLUMNS if solution[name] is not None}
    # Six columns of 12 leave no more than one space between them on a line of 80.
    gap = " " if len(columns) > 4 else "  "
    if result.title:
        yield result.title
    for i, j in np.ndindex(result_shape(result.conditions)[:2]):
        T = result.conditions.temperature
        at = "" if T is None else f", temperature {T[i]:.6g} K ({T[i] - 273.15:.4g} °C)"
        yield ""
        yield f"pressure {result.conditions.pressure[j] / 1e6:.6g} MPa{at}"
        yield gap.join(f"{heading:>12}" for heading in ("v [m/s]", *(COLUMNS[name][0] for name in columns)))
        for k, v in enumerate(result.conditions.velocity):
            row = (f"{COLUMNS[name][1] * values[i, j, k]:12.5e}" for name, values in columns.items())
            yield gap.join((f"{v:12.4e}", *row))


class Parser(argparse.ArgumentParser):
    """A parser whose complaint is one line."""

    def error(self, message):
        """One line, without the usage that argparse puts before it."""
        self.exit(2, f"{self.prog}: {message}\n")


def _parser():
    parser = Parser(
        prog="rubberfric", description="Rubber friction and contact of rough viscoelastic solids."
    )
    version = importlib.metadata.version("rubberfric")
    parser.add_argument("--version", action="version", version=f"rubberfric {version}")
    parser.set_defaults(left=lambda arguments: LOST)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    one = commands.add_parser(
        "run",
        help="compute a scene at the conditions in its file",
        description="Print contact area, friction coefficient and mean separation over velocity; parts of "
        "the friction, the force across the direction of sliding and the flash temperature where the scene "
        "has contact shear, anisotropic roughness and heating.",
    )
    one.add_argument(
        "scene", metavar="SCENE", help="scene file (.toml), or result file (.h5) to compute again"
    )
    one.add_argument("--out", metavar="FILE.h5", help="write the result and the scene that made it")
    one.add_argument("--plot", metavar="FILE.png", help="draw the curves (.png, .pdf or .svg)")
    one.set_defaults(run=run)
    accuracy_command.add(commands)
    map_command.add(commands)
    return parser


def complain(program, error, status):
    """Say on one line what was wrong; returns the exit status."""
    print(f"{program}: {' '.join(str(error).split())}", file=sys.stderr)
    return status


def reader_left():
    """Exit status where the reader of the output went away (| head), of which Python would complain again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 1
