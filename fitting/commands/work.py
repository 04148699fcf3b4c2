"""Run the command `rubberfric-fit` after its arguments have been checked."""

import argparse

from fitting.commands.job import Job, about, read_job
from fitting.ensemble.members import EnsembleResult, bootstrap_members
from fitting.ensemble.run import run_ensemble
from fitting.fit import fit
from fitting.results.hdf5 import save
from fitting.results.plot import save_plot
from fitting.results.result import FitResult
from fitting.uncertainty.likelihood_profile import LikelihoodProfile
from rubberfric.base import Progress, StrPath
from rubberfric.commands import Interrupts, complain, write_outputs

_PROGRAM = "rubberfric-fit"


def run_fit(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Fit a job, write files, print the report, and return the exit status."""
    show(f"reading {arguments.job}")
    outputs = (arguments.out, arguments.plot, arguments.checkpoint)
    job = read_job(arguments.job, [path for path in outputs if path is not None])
    try:
        result = _fit(arguments.job, job, interrupts, show)
        interrupts.hold()
        failure: Exception | None = write_outputs(
            show,
            ("writing", arguments.out, lambda path: save(path, result, job.title)),
            ("drawing", arguments.plot, lambda path: save_plot(path, result, job.title)),
        )
        profile = spread = None
        if arguments.profile is not None and result.success and not interrupts.stopped:
            try:
                profile = _profile(arguments, result, interrupts, show)
            except ValueError as error:  # a wrong name must not prevent the report
                failure = failure or ValueError(f"--profile: {error}")
        if arguments.bootstrap is not None and result.success and not interrupts.stopped:
            spread = _bootstrap(arguments, result, interrupts, show)
    finally:
        interrupts.release()
    show("computing the report")
    text = job.title + "\n" * bool(job.title) + result.report()
    text += "".join(more.report() for more in (profile, spread) if more is not None)
    show.end()
    print(text, end="", flush=True)
    if failure is not None:
        raise failure
    if interrupts.asked:
        return complain(_PROGRAM, f"interrupted: {_left(result, spread, interrupts)}", interrupts.status)
    if not result.success:
        return complain(_PROGRAM, result.message, 1)
    if result.verdict.explains is False:
        return complain(_PROGRAM, "the scene does not explain the data: see the verdict above", 3)
    return 0


def _left(result: FitResult, spread: EnsembleResult | None, interrupts: Interrupts) -> str:
    if not result.success:
        return "these are the best values so far"
    if not interrupts.stopped:
        return "all results are complete"
    return "one start has converged, others have not" if spread is None else "the bootstrap is incomplete"


def _fit(path: StrPath, job: Job, interrupts: Interrupts, show: Progress) -> FitResult:
    def callback(step: int, cost: float) -> None:
        show(f"step {step}, cost {cost:.6g}")
        interrupts.hold()  # from now on there is something to report
        interrupts.check()

    with about(path):
        return fit(
            job.scene, job.data, job.free, prior=job.prior, callback=callback, progress=show, **job.options
        )


def _profile(
    arguments: argparse.Namespace, result: FitResult, interrupts: Interrupts, show: Progress
) -> LikelihoodProfile:
    def callback(step: int, cost: float) -> None:
        del cost
        show(f"profile of {arguments.profile}: step {step}")
        interrupts.check()

    show("profile: compiling")
    of = result.profile_cutoff if arguments.profile.endswith(".q1") else result.profile
    return of(arguments.profile, callback=callback)


def _bootstrap(
    arguments: argparse.Namespace, result: FitResult, interrupts: Interrupts, show: Progress
) -> EnsembleResult:
    def callback(done: int, members: int) -> None:
        show(f"bootstrap: {done} of {members} fits")
        interrupts.check()

    show("bootstrap: compiling")
    return run_ensemble(
        bootstrap_members(result, arguments.bootstrap),
        checkpoint=arguments.checkpoint,
        resume=arguments.resume,
        callback=callback,
    )
