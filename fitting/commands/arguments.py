"""Arguments of `rubberfric-fit` and its sub-commands, and checks before JAX is imported."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from fitting.commands.options import BODIES, HEIGHTS, READING, add_reading
from rubberfric.base import TABLE_SUFFIXES, VERSION, check_readable, check_writable
from rubberfric.commands import (
    Parser,
    add_common,
    add_outputs,
    check_input,
    check_no_input,
    check_outputs,
    named_files,
)

PROGRAM = "rubberfric-fit"
_SCENES = (".toml", ".h5")


def _check_fit(arguments: argparse.Namespace) -> None:
    checkpoint = arguments.checkpoint
    if arguments.bootstrap is None and (checkpoint is not None or arguments.resume):
        raise ValueError("--checkpoint and --resume must come with --bootstrap N")
    if arguments.resume and checkpoint is None:
        raise ValueError("--resume: must come with --checkpoint FILE.h5")
    check_input(arguments.job, (".toml",))
    check_outputs(arguments, ".h5", inputs=[arguments.job])
    if isinstance(arguments.budget, str):
        check_writable(arguments.budget, (".png", ".pdf", ".svg"))
        check_no_input("--budget", arguments.budget, [arguments.job, *named_files(arguments.job)])
        if arguments.plot is not None and Path(arguments.budget).resolve() == Path(arguments.plot).resolve():
            raise ValueError(f"--budget {arguments.budget}: is the file of --plot; must be another file")
    if checkpoint is None:
        return
    check_writable(checkpoint, (".h5",))
    check_no_input("--checkpoint", checkpoint, [arguments.job, *named_files(arguments.job)])
    if arguments.out is not None and Path(checkpoint).resolve() == Path(arguments.out).resolve():
        raise ValueError(f"--checkpoint {checkpoint}: is the file of --out; must be another file")
    if Path(checkpoint).exists() and not arguments.resume:
        raise ValueError(f"{checkpoint}: the file exists; continue it with --resume, or remove it")


def _design_parser() -> Parser:
    parser = Parser(
        prog=f"{PROGRAM} design", description="Fit a job and choose the measurements to make next."
    )
    parser.add_argument("job", metavar="JOB", help="job file (.toml) with a table [design]")
    add_outputs(parser, "FILE.csv", "write the conditions to measure at", "draw the gain of each measurement")
    add_common(parser)
    return parser


def _calibration_parser() -> Parser:
    parser = Parser(
        prog=f"{PROGRAM} calibration",
        description="Fit data drawn from the priors of a job; report the coverage of its error bars.",
    )
    add = parser.add_argument
    add("job", metavar="JOB", help="job file (.toml) with a Gaussian prior of each free parameter")
    add("--members", metavar="N", type=_count, default=1000, help="number of fits (default: 1000)")
    text = "compare the true values with error bars, or with posterior draws, which takes longer"
    add("--on", choices=("normal", "samples"), default="normal", help=text)
    add("--plot", metavar="FILE.png", help="draw the ranks of the true values (.png, .pdf or .svg)")
    parser.set_defaults(out=None)
    add_common(parser)
    return parser


def _laboratory_parser(kind: str, description: str, out: str, plot: str | None, suffixes: str) -> Parser:
    """Return a parser with the arguments that all commands of `fitting.commands.laboratory` have."""
    parser = Parser(prog=f"{PROGRAM} {kind}", description=description)
    if plot is None:
        parser.add_argument("--out", metavar="FILE", required=True, help=f"{out} ({suffixes})")
        parser.set_defaults(plot=None)
    else:
        add_outputs(parser, "FILE", f"{out} ({suffixes})", plot)
    add_common(parser)
    return parser


def _add_scene(parser: Parser, body: str) -> None:
    add = parser.add_argument
    add("--scene", metavar="SCENE", help="scene that gets the result (default: a new one)")
    add("--body", choices=BODIES, default=body, help=f"body of the scene (default: {body})")


def _add_response(parser: Parser) -> None:
    """Add the options for reading moduli over frequency, and E(t) or D(t) over time."""
    add = parser.add_argument
    kinds = ("modulus", "relaxation", "creep")
    add("--kind", choices=kinds, help="kind of data (default: from the columns)")
    text = "Poisson's ratio: a storage modulus is then of shear (default: E', and 0.5 in the scene)"
    add("--poisson", type=float, metavar="NU", help=text)
    for name in ("columns", "bad_rows", "check_units", "block"):
        add_reading(parser, name)


def _mastercurve_parser() -> Parser:
    parser = _laboratory_parser(
        "mastercurve",
        "Shift sweeps of a dynamic mechanical analysis, relaxation moduli or creep compliances onto one curve"
        " and fit a Prony series; print both.",
        "write a scene with this material, or the master curve",
        "draw the master curve and the shifts",
        ".toml or .h5, or .csv",
    )
    add = parser.add_argument
    text = "tables of E', E'' over frequency, or of E(t) or D(t) over time"
    add("data", nargs="+", metavar="DATA", help=text)
    _add_response(parser)
    text = "temperature of each file [K], if the files do not contain it"
    add("--temperature", nargs="+", type=float, metavar="K", help=text)
    text = "temperature of the curve [K] (default: nearest to 293.15)"
    add("--reference", type=float, metavar="K", help=text)
    shifts = ("none", "free", "entropic")
    add("--vertical", choices=shifts, default="none", help="vertical shift (default: none)")
    text = "relaxation times per decade (default: 2)"
    add("--per-decade", type=float, default=2.0, metavar="N", help=text)
    add("--strain", metavar="DATA", help="strain sweep of a filled rubber, for its softening in the scene")
    add("--strain-columns", nargs="+", metavar="NAME", help="as --columns, for the strain sweep")
    _add_scene(parser, "upper")
    return parser


def _spectrum_parser() -> Parser:
    parser = _laboratory_parser(
        "spectrum",
        "Compute the spectrum of a measured surface and fit a self-affine one; print it. The file holds"
        " traces of a profilometer, with --map a height map, with --normalisation a spectrum.",
        "write a scene with this roughness, or the measured spectrum",
        "draw the measured and the fitted spectrum",
        ".toml or .h5, or .csv",
    )
    add = parser.add_argument
    add("data", metavar="DATA", help="table of heights or of a spectrum")
    add("--map", action="store_true", help="the file is a height map: x, y, z or a grid")
    add("--spacing", nargs="+", type=float, metavar="M", help="dx, or dx and dy, of a grid of heights [m]")
    add("--unit", metavar="UNIT", help="unit of a height map without units: m, cm, mm, um, nm")
    text = "normalisation of a spectrum: C, C_iso, C_1D, C_1D_one_sided, W1, Wr, ISO_8608 ..."
    add("--normalisation", metavar="NAME", help=text)
    text = "Hurst exponent, if a spectrum along a line is taken as self-affine without a roll-off"
    add("--hurst", type=float, metavar="H", help=text)
    for name, options in HEIGHTS.items():
        add(f"--{name.replace('_', '-')}", **{"default": None, **options})
    text = "largest wavevector to fit [1/m] (default: the end of the resolved range)"
    add("--q1", type=float, metavar="Q", help=text)
    text = "continue or cut the roughness to this rms slope, often 1.3"
    add("--slope", dest="rms_slope", type=float, metavar="S", help=text)
    add("--table", action="store_true", help="put the measured spectrum itself into the scene")
    _add_scene(parser, "lower")
    for name in ("columns", "bad_rows", "check_units"):
        add_reading(parser, name)
    return parser


def _job_parser() -> Parser:
    parser = _laboratory_parser(
        "job", "Write a job file for rubberfric-fit, and print it.", "job file to write", None, ".toml"
    )
    add = parser.add_argument
    add("scene", metavar="SCENE", help="scene file (.toml or .h5)")
    add("data", nargs="+", metavar="DATA", help="tables of measured friction, area, moduli or spectra")
    for name in READING:
        add_reading(parser, name)
    text = "add contact shear to the scene, written as OUT_scene.toml, and free it"
    add("--shear", action="store_true", help=text)
    text = "free parameters, all > 0 (default: q1 of each spectrum, and contact shear with --shear)"
    add("--free", nargs="+", metavar="KEYPATH", help=text)
    return parser


def _table_parser() -> Parser:
    parser = _laboratory_parser(
        "table",
        "Tabulate the friction of a fit or a scene for a simulation, to a stated interpolation error.",
        "table to write",
        None,
        ".inp Abaqus, .k LS-DYNA, .csv, .json, .txt",
    )
    add = parser.add_argument
    add("fit", metavar="FIT", help="fit (.h5) or scene (.toml or .h5)")
    for name, unit in (("velocity", "m/s"), ("pressure", "Pa"), ("temperature", "K")):
        text, needed = f"lowest and highest {name}, or one value [{unit}]", name != "temperature"
        add(f"--{name}", nargs="+", type=float, metavar=unit, required=needed, help=text)
    add("--error", type=float, default=0.01, help="interpolation error (default: 0.01)")
    text = "units of the table: m/s, mm/s or um/s; Pa, kPa, MPa or GPa; K or C (default: m/s Pa K)"
    add("--units", nargs=3, default=("m/s", "Pa", "K"), metavar=("V", "P", "T"), help=text)
    return parser


# Programs for cards, by the suffix of the file that is written.
CARD_SUFFIXES = {
    **{".inp": "abaqus", ".mac": "ansys", ".txt": "comsol", ".k": "lsdyna", ".rad": "openradioss"},
    ".csv": "pyvisco",
}


def _cards_parser() -> Parser:
    suffixes = ", ".join(f"{suffix} {program}" for suffix, program in CARD_SUFFIXES.items())
    parser = _laboratory_parser(
        "cards",
        "Write the Prony series of a scene, a fit or a table of moduli as cards, and print E' and E''.",
        "cards to write",
        None,
        suffixes,
    )
    add = parser.add_argument
    text = "scene (.toml or .h5), fit (.h5), or table of a master curve, E(t) or D(t) (.csv, .txt, .xlsx)"
    add("input", metavar="INPUT", help=text)
    programs = tuple(CARD_SUFFIXES.values())
    add("--program", choices=programs, help="finite-element program (default: from the suffix of --out)")
    add("--body", choices=BODIES, help="body of the scene (default: the only one with a Prony series)")
    stresses = ("Pa", "kPa", "MPa", "GPa")
    add("--unit-stress", choices=stresses, default="MPa", help="unit of moduli (default: MPa)")
    text = "unit of temperatures (default: K)"
    add("--unit-temperature", choices=("K", "C"), default="K", help=text)
    add("--bulk", type=float, metavar="Pa", help="elastic bulk modulus [Pa], for compressible elements")
    add("--density", type=float, metavar="kg/m3", help="density [kg/m^3], needed by lsdyna and openradioss")
    add("--name", default="RUBBER", help="name of the material (default: RUBBER)")
    text = "leave out the shift with temperature"
    add("--no-shift", dest="shift", action="store_const", const=False, default=None, help=text)
    text = "lowest and highest temperature of a vertical shift, or with --no-shift the temperature [K]"
    add("--temperature", nargs="+", type=float, metavar="K", help=text)
    text = "write neo-Hookean cards (abaqus, ansys)"
    add("--hyperelastic", action="store_true", help=text)
    text = "relaxation times per decade, for a table (default: 2)"
    add("--per-decade", type=float, default=2.0, metavar="N", help=text)
    _add_response(parser)
    return parser


def _check_cards(arguments: argparse.Namespace) -> None:
    check_outputs(arguments, *CARD_SUFFIXES, inputs=[arguments.input])
    check_input(arguments.input, (*_SCENES, *TABLE_SUFFIXES))
    if len(arguments.temperature or [0]) > 2:
        raise ValueError("--temperature: must be the lowest and the highest value, or one value")


def _check_planning(arguments: argparse.Namespace) -> None:
    check_input(arguments.job, (".toml",))
    check_outputs(arguments, ".csv", inputs=[arguments.job])


def _check_characterisation(arguments: argparse.Namespace) -> None:
    data = arguments.data if isinstance(arguments.data, list) else [arguments.data]
    inputs = [arguments.scene, getattr(arguments, "strain", None), *data]
    check_outputs(arguments, *_SCENES, ".csv", inputs=inputs)
    if arguments.scene is not None:
        check_input(arguments.scene, _SCENES)
    for path in data:
        check_readable(path)
    if len(getattr(arguments, "spacing", None) or [0]) > 2:
        raise ValueError("--spacing: must be dx, or dx and dy")


def _check_job(arguments: argparse.Namespace) -> None:
    check_outputs(arguments, ".toml", inputs=[arguments.scene, *arguments.data])
    check_input(arguments.scene, _SCENES)
    for path in arguments.data:
        check_readable(path)


def _check_table(arguments: argparse.Namespace) -> None:
    check_outputs(arguments, ".inp", ".k", ".csv", ".json", ".txt", inputs=[arguments.fit])
    check_input(arguments.fit, _SCENES)
    for name in ("velocity", "pressure", "temperature"):
        if len(getattr(arguments, name) or [0]) > 2:
            raise ValueError(f"--{name}: must be the lowest and the highest value, or one value")


def _fit_parser() -> Parser:
    parser = Parser(
        prog=PROGRAM,
        description="Fit parameters of a rubber friction scene to measurements; print values and errors.",
        epilog="Other commands, each with --help: rubberfric-fit design, choose the next measurements;"
        " calibration, measure the coverage of error bars; mastercurve, fit moduli of a DMA; spectrum, fit a"
        " measured surface; job, write a job file; cards, write material cards; table, write friction for a"
        " simulation.",
    )
    add = parser.add_argument
    add("--version", action="version", version=f"{PROGRAM} {VERSION}")
    add("job", metavar="JOB", help="job file (.toml): scene, data, free parameters")
    text = "write the fit; fitting.FitResult.load reads it"
    add_outputs(parser, "FILE.h5", text, "draw data, fit and residuals")
    add("--bootstrap", metavar="N", type=_count, help="fit N simulated data sets, report their spread")
    text = "fix this parameter, or the q1 of a spectrum, at several values; print the cost"
    add("--profile", metavar="KEYPATH", help=text)
    text = "print how theory, conditions and fixed numbers move each parameter; draw it to FILE.png if given"
    add("--budget", nargs="?", const=True, metavar="FILE.png", help=text)
    text = "save the bootstrap's state every minute; refused if it exists"
    add("--checkpoint", metavar="FILE.h5", help=text)
    add("--resume", action="store_true", help="continue the checkpoint, if it exists")
    add_common(parser)
    return parser


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit() or len(text) > 9 or not 0 < int(text) <= _MOST:
        raise argparse.ArgumentTypeError(f"{text[:20]!r}: must be an integer >= 1, and <= {_MOST}")
    return int(text)


# Largest number of fits. The data of more would exceed the memory of many machines.
_MOST = 10**6


class Command(NamedTuple):
    """Parser of a sub-command, check of its arguments, and name of its module in `fitting.commands`."""

    parser: Callable[[], Parser]
    check: Callable[[argparse.Namespace], None]
    module: str


# "fit" is also the command that runs if none is named.
COMMANDS = {
    "fit": Command(_fit_parser, _check_fit, "work"),
    "design": Command(_design_parser, _check_planning, "work"),
    "calibration": Command(_calibration_parser, _check_planning, "work"),
    "mastercurve": Command(_mastercurve_parser, _check_characterisation, "laboratory"),
    "spectrum": Command(_spectrum_parser, _check_characterisation, "laboratory"),
    "job": Command(_job_parser, _check_job, "laboratory"),
    "cards": Command(_cards_parser, _check_cards, "cards"),
    "table": Command(_table_parser, _check_table, "laboratory"),
}
