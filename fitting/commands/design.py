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
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

import rubberfric as rf
from fitting.commands.job import read_job
from fitting.fit import fit
from fitting.uncertainty.uses.design import Design, design, prediction
from rubberfric.base import StrPath, shown
from rubberfric.commands import Parser, add_outputs, check_outputs, complain, ended
from rubberfric.io import read_conditions, toml
from rubberfric.plot import save_figure

PROGRAM = "rubberfric-fit design"
_POINTS = ("velocity", "pressure", "temperature")
KEYS = (*_POINTS, "n", "criterion", "relative", "draws", "seed")


def main(argv: Sequence[str], *, process: bool) -> int:
    """Run the command with arguments `argv`; returns the exit status. `process` as of `ended`."""
    parser = Parser(prog=PROGRAM, description="Fit a job and choose the measurements to make next.")
    parser.add_argument("job", metavar="JOB", help="job file (.toml) with a table [design]")
    add_outputs(parser, "FILE.csv", "write the conditions to measure at", "draw what each would tell")
    arguments = parser.parse_args(argv)
    return ended(PROGRAM, lambda _: run(arguments), process=process)


def run(arguments: argparse.Namespace) -> int:
    """Fit, design, write what was asked for, print the report."""
    jax.config.update("jax_enable_x64", True)  # as every command
    check_outputs(arguments, ".csv")
    job = read_job(arguments.job)
    if job.design is None:
        raise ValueError(f"{arguments.job}: design: is missing; must say what could be measured")
    options = read_design(arguments.job, job.design, job.scene)
    result = fit(job.scene, job.data, job.free, prior=job.prior, **job.options)
    if not result.success:
        return complain(PROGRAM, result.message, 1)
    plan: Design = design(result, **options)
    if arguments.out is not None:
        plan.write(arguments.out)
    if arguments.plot is not None:
        save_figure(arguments.plot, plan.plot())
    print(job.title + "\n" * bool(job.title) + plan.report(), end="", flush=True)
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
