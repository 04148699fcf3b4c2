"""The command `rubberfric-fit design`: fit a job, and say what to measure next.

The job has a table more, of what could be measured:

    [design]
    velocity = { from = 1e-5, to = 0.1, points = 17 }   # as in [run] of a scene file; every combination
    pressure = 2e5                                      # of these is a candidate
    temperature = [278.15, 293.15, 313.15]
    n = 6                                               # measurements to make
    criterion = "D"                                     # or "A", or a table of velocity, pressure and
                                                        # temperature at which friction is to be predicted
    relative = 0.05                                     # optional: error of a measurement; draws, seed

Exit status as of `rubberfric-fit`, whose verdict is on the fit that the design rests on.
"""

import argparse
from pathlib import Path
from typing import Any

import jax
import numpy as np

import rubberfric as rf
from fitting.commands.job import read_job
from fitting.commands.refusals import about
from fitting.fit import fit
from fitting.uncertainty.design import Design, design, prediction
from rubberfric.base import Progress, StrPath, shown
from rubberfric.commands import Interrupts, complain, write_outputs
from rubberfric.io import read_conditions, toml
from rubberfric.plot import save_figure

PROGRAM = "rubberfric-fit design"
_POINTS = ("velocity", "pressure", "temperature")
KEYS = (*_POINTS, "n", "criterion", "relative", "draws", "seed")


def run(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Fit, design, write what was asked for, print the report."""
    show(f"reading {arguments.job}")
    job = read_job(arguments.job, [path for path in (arguments.out, arguments.plot) if path is not None])
    if job.design is None:
        raise ValueError(f"{arguments.job}: design: is missing; must say what could be measured")
    if not isinstance(job.scene, rf.Scene):
        raise ValueError(f"{arguments.job}: design: must be of one scene, not of several")
    options = read_design(arguments.job, job.design, job.scene)

    def callback(step: int, cost: float) -> None:
        show(f"step {step}, cost {cost:.6g}")
        interrupts.check()

    with about(arguments.job):
        result = fit(
            job.scene, job.data, job.free, prior=job.prior, callback=callback, progress=show, **job.options
        )
    if not result.success:
        return complain(PROGRAM, result.message, 1)
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
        return complain(PROGRAM, "the scene does not explain the data: rubberfric-fit says why", 3)
    return 0


def read_design(path: StrPath, content: Any, scene: rf.Scene) -> dict[str, Any]:
    """Arguments of `fitting.design` from the table [design]; ValueError in one line."""
    path = Path(path)
    toml.check_keys(path, "design", content, KEYS, ("velocity", "pressure", "n"))
    options: dict[str, Any] = {"candidates": _grid(path, "design", content, scene), "n": content["n"]}
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
    """Every combination of velocity, pressure and temperature, flat."""
    given = {name: content[name] for name in _POINTS if name in content}
    v, p, T = read_conditions(path, table, given, scene).grid()
    found = np.broadcast_arrays(*(x for x in (v, p, T) if x is not None))
    return tuple(np.array(x).ravel() for x in found)
