"""Arguments of the commands, and checks before JAX is imported."""

import argparse
import importlib.util
import os
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, NoReturn

from rubberfric.base.atomic import TABLE_SUFFIXES, StrPath, check_readable, check_suffix, check_writable
from rubberfric.base.release import VERSION
from rubberfric.commands.inputs import named_files

SCENES = (".toml", ".h5")
# Quantities of `rubberfric map`: fields of `rubberfric.Solution`, repeated to avoid importing JAX.
MAPPED = (
    *("area", "friction", "separation", "viscoelastic_friction", "shear_friction", "transverse_friction"),
    *("flash_temperature", "converged"),
)
# Above this number of devices JAX needs seconds and gigabytes to start.
_MOST_DEVICES = 256


class Parser(argparse.ArgumentParser):
    """A parser whose error message is one line.

    The dict `options` has the options of the command by their names in Python.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.options: dict[str, argparse.Action] = {}
        super().__init__(*arguments, **options)
        self.set_defaults(words=self.options)

    def add_argument(self, *arguments: Any, **options: Any) -> argparse.Action:
        """Add an argument as `argparse` does."""
        action = super().add_argument(*arguments, **options)
        if action.option_strings:
            self.options[action.dest] = action
        return action

    def error(self, message: str) -> NoReturn:
        """Print the message on one line without the usage, and exit."""
        if message.startswith("argument COMMAND: invalid choice"):
            message += f"; {self.epilog}"
        self.exit(2, f"{self.prog}: {' '.join(message.split())}\n")


# Help and description of each command, help of its scene, and name and help of --out and help of --plot.
_SCENE = "scene file (.toml) or result file (.h5)"
_COMMANDS: dict[str, tuple[str, str, str, tuple[str, str, str] | None]] = {
    "run": (
        "compute a scene at the conditions in its file",
        "Print contact area, friction coefficient and mean separation over velocity; parts of the friction, "
        "transverse force and flash temperature if the scene has contact shear, anisotropic roughness or "
        "heating.",
        "scene file (.toml), or result file (.h5) to compute again",
        ("FILE.h5", "write the result and the scene that made it", "draw the curves"),
    ),
    "accuracy": (
        "measure errors and run times of a scene for settings of increasing accuracy",
        "Print errors of area, friction, separation and of their gradients with run times, for accuracy "
        "settings in double and single precision and for the textbook method, and the cheapest setting for a "
        "required error. Rows are printed as they come, in a terminal or with --verbose.",
        _SCENE,
        ("FILE.csv", "write the table", "draw error over run time"),
    ),
    "map": (
        "compute a scene over velocity, temperature and pressure",
        "Compute a scene at every combination of the velocities, pressures and temperatures of the "
        "table [map] of its file, or of [run] if there is none; print the range of each quantity and the "
        "conditions of its largest value.",
        _SCENE,
        ("FILE.h5", "write the map and the scene that made it", "draw the map"),
    ),
    "grip": (
        "compute the grip of a patch that slips",
        "Print force, aligning moment and sliding share of a contact patch (brush model) for each slip, "
        "speed and load.",
        _SCENE,
        None,
    ),
    "leak": (
        "compute the leak of a seal",
        "Print the contact area, the conductivity of the gaps and the leak of a seal for each pressure, and "
        "the pressure at which the leak ends.",
        _SCENE,
        None,
    ),
    "explore": (
        "change the numbers of a scene on a page with sliders",
        "Serve a page to this machine only, with a slider for each number of a scene. It shows friction, "
        "contact area, moduli, spectra, sensitivities and measured points. The scene and a fit that begins "
        "there can be downloaded. Ctrl-C ends it.",
        _SCENE,
        None,
    ),
    "doctor": (
        "report versions, devices and the compilation cache",
        "Print versions, devices, precision, the folder of the compilation cache and a test of it, and known "
        "faults of these versions.",
        "",
        None,
    ),
}


class _Number(NamedTuple):
    """An option with a number, or with several if `several`."""

    name: str
    help: str
    default: float | None = None
    required: bool = True
    several: bool = False


_TEMPERATURE = _Number("temperature", "temperature [K] (default: the reference temperatures)", required=False)
_PATCH = "default: [patch] of the scene"
# Numbers of the applications.
_NUMBERS = {
    "grip": (
        _Number("length", f"length of the patch [m] ({_PATCH})", required=False),
        _Number("width", f"width of the patch [m] ({_PATCH})", required=False),
        _Number("stiffness", f"shear stress of the tread per displacement [Pa/m] ({_PATCH})", required=False),
        _Number("slip", "slip angles [rad] or slip ratios [-]", several=True),
        _Number("speed", "travelling speeds [m/s]", several=True),
        _Number("load", "loads [N]", several=True),
        _TEMPERATURE,
    ),
    "leak": (
        _Number("pressure", "pressures of the seal on the surface [Pa]", several=True),
        _Number("fluid-pressure", "difference of the fluid pressure across the seal [Pa]"),
        _Number("length", "length of the contact along the flow [m]"),
        _Number("width", "width of the contact across the flow, such as the circumference [m]"),
        _Number("viscosity", "viscosity of the fluid [Pa s] (default: 1e-3, water)", 1e-3, False),
        _Number("critical-area", "A/A0 at which the leak ends (default: 0.415)", 0.415, False),
        _TEMPERATURE,
    ),
}


def parser() -> Parser:
    """Return the argument parser of `rubberfric`."""
    whole = Parser(
        prog="rubberfric",
        description="Rubber friction and contact of rough viscoelastic solids.",
        epilog="fits and measured data have their own command: rubberfric-fit --help",
    )
    whole.add_argument("--version", action="version", version=f"rubberfric {VERSION}")
    commands = whole.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, (text, description, scene, outputs) in _COMMANDS.items():
        command = commands.add_parser(name, help=text, description=description)
        if scene:
            command.add_argument("scene", metavar="SCENE", help=scene)
        if name == "accuracy":
            wanted = "required relative error (default: 1e-6)"
            command.add_argument("--error", type=float, default=1e-6, help=wanted)
        if outputs is not None:
            add_outputs(command, *outputs)
        if name in _NUMBERS:
            _add_application(command, name)
        if name == "map":
            _add_map(command)
        if name == "explore":
            _add_explore(command)
        add_common(command)
    return whole


def _add_application(command: argparse.ArgumentParser, name: str) -> None:
    for number in _NUMBERS[name]:
        several = {"nargs": "+"} if number.several else {}
        command.add_argument(
            f"--{number.name}",
            type=float,
            metavar="X",
            help=number.help,
            default=number.default,
            required=number.required,
            **several,
        )
    if name == "grip":
        kind = "slip angle (default) or slip ratio"
        command.add_argument("--kind", choices=("angle", "ratio"), default="angle", help=kind)
        shape = "pressure along the patch (default: [patch] of the scene, or parabolic)"
        choices = ("parabolic", "uniform")
        command.add_argument("--patch-pressure", choices=choices, help=shape)
    command.add_argument("--out", metavar="FILE.csv", help="write the table")


def _add_map(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--quantity",
        nargs="+",
        choices=MAPPED,
        metavar="NAME",
        help=f"quantities to compute, from {', '.join(MAPPED)} (default: friction area)",
    )
    devices = "number of CPU devices of JAX (default: one for each core); no effect on other devices"
    command.add_argument("--devices", type=int, metavar="N", help=devices)


def _add_explore(command: argparse.ArgumentParser) -> None:
    data = "measured friction: a table with v, mu, and optionally p and T"
    command.add_argument("--data", metavar="FILE", help=data)
    columns = '"name [unit]" of each column of --data, "-" to skip one'
    command.add_argument("--columns", nargs="+", metavar="NAME", help=columns)
    rows = "rows of --data with empty or invalid values: an error (default), or left out"
    command.add_argument("--bad-rows", choices=("error", "drop"), help=rows)
    command.add_argument("--port", type=int, default=0, metavar="N", help="port (default: any free port)")
    browser = "print the address without opening a browser"
    command.add_argument("--no-browser", action="store_true", help=browser)


def add_outputs(command: argparse.ArgumentParser, name: str, written: str, drawn: str) -> None:
    """Add the options --out, whose help shows the file `name`, and --plot."""
    command.add_argument("--out", metavar=name, help=written)
    command.add_argument("--plot", metavar="FILE.png", help=f"{drawn} (.png, .pdf or .svg)")


def add_common(command: argparse.ArgumentParser) -> None:
    """Add the options that every command has."""
    command.add_argument(
        "--no-cache", action="store_true", help="neither read nor write the cache of compiled functions"
    )
    command.add_argument(
        "--verbose", action="store_true", help="print progress to stderr, also if it is not a terminal"
    )


def check_arguments(arguments: argparse.Namespace) -> None:
    """Raise ValueError for invalid arguments of `rubberfric`, before any work begins."""
    if arguments.command == "doctor":
        return
    if arguments.command == "map" and (count := arguments.devices) is not None:
        if count < 1:
            raise ValueError(f"--devices {count}: must be > 0")
        if count > _MOST_DEVICES:
            raise ValueError(
                f"--devices {count}: must be {_MOST_DEVICES} or less, such as the number of cores"
            )
    check_input(arguments.scene, SCENES)
    if arguments.command == "explore":
        if arguments.port != 0 and not 1024 <= arguments.port < 2**16:
            raise ValueError(f"--port {arguments.port}: must be 1024 ... 65535, or 0 for any free port")
        if arguments.data is not None:
            check_input(arguments.data, TABLE_SUFFIXES)
        return
    suffix = ".csv" if arguments.command in ("accuracy", *_NUMBERS) else ".h5"
    check_outputs(arguments, suffix, inputs=[arguments.scene])


def check_input(path: StrPath, suffixes: tuple[str, ...]) -> None:
    """Raise ValueError unless a file is readable and has one of the suffixes."""
    check_suffix(path, suffixes)
    check_readable(path)


def check_outputs(
    arguments: argparse.Namespace, *suffixes: str, inputs: Iterable[StrPath | None] = ()
) -> None:
    """Raise ValueError unless --out, with one of the suffixes, and --plot can be written.

    `inputs` are files that the command reads. They, and the files that they name, must not be overwritten.
    """
    inputs = [each for path in inputs if path is not None for each in (path, *named_files(path))]
    if arguments.out is not None:
        check_writable(arguments.out, suffixes)
    # The applications have no --plot.
    plot = getattr(arguments, "plot", None)
    if plot is not None:
        check_writable(plot, (".png", ".pdf", ".svg"))
    for option, path in (("out", arguments.out), ("plot", plot)):
        check_no_input(f"--{option}", path, inputs)
    if plot is not None and importlib.util.find_spec("matplotlib") is None:
        raise ValueError("--plot needs matplotlib; install it with: pip install 'rubberfric[plot]'")


def check_no_input(option: str, path: StrPath | None, inputs: Iterable[StrPath | None]) -> None:
    """Raise ValueError if the file of an option is one of the files that the command reads."""
    for other in inputs:
        # Path.resolve raises RuntimeError for a link to itself.
        if path is None or other is None:
            continue
        same = os.path.realpath(path) == os.path.realpath(other)
        if same or (os.path.exists(path) and os.path.exists(other) and os.path.samefile(path, other)):
            raise ValueError(f"{option} {path}: is a file that this command reads; choose another file")


def write_outputs(
    show: Callable[[str], object], *outputs: tuple[str, str | None, Callable[[str], object]]
) -> OSError | None:
    """Write the files of a command, and return the last error or None.

    An error in one file does not prevent the other files or the printed output. `show` is called with the
    name of each step. `outputs` are tuples of a name, a path or None, and the function that writes to it.
    """
    failure = None
    for what, path, write in outputs:
        if path is not None:
            show(f"{what} {path}")
            try:
                write(path)
            except OSError as error:
                failure = error
    return failure
