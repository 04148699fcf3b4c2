"""Measure how time and memory grow with the work, and write growth.md, growth.json and figures/growth.png.

    python notebooks/growth.py [velocities] [terms] [members] [maps] [throughput] [page]

The default measures all parts, which takes some minutes. `page` only writes the page. Needs matplotlib.
growth.json keeps the measurements by device, so the same command on another machine or a GPU adds lines to
the page.
"""

import dataclasses
import itertools
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import fitting
import rubberfric as rf
from rubberfric.analysis import batches, maps
from rubberfric.base import cores
from rubberfric.io.files import read_scene_file
from rubberfric.plot import style
from rubberfric.scene import cast
from rubberfric.theory import model

FOLDER = Path(__file__).resolve().parent
STORE = FOLDER / "growth.json"  # measurements by device
PAGE = FOLDER / "growth.md"
FIGURE = FOLDER / "figures" / "growth.png"

DEFAULT = rf.Quadrature()
# Nodes of a quick and less accurate map.
QUICK = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0)
# Nodes of the results from which errors are differences.
FINEST = rf.Quadrature(order=20, panels=24, graded=12, ratio=4.0, angular_order=24)
SETTINGS = {"default": DEFAULT, "quick": QUICK}

# Numbers of velocities of a friction curve.
VELOCITIES = (100, 1000, 10_000, 100_000, 1_000_000, 10_000_000)
# Numbers of terms of a Prony series.
TERMS = (1, 3, 10, 30, 100, 300)
# Numbers of fits of an ensemble.
MEMBERS = (1, 10, 100, 1000, 10_000, 100_000)
# Velocities, pressures, temperatures.
SHAPES = ((1000, 1, 1000), (1000, 3, 334), (500, 20, 100), (100, 100, 100))
PARTS = ("velocities", "terms", "members", "maps", "throughput")


def tread():
    """Return a scene: smooth tread rubber with 17 Prony terms on a rigid road."""
    return read_scene_file(FOLDER.parent / "data" / "tread_on_asphalt.toml")[0]


def apart(code, *arguments):
    """Call a function of this module in a new process, so that its largest memory can be measured."""
    done = subprocess.run(
        [sys.executable, __file__, "--call", code, json.dumps(arguments)],
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        cwd=FOLDER.parent,
        env=os.environ
        | {"PYTHONPATH": os.pathsep.join([str(FOLDER.parent), os.environ.get("PYTHONPATH", "")])},
    )
    return json.loads(done.stdout)


