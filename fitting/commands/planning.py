"""Commands on planned measurements: `rubberfric-fit design` and `rubberfric-fit calibration`.

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
from pathlib import Path
from typing import Any

import jax
import numpy as np

import rubberfric as rf
from fitting.commands.job import about, read_job
from fitting.ensemble.calibration import calibration
from fitting.fit import fit
from fitting.uncertainty.design import Design, design, prediction
from rubberfric.base import Progress, StrPath, shown
from rubberfric.commands import Interrupts, complain, write_outputs
from rubberfric.io import read_conditions, toml
from rubberfric.plot import save_figure

_DESIGN, _CALIBRATION = "rubberfric-fit design", "rubberfric-fit calibration"
_POINTS = ("velocity", "pressure", "temperature")
KEYS = (*_POINTS, "n", "criterion", "relative", "draws", "seed")
# Options in the table [fit] of a job that a calibration uses; the others concern the search.
_SHARED_OPTIONS = ("key", "discrepancy")
# Largest numbers of candidates, of measurements to choose, and of draws.
_MOST = {"candidates": 100_000, "n": 10_000, "draws": 100_000}


def run_design(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Fit a job, choose measurements, write files, print the report, and return the exit status."""
    show(f"reading {arguments.job}")
    job = read_job(arguments.job, [path for path in (arguments.out, arguments.plot) if path is not None])
    if job.design is None:
        raise ValueError(
            f"{arguments.job}: design: is missing. Add a table [design] with the candidate measurements"
        )
    if not isinstance(job.scene, rf.Scene):
        raise ValueError(f"{arguments.job}: design: must have one scene, not several")
    options = read_design(arguments.job, job.design, job.scene)

    def callback(step: int, cost: float) -> None:
        show(f"step {step}, cost {cost:.6g}")
        interrupts.check()

    with about(arguments.job):
        result = fit(
            job.scene, job.data, job.free, prior=job.prior, callback=callback, progress=show, **job.options
        )
    if not result.success:
        return complain(_DESIGN, result.message, 1)
    show("choosing measurements")
    with about(arguments.job):
        plan: Design = design(result, **options)
    failure = write_outputs(
        show,
        ("writing", arguments.out, plan.write),
        ("drawing", arguments.plot, lambda path: save_figure(path, plan.plot())),
    )
    show.end()
    print(job.title + "\n" * bool(job.title) + plan.report(), end="", flush=True)
    if failure is not None:
        raise failure
    if result.verdict.explains is False:
        return complain(
            "rubberfric-fit design", "the scene does not explain the data: run rubberfric-fit for details", 3
        )
    return 0


def read_design(path: StrPath, content: Any, scene: rf.Scene) -> dict[str, Any]:
    """Return the arguments of `fitting.design` from the table [design] of a job.

    Raise ValueError if an argument is invalid.
    """
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
    """Return flat arrays (velocity, pressure), or (velocity, pressure, temperature).

    The arrays contain every combination of the values in `content`. The temperature is left out if `content`
    contains none.
    """
    given = {name: content[name] for name in _POINTS if name in content}
    conditions = read_conditions(path, table, given, scene)
    size = math.prod(values.size for values in conditions if values is not None)
    if size > _MOST["candidates"]:
        raise ValueError(f"{path}: {table}: has {size} candidates: must have at most {_MOST['candidates']}")
    v, p, T = conditions.grid()
    found = np.broadcast_arrays(*(x for x in (v, p, T) if x is not None))
    return tuple(np.array(x).ravel() for x in found)


def run_calibration(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Run a calibration, draw a figure, print the report, and return the exit status."""
    show(f"reading {arguments.job}")
    job = read_job(arguments.job, [] if arguments.plot is None else [arguments.plot])
    if not isinstance(job.scene, rf.Scene) or isinstance(job.data, dict):
        raise ValueError(f"{arguments.job}: calibration needs one scene, not several")
    if job.options.get("loss", "linear") != "linear":
        raise ValueError(f"{arguments.job}: fit.loss: must be 'linear' for a calibration")
    options: dict[str, Any] = {name: job.options[name] for name in _SHARED_OPTIONS if name in job.options}

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
        return complain(
            "rubberfric-fit calibration",
            "error bars do not have their stated coverage: see NOT CALIBRATED above",
            3,
        )
    return 0
