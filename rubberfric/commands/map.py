"""The command `rubberfric map`: quantities of a scene file over velocity, temperature and pressure."""

import argparse
import os
import sys
from collections.abc import Iterator

import jax
import numpy as np

from rubberfric.analysis.maps.friction_map import DEFAULT_QUANTITIES, friction_map
from rubberfric.commands.shared import add_outputs, check_outputs, convergence_line, progress
from rubberfric.io.files import read_computable
from rubberfric.io.results import CONDITIONS, QUANTITIES, Result, result_shape
from rubberfric.plot.map import check_map
from rubberfric.plot.save import save_map_plot
from rubberfric.theory.quantities import quantities_of

_SEVERAL = {"velocity": "velocities", "pressure": "pressures", "temperature": "temperatures"}


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to argparse's subparsers."""
    parser = commands.add_parser(
        "map",
        help="compute a scene over velocity, temperature and pressure",
        description="Compute a scene at every combination of the velocities, pressures and temperatures of "
        "the table [map] of its file, or of [run] if there is none; print the range of each quantity, and "
        "where its largest value is.",
    )
    parser.add_argument("scene", metavar="SCENE", help="scene file (.toml) or result file (.h5)")
    add_outputs(parser, "FILE.h5", "write the map and the scene that made it", "draw the map")
    parser.add_argument(
        "--quantity",
        nargs="+",
        choices=tuple(QUANTITIES),
        default=DEFAULT_QUANTITIES,
        metavar="NAME",
        help=f"what to compute, out of {', '.join(QUANTITIES)} (default: {' '.join(DEFAULT_QUANTITIES)})",
    )
    parser.add_argument(
        "--devices",
        type=int,
        metavar="N",
        help="devices that JAX makes of the processor (default: one for each core); nothing to other devices",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """`rubberfric map`: a friction map of a scene file."""
    make_devices(arguments.devices)  # before the scene is read, for with that JAX begins
    check_outputs(arguments, ".h5")
    scene, conditions, title = read_computable(arguments.scene, "map")
    if arguments.plot is not None:
        try:
            check_map(conditions)
        except ValueError as error:
            raise ValueError(f"{arguments.scene}: {error}") from None
    quantities = list(arguments.quantity)
    if "converged" in quantities_of(scene) and "converged" not in quantities:
        quantities.append("converged")
    with progress() as show:
        result = friction_map(
            scene, *conditions, quantities=quantities, progress=show, path=arguments.out, title=title
        )
    if arguments.plot is not None:
        save_map_plot(arguments.plot, result)
    for line in summary(result):
        print(line)
    if line := convergence_line(result):
        print(f"\n{line}")
    sys.stdout.flush()
    return 0


def make_devices(count: int | None) -> None:
    """One device of the processor for each of its cores, or as many as asked for.

    ValueError if they are not a number > 0, or if JAX has others already.
    """
    if count is not None and count < 1:
        raise ValueError(f"--devices {count}: must be > 0")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        jax.config.update("jax_num_cpu_devices", count or cores)
    except RuntimeError:  # JAX has begun, which only a caller from Python can have done
        found = jax.local_device_count("cpu")
        if count not in (None, found):
            raise ValueError(f"--devices {count}: JAX has begun with {found}: must be that") from None


def summary(result: Result) -> Iterator[str]:
    """Lines that say what a map covers, and the range of each of its quantities."""
    if result.title:
        yield result.title
    for name, units in CONDITIONS.items():
        values = getattr(result.conditions, name)
        if values is None:
            continue
        several = f"{values.size} {_SEVERAL[name]}" if values.size > 1 else name
        ends = dict.fromkeys((f"{values.min():.6g}", f"{values.max():.6g}"))
        yield f"{several}: {' ... '.join(ends)} {units}"
    yield f"{np.prod(result_shape(result.conditions))} points"
    yield ""
    v, p, T = result.conditions
    headings = ["smallest", "largest", "at v [m/s]", "p [MPa]"] + ([] if T is None else ["T [K]"])
    yield " ".join((f"{'':>25}", *(f"{heading:>11}" for heading in headings)))
    for name, values in result.solution._asdict().items():
        if values is None or name == "converged":
            continue
        # A temperature at a time: an array that stays in its file is not read at once.
        low = min(float(plane.min()) for plane in values)
        i = int(np.argmax([float(plane.max()) for plane in values]))
        j, k = np.unravel_index(int(values[i].argmax()), values.shape[1:])
        at = [f"{v[k]:.4g}", f"{p[j] / 1e6:.6g}"] + ([] if T is None else [f"{T[i]:.6g}"])
        columns = (f"{low:.5g}", f"{float(values[i, j, k]):.5g}", *at)
        yield " ".join(
            (f"{f'{name} [{QUANTITIES[name].unit}]':25}", *(f"{column:>11}" for column in columns))
        )