def memory():
    """Return the largest resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def velocities(count):
    """Stream a map of `count` velocities; return seconds, and memory in excess of a small map [MB]."""
    scene, v = tread(), np.logspace(-6, 2, count)
    maps.MOST_IN_MEMORY = 0
    with tempfile.TemporaryDirectory() as folder:

        def run(v):
            rf.friction_map(scene, v, 1e5, 293.15, path=Path(folder) / "m.h5")

        run(v[: 10 * batches.BATCH["cpu"]])  # compiles
        before, begin = memory(), time.perf_counter()
        run(v)
        return {"seconds": time.perf_counter() - begin, "added": memory() - before, "peak": memory()}


def terms(count, points=4096):
    """Map a rubber of `count` Prony terms; return run and compile seconds and memory [MB]."""
    tau = np.logspace(-12, 4, count)
    rubber = rf.Prony(3.6e6, np.full(count, 1e9 / count), tau, 0.5, rf.WLF(12.0, 150.0, 293.15))
    scene = rf.Scene(tread().lower, rf.Body(rubber))
    v, begin = np.logspace(-6, 2, points), time.perf_counter()
    rf.friction_map(scene, v, 1e5, 293.15)
    first = time.perf_counter() - begin
    seconds = best(lambda: rf.friction_map(scene, v, 1e5, 293.15))
    at = maps.Conditions(v, np.array([1e5]), np.array([293.15]))
    task = batches.Task(cast(scene, jnp.float64), at, DEFAULT, maps.DEFAULT_QUANTITIES)
    program = batches.program_bytes(batches.plan(points, 1), task)
    return {"seconds": seconds, "points": points, "compile": first - seconds, "program": program / 1e6}


def members(count):
    """Run bootstrap fits of 24 moduli with 4 parameters; return seconds without compilation, memory [MB]."""
    rubber = rf.Prony(3e6, [5e8, 2e7, 2e6], [1e-7, 1e-4, 1e-1])
    scene = rf.Scene(tread().lower, rf.Body(rubber))
    omega = np.logspace(-2, 7, 12)
    exact = np.asarray(rf.complex_modulus(rubber, omega))
    noise = np.exp(0.02 * np.random.default_rng(0).standard_normal((2, omega.size)))
    data = fitting.ModulusData(omega, exact.real * noise[0], exact.imag * noise[1], relative=0.02)
    free = dict.fromkeys(("upper.material.E", "upper.material.E_inf"), fitting.Positive())
    drawn = fitting.bootstrap_members(fitting.fit(scene, data, free), count)
    fitting.run_ensemble(dataclasses.replace(drawn, max_steps=1))  # compiles
    before, result = memory(), fitting.run_ensemble(drawn)
    found = {"seconds": result.seconds, "steps": int(result.njev.sum()), "failed": int(result.failed.size)}
    return found | {"program": result.peak / 1e6, "added": memory() - before}


def million(shape, setting):
    """Map about a million points in memory; return seconds, memory [MB] and error."""
    nv, nP, nT = shape
    v, p, T = np.logspace(-6, 2, nv), np.logspace(4.5, 6, nP), np.linspace(243.15, 373.15, nT)
    scene, quadrature, found = tread(), SETTINGS[setting], []

    def run():
        found[:] = [rf.friction_map(scene, v, p, T, quadrature=quadrature).solution]

    begin = time.perf_counter()
    run()
    first = time.perf_counter() - begin
    seconds, peak = best(run, 2), memory()
    pick = [slice(None, None, max(1, n // 12)) for n in (nT, nP, nv)]
    at = v[pick[2]], p[pick[1], None], T[pick[0], None, None]
    exact = rf.solve(scene, *at, quadrature=FINEST, quantities=maps.DEFAULT_QUANTITIES)
    error = max(
        float(np.max(np.abs(getattr(found[0], name)[tuple(pick)] / getattr(exact, name) - 1)))
        for name in maps.DEFAULT_QUANTITIES
    )
    return {"seconds": seconds, "first": first, "points": nv * nP * nT, "peak": peak, "error": error}


def throughput(dtype, points=2**14):
    """Return points per second of friction and its gradient, and the compiler's counts for each point."""
    scene = jax.tree.map(lambda x: jnp.asarray(x, dtype), tread())
    v = jnp.logspace(-6, 2, points, dtype=dtype)
    p, T = jnp.full(points, 1e5, dtype), jnp.full(points, 293.15, dtype)

    def values(scene, v, p, T):
        return rf.friction(scene, v, p, T)

    def gradient(scene, v, p, T):
        return jax.value_and_grad(lambda s: jnp.sum(values(s, v, p, T)))(scene)

    found = {}
    for name, function in (("values", values), ("gradient", gradient)):
        ready = jax.jit(function)
        jax.block_until_ready(ready(scene, v, p, T))
        seconds = best(lambda ready=ready: jax.block_until_ready(ready(scene, v, p, T)))
        # The compiler counts the body of a loop once, so count a block of points that needs no loop.
        few = model.BLOCK
        program = ready.lower(scene, v[:few], p[:few], T[:few]).compile()
        cost, held = program.cost_analysis(), program.memory_analysis().temp_size_in_bytes
        found[name] = {
            "rate": points / seconds,
            "flops": cost.get("flops", float("nan")) / few,
            "bytes": cost.get("bytes accessed", float("nan")) / few,
            "program": held / 1e6,
        }
    return found


