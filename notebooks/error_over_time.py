"""Measure error over run time for four scenes; write error_over_time.md and figures/error_over_time.png.

    python notebooks/error_over_time.py

Needs matplotlib. Every setting of `rubberfric.analysis.reference` is compared with a reference that is
checked by refinement. It is timed in turns with the textbook method, compiled trapezoidal rules of the
paper's equations, in one run for each scene.
"""

import os
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path

import jax

import rubberfric as rf
from rubberfric.io.files import read_scene_file
from rubberfric.plot import plot_accuracy

FOLDER = Path(__file__).resolve().parent
DATA = FOLDER.parent / "data"
SCENES = {
    "tread_on_asphalt": "smooth rubber on a rigid road",
    "rough_tread_on_asphalt": "rubber and road both rough",
    "two_rubbers": "two viscoelastic solids, both rough",
    "thin_layer": "a layer of rubber on a rigid road",
}
PRESSURE = 0.15e6  # nominal pressure [Pa]
TEMPERATURE = 293.15  # [K]
UNIT = (200, 64)  # nodes of the textbook method whose run time is the unit


def main(scenes=SCENES, folder=FOLDER, **options):
    """Sweep over the scenes with options of `rf.analysis.accuracy`; write the table and the figure."""
    jax.config.update("jax_enable_x64", True)
    begin = time.perf_counter()
    sweeps = {}
    for name, what in scenes.items():
        scene, conditions, _ = read_scene_file(DATA / f"{name}.toml")

        def tell(text, name=name):
            print(f"{time.perf_counter() - begin:5.0f} s  {name}: {text}", file=sys.stderr, flush=True)

        found = rf.analysis.accuracy(
            scene, conditions.velocity, PRESSURE, TEMPERATURE, progress=tell, **options
        )
        sweeps[name, what] = found
        jax.clear_caches()
    folder = Path(folder)
    (folder / "figures").mkdir(exist_ok=True)
    draw(folder / "figures" / "error_over_time.png", sweeps)
    seconds = time.perf_counter() - begin
    load = os.getloadavg()[2] if hasattr(os, "getloadavg") else 0.0
    (folder / "error_over_time.md").write_text(
        "\n".join(page(sweeps, seconds, load)) + "\n", encoding="utf-8"
    )
    return sweeps


def unit(found):
    """Return the textbook row that times are relative to."""
    return next(row for row in found.rows if row.method == "textbook" and row.setting == UNIT)


