"""Plots chosen by the kind of an object, and plots saved to files. They need matplotlib."""

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from rubberfric.analysis.scales.profiles import Profile
from rubberfric.analysis.sweep import Accuracy
from rubberfric.base.atomic import StrPath, replacing
from rubberfric.base.checks import ArrayLike
from rubberfric.io.results import Conditions, Curves, FrictionTable, Result, curves_of
from rubberfric.materials.material import Material
from rubberfric.plot.curves import plot_result
from rubberfric.plot.errors import plot_accuracy
from rubberfric.plot.ingredients import plot_modulus, plot_spectrum
from rubberfric.plot.maps import plot_map
from rubberfric.plot.over_wavevectors import plot_profile
from rubberfric.plot.style import Axes, FigureBase, Panels
from rubberfric.scene.scene import Scene
from rubberfric.theory.model import solve
from rubberfric.theory.structure import Solution, quantities_of

_LINES = 10  # more lines are drawn as a map


def auto(
    drawn: Any,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    ax: Any = None,
    **options: Any,
) -> Any:
    """Draw an object with the function `plot_...` that suits it.

    Parameters
    ----------
    drawn : object to draw
        A Result, a Solution or an array of friction coefficients is drawn as curves over the velocity, or as
        a map instead of more than ten curves. The friction of a FrictionTable is drawn in the same way. A
        Scene is drawn as curves at `pressure`, by default over 1e-6 ... 10 m/s. A Material is drawn as its
        modulus. A spectrum, a measured spectrum or a dict of spectra is drawn as C(q). A Profile is drawn by
        `plot_profile`, and an Accuracy by `plot_accuracy`. Any other object, such as a fit, is drawn by its
        method `plot`.
    velocity, pressure, temperature : conditions of a Solution or an array, or for a scene
    ax, options : as for the function `plot_...`

    Returns
    -------
    the axes, or a sequence of axes

    Raises
    ------
    ValueError : if the object cannot be drawn, or if the function `plot_...` raises ValueError.

    Examples
    --------
    A material is drawn as its modulus. The highest point is the glassy modulus:

    >>> ax = rf.plot.auto(rf.Prony(E_inf=1e6, E=[1e7], tau=[1e-3]))
    >>> f"{max(ax.lines[0].get_ydata()):.2g}"
    '1.1e+07'
    """
    at = {"velocity": velocity, "pressure": pressure, "temperature": temperature}
    if isinstance(drawn, Scene):
        drawn, at["velocity"] = _solved(drawn, at)
    if isinstance(drawn, FrictionTable):
        conditions = Conditions(drawn.velocity, drawn.pressure, drawn.temperature)
        drawn = Curves(conditions, Solution(area=drawn.area, friction=drawn.friction), drawn.title)
    if isinstance(drawn, Result | Curves | Solution | np.ndarray | jax.Array):
        curves = curves_of(drawn, at["velocity"], at["pressure"], at["temperature"])
        T = curves.conditions.temperature
        lines = curves.conditions.pressure.size * (1 if T is None else T.size)
        return (plot_result if lines <= _LINES else plot_map)(curves, ax=ax, **options)
    if isinstance(drawn, Material):
        options["temperature"] = at.pop("temperature")
    condition = next((name for name, values in at.items() if values is not None), None)
    if condition is not None:
        raise ValueError(
            f"{condition} is given, but {type(drawn).__name__} has its own or needs none; omit {condition}"
        )
    return _drawing(drawn)(ax=ax, **options)


def _drawing(drawn):
    draws = {Material: plot_modulus, Profile: plot_profile, Accuracy: plot_accuracy}
    for kind, draw in draws.items():
        if isinstance(drawn, kind):
            return functools.partial(draw, drawn)
    if callable(getattr(drawn, "plot", None)):
        return drawn.plot
    if isinstance(drawn, Mapping) or hasattr(drawn, "power_law") or hasattr(drawn, "C"):
        return functools.partial(plot_spectrum, drawn)
    raise ValueError(
        "drawn must be a scene, a result of solve, friction_map or a fit, a FrictionTable, a material, a"
        f" spectrum, a Profile or an Accuracy, got {type(drawn).__name__}"
    )


def _solved(scene, at):
    if at["pressure"] is None:
        raise ValueError("pressure is missing; curves of a scene need it [Pa]")
    velocity = np.logspace(-6, 1, 60) if at["velocity"] is None else at["velocity"]
    solution = solve(scene, velocity, at["pressure"], at["temperature"], quantities=quantities_of(scene))
    return solution, velocity


def save_figure(path: StrPath, figure: FigureBase | Axes | Panels) -> None:
    """Write a figure to a file, where `figure` may also be axes or a sequence of axes in the figure.

    The file is written completely or not at all.

    Examples
    --------
    >>> ax = rf.plot.plot_curve([1e-3, 1e-2], [0.8, 1.0])
    >>> rf.plot.save_figure("friction.png", ax)
    >>> with open("friction.png", "rb") as file:
    ...     print(file.read(4)[1:])
    b'PNG'
    """
    if isinstance(figure, Sequence | np.ndarray):
        figure = figure[0]
    figure = getattr(figure, "figure", None) or figure  # of axes or of a figure
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)  # pyright: ignore[reportAttributeAccessIssue]: not a SubFigure


def save_plot(path: StrPath, result: Result) -> None:
    """Plot a result, and save the figure to a file.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> rf.plot.save_plot("friction.png", rf.friction_map(scene, [1e-3, 1e-2, 1e-1], 0.15e6))
    >>> with open("friction.png", "rb") as file:
    ...     print(file.read(4)[1:])
    b'PNG'
    """
    save_figure(path, plot_result(result)[0].figure)


def save_accuracy_plot(path: StrPath, accuracy: Accuracy, title: str = "") -> None:
    """Plot a sweep of errors over run time, and save the figure to a file."""
    ax = plot_accuracy(accuracy)
    ax.set_title(title, fontsize="medium", wrap=True)
    save_figure(path, ax.figure)