def best(function, repeats=3):
    """Return the least time of a function [s]."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def machine():
    """Return device and versions as text."""
    device = jax.devices()[0]
    count = cores()
    processor = f"{platform.machine()} processor, {count} core{'s' * (count > 1)}"
    what = processor if device.platform == "cpu" else device.device_kind
    return f"{what}, jax {version('jax')}"


def measure(parts):
    """Measure parts on this machine, each in a new process, and keep them in growth.json."""
    store = json.loads(STORE.read_text()) if STORE.exists() else {}
    sizes = {
        "velocities": [("velocities", n) for n in VELOCITIES],
        "terms": [("terms", n) for n in TERMS],
        "members": [("members", n) for n in MEMBERS],
        "maps": [("million", shape, name) for shape in SHAPES for name in SETTINGS],
        "throughput": [("throughput", dtype) for dtype in ("float64", "float32")],
    }
    parts = [part for part in parts if part != "page"]
    device = apart("machine") if parts else None
    for part in parts:
        rows = []
        for call in sizes[part]:
            rows.append([call[1:], apart(*call)])
            print(part, *rows[-1], file=sys.stderr, flush=True)
            store.setdefault(device, {})[part] = rows
            STORE.write_text(json.dumps(store, indent=1) + "\n")
    return store


def page(store):
    """Yield the lines of the Markdown page."""
    yield from ("# Growth of time and memory", "")
    yield "`python notebooks/growth.py` generates this page, and checks its statements."
    yield ""
    yield (
        "Each row was measured in a new process. Unless stated otherwise, it gives run times and memory for "
        "area and friction of `data/tread_on_asphalt.toml` (17 Prony terms) with `rf.Quadrature()`. The "
        "setting *quick* is `rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0)`. Times are the shortest "
        "of several runs. Maps of this scene lie on one curve, so `rf.friction_map` computes some hundred to "
        "thousand points and interpolates the others."
    )
    yield from ("", "![growth](figures/growth.png)")
    for device, parts in store.items():
        yield from ("", f"## {device}")
        for part, lines in zip(PARTS, (_velocities, _terms, _members, _maps, _throughput), strict=True):
            if part in parts:
                yield ""
                yield from lines(parts[part])
    if all("processor" in device for device in store):
        yield from ("", "## GPU", "")
        yield (
            "Not measured. Running `python notebooks/growth.py` on a GPU adds its measurements to this page. "
            "A roofline model can be computed from the flops and bytes above."
        )
    yield ""
    yield from _planning(store)


def _table(text, *columns):
    yield from (text, "", f"| {' | '.join(columns)} |", "|" + len(columns) * "---|")


def _velocities(rows):
    text = (
        "The first table is for maps with different numbers of velocities, which are written to a file. The "
        "added memory is the increase over a previous map of at most 8e4 velocities. It grows only with the "
        "length of the velocity axis. An array of 1e7 velocities takes 80 MB."
    )
    yield from _table(
        text, "velocities", "seconds", "µs per point", "memory added [MB]", "largest memory [MB]"
    )
    for (count,), row in rows:
        cells = f"{row['seconds']:.3g}", f"{1e6 * row['seconds'] / count:.1f}", f"{row['added']:.0f}"
        yield f"| {count:.0e} | {' | '.join(cells)} | {row['peak']:.0f} |"


def _terms(rows):
    text = "The next table is for maps of 4096 velocities with different numbers of Prony terms."
    yield from _table(text, "terms", "µs per point", "compilation [s]", "memory of the function [MB]")
    for (count,), row in rows:
        cells = f"{1e6 * row['seconds'] / row['points']:.1f} | {row['compile']:.1f} | {row['program']:.2f}"
        yield f"| {count} | {cells} |"


def _members(rows):
    text = (
        "The next table is for ensembles of bootstrap fits. Each member fits 4 parameters to 24 moduli. The "
        "memory of the function is bounded, because the members are computed in batches. A checkpoint file "
        "contains the states of all members."
    )
    yield from _table(
        text, "members", "seconds", "µs per step", "memory of the function [MB]", "memory added [MB]"
    )
    for (count,), row in rows:
        cells = [f"{row['seconds']:.3g}", f"{1e6 * row['seconds'] / row['steps']:.0f}"]
        cells += [f"{row['program']:.2f}", f"{row['added']:.0f}"]
        yield f"| {count:.0e} | {' | '.join(cells)} |"


def _maps(rows):
    text = (
        "The next table is for maps of a million points, which are kept in memory. Errors are relative to a "
        "finer quadrature. The time of the first call includes compilation."
    )
    columns = ("setting", "seconds", "first call", "points/s", "memory [MB]", "error")
    yield from _table(text, "velocities x pressures x temperatures", *columns)
    for (shape, setting), row in rows:
        cells = [f"{row['seconds']:.1f}", f"{row['first']:.1f}", f"{row['points'] / row['seconds']:.2g}"]
        cells += [f"{row['peak']:.0f}", f"{row['error']:.0e}"]
        yield f"| {' x '.join(map(str, shape))} | {setting} | {' | '.join(cells)} |"


def _throughput(rows):
    text = (
        "The last table is for friction at 16384 points (`rf.friction`), and for the gradient of the sum of "
        "these values with respect to every number of the scene. Flops and bytes are counts of the compiler "
        "(`cost_analysis`)."
    )
    yield from _table(
        text, "precision", "quantity", "points/s", "flops per point", "bytes per point", "flops per byte"
    )
    for (dtype,), row in rows:
        for what, x in row.items():
            cells = (
                f"{x['rate']:.2g}",
                f"{x['flops']:.3g}",
                f"{x['bytes']:.3g}",
                f"{x['flops'] / x['bytes']:.2g}",
            )
            yield f"| {dtype} | {what} | {' | '.join(cells)} |"


def _planning(store):
    yield from ("## Planning for 1e10 evaluations", "")
    yield (
        "Run time is linear in the number of points. A file with two quantities at 1e10 points has 160 GB in "
        "double precision and 80 GB in single precision. It is allocated before the computation begins. "
        "The points are computed in batches, so a process on a CPU uses less than 1 GiB. Points are "
        "independent, so they can be distributed over the cores of one machine (`--devices`) or of several "
        "machines (`jax.distributed`)."
    )
    for device, parts in store.items():
        if "maps" not in parts or "velocities" not in parts:
            continue
        yield ""
        (count,), row = parts["velocities"][-1]
        writing = 1e10 * row["seconds"] / count / 3600
        text = (
            f"These times follow from the maps of a million points in memory above ({device}). Writing them "
            f"to a file takes longer: {writing:.1f} h at the rate of the first table."
        )
        yield from _table(
            text, "pressures", "setting", "hours on one such machine", "machines for a night (10 h)"
        )
        for (shape, setting), row in parts["maps"]:
            hours = 1e10 * row["seconds"] / row["points"] / 3600
            yield f"| {shape[1]} | {setting} | {hours:.2g} | {max(1, int(np.ceil(hours / 10)))} |"


def draw(store, path):
    """Draw time and memory over velocities, Prony terms and members, with a colour for each device."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    figure = Figure(figsize=(10.0, 5.6), layout="constrained")
    axes = figure.subplots(2, 3)
    looks = zip(style.colours(len(store)), itertools.cycle(("o-", "s--", "^-.", "D:")), strict=False)
    for (device, parts), (colour, look) in zip(store.items(), looks, strict=True):
        memories = {"velocities": "peak", "terms": "program", "members": "added"}
        for column, (part, memory_of) in enumerate(memories.items()):
            if part not in parts:
                continue
            counts = np.array([count for (count,), _ in parts[part]])
            for ax, key in ((axes[0, column], "seconds"), (axes[1, column], memory_of)):
                ax.loglog(counts, [row[key] for _, row in parts[part]], look, color=colour, label=device)
            seconds = np.array([row["seconds"] for _, row in parts[part]])
            ends = counts[[0, -1]]
            axes[0, column].loglog(ends, seconds[-1] * ends / ends[-1], "k:", linewidth=1, label="linear")
    labels = ("run time [s]", "run time of 4096 points [s]", "run time [s]")
    labels += tuple(
        f"{what} [MB]" for what in ("largest memory of the process", "memory of the function", "memory added")
    )
    for ax, label in zip(axes.flat, labels, strict=True):
        ax.set_ylabel(label)
    axes[1, 0].set_ylim(100, 3000)
    axes[1, 0].yaxis.set_minor_formatter(NullFormatter())
    axes[1, 2].set_yscale("linear")
    axes[1, 2].set_ylim(-0.5, 10)
    for ax, label in zip(axes.flat, 2 * ("velocities", "Prony terms", "members of an ensemble"), strict=True):
        ax.set_xlabel(label)
        ax.grid(alpha=0.3)
    named = {line.get_label(): line for ax in axes[0] for line in ax.lines}
    if named:
        figure.legend(
            named.values(), named, loc="outside upper center", ncols=min(len(named), 3), fontsize="medium"
        )
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=150)


