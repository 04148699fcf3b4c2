"""Fit the files of three laboratories, by commands and in Python, and compare all numbers with the truth.

    python notebooks/benchmarks/laboratories.py [1 2 3]

| laboratory | moduli | roughness | friction |
|---|---|---|---|
| 1 | TRIOS | traces of a stylus | forces and areas of a linear tester |
| 2 | Eplexor | height map of Gwyddion | records of reciprocating runs |
| 3 | NETZSCH Proteus | texture spectrum of ISO 13473-4 | forces and moments of a wheel tester |

Each command is a new process, with a compilation cache that is empty at the start of the route. The Python
route is one process, which compiles all of its functions. Times are CPU seconds. `laboratory_files.py`
contains the true materials and spectra, and writes the files.
"""

import contextlib
import inspect
import os
import resource
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

import jax
import laboratory_files as files
import numpy as np
from laboratory_files import ZERO

jax.config.update("jax_enable_x64", True)

import fitting  # noqa: E402
import rubberfric as rf  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
MODULES = {"rubberfric": "rubberfric", "rubberfric-fit": "fitting"}  # module of each command
SHEAR = ("shear.tau_f0", "shear.c", "shear.v0", "shear.shift.energy")
CUTOFF = "lower.spectrum.q1"
FREQUENCIES, CELSIUS = (0.1, 10.0, 1e3), (0.0, 20.0, 50.0)  # at which moduli are compared [Hz], [°C]
WAVEVECTORS = (1e3, 1e4, 6e4)  # at which spectra are compared [1/m]
VELOCITIES = (1e-3, 1e-2, 1e-1)  # at which friction is compared [m/s]


class Laboratory(NamedTuple):
    """Truth, writers of the files, and both routes, which run in the folder of the files.

    The commands write the scene before the fit to scene.toml, and the fit to fit.h5. The function `route`
    returns the fit of the spectrum, the scene before the fit, and the fit.
    """

    truth: files.Truth
    writers: tuple[Callable, ...]
    commands: tuple[str, ...]
    route: Callable
    pressure: float  # at which friction is compared [Pa]

    def write(self, seed):
        rng = np.random.default_rng(seed)
        for writer in self.writers:
            writer(self.truth, rng)


def scene_of(curve, road, slope, **parts):
    """Return the scene of a master curve and a fitted spectrum, with the initial guess of contact shear."""
    series = fitting.fit_prony(curve.data, 2.0, shift=curve.shift)
    shear = rf.ContactShear(tau_f0=5e6, c=0.2, v0=1e-2, shift=rf.Arrhenius(1.0, files.SHEAR_T_REF))
    road = rf.Body(rf.Rigid(), rf.with_cutoff(road.spectrum, slope))
    return rf.Scene(road, rf.Body(series.material), shear=shear, **parts)


def forces_in_python():
    curve = fitting.fit_master_curve(fitting.read("trios.txt"))
    x, traces = rf.io.read_traces("stylus.csv")
    road = fitting.fit_spectrum(rf.roughness.spectrum_of_profile(x, traces, per_decade=10))
    scene = scene_of(curve, road, 1.3)
    friction = fitting.read("forces.csv", relative=0.03)
    return road, scene, fitting.fit(scene, friction, dict.fromkeys([*SHEAR, CUTOFF], fitting.Positive()))


FORCES = Laboratory(
    files.FORCES,
    (files.write_trios, files.write_stylus, files.write_forces),
    (
        "rubberfric-fit mastercurve trios.txt --out material.toml",
        "rubberfric-fit spectrum stylus.csv --scene material.toml --slope 1.3 --out scene.toml",
        "rubberfric-fit job scene.toml forces.csv --relative 0.03 --shear --out job.toml",
        "rubberfric-fit job.toml --out fit.h5",
    ),
    forces_in_python,
    2e5,
)


RUNS = tuple(f"run_{celsius}C_{load}N.csv" for celsius in (5, 25, 45) for load in (80, 240))


