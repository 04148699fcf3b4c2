"""The commands `rubberfric run`, `map` and `accuracy`, which compute a scene file at its conditions.

`map` and `accuracy` import what they alone need late, so that `run` starts sooner.
"""

import argparse
import math
import time
from collections.abc import Iterator

import jax
import numpy as np

from rubberfric.analysis.validity import (
    contact_model_name,
    friction_outside_table,
    tabulated_solids,
    theory_error,
)
from rubberfric.base.compilation import quick_options
from rubberfric.base.progress import Progress
from rubberfric.base.quadrature import Quadrature
from rubberfric.base.release import cores
from rubberfric.base.units import to_celsius
from rubberfric.commands.arguments import write_outputs
from rubberfric.io.files import MOST_POINTS, read_computable, save_result
from rubberfric.io.results import QUANTITY_FORMATS, Conditions, Result, result_shape
from rubberfric.scene.scene import Scene, dissipates, iterates, rough_surfaces
from rubberfric.scene.settings import default_quadrature
from rubberfric.theory.model import solve
from rubberfric.theory.structure import (
    CONDITION_UNITS,
    Solution,
    has_transverse_force,
    iterated,
    quantities_of,
)

_SEVERAL = {"velocity": "velocities", "pressure": "pressures", "temperature": "temperatures"}
# More points make the sweep slower without changing the errors.
_POINTS = 60


def run_scene(arguments: argparse.Namespace, show: Progress) -> tuple[str, OSError | None]:
    """Run `rubberfric run`, and return the text to print and the error of a file or None."""
    show(f"reading {arguments.scene}")
    scene, conditions, title = read_computable(arguments.scene, most=MOST_POINTS, default=True)
    quadrature = default_quadrature(scene, conditions.pressure)
    quantities = quantities_of(scene)
    points = math.prod(result_shape(conditions))
    show(f"compiling and computing {', '.join(quantities)} at {points} points")
    result = Result(scene, conditions, compute(scene, conditions, quadrature), quadrature, title)

    def draw(path: str) -> None:
        from rubberfric.plot.choice import save_plot

        save_plot(path, result)

    failure = write_outputs(
        show,
        ("writing", arguments.out, lambda path: save_result(path, result)),
        ("drawing", arguments.plot, draw),
    )
    if tabulated_solids(scene):
        show("computing the friction from outside the tables")
    ends = [
        line
        for line in (
            *(missing_line(scene), extrapolation_line(result), convergence_line(result)),
            model_error_line(result),
        )
        if line
    ]
    return "\n".join([*result_lines(result), *(f"\n{line}" for line in ends)]), failure


def compute(scene: Scene, conditions: Conditions, quadrature: Quadrature | None = None) -> Solution:
    """Return all quantities as arrays [temperature, pressure, velocity], or raise FloatingPointError."""
    quantities = quantities_of(scene)
    solution = solve(
        scene,
        *conditions.grid(),
        quadrature=quadrature,
        quantities=quantities,
        compiler_options=quick_options(),
    )
    shape = result_shape(conditions)
    columns = {name: np.broadcast_to(np.asarray(getattr(solution, name)), shape) for name in quantities}
    for name, values in columns.items():
        bad = np.argwhere(~np.isfinite(values))
        if bad.size:
            _, j, k = bad[0]
            v, p = conditions.velocity[k], conditions.pressure[j]
            raise FloatingPointError(
                f"{name} = {values[tuple(bad[0])]} at v = {v:g} m/s, p = {p:g} Pa: not finite"
            )
    return Solution(**columns)


def result_lines(result: Result) -> Iterator[str]:
    """Yield the lines of a printed result, with a block for every temperature and pressure."""
    solution = result.solution._asdict()
    columns = {name: solution[name] for name, quantity in QUANTITY_FORMATS.items() if quantity.heading}
    columns = {name: values for name, values in columns.items() if values is not None}
    # Six columns of 12 leave one space between them on a line of 80.
    gap = " " if len(columns) > 4 else "  "
    if result.title:
        yield result.title
    for i, j in np.ndindex(result_shape(result.conditions)[:2]):
        T = result.conditions.temperature
        at = "" if T is None else f", temperature {T[i]:.6g} K ({to_celsius(T[i]):.4g} °C)"
        yield ""
        yield f"pressure {result.conditions.pressure[j] / 1e6:.6g} MPa{at}"
        yield gap.join(
            f"{heading:>12}" for heading in ("v [m/s]", *(QUANTITY_FORMATS[name].heading for name in columns))
        )
        for k, v in enumerate(result.conditions.velocity):
            row = (
                f"{QUANTITY_FORMATS[name].factor * values[i, j, k]:12.5e}" for name, values in columns.items()
            )
            yield gap.join((f"{v:12.4e}", *row))


def missing_line(scene: Scene) -> str:
    """Return a line that says why a scene has no roughness or no friction, or ""."""
    if not rough_surfaces(scene):
        shear = "" if scene.shear is None else "viscoelastic "
        return (
            f"the scene has no roughness: the contact is complete, and the {shear}friction is 0;\n"
            "add a spectrum, for example with `rubberfric-fit spectrum DATA --scene SCENE --out NEW`"
        )
    if scene.shear is None and not dissipates(scene):
        return "friction is 0: no rough solid faces a viscoelastic one, and there is no contact shear"
    return ""