def main(parts=PARTS):
    """Measure parts, write page and figure, and check the statements of the page."""
    store = measure(parts)
    draw(store, FIGURE)
    PAGE.write_text("\n".join(page(store)) + "\n", encoding="utf-8")
    check(store[apart("machine")])


def check(parts):
    """Raise AssertionError unless time grows linearly, and memory and errors stay small."""
    rows = {count: row for (count,), row in parts["velocities"]}
    assert rows[10_000_000]["seconds"] < 1.5 * 100 * rows[100_000]["seconds"]
    # Seven arrays of the length of the velocities.
    assert max(row["added"] - 56e-6 * count for count, row in rows.items()) < 100
    assert max(row["peak"] for row in rows.values()) < 1000
    rows = {count: row for (count,), row in parts["terms"]}
    assert rows[300]["seconds"] < 1.5 * 10 * rows[30]["seconds"]
    assert rows[300]["program"] < 64  # [MB]
    rows = {count: row for (count,), row in parts["members"]}
    assert rows[100_000]["seconds"] < 1.5 * 100 * rows[1000]["seconds"]
    assert not any(row["failed"] for row in rows.values())
    for (shape, setting), row in parts["maps"]:
        assert row["error"] < 1e-8, (shape, setting)
        assert row["peak"] < 2000


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    if sys.argv[1:2] == ["--call"]:
        if jax.config.jax_platforms in (None, "", "cpu"):
            jax.config.update("jax_num_cpu_devices", cores())
        json.dump(globals()[sys.argv[2]](*json.loads(sys.argv[3])), sys.stdout)
    else:
        main(sys.argv[1:] or PARTS)
