"""The picture that suits what was found. It needs matplotlib, as `rubberfric.plot`."""

import functools
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from jax.typing import ArrayLike

from rubberfric.analysis.by_wavevector import Profile
from rubberfric.analysis.error_and_time.report import Accuracy
from rubberfric.io.friction_tables.table import FrictionTable
from rubberfric.io.results import Curves, Result, curves_of
from rubberfric.io.scene_files.conditions import Conditions
from rubberfric.materials.material import Material
from rubberfric.plot.accuracy import plot_accuracy
from rubberfric.plot.curves import plot_result
from rubberfric.plot.ingredients.modulus import plot_modulus
from rubberfric.plot.ingredients.spectrum import plot_spectrum
from rubberfric.plot.map import plot_map
from rubberfric.plot.profile import plot_profile
from rubberfric.scene.scene import Scene
from rubberfric.theory.model import solve
from rubberfric.theory.quantities import Solution, quantities_of

# Lines that a panel has room for; more are a map.
_LINES = 10


def auto(
    found: Any,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    ax: Any = None,
    **options: Any,
) -> Any:
    """Draw whatever the library gives, by the function `plot_...` that suits it.

    Parameters
    ----------
    found : what is drawn
        Result, Solution or the array of a friction coefficient: curves over the velocity, or a map where
        there would be more than ten of them. FrictionTable: its friction. Scene: its curves at `pressure`,
        over 1e-6 ... 10 m/s if no velocities are given. A material: its modulus. A spectrum, a measured one,
        or a dict of them: C(q). Profile, Accuracy: theirs. All that has a method `plot`, as fits have: that.
    velocity, pressure, temperature : at what a Solution or an array was computed, or a scene is
    ax, options : of the function `plot_...`

    Returns
    -------
    what that function does: the axes, or a sequence of them

    Raises
    ------
    ValueError : there is no picture of it; and as that function.
    """
    at = {"velocity": velocity, "pressure": pressure, "temperature": temperature}
    if isinstance(found, Scene):
        found, at["velocity"] = _solved(found, at)
    if isinstance(found, FrictionTable):
        conditions = Conditions(found.velocity, found.pressure, found.temperature)
        found = Curves(conditions, Solution(area=found.area, friction=found.friction), found.title)
    if isinstance(found, Result | Curves | Solution | np.ndarray | jax.Array):
        curves = curves_of(found, at["velocity"], at["pressure"], at["temperature"])
        T = curves.conditions.temperature
        lines = curves.conditions.pressure.size * (1 if T is None else T.size)
        return (plot_result if lines <= _LINES else plot_map)(curves, ax=ax, **options)
    if isinstance(found, Material):
        options["temperature"] = at.pop("temperature")
    given = next((name for name, values in at.items() if values is not None), None)
    if given is not None:
        raise ValueError(f"{given}: must not be given; {type(found).__name__} has its own, or none")
    return _drawing(found)(ax=ax, **options)


def _drawing(found):
    """The function that draws it."""
    draws = {Material: plot_modulus, Profile: plot_profile, Accuracy: plot_accuracy}
    for kind, draw in draws.items():
        if isinstance(found, kind):
            return functools.partial(draw, found)
    if callable(getattr(found, "plot", None)):
        return found.plot
    if isinstance(found, Mapping) or hasattr(found, "power_law") or hasattr(found, "C"):
        return functools.partial(plot_spectrum, found)
    raise ValueError(
        f"found is a {type(found).__name__}: must be a scene, what solve, friction_map or a fit return, a"
        " FrictionTable, a material, a spectrum, a Profile or an Accuracy"
    )


def _solved(scene, at):
    """The solution of a scene at its conditions, and its velocities."""
    if at["pressure"] is None:
        raise ValueError("pressure is missing: must be given for curves of a scene [Pa]")
    velocity = np.logspace(-6, 1, 60) if at["velocity"] is None else at["velocity"]
    solution = solve(scene, velocity, at["pressure"], at["temperature"], quantities=quantities_of(scene))
    return solution, velocity