def extrapolation_line(result: Result) -> str:
    """Return a line about the share of the friction from extrapolated moduli, or "" without tables."""
    if not tabulated_solids(result.scene):
        return ""
    beyond = friction_outside_table(result.scene, *result.conditions.grid(), compiler_options=quick_options())
    share = np.max(np.abs(np.asarray(beyond)))
    mu = "mu" if result.scene.shear is None else "the viscoelastic mu"
    return f"at most {100 * share:.2g} % of {mu} comes from frequencies outside the tabulated moduli"


def model_error_line(result: Result) -> str:
    """Return lines that state the contact model and the expected error of this model."""
    ranges = theory_error(result.scene, np.asarray(result.solution.area))
    if ranges is None:
        return f"contact model: {contact_model_name(result.scene)}. Its error in such scenes is unknown"
    area, friction = (f"{100 * low - 100:+.0f} ... {100 * high - 100:+.0f} %" for low, high in ranges[:2])
    mu = "mu" if result.scene.shear is None else "viscoelastic mu"
    low, high = ranges.contact
    beyond = (
        f"\nq1/q0 is {10**ranges.extrapolated:.3g} times larger than in any case; the range includes this"
        if ranges.extrapolated
        else ""
    )
    return (
        f"contact model: {contact_model_name(result.scene)}\n"
        "its error against boundary elements of such scenes\n"
        f"(A/A0 {low:.2g} ... {high:.2g}, nine cases of ten; notebooks/law_table.md):\n"
        f"A/A0 is off by {area}, {mu} by {friction}{beyond}"
    )


def convergence_line(result: Result) -> str:
    """Return a line about the points at which the solution did not converge, or "" if there are none."""
    converged = result.solution.converged
    if converged is None:
        return ""
    # One temperature at a time, because an array may be in a file.
    left = [np.size(plane) - np.count_nonzero(plane) for plane in converged]
    if not any(left):
        return ""
    i = int(np.flatnonzero(left)[0])
    j, k = np.argwhere(~converged[i])[0]
    return (
        f"the {iterated(result.scene)} did not converge at {sum(left)} of {converged.size} points, "
        f"first at v = {result.conditions.velocity[k]:g} m/s, p = {result.conditions.pressure[j]:g} Pa: "
        "their values are the last iterate"
    )


# --- map


def run_map(arguments: argparse.Namespace, show: Progress) -> tuple[str, OSError | None]:
    """Run `rubberfric map`, and return the text to print and the error of a file or None."""
    from rubberfric.analysis.maps import DEFAULT_QUANTITIES, friction_map
    from rubberfric.plot.choice import save_figure
    from rubberfric.plot.maps import check_map, figure_of_map

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
    failure = write_outputs(
        show, ("drawing", arguments.plot, lambda path: save_figure(path, figure_of_map(result)))
    )
    lines = [*summary(result)]
    for line in (missing_line(scene), convergence_line(result)):
        lines += ["", line] * bool(line)
    return "\n".join(lines), failure


def make_devices(count: int | None) -> None:
    """Make JAX use `count` CPU devices (None: one for each core); ValueError if JAX has already started."""
    try:
        jax.config.update("jax_num_cpu_devices", count or cores())
    except RuntimeError:  # JAX was started by a caller from Python
        there = jax.local_device_count("cpu")
        if count not in (None, there):
            raise ValueError(
                f"--devices {count}: JAX has already started with {there} devices; use this number"
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


# --- accuracy


def run_accuracy(arguments: argparse.Namespace, show: Progress) -> tuple[str, OSError | None]:
    """Run `rubberfric accuracy`, and return the text to print and the error of a file or None."""
    from rubberfric.analysis.reference import check_error
    from rubberfric.analysis.sweep import Row, accuracy
    from rubberfric.plot.choice import save_accuracy_plot

    check_error(arguments.error)
    show(f"reading {arguments.scene}")
    scene, conditions, title = read_computable(arguments.scene, most=MOST_POINTS)
    velocity = thinned(conditions)
    at = conditions._replace(velocity=velocity).grid()
    show.line(
        "A reference and about 20 settings are compiled and timed: this takes 2 to 4 minutes on two cores,"
        " and up to 10 with heating or softening. Ctrl-C ends it."
    )
    begin = time.monotonic()

    def report(row: Row, k: int, of: int) -> None:
        # Rows take about the same time, most of it for compilation.
        left = (time.monotonic() - begin) / k * (of - k)
        show.line(f"{k} of {of}: {row.summary()}; about {left:.0f} s left")

    result = accuracy(scene, *at, error=arguments.error, progress=show, report=report)
    failure = write_outputs(
        show,
        ("writing", arguments.out, result.write),
        ("drawing", arguments.plot, lambda path: save_accuracy_plot(path, result, title)),
    )
    lines = [title] * bool(title)
    if velocity.size < conditions.velocity.size:
        lines.append(f"{velocity.size} of {conditions.velocity.size} velocities, equally spread")
    return "\n".join([*lines, result.report()]), failure


def thinned(conditions: Conditions) -> np.ndarray:
    """Return at least 5 of the velocities, evenly spread, so that a sweep has few points."""
    temperatures = 1 if conditions.temperature is None else conditions.temperature.size
    count = max(5, _POINTS // (temperatures * conditions.pressure.size))
    velocity = conditions.velocity
    if velocity.size <= count:
        return velocity
    return velocity[np.linspace(0, velocity.size - 1, count).round().astype(int)]