def draw(path, sweeps):
    """Draw one panel for each scene, with times in units of the textbook method."""
    from matplotlib.figure import Figure

    rows = -(-len(sweeps) // 2)
    figure = Figure(figsize=(9.6, 0.8 + 3.4 * rows), layout="constrained")
    panels = figure.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    for ax, ((_, what), found) in zip(panels.flat, sweeps.items(), strict=False):
        plot_accuracy(found, ax, unit=unit(found))
        ax.set_title(what, fontsize="medium")
        ax.set_xlabel("")
        ax.set_ylabel("")
        handles, labels = ax.get_legend_handles_labels()
        ax.get_legend().remove()
    figure.supxlabel("run time / that of the textbook method with 200 x 64 nodes", fontsize="medium")
    figure.supylabel("largest relative error of area, friction and separation", fontsize="medium")
    figure.legend(handles, labels, loc="outside upper center", ncols=3, fontsize="small")
    figure.savefig(path, dpi=120)


def page(sweeps, seconds, load=0.0):
    """Yield the lines of the page; `load` is the number of jobs on the machine, this one included."""
    points = next(iter(sweeps.values())).points
    yield "# Error over run time"
    yield ""
    yield f"Made by `python notebooks/error_over_time.py` in {seconds / 60:.1f} minutes on {machine()}."
    yield ""
    yield (
        f"This page compares quadrature settings for area, friction and separation at {points} velocities, "
        f"{PRESSURE / 1e6:g} MPa and {TEMPERATURE - 273.15:g} °C, and for the gradient of their sum with "
        "respect to every number of the scene and the conditions."
    )
    yield ""
    yield ("- *Error of values* is the largest relative error among the three quantities and all velocities.")
    yield (
        "- *Error of gradients* is the largest error of a relative sensitivity, divided by the largest "
        "sensitivity (`rubberfric/analysis/reference.py`)."
    )
    yield (
        "- *Time ratio* is the run time of the textbook method, divided by the run time of the setting. The "
        "textbook method computes only values, with compiled trapezoidal rules and 200 ln q x 64 phi nodes. "
        "Both are timed alternately in the same run."
    )
    yield (
        "- *Compile* is the time to compile the function of the values, plus the time to compile the "
        "function of values and gradient."
    )
    yield (
        "- *Automatic* is the setting that a call chooses if none is given and the scene is concrete (not "
        "traced by `jit` or `vmap`). `Quadrature()` is the default for a traced scene."
    )
    if load > os.cpu_count() + 0.5:
        yield ""
        yield (
            f"{load:.0f} jobs shared the {os.cpu_count()} cores, so times in seconds are several times "
            "longer than on an idle machine. The time ratios are less affected, because both times were "
            "measured alternately."
        )
    yield ""
    yield "![error over run time](figures/error_over_time.png)"
    for (name, what), found in sweeps.items():
        yield ""
        yield f"## {what[0].upper()}{what[1:]} (`data/{name}.toml`)"
        yield ""
        agreement = found.agreement
        yield (
            f"The refinements of the reference agree to {agreement.value:.0e} (values) and "
            f"{agreement.gradient:.0e} (gradients). "
            f"The textbook method takes {1e3 * unit(found).forward:.0f} ms."
        )
        yield ""
        yield from table(found)


def table(found):
    """Yield the lines of the table of one sweep."""
    heads = (
        "setting",
        "precision",
        "error of values",
        "error of gradients",
        "time ratio, values",
        "time ratio, gradients",
        "compile [s]",
    )
    yield f"| {' | '.join(heads)} |"
    yield "|" + len(heads) * "---|"
    numpy_time = unit(found).forward
    for row in found.rows:
        known, errors = found.known(row), row.errors
        cells = [setting_cell(row, found.automatic), row.dtype, bounded(errors.value, known.value)]
        if row.method == "textbook":
            cells += ["", f"{numpy_time / row.forward:.2g}", "", ""]
        else:
            compile_time = f"{row.compile_forward:.1f} + {row.compile_gradient:.1f}"
            ratios = (numpy_time / row.forward, numpy_time / row.gradient)
            cells += [bounded(errors.gradient, known.gradient), *(f"{r:.0f}" for r in ratios), compile_time]
        yield f"| {' | '.join(cells)} |"


def bounded(error, known):
    """Return an error as text, or the bound that the reference gives."""
    return f"{'< ' if known > error else ''}{known:.0e}"


def setting_cell(row, automatic):
    """Return a setting in Python, marked if it is the default."""
    if row.method == "textbook":
        return f"textbook, {row.setting[0]} x {row.setting[1]}"
    knobs = ("order", "panels", "graded", "ratio", "angular_order")
    said = f"`{', '.join(f'{knob}={getattr(row.setting, knob):g}' for knob in knobs)}`"
    if row.setting == rf.Quadrature():
        said = "`Quadrature()`"
    return f"automatic: {said}" if row.setting == automatic and row.dtype == "float64" else said


def machine():
    """Return processor and versions."""
    names = [
        line.partition(":")[2].strip()
        for line in (Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else [])
        if line.startswith("model name")
    ]
    versions = ", ".join(f"{name} {version(name)}" for name in ("jax", "numpy"))
    processor = names[0] if names else platform.processor() or platform.machine()
    return f"{os.cpu_count()} cores of an {processor}, Python {platform.python_version()}, {versions}"


if __name__ == "__main__":
    main()
