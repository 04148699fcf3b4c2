"""Commands that turn laboratory exports into a friction table for a simulation, without editing files.

::

    rubberfric-fit mastercurve dma.csv --out material.toml
    rubberfric-fit spectrum stylus.csv --scene material.toml --slope 1.3 --out scene.toml
    rubberfric-fit job scene.toml friction.csv --relative 0.05 --shear --out job.toml
    rubberfric-fit job.toml --out fit.h5
    rubberfric-fit table fit.h5 --velocity 1e-4 0.1 --pressure 1e5 4e5 --out friction.inp

Each command calls public functions: `fitting.fit_master_curve` and `fit_prony`, `rubberfric.roughness` and
`fitting.fit_spectrum`, `fitting.friction_table` and `rubberfric.io.write_friction`. All numbers are in SI.
"""

import argparse
import dataclasses
import os
from collections.abc import Callable
from typing import Any, Literal, cast

import numpy as np

import rubberfric as rf
from fitting.commands.options import HEIGHTS, reading_options
from fitting.commands.work import Output, finish
from fitting.data.averages import average
from fitting.data.files import read
from fitting.data.kinds import (
    TRANSIENTS,
    CreepData,
    ModulusData,
    RelaxationData,
    SpectrumData,
    as_data_sets,
)
from fitting.parameters.constraints import Positive
from fitting.results.result import FitResult, friction_table
from fitting.solvers.problem import CURVE_QUANTITIES, make_problem
from rubberfric.base import POSITIVE, Progress, StrPath, as_path, check_values, check_writable, write_durably
from rubberfric.commands import Interrupts
from rubberfric.io import COLUMNS, read_names, toml
from rubberfric.plot import plot_spectrum, save_figure

# Bins per decade of the spectrum of measured heights.
_BINS = 10
# Facing body of a new scene with roughness.
_BLOCK = rf.Elastic(1e7, 0.5)
# Contact shear with which a fit begins, of the size that tread rubber has on asphalt.
_SHEAR = rf.ContactShear(5e6, 0.2, 1e-2, rf.Arrhenius(1.0, 293.15))
# Default free parameters of a job with contact shear.
_FREE_SHEAR = ("shear.tau_f0", "shear.c", "shear.v0", "shear.shift.energy")
# Default free parameter of a patch for each quantity of slip data. Forces alone do not determine the length.
_FREE_PATCH = {"force": "patch.stiffness", "moment": "patch.length"}