def records_in_python():
    curve = fitting.fit_master_curve(fitting.read("eplexor.csv"))
    surface = rf.io.read_heights("map.txt")
    measured = rf.roughness.spectrum_of_topography(surface.heights, surface.dx, surface.dy, per_decade=10)
    road = fitting.fit_spectrum(measured)
    scene = scene_of(curve, road, 1.3)
    steps = {"zero": True, "discard": "2 s", "fold": True, "average": True}
    friction = fitting.average([fitting.read(path, area=4e-4, **steps) for path in RUNS])
    return road, scene, fitting.fit(scene, friction, dict.fromkeys([*SHEAR, CUTOFF], fitting.Positive()))


RECORDS = Laboratory(
    files.RECORDS,
    (files.write_eplexor, files.write_map, files.write_records),
    (
        "rubberfric-fit mastercurve eplexor.csv --out material.toml",
        "rubberfric-fit spectrum map.txt --map --scene material.toml --slope 1.3 --out scene.toml",
        f"rubberfric-fit job scene.toml {' '.join(RUNS)} --area 4e-4 --zero --discard '2 s' --fold --average"
        " --shear --out job.toml",
        "rubberfric-fit job.toml --out fit.h5",
    ),
    records_in_python,
    2e5,
)


def wheel_in_python():
    curve = fitting.fit_master_curve(fitting.read("netzsch.csv"))
    road = fitting.fit_spectrum(fitting.read("texture.csv"))
    scene = scene_of(curve, road, 0.7, patch=rf.Patch(length=0.04, width=0.018, stiffness=4e7))
    forces = fitting.read("wheel.csv", kind="force", relative=0.025)
    moments = fitting.read("wheel.csv", kind="moment")
    names = ["patch.stiffness", "patch.length", *SHEAR, CUTOFF]
    return road, scene, fitting.fit(scene, [forces, moments], dict.fromkeys(names, fitting.Positive()))


WHEEL = Laboratory(
    files.WHEEL,
    (files.write_netzsch, files.write_texture, files.write_wheel, files.write_patch),
    (
        "rubberfric-fit mastercurve netzsch.csv --out material.toml",
        "rubberfric-fit spectrum texture.csv --scene material.toml --slope 0.7 --out scene.toml",
        "cat patch.toml >> scene.toml",
        "rubberfric-fit job scene.toml wheel.csv --relative 0.025 --kind force moment --shear --out job.toml",
        "rubberfric-fit job.toml --out fit.h5",
    ),
    wheel_in_python,
    1.2e5,
)
LABORATORIES = {1: FORCES, 2: RECORDS, 3: WHEEL}
SEEDS = {1: 70, 2: 71, 3: 72}


# --- both routes


def follow(commands, call):
    """Call `call(program, arguments)` for each command, or append a file to another. Yield (line, answer)."""
    for line in commands:
        program, *arguments = shlex.split(line)
        if program == "cat":
            source, _, target = arguments
            Path(target).write_text(Path(target).read_text() + Path(source).read_text())
            yield line, None
        else:
            yield line, call(program, arguments)


class Row(NamedTuple):
    """A number, its true value, and its standard error, or None."""

    quantity: str
    truth: float
    value: float
    stderr: float | None = None

    @property
    def deviation(self):
        """In standard errors, or relative."""
        return (self.value - self.truth) / (self.stderr or abs(self.truth))


