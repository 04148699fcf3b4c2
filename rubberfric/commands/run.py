"""The command `rubberfric run`, which computes all quantities of a scene file at its conditions."""

import argparse
import math
from collections.abc import Iterator

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
from rubberfric.base.units import to_celsius
from rubberfric.commands.arguments import write_outputs
from rubberfric.io.files import MOST_POINTS, read_computable, save_result
from rubberfric.io.results import QUANTITY_FORMATS, Conditions, Result, result_shape
from rubberfric.scene.scene import Scene
from rubberfric.scene.settings import default_quadrature
from rubberfric.theory.model import solve
from rubberfric.theory.structure import Solution, iterated, quantities_of


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
        for line in (extrapolation_line(result), convergence_line(result), model_error_line(result))
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
    found = {name: np.broadcast_to(np.asarray(getattr(solution, name)), shape) for name in quantities}
    for name, values in found.items():
        bad = np.argwhere(~np.isfinite(values))
        if bad.size:
            _, j, k = bad[0]
            v, p = conditions.velocity[k], conditions.pressure[j]
            raise FloatingPointError(
                f"{name} = {values[tuple(bad[0])]} at v = {v:g} m/s, p = {p:g} Pa: not finite"
            )
    return Solution(**found)


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
    found = theory_error(result.scene, np.asarray(result.solution.area))
    if found is None:
        return f"contact model: {contact_model_name(result.scene)}. Its error in such scenes is unknown"
    area, friction = (f"{100 * low - 100:+.0f} ... {100 * high - 100:+.0f} %" for low, high in found[:2])
    mu = "mu" if result.scene.shear is None else "viscoelastic mu"
    low, high = found.contact
    page = "boundary_elements" if result.scene.contact_model == "paper" else "how_true"
    beyond = (
        f"\nq1/q0 is {10**found.extrapolated:.3g} times larger than in any case; the range includes this"
        if found.extrapolated
        else ""
    )
    return (
        f"contact model: {contact_model_name(result.scene)}\n"
        "its error against boundary elements of such scenes\n"
        f"(A/A0 {low:.2g} ... {high:.2g}, nine cases of ten; notebooks/{page}.md):\n"
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
