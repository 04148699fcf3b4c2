"""The command `rubberfric-fit`.

Exit status: 0 fitted; 1 not converged, interrupted, or the work failed; 2 bad input, with one
line on stderr and nothing written. A fit that was interrupted (Ctrl-C or SIGTERM) is reported
and written as far as it came, as is one that did not converge. An interrupt before the first
step, and a second one, do not wait for that: exit status 130 or 143, within a second. A
bootstrap that was interrupted, or killed, goes on with --resume.
"""

import argparse
import importlib.metadata

import numpy as np

from fitting.commands.job import read_job
from fitting.ensemble.members import bootstrap_members
from fitting.ensemble.run import run_ensemble
from fitting.fit import fit
from fitting.results.hdf5 import save
from fitting.results.plot import save_plot
from rubberfric.base.atomic import check_writable
from rubberfric.commands.shared import Parser, complain, ended, progress
from rubberfric.plot.save import check_plot

PROGRAM = "rubberfric-fit"


def main(argv=None):
    """Run the command with arguments `argv`; returns the exit status.

    None: those of the process, which a signal then may end (`rubberfric.commands.interrupts`).
    """
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.bootstrap is None and (arguments.checkpoint is not None or arguments.resume):
        parser.error("--checkpoint and --resume are of a bootstrap: must come with --bootstrap N")
    if arguments.resume and arguments.checkpoint is None:
        parser.error("--resume: must come with --checkpoint FILE.h5")
    return ended(PROGRAM, lambda interrupts: run(arguments, interrupts), process=argv is None)


def run(arguments, interrupts):
    """Fit a job file, write what was asked for, print the report."""
    if arguments.out is not None:
        check_writable(arguments.out, (".h5",))
    if arguments.plot is not None:
        check_plot(arguments.plot)
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
        text = (
            "a start had converged, others had not"
            if spread is None
            else "of the bootstrap only a part is done"
        )
        return complain(PROGRAM, f"interrupted: {text}", 1)
    return 0


def _fit(path, job, interrupts):
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


def _bootstrap(arguments, result, interrupts):
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
    )
    version = importlib.metadata.version("rubberfric")
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {version}")
    parser.add_argument("job", metavar="JOB", help="job file (.toml): scene, data, what is free")
    parser.add_argument("--out", metavar="FILE.h5", help="write the fit; fitting.FitResult.load reads it")
    parser.add_argument(
        "--plot", metavar="FILE.png", help="draw data, fit and residuals (.png, .pdf or .svg)"
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
