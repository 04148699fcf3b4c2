"""The command `rubberfric map`, which computes quantities over velocity, temperature and pressure."""

import argparse
import math
from collections.abc import Iterator

import jax
import numpy as np

from rubberfric.analysis.maps import DEFAULT_QUANTITIES, friction_map
from rubberfric.base.progress import Progress
from rubberfric.base.release import cores
from rubberfric.commands.arguments import write_outputs
from rubberfric.commands.run import convergence_line
from rubberfric.io.files import read_computable
from rubberfric.io.results import CONDITION_UNITS, QUANTITY_FORMATS, Result, result_shape
from rubberfric.plot.choice import save_map_plot
from rubberfric.plot.maps import check_map
from rubberfric.theory.structure import has_transverse_force, iterates

_SEVERAL = {"velocity": "velocities", "pressure": "pressures", "temperature": "temperatures"}


def run_map(arguments: argparse.Namespace, show: Progress) -> tuple[str, OSError | None]:
    """Run `rubberfric map`, and return the text to print and the error of a file or None."""
    make_devices(arguments.devices)  # before reading the scene, which starts JAX
    show(f"reading {arguments.scene}")
    scene, conditions, title = read_computable(arguments.scene, "map")
    if arguments.plot is not None:
        try:
            check_map(conditions)
        except ValueError as error:
            raise ValueError(f"{arguments.scene}: {error}") from None
    quantities: list[str] = list(arguments.quantity or DEFAULT_QUANTITIES)
    for name, absent in (
        ("shear_friction", scene.shear is None),
        ("transverse_friction", not has_transverse_force(scene)),
    ):
        if name in quantities and absent:
            raise ValueError(f"{arguments.scene}: {name} is 0 in this scene: leave it out of --quantity")
    if iterates(scene) and "converged" not in quantities:
        quantities.append("converged")
    points = math.prod(result_shape(conditions))
    show(f"compiling {', '.join(quantities)} for a map of {points} points")

    def computed(done: int, of: int) -> None:
        if done:  # before, it still compiles
            show(done, of)

    result = friction_map(
        scene, *conditions, quantities=quantities, progress=computed, path=arguments.out, title=title
    )
    failure = write_outputs(show, ("drawing", arguments.plot, lambda path: save_map_plot(path, result)))
    lines = [*summary(result)]
    if line := convergence_line(result):
        lines += ["", line]
    return "\n".join(lines), failure


def make_devices(count: int | None) -> None:
    """Make JAX use `count` CPU devices (None: one for each core); ValueError if JAX has already started."""
    try:
        jax.config.update("jax_num_cpu_devices", count or cores())
    except RuntimeError:  # JAX was started by a caller from Python
        found = jax.local_device_count("cpu")
        if count not in (None, found):
            raise ValueError(
                f"--devices {count}: JAX has already started with {found} devices; use this number"
            ) from None


def summary(result: Result) -> Iterator[str]:
    """Yield lines about the extent of a map and the range of each quantity."""
    if result.title:
        yield result.title
    for name, units in CONDITION_UNITS.items():
        values = getattr(result.conditions, name)
        if values is None:
            continue
        several = f"{values.size} {_SEVERAL[name]}" if values.size > 1 else name
        ends = dict.fromkeys((f"{values.min():.6g}", f"{values.max():.6g}"))
        yield f"{several}: {' ... '.join(ends)} {units}"
    how = f", {result.interpolation}" if result.interpolation else ""
    yield f"{np.prod(result_shape(result.conditions))} points{how}"
    yield ""
    v, p, T = result.conditions
    headings = ["smallest", "largest", "at v [m/s]", "p [MPa]"] + ([] if T is None else ["T [K]"])
    yield " ".join((f"{'':>25}", *(f"{heading:>11}" for heading in headings)))
    for name, values in result.solution._asdict().items():
        if values is None or name == "converged":
            continue
        # One temperature at a time, because an array may be in a file.
        low = min(float(plane.min()) for plane in values)
        i = int(np.argmax([float(plane.max()) for plane in values]))
        j, k = np.unravel_index(int(values[i].argmax()), values.shape[1:])
        at = [f"{v[k]:.4g}", f"{p[j] / 1e6:.6g}"] + ([] if T is None else [f"{T[i]:.6g}"])
        columns = (f"{low:.5g}", f"{float(values[i, j, k]):.5g}", *at)
        yield " ".join(
            (f"{f'{name} [{QUANTITY_FORMATS[name].unit}]':25}", *(f"{column:>11}" for column in columns))
        )
