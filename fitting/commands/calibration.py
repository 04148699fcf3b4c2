"""The command `rubberfric-fit calibration`: whether the error bars of a job would be what they say.

Truths are drawn from the priors of the job, which must be Gaussian ones of all that is free; data from the
scenes that they make, at the conditions and with the errors of the job's data. Of the measured values none
counts.

Exit status as of `rubberfric-fit`; 3: of a number that the data determine, error bars (or draws) are not what
they say.
"""

import argparse
from typing import Any

import rubberfric as rf
from fitting.commands.job import read_job
from fitting.commands.refusals import about
from fitting.ensemble.calibration import calibration
from rubberfric.base import Progress
from rubberfric.commands import Interrupts, complain, write_outputs
from rubberfric.plot import save_figure

PROGRAM = "rubberfric-fit calibration"
# Of a job's table [fit]: what a calibration has as well; others say how a fit finds its minimum.
_OPTIONS = ("key", "discrepancy")


def run(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Calibrate, draw what was asked for, print the report."""
    show(f"reading {arguments.job}")
    job = read_job(arguments.job, [] if arguments.plot is None else [arguments.plot])
    if not isinstance(job.scene, rf.Scene) or isinstance(job.data, dict):
        raise ValueError(f"{arguments.job}: scenes: must be one scene, not several, for a calibration")
    if job.options.get("loss", "linear") != "linear":
        raise ValueError(f"{arguments.job}: fit.loss: must be 'linear' for a calibration")
    options: dict[str, Any] = {name: job.options[name] for name in _OPTIONS if name in job.options}

    def callback(done: int, members: int) -> None:
        show(f"calibration: {done} of {members}")
        interrupts.check()

    show("calibration: compiling")
    with about(arguments.job):
        found = calibration(
            job.scene,
            job.data,
            job.free,
            job.prior,
            arguments.members,
            on=arguments.on,
            callback=callback,
            **options,
        )
    failure = write_outputs(
        show,
        ("drawing", arguments.plot, lambda path: save_figure(path, found.plot())),
    )
    show.end()
    print(job.title + "\n" * bool(job.title) + found.report(), end="", flush=True)
    if failure is not None:
        raise failure
    if not found.inside()[found.identified].all():
        return complain(PROGRAM, "error bars are not what they say: see NOT CALIBRATED above", 3)
    return 0
