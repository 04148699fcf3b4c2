"""What the commands share: complaints of one line, exit statuses, outputs, progress."""

import argparse
import os
import sys
from collections.abc import Callable
from typing import NoReturn

import jax
import numpy as np

from rubberfric.base.atomic import check_writable
from rubberfric.base.progress import Progress, TerminalLine
from rubberfric.commands.interrupts import Interrupts
from rubberfric.io.results import Result
from rubberfric.plot.save import check_plot


class Parser(argparse.ArgumentParser):
    """A parser whose complaint is one line."""

    def error(self, message: str) -> NoReturn:
        """One line, without the usage that argparse puts before it."""
        self.exit(2, f"{self.prog}: {message}\n")


def ended(program: str, work: Callable[[Interrupts], int], *, process: bool) -> int:
    """Do the work of a command, in double precision; returns its exit status, or that of how it failed.

    Parameters
    ----------
    program : what the line of a complaint begins with
    work : function of the signals that arrive meanwhile, returns the exit status
    process : as of `Interrupts`
    """
    # The library never does this: the precision of a program is its own choice.
    jax.config.update("jax_enable_x64", True)
    with Interrupts(program, process=process) as interrupts:
        try:
            return work(interrupts)
        except KeyboardInterrupt:
            return interrupts.complain()
        except BrokenPipeError:  # the reader went away (| head), of which Python would complain again
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 1
        except (OSError, FloatingPointError, np.linalg.LinAlgError) as error:  # the last is a ValueError
            return complain(program, error, 1)
        except ValueError as error:
            return complain(program, error, 2)


def complain(program: str, error: object, status: int) -> int:
    """Say on one line what was wrong; returns the exit status."""
    print(f"{program}: {' '.join(str(error).split())}", file=sys.stderr)
    return status


def progress() -> Progress:
    """A line on stderr in place of the last one, gone at the end of a `with` block; nothing elsewhere."""
    return Progress("", TerminalLine(sys.stderr, stays=False) if sys.stderr.isatty() else None)


def add_outputs(parser: argparse.ArgumentParser, name: str, written: str, drawn: str) -> None:
    """Add --out, for a file of that kind of name, and --plot."""
    parser.add_argument("--out", metavar=name, help=written)
    parser.add_argument("--plot", metavar="FILE.png", help=f"{drawn} (.png, .pdf or .svg)")


def check_outputs(arguments: argparse.Namespace, suffix: str) -> None:
    """ValueError unless what --out and --plot name could be written."""
    if arguments.out is not None:
        check_writable(arguments.out, (suffix,))
    if arguments.plot is not None:
        check_plot(arguments.plot)


def convergence_line(result: Result) -> str:
    """How many temperatures of a heated scene are not a solution; "" if all are."""
    converged = result.solution.converged
    if converged is None:
        return ""
    # A temperature at a time: an array that stays in its file is not read at once.
    left = [np.size(plane) - np.count_nonzero(plane) for plane in converged]
    if not any(left):
        return ""
    i = int(np.flatnonzero(left)[0])
    j, k = np.argwhere(~converged[i])[0]
    return (
        f"the temperatures did not converge at {sum(left)} of {converged.size} points, "
        f"first at v = {result.conditions.velocity[k]:g} m/s, p = {result.conditions.pressure[j]:g} Pa: "
        "the values there are those of the last iterate"
    )