def run_mastercurve(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Fit shifts and a Prony series to moduli, write files, and return the exit status."""
    # Other commands do not need these, whose imports take half a second.
    from fitting.characterise.master_curve import fit_master_curve
    from fitting.characterise.prony import fit_prony
    from fitting.characterise.softening import softening_from_sweep

    del interrupts
    file_temperatures = arguments.temperature or [None] * len(arguments.data)
    if len(file_temperatures) != len(arguments.data):
        raise ValueError(
            f"--temperature has {len(file_temperatures)} values for {len(arguments.data)} files;"
            " give one for each file"
        )
    data: list[Any] = [
        read_response(arguments, path, T) for path, T in zip(arguments.data, file_temperatures, strict=True)
    ]
    temperatures = [
        T for dataset in data if dataset.temperature is not None for T in np.ravel(dataset.temperature)
    ]
    options: dict[str, Any] = {"poisson": arguments.poisson or 0.5}
    texts, curve, moduli = [], None, data[0]
    if temperatures and np.ptp(temperatures) > 1.0:
        show("shifting the sweeps")
        vertical: Any = {"none": False, "free": True}.get(arguments.vertical, arguments.vertical)
        curve = fit_master_curve(data, arguments.reference, vertical=vertical)
        moduli, options["shift"] = curve.data, curve.shift
        texts.append(curve.report(command=True))
    elif len(data) > 1:
        raise ValueError("several files have no temperatures; give one file, or --temperature for each file")
    elif temperatures:
        moduli = dataclasses.replace(moduli, temperature=None, check_units=False)
    show("fitting a Prony series")
    series = fit_prony(moduli, arguments.per_decade, **options)
    texts.append(series.report())
    changes: dict[str, Any] = {"material": series.material}
    if arguments.strain is not None:
        sweep = _strain_sweep(arguments)
        softening: Any = softening_from_sweep(sweep["strain"], sweep["E_stor"], sweep["E_loss"])
        changes["softening"] = softening
        ends = (float(values[-1]) for values in (softening.strain, softening.storage, softening.loss))
        text = "At a strain of {:.3g}, E' is {:.3g} and E'' {:.3g} times the value at rest.\n"
        texts.append(text.format(*ends))

    def write(path: str) -> None:
        if as_path(path).suffix.lower() == ".csv":
            return (moduli if isinstance(moduli, ModulusData) else series.moduli()).write(path)
        scene = _with_body(arguments, rf.Body(rf.Rigid()), **changes)
        return rf.save_scene(path, scene, like=arguments.scene)

    return _ended(
        arguments, show, texts, write, lambda: series.plot() if curve is None else curve.plot(series=series)
    )


def read_response(
    arguments: argparse.Namespace, path: StrPath, temperature: float | None = None
) -> ModulusData | RelaxationData | CreepData:
    """Return the moduli over frequency, or the relaxation moduli or compliances over time, of a file."""
    options = reading_options(arguments, "columns", "poisson", "check_units", "bad_rows", "block")
    kind = arguments.kind or "modulus"
    if arguments.kind is None:
        names = {COLUMNS[name].name for name in _names(arguments, path) if name in COLUMNS}
        over_time = [cls.quantity for cls in TRANSIENTS if names & {_column(cls), *cls.others}]
        if not names & {_column(ModulusData), *ModulusData.others} and over_time:
            kind = over_time[0]
    known = cast(Literal["modulus", "relaxation", "creep"], kind)
    return read(path, temperature=temperature, kind=known, **options)


def _names(arguments, path):
    try:
        return read_names(path, arguments.columns, "E" if arguments.poisson is None else "G", arguments.block)
    except ValueError:
        return []  # `read` explains


def _column(cls):
    return cls.fields()[cls.values[0]].column


def _strain_sweep(arguments):
    options = {"columns": arguments.strain_columns, **reading_options(arguments, "poisson", "bad_rows")}
    try:
        return rf.io.read_table(arguments.strain, ["strain", "E_stor", "E_loss"], **options)
    except ValueError as error:
        raise ValueError(str(error).replace("columns=", "strain_columns=")) from None


def _with_body(arguments, other, **changes):
    """Return the scene of --scene, or a new one with the body `other`, in which one body has the changes."""
    if arguments.scene is not None:
        scene = rf.load_scene(arguments.scene)
        return scene.replace(**{arguments.body: getattr(scene, arguments.body).replace(**changes)})
    own = rf.Body(**{"material": rf.Rigid(), **changes})
    return rf.Scene(own, other) if arguments.body == "lower" else rf.Scene(other, own)


def run_spectrum(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Compute and fit the spectrum of a measured surface, write files, and return the exit status."""
    from fitting.characterise.spectrum import fit_spectrum
    from fitting.data.heights import spectrum_data

    del interrupts
    _check_end(arguments)
    show(f"reading {arguments.data}")
    measured, text = measured_spectrum(arguments)
    show("inverting and fitting the spectrum")
    road = fit_spectrum(measured, q1=arguments.q1)
    data = measured if isinstance(measured, SpectrumData) else spectrum_data(measured)
    spectrum: Any = rf.TabulatedSpectrum(data.q, data.C) if arguments.table else road.spectrum
    if arguments.rms_slope is not None:
        spectrum = rf.with_cutoff(spectrum, arguments.rms_slope)
    q1 = float(spectrum.q[-1] if spectrum.q1 is None else spectrum.q1)
    slope, height = float(rf.rms_slope(spectrum)), float(rf.roughness.rms_height(spectrum))
    texts = [text, road.report()]
    texts.append(
        f"The scene ends at q1 = {q1:.4g} 1/m, {_reason_of_cutoff(arguments, measured)}"
        f" Its rms height is {height:.3g} m, its rms slope {slope:.3g}.\n"
    )

    def write(path: str) -> None:
        if as_path(path).suffix.lower() == ".csv":
            return data.write(path)
        scene = _with_body(arguments, rf.Body(_BLOCK), spectrum=spectrum)
        return rf.save_scene(path, scene, like=arguments.scene)

    drawn = {"measured": data, "table" if arguments.table else "fit": spectrum}
    return _ended(arguments, show, texts, write, lambda: plot_spectrum(drawn))


def _check_end(arguments):
    """Raise ValueError unless --q1 and --slope can end a spectrum."""
    if arguments.q1 is not None and not 0 < arguments.q1 <= rf.roughness.LARGEST_WAVEVECTOR:
        largest = rf.roughness.LARGEST_WAVEVECTOR
        raise ValueError(
            f"--q1 {arguments.q1:g}: must be > 0 and <= {largest:.2g} 1/m, the distance of atoms"
        )
    if arguments.rms_slope is not None:
        check_values("rms_slope", arguments.rms_slope, POSITIVE)


def _reason_of_cutoff(arguments, measured):
    """Return the reason for q1 of the scene, as the end of a sentence."""
    if arguments.rms_slope is not None:
        return f"because its rms slope is {arguments.rms_slope:g} there (--slope)."
    if arguments.q1 is not None:
        return "as given by --q1."
    whole = arguments.table or isinstance(measured, SpectrumData)
    end = "the data end" if whole else "the resolved range ends"
    return f"where {end}. --slope 1.3 ends it where rubber on roads usually does."


def measured_spectrum(
    arguments: argparse.Namespace,
) -> tuple[SpectrumData | rf.roughness.MeasuredSpectrum, str]:
    """Return SpectrumData of a spectrum or the MeasuredSpectrum of heights, and a text about it."""
    stated = {name: getattr(arguments, name) for name in HEIGHTS if getattr(arguments, name) is not None}
    if not arguments.map and (arguments.normalisation is not None or _is_spectrum(arguments)):
        for name, value in stated.items():
            raise ValueError(f"{name} = {value}: must not be given; {arguments.data} holds a spectrum")
        data = read(
            arguments.data,
            normalisation=arguments.normalisation,
            hurst=arguments.hurst,
            kind="spectrum",
            **reading_options(arguments, "columns", "check_units", "bad_rows"),
        )
        return data, f"{data.q.size} wavevectors"
    outliers, options = stated.pop("outliers", None), {"per_decade": _BINS, **stated}
    if arguments.map:
        spacing = _one_or_two(arguments.spacing)
        surface = rf.io.read_heights(arguments.data, spacing, arguments.unit, outliers=outliers)
        measured = rf.roughness.spectrum_of_topography(surface.heights, surface.dx, surface.dy, **options)
        size = " x ".join(map(str, surface.heights.shape))
        return measured, f"{size} heights, {surface.holes:.1%} of them filled\n{measured.report()}"
    x, traces = rf.io.read_traces(arguments.data, outliers)
    measured = rf.roughness.spectrum_of_profile(x, traces, **options)
    count = f"{len(traces)} trace{'s' * (len(traces) > 1)}"
    text = f"{count} of {x.size} heights; the surface is taken as isotropic\n{measured.report()}"
    return measured, text


def _is_spectrum(arguments):
    """Return True if the file has a column of a spectrum."""
    try:
        names = read_names(arguments.data, arguments.columns)
    except ValueError:
        return False
    return not {COLUMNS[name].name for name in names if name in COLUMNS}.isdisjoint(("C", "C_1D"))


def run_job(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Write and print a job file for `rubberfric-fit`, and return the exit status."""
    del interrupts
    show("writing the job")
    out = as_path(arguments.out)
    place, scene = as_path(arguments.scene), rf.load_scene(arguments.scene)
    added = arguments.shear
    if added:
        if scene.shear is not None:
            raise ValueError(f"{place}: has contact shear already: leave out --shear")
        scene, place = scene.replace(shear=_SHEAR), _new_scene(out)
        check_writable(place, (".toml",))
    reading = reading_options(arguments)
    kinds = [{"kind": kind} for kind in dict.fromkeys(reading.pop("kind", []))] or [{}]
    # In a file with several kinds of data, --relative is for those without errors.
    relative = reading.pop("relative", None) if len(kinds) > 1 else None
    sets = [([path], reading | kind) for path in arguments.data for kind in kinds]
    data: Any = []
    for (path,), options in sets:
        dataset: Any = read(path, **options)
        if relative is not None and dataset.error is None:
            options["relative"] = relative
            dataset = dataclasses.replace(dataset, relative=relative, check_units=False)
        data.append(dataset)
    if arguments.average and len(arguments.data) > 1:
        data, sets = [average(data)], [(arguments.data, reading | kinds[0])]
    data = as_data_sets(data)
    rough = [side for side in ("lower", "upper") if getattr(scene, side).spectrum is not None]
    if not rough and any(d.quantity in CURVE_QUANTITIES for d in data):
        raise ValueError(
            f"{arguments.scene}: has no roughness, so that the contact is complete: add a spectrum, for"
            " example with `rubberfric-fit spectrum`"
        )
    cutoffs = [f"{side}.spectrum.q1" for side in rough if getattr(scene, side).spectrum.q1 is not None]
    of_patch = [path for quantity, path in _FREE_PATCH.items() if any(d.quantity == quantity for d in data)]
    free = arguments.free or [*of_patch, *(_FREE_SHEAR if added else ()), *cutoffs]
    if not free:
        raise ValueError("--free: must name the free parameters; the scene has no cutoff q1")
    # Errors in the job show before anything is written.
    make_problem(scene, data, dict.fromkeys(free, Positive()))
    lines = [f"scene = {toml.string(_from(out, place))}"]
    for paths, options in sets:
        files = ", ".join(toml.string(_from(out, path)) for path in paths)
        lines += ["", "[[data]]", f"file = [{files}]" if len(paths) > 1 else f"file = {files}"]
        lines += [f"{name} = {toml.literal(value)}" for name, value in options.items()]
    lines += ["", "[free]", *(f'{toml.string(path)} = "positive"' for path in free)]
    text = "\n".join(lines) + "\n"
    if added:
        rf.save_scene(place, scene, like=arguments.scene)
    finish(show, text, ("writing", str(out), lambda path: write_durably(path, text.encode())))
    return 0


def _new_scene(out):
    """Return an unused path for the scene of a job, because the user has not named a file."""
    ends = ("", *(f"_{k}" for k in range(2, 10_000)))
    paths = (out.with_name(f"{out.stem}_scene{end}.toml") for end in ends)
    return next(path for path in paths if not os.path.lexists(path))


def _from(out, path):
    return os.path.relpath(path, out.parent).replace(os.sep, "/")


def run_table(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Tabulate the friction of a fit or a scene for other software, and return the exit status."""
    del interrupts
    show(f"reading {arguments.fit}")
    axes: Any = [_one_or_two(getattr(arguments, name)) for name in ("velocity", "pressure", "temperature")]
    table: Any
    try:
        result = FitResult.load(arguments.fit) if as_path(arguments.fit).suffix.lower() == ".h5" else None
    except ValueError:
        result = None  # a scene or a result of `rubberfric run`
    show("computing the table")
    if result is None:
        table = rf.analysis.friction_table(rf.load_scene(arguments.fit), *axes, error=arguments.error)
    else:
        table = friction_table(result, *axes, error=arguments.error)
    units = dict(zip(("unit_velocity", "unit_pressure", "unit_temperature"), arguments.units, strict=True))
    text = (
        f"mu at {table.velocity.size} velocities, {table.pressure.size} pressures"
        + (f", {table.temperature.size} temperatures" if table.temperature is not None else "")
        + f": {table.friction.min():.3g} ... {table.friction.max():.3g};"
        f" interpolation error {table.error:.2g}\n"
    )
    return _ended(arguments, show, [text], lambda path: rf.io.write_friction(path, table, **units), None)


def _one_or_two(values):
    return values if values is None or len(values) > 1 else values[0]


def _ended(
    arguments: argparse.Namespace,
    show: Progress,
    texts: list[str],
    write: Callable[[str], object],
    draw: Callable[[], Any] | None,
) -> int:
    """Write the files of --out and --plot, print the texts, and return the exit status."""
    outputs: list[Output] = [("writing", arguments.out, write)]
    if draw is not None:
        outputs.append(("drawing", arguments.plot, lambda path: save_figure(path, draw())))
    finish(show, "\n".join(text.rstrip("\n") + "\n" for text in texts), *outputs)
    return 0
