"""The command `rubberfric-fit`.

Exit status: 0 fitted; 3 fitted, but the scene does not explain the data (`fitting.uncertainty.verdict`);
1 not converged, interrupted, or the work failed; 2 bad input, with one line on stderr and nothing
written. A fit that was interrupted (Ctrl-C or SIGTERM) is reported and written as far as it came, as
is one that did not converge. An interrupt before the first step, and a second one, do not wait for
that: exit status 130 or 143, within a second. A bootstrap that was interrupted, or killed, goes on
with --resume.
"""

import argparse
import importlib.metadata
import sys
from collections.abc import Sequence

import numpy as np

from fitting.commands import design
from fitting.commands.job import Job, read_job
from fitting.ensemble.members import bootstrap_members
from fitting.ensemble.result import EnsembleResult
from fitting.ensemble.run import run_ensemble
from fitting.fit import fit
from fitting.results.hdf5 import save
from fitting.results.plot import save_plot
from fitting.results.result import FitResult
from rubberfric.base import StrPath, check_writable
from rubberfric.commands import Interrupts, Parser, add_outputs, check_outputs, complain, ended, progress

PROGRAM = "rubberfric-fit"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments `argv`; returns the exit status.

    None: those of the process, which a signal then may end (`rubberfric.commands.interrupts`).
    """
    given = sys.argv[1:] if argv is None else list(argv)
    if given[:1] == ["design"]:
        return design.main(given[1:], process=argv is None)
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.bootstrap is None and (arguments.checkpoint is not None or arguments.resume):
        parser.error("--checkpoint and --resume are of a bootstrap: must come with --bootstrap N")
    if arguments.resume and arguments.checkpoint is None:
        parser.error("--resume: must come with --checkpoint FILE.h5")
    return ended(PROGRAM, lambda interrupts: run(arguments, interrupts), process=argv is None)


def run(arguments: argparse.Namespace, interrupts: Interrupts) -> int:
    """Fit a job file, write what was asked for, print the report."""
    check_outputs(arguments, ".h5")
    if arguments.checkpoint is not None:
        check_writable(arguments.checkpoint, (".h5",))
    job, failures = read_job(arguments.job), []
    try:
        result = _fit(arguments.job, job, interrupts)
        interrupts.hold()
        for writer, path in ((save, arguments.out), (save_plot, arguments.plot)):
            try:
                if path is not None:
                    writer(path, result, job.title)
            except OSError as error:  # a full disk must not cost the report
                failures.append(error)
        spread = None
        if arguments.bootstrap is not None and result.success and not interrupts.stopped:
            spread = _bootstrap(arguments, result, interrupts)
    finally:
        interrupts.release()
    print(job.title + "\n" * bool(job.title) + result.report(), end="")
    print("" if spread is None else spread.report(), end="", flush=True)
    if failures:
        raise failures[0]
    if not result.success:
        return complain(PROGRAM, result.message, 1)
    if interrupts.stopped:
        left = "a start had converged, others had not"
        left = left if spread is None else "of the bootstrap only a part is done"
        return complain(PROGRAM, f"interrupted: {left}", 1)
    if result.verdict.explains is False:
        return complain(PROGRAM, "the scene does not explain the data: see the verdict above", 3)
    return 0


def _fit(path: StrPath, job: Job, interrupts: Interrupts) -> FitResult:
    """The fit of a job, with its progress on a terminal."""
    with progress() as show:

        def callback(step, cost):
            show(f"step {step}, cost {cost:.6g}")
            interrupts.hold()  # from now on there is something to report
            interrupts.check()

        show("compiling ...")
        try:
            return fit(job.scene, job.data, job.free, prior=job.prior, callback=callback, **job.options)
        except np.linalg.LinAlgError:  # a ValueError, but not one of the input
            raise
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None


def _bootstrap(arguments: argparse.Namespace, result: FitResult, interrupts: Interrupts) -> EnsembleResult:
    """Refits of simulated data, with their progress on a terminal."""
    with progress() as show:

        def callback(done, members):
            show(f"bootstrap: {done} of {members} fits")
            interrupts.check()

        show("bootstrap: compiling ...")
        return run_ensemble(
            bootstrap_members(result, arguments.bootstrap),
            checkpoint=arguments.checkpoint,
            resume=arguments.resume,
            callback=callback,
        )


def _parser():
    parser = Parser(
        prog=PROGRAM,
        description="Fit parameters of a rubber friction scene to measurements; print values and errors.",
        epilog="rubberfric-fit design JOB: fit, and choose the measurements to make next.",
    )
    version = importlib.metadata.version("rubberfric")
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {version}")
    parser.add_argument("job", metavar="JOB", help="job file (.toml): scene, data, what is free")
    add_outputs(
        parser, "FILE.h5", "write the fit; fitting.FitResult.load reads it", "draw data, fit and residuals"
    )
    parser.add_argument(
        "--bootstrap", metavar="N", type=_count, help="refit N simulated data sets, report their spread"
    )
    parser.add_argument(
        "--checkpoint",
        metavar="FILE.h5",
        help="save the bootstrap's state every minute; refused if it exists",
    )
    parser.add_argument("--resume", action="store_true", help="go on with the checkpoint, if it exists")
    return parser


def _count(text):
    if not text.isascii() or not text.isdigit() or not 0 < int(text) < 2**31:
        raise argparse.ArgumentTypeError(f"{text!r}: must be an integer >= 1")
    return int(text)