def compared(laboratory, scene, result, road):
    """Return a Row for each number of the scene before the fit, and of the fit.

    `road` is the fit of the spectrum, which has its standard errors.
    """
    truth, rubber = laboratory.truth, scene.upper.material
    exact, spectrum, rows = truth.scene(), scene.lower.spectrum, []
    for name in road.names:
        rows.append(Row(name, *(float(attrgetter(name)(one)) for one in (exact, scene)), road[name].stderr))
    for q in WAVEVECTORS:
        rows.append(
            Row(f"C at {q:g} 1/m [m^4]", float(truth.areal(q)), float(rf.power_spectrum(spectrum, q)))
        )
    for celsius in CELSIUS:
        for f in FREQUENCIES:
            T, omega = celsius + ZERO, 2 * np.pi * f
            E = truth.modulus(omega, T), complex(rf.complex_modulus(rubber, omega, T))
            rows += [
                Row(f"{name} at {f:g} Hz, {celsius:g} °C [Pa]", *map(part, E))
                for name, part in (("E'", np.real), ("E''", np.imag))
            ]
    for name in result.names:
        rows.append(Row(name, float(attrgetter(name)(exact)), result[name].value, result[name].stderr))
    slopes = (float(rf.rms_slope(one.lower.spectrum)) for one in (exact, result.scene))
    rows.append(Row("rms slope up to q1", *slopes))
    for celsius in (5.0, 25.0, 45.0):
        mu = [
            np.asarray(rf.friction(one, np.array(VELOCITIES), laboratory.pressure, celsius + ZERO))
            for one in (exact, result.scene)
        ]
        rows += [
            Row(f"friction at {v:g} m/s, {celsius:g} °C", *map(float, pair))
            for v, *pair in zip(VELOCITIES, *mu, strict=True)
        ]
    return rows


def in_process(program, arguments):
    """Run a command or a script of Python, print its output, and return its CPU seconds."""
    module = MODULES.get(program)
    begin = [sys.executable, "-m", module] if module else [sys.executable, program]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*begin, *arguments], capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(done.stdout + done.stderr, end="")
    assert done.returncode == 0, done.returncode
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def new_cache(name):
    """Let new processes use an empty compilation cache, and write bytecode, as for a new user."""
    for variable in ("PYTHONDONTWRITEBYTECODE", "JAX_COMPILATION_CACHE_DIR"):
        os.environ.pop(variable, None)
    os.environ |= {"XDG_CACHE_HOME": str(Path(name).resolve()), "PYTHONPATH": str(ROOT)}


def timed_routes(number):
    """Print the transcripts, the CPU seconds and the numbers of a laboratory, in the folder of its files."""
    laboratory, seconds = LABORATORIES[number], {"commands": 0.0}
    laboratory.write(SEEDS[number])
    print(f"\n=== laboratory {number}, by commands")
    new_cache("cache_of_commands")

    def call(program, arguments):
        print(f"$ {shlex.join([program, *arguments])}")
        own = in_process(program, arguments)
        print(f"[{own:.2f} CPU seconds]", flush=True)
        return own

    for line, own in follow(laboratory.commands, call):
        if own is None:
            print(f"$ {line}")
        seconds["commands"] += own or 0.0
    print(f"\n=== laboratory {number}, in Python")
    print(inspect.getsource(scene_of) + inspect.getsource(laboratory.route))
    new_cache("cache_of_python")
    seconds["Python"] = in_process(str(Path(__file__).resolve()), ["--route", str(number)])
    road = fitting.FitResult.load("road.h5")
    sides = [
        compared(laboratory, rf.load_scene(scene), fitting.FitResult.load(fit), road)
        for scene, fit in (("scene.toml", "fit.h5"), ("python.toml", "python.h5"))
    ]
    print(f"\n{'quantity':32s} {'truth':>10s} {'commands':>10s} {'':>8s} {'Python':>10s}")
    for ours, theirs in zip(*sides, strict=True):
        texts = (f"{row.value:10.4g} {deviation(row):>8s}" for row in (ours, theirs))
        print(f"{ours.quantity:32s} {ours.truth:10.4g} {' '.join(texts)}")
    print(", ".join(f"{name} {value:.1f} CPU seconds" for name, value in seconds.items()), flush=True)


def deviation(row):
    """Return the deviation from the truth as text, in standard errors or in per cent."""
    return f"{100 * row.deviation:+.1f} %" if row.stderr is None else f"{row.deviation:+.1f} se"


def run_route(number):
    """Run the Python route of a laboratory in this process, and write its scene and its fit."""
    road, scene, result = LABORATORIES[number].route()
    print(result.report())
    road.fit.save("road.h5")
    rf.save_scene("python.toml", scene)
    result.save("python.h5")


def main(arguments):
    if arguments[:1] == ["--route"]:
        return run_route(int(arguments[1]))
    for number in map(int, arguments or LABORATORIES):
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            timed_routes(number)


if __name__ == "__main__":
    main(sys.argv[1:])
