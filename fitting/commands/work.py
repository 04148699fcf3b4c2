"""Run the commands `rubberfric-fit`, `rubberfric-fit design` and `rubberfric-fit calibration`.

`design` fits a job and chooses the next measurements. The job has an additional table of the candidates:

    [design]
    velocity = { from = 1e-5, to = 0.1, points = 17 }   # as in [run] of a scene file; every combination
    pressure = 2e5                                      # of these is a candidate
    temperature = [278.15, 293.15, 313.15]
    n = 6                                               # measurements to make
    criterion = "D"                                     # or "A", or a table of velocity, pressure and
                                                        # temperature at which friction is to be predicted
    relative = 0.05                                     # optional: error of a measurement; draws, seed

The exit status refers to the fit on which the design is based, as for `rubberfric-fit`.

`calibration` tests the error bars that a job would give. True parameters are drawn from the priors of the
job, which must be Gaussian for every free parameter. Data are drawn from the scenes with these parameters, at
the conditions and with the errors of the job's data. The measured values are not used. The exit status is as
for `rubberfric-fit`, and 3 if the error bars or the draws of an identified parameter are wrong.
"""

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np

import rubberfric as rf
from fitting.commands.arguments import PROGRAM
from fitting.commands.job import Job, about, read_job
from fitting.ensemble.calibration import calibration
from fitting.ensemble.members import EnsembleResult, bootstrap_members
from fitting.ensemble.run import run_ensemble
from fitting.fit import fit
from fitting.results.budget import Budget
from fitting.results.hdf5 import save
from fitting.results.plot import save_plot
from fitting.results.result import FitResult
from fitting.uncertainty.design import MOST_MEASUREMENTS, Design, design, prediction
from fitting.uncertainty.likelihood_profile import LikelihoodProfile
from rubberfric.base import Progress, StrPath, shown
from rubberfric.commands import Interrupts, complain, reworded, write_outputs
from rubberfric.io import read_conditions, toml
from rubberfric.plot import save_figure

_POINTS = ("velocity", "pressure", "temperature")
KEYS = (*_POINTS, "n", "criterion", "relative", "draws", "seed")
# Options in the table [fit] of a job that a calibration uses. The others concern the search.
_SHARED_OPTIONS = ("key", "discrepancy")
# Largest numbers of candidates, of measurements to choose, and of draws.
_MOST = {"candidates": 100_000, "n": MOST_MEASUREMENTS, "draws": 100_000}

# Stage of the work, path of a file or None, and function that writes the file.
Output = tuple[str, Any, Callable[[str], object]]


def finish(show: Progress, text: str, *outputs: Output) -> None:
    """Write the files of a command, print its text, and raise the error of a file that was not written."""
    failure = write_outputs(show, *outputs)
    show.end()
    print(reworded(text), end="", flush=True)
    if failure is not None:
        raise failure


