"""The command `rubberfric-fit`.

The exit status is 0 for a good fit, 3 if the scene does not explain the data (`fitting.uncertainty.verdict`),
1 if the fit did not converge or an error occurred, 2 for bad input, with one line on stderr and nothing
written, and 130, 143 or 129 after an interrupt by Ctrl-C (SIGINT), SIGTERM or SIGHUP. An interrupt after the
first step of a fit gives a message at once. The best values so far are reported and written, as for a fit
that did not converge. An interrupt before the first step, or a second one, ends the process within a second.
A bootstrap that was interrupted, or killed, continues with --resume.
"""

from __future__ import annotations

from rubberfric.commands import leave_at_once

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from rubberfric.commands import Interrupts, Parser

PROGRAM = "rubberfric-fit"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments `argv`, and return the exit status.

    `argv` None: the arguments of the process, which signals can end (`rubberfric.commands.interrupts`).
    """
    if argv is None:
        leave_at_once(PROGRAM)
    import sys

    from rubberfric.commands import ended

    given = sys.argv[1:] if argv is None else list(argv)
    program = f"{PROGRAM} {given[0]}" if given and given[0] in _SUB_COMMANDS else PROGRAM
    return ended(program, lambda interrupts: _run(given, interrupts, argv is None), process=argv is None)


def _run(given: Sequence[str], interrupts: Interrupts, process: bool) -> int:
    from importlib import import_module

    from rubberfric.commands import begin_jax, check_input, check_outputs, command_progress

    kind = given[0] if given and given[0] in _SUB_COMMANDS else "fit"
    if kind in _SUB_COMMANDS:
        arguments = _SUB_COMMANDS[kind]().parse_args(given[1:])
        check_input(arguments.job, (".toml",))
        check_outputs(arguments, ".csv")
    else:
        arguments = _parser().parse_args(given)
        check_fit_arguments(arguments)
    with command_progress(arguments.verbose) as show:
        show("loading JAX")
        begin_jax(process=process, cache=not arguments.no_cache)
        module = import_module(f"fitting.commands.{'work' if kind == 'fit' else 'planning'}")
        return getattr(module, f"run_{kind}")(arguments, interrupts, show)


def check_fit_arguments(arguments: argparse.Namespace) -> None:
    """Raise a ValueError if the arguments are wrong, before any work begins."""
    from pathlib import Path

    from rubberfric.base import check_writable
    from rubberfric.commands import check_input, check_outputs

    checkpoint = arguments.checkpoint
    if arguments.bootstrap is None and (checkpoint is not None or arguments.resume):
        raise ValueError("--checkpoint and --resume must come with --bootstrap N")
    if arguments.resume and checkpoint is None:
        raise ValueError("--resume: must come with --checkpoint FILE.h5")
    check_input(arguments.job, (".toml",))
    check_outputs(arguments, ".h5")
    if checkpoint is None:
        return
    check_writable(checkpoint, (".h5",))
    if arguments.out is not None and Path(checkpoint).resolve() == Path(arguments.out).resolve():
        raise ValueError(f"--checkpoint {checkpoint}: is the file of --out; must be another file")
    if Path(checkpoint).exists() and not arguments.resume:
        raise ValueError(f"{checkpoint}: the file exists; continue it with --resume, or remove it")


def _design_parser() -> Parser:
    from rubberfric.commands import Parser, add_common, add_outputs

    parser = Parser(
        prog=f"{PROGRAM} design", description="Fit a job and choose the measurements to make next."
    )
    parser.add_argument("job", metavar="JOB", help="job file (.toml) with a table [design]")
    add_outputs(parser, "FILE.csv", "write the conditions to measure at", "draw the gain of each measurement")
    add_common(parser)
    return parser


def _calibration_parser() -> Parser:
    from rubberfric.commands import Parser, add_common

    parser = Parser(
        prog=f"{PROGRAM} calibration",
        description="Fit data drawn from the priors of a job; report the coverage of its error bars.",
    )
    parser.add_argument(
        "job", metavar="JOB", help="job file (.toml) with a Gaussian prior of each free parameter"
    )
    parser.add_argument(
        "--members", metavar="N", type=_count, default=1000, help="number of fits (default: 1000)"
    )
    parser.add_argument(
        "--on",
        choices=("normal", "samples"),
        default="normal",
        help="compare the truths with error bars, or with draws from the posterior, which takes longer",
    )
    parser.add_argument(
        "--plot", metavar="FILE.png", help="draw the ranks of the truths (.png, .pdf or .svg)"
    )
    parser.set_defaults(out=None)
    add_common(parser)
    return parser


def _parser() -> Parser:
    from rubberfric.base import VERSION
    from rubberfric.commands import Parser, add_common, add_outputs

    parser = Parser(
        prog=PROGRAM,
        description="Fit parameters of a rubber friction scene to measurements; print values and errors.",
        epilog="rubberfric-fit design JOB: fit, and choose the measurements to make next."
        " rubberfric-fit calibration JOB: measure the coverage of error bars.",
    )
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {VERSION}")
    parser.add_argument("job", metavar="JOB", help="job file (.toml): scene, data, free parameters")
    add_outputs(
        parser, "FILE.h5", "write the fit; fitting.FitResult.load reads it", "draw data, fit and residuals"
    )
    parser.add_argument(
        "--bootstrap", metavar="N", type=_count, help="fit N simulated data sets, report their spread"
    )
    parser.add_argument(
        "--profile",
        metavar="KEYPATH",
        help="fix this parameter, or the q1 of a spectrum, at several values; print the cost",
    )
    parser.add_argument(
        "--checkpoint",
        metavar="FILE.h5",
        help="save the bootstrap's state every minute; refused if it exists",
    )
    parser.add_argument("--resume", action="store_true", help="continue the checkpoint, if it exists")
    add_common(parser)
    return parser


def _count(text: str) -> int:
    from argparse import ArgumentTypeError

    if not text.isascii() or not text.isdigit() or len(text) > 9 or not 0 < int(text) <= _MOST:
        raise ArgumentTypeError(f"{text[:20]!r}: must be an integer >= 1, and <= {_MOST}")
    return int(text)


# Largest number of fits; the data of more would exceed the memory of many machines.
_MOST = 10**6
# Parsers of the sub-commands, which `fitting.commands.planning` runs.
_SUB_COMMANDS = {"design": _design_parser, "calibration": _calibration_parser}