def run_fit(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Fit a job, write files, print the report, and return the exit status."""
    job = _job(arguments, show)
    try:
        result = _fit(arguments.job, job, interrupts, show)
        interrupts.hold()
        budget = None
        if arguments.budget is not None and result.success and not interrupts.stopped:
            show("computing the budget")
            budget = result.budget(**job.budget)
        content = None if budget is None else budget.write_group
        failure: Exception | None = write_outputs(
            show,
            ("writing", arguments.out, lambda path: save(path, result, job.title, budget=content)),
            ("drawing", arguments.plot, lambda path: save_plot(path, result, job.title)),
            *_picture(budget, arguments.budget),
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
    text = _titled(job, result.report())
    text += "".join(more.report() for more in (budget, profile, spread) if more is not None)
    finish(show, text)
    if failure is not None:
        raise failure
    if interrupts.asked:
        return complain(PROGRAM, f"interrupted: {_left(result, spread, interrupts)}", interrupts.status)
    if not result.success:
        return complain(PROGRAM, result.message, 1)
    if result.verdict.explains is False:
        return complain(PROGRAM, "the scene does not explain the data: see the verdict above", 3)
    return 0


def _picture(budget: Budget | None, path: Any) -> list[Output]:
    """Return the output of the picture of a budget, if a file was given."""
    if budget is None or not isinstance(path, str):
        return []
    return [("drawing", path, lambda path: save_figure(path, budget.plot().figure))]


def _job(arguments: argparse.Namespace, show: Progress) -> Job:
    show(f"reading {arguments.job}")
    return read_job(arguments.job)


def _titled(job: Job, report: str) -> str:
    return job.title + "\n" * bool(job.title) + report


def _left(result: FitResult, spread: EnsembleResult | None, interrupts: Interrupts) -> str:
    if not result.success:
        return "these are the best values so far"
    if not interrupts.stopped:
        return "all results are complete"
    return "one start has converged, others have not" if spread is None else "the bootstrap is incomplete"


def _fit(path: StrPath, job: Job, interrupts: Interrupts, show: Progress, hold: bool = True) -> FitResult:
    def callback(step: int, cost: float) -> None:
        show(f"step {step}, cost {cost:.6g}")
        if hold:
            interrupts.hold()  # from now on there is something to report
        interrupts.check()

    options = {"prior": job.prior, "callback": callback, "progress": show, **job.options}
    with about(path):
        result = fit(job.scene, job.data, job.free, **options)
    if not interrupts.holding:
        interrupts.check()  # a fit ends normally if an interrupt comes between its start and the first step
    return result


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


def _counting(what: str, interrupts: Interrupts, show: Progress) -> Callable[[int, int], None]:
    def callback(done: int, members: int) -> None:
        show(f"{what}: {done} of {members} fits")
        interrupts.check()

    return callback


def _bootstrap(
    arguments: argparse.Namespace, result: FitResult, interrupts: Interrupts, show: Progress
) -> EnsembleResult:
    show("bootstrap: compiling")
    return run_ensemble(
        bootstrap_members(result, arguments.bootstrap),
        checkpoint=arguments.checkpoint,
        resume=arguments.resume,
        callback=_counting("bootstrap", interrupts, show),
    )


def run_design(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Fit a job, choose measurements, write files, print the report, and return the exit status."""
    job, program = _job(arguments, show), f"{PROGRAM} design"
    if job.design is None:
        raise ValueError(f"{arguments.job}: design: is missing; add a table [design] with the candidates")
    if not isinstance(job.scene, rf.Scene):
        raise ValueError(f"{arguments.job}: design: must have one scene, not several")
    if "discrepancy" in job.options:
        raise ValueError(
            f"{arguments.job}: discrepancy: must be left out of a design, because further measurements"
            " share the error of the theory, and a design promises errors without it"
        )
    options = read_design(arguments.job, job.design, job.scene)
    result = _fit(arguments.job, job, interrupts, show, hold=False)
    if not result.success:
        return complain(program, result.message, 1)
    show("choosing measurements")
    with about(arguments.job):
        plan: Design = design(result, **options)
    finish(
        show,
        _titled(job, plan.report()),
        ("writing", arguments.out, plan.write),
        ("drawing", arguments.plot, lambda path: save_figure(path, plan.plot())),
    )
    if result.verdict.explains is False:
        return complain(program, "the scene does not explain the data: run rubberfric-fit for details", 3)
    return 0


def read_design(path: StrPath, content: Any, scene: rf.Scene) -> dict[str, Any]:
    """Return the arguments of `fitting.design` from the table [design] of a job."""
    path = Path(path)
    toml.check_keys(path, "design", content, KEYS, ("velocity", "pressure", "n"))
    options: dict[str, Any] = {"candidates": _grid(path, "design", content, scene), "n": content["n"]}
    for name in ("n", "draws"):
        if isinstance(content.get(name), int | float) and content[name] > _MOST[name]:
            raise ValueError(f"{path}: design.{name} = {content[name]}: must be at most {_MOST[name]}")
    criterion = content.get("criterion", "D")
    if isinstance(criterion, dict):
        toml.check_keys(path, "design.criterion", criterion, _POINTS)
        v, p, *T = _grid(path, "design.criterion", criterion, scene)
        criterion = prediction(v, p, T[0] if T else None)
    options["criterion"] = criterion
    if "relative" in content:
        options["relative"] = toml.number(path, "design.relative", content["relative"])
    if "draws" in content:
        options["draws"] = content["draws"]
    if "seed" in content:
        if isinstance(content["seed"], bool) or not isinstance(content["seed"], int):
            raise ValueError(f"{path}: design.seed = {shown(content['seed'])}: must be an integer")
        options["key"] = jax.random.key(content["seed"])
    return options


def _grid(path, table, content, scene):
    """Return flat arrays (velocity, pressure), and temperature if given, of all combinations."""
    points = {name: content[name] for name in _POINTS if name in content}
    conditions = read_conditions(path, table, points, scene)
    size = math.prod(values.size for values in conditions if values is not None)
    if size > _MOST["candidates"]:
        raise ValueError(f"{path}: {table}: has {size} candidates: must have at most {_MOST['candidates']}")
    grids = np.broadcast_arrays(*(x for x in conditions.grid() if x is not None))
    return tuple(np.array(x).ravel() for x in grids)


def run_calibration(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Run a calibration, draw a figure, print the report, and return the exit status."""
    job = _job(arguments, show)
    if not isinstance(job.scene, rf.Scene) or isinstance(job.data, dict):
        raise ValueError(f"{arguments.job}: calibration needs one scene, not several")
    if job.options.get("loss", "linear") != "linear":
        raise ValueError(f"{arguments.job}: fit.loss: must be 'linear' for a calibration")
    options: dict[str, Any] = {name: job.options[name] for name in _SHARED_OPTIONS if name in job.options}
    options |= {"on": arguments.on, "callback": _counting("calibration", interrupts, show)}
    show("calibration: compiling")
    with about(arguments.job):
        result = calibration(job.scene, job.data, job.free, job.prior, arguments.members, **options)
    interrupts.check()  # a calibration ends normally with the members that are done
    drawing = ("drawing", arguments.plot, lambda path: save_figure(path, result.plot()))
    finish(show, _titled(job, result.report()), drawing)
    if not result.inside()[result.identified].all():
        text = "error bars do not have their stated coverage: see NOT CALIBRATED above"
        return complain(f"{PROGRAM} calibration", text, 3)
    return 0
