"""Curves of a scene at the sliders' values.

One compiled function computes all curves, and another one computes the sensitivities. The functions take the
numbers of the scene as arguments, so moving a slider compiles nothing. The quadrature of the functions is
valid for ten decades at any load. If the curves are too slow to follow a slider, as with
adhesion, a third function with a coarser quadrature computes drafts while the slider moves.
"""

import math
import threading
import time
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.analysis.jacobian import value_and_jacobian
from rubberfric.base.quadrature import Quadrature
from rubberfric.commands.explorer.points import MeasuredPoints, group_points
from rubberfric.commands.explorer.sliders import changes, moved, sliders_of, with_cutoffs
from rubberfric.io.results import Conditions, check_conditions
from rubberfric.materials.material import Material, complex_modulus
from rubberfric.scene.scene import Scene, cast, dissipates
from rubberfric.scene.settings import default_quadrature
from rubberfric.theory.model import solve
from rubberfric.theory.quantities import quantities_of

# Points of a curve. Every third point has sensitivities, and every second point is used in curves for
# measured points. The last number is the number of points of a master curve.
POINTS, EVERY, BESIDE, FREQUENCIES = 61, 3, 2, 121
# With adhesion a point takes a hundred times as long.
ADHESIVE_POINTS = 13
# Drafts are drawn if the curves take longer than this [s]. Their quadrature takes a tenth of the time. Areas
# of the adhesive scenes in data have errors up to 1 %, and the page shows the error of the last draft.
PATIENCE = 0.04
DRAFT = Quadrature(order=8, panels=6, graded=4, ratio=6.0, angular_order=8)
# Range of pressures if the scene has only one, and of frequencies beyond those of a material.
_REACH, _BEYOND = 30.0, 100.0
# Frequencies for a material without a frequency range [rad/s].
_FREQUENCIES = 1.0, 1e10

CurveValues = Mapping[str, float]


class Explorer:
    """A scene with its sliders and curves.

    Parameters
    ----------
    scene, conditions, title : contents of the scene file
        The abscissa of the curves is the velocity, or the pressure if the file does not have two different
        velocities > 0.
    measured : measured points that are drawn with the curves, or None
    """

    def __init__(
        self, scene: Scene, conditions: Conditions, title: str = "", measured: MeasuredPoints | None = None
    ) -> None:
        self.scene, self.conditions, self.title = with_cutoffs(scene), conditions, title
        self.measured = measured
        adheres = scene.adhesion is not None
        self.axis, self.at = _axis(conditions, ADHESIVE_POINTS if adheres else POINTS)
        if self.axis == "pressure" and measured is not None:
            raise ValueError(
                f"{measured.path} has points over velocity, but [run] of the scene has no velocity range: "
                "give it two velocities > 0"
            )
        self.sliders = sliders_of(self.scene, conditions, self.axis)
        self.quadrature = default_quadrature(
            self.scene, conditions.pressure, margin=0.0 if adheres else math.inf
        )
        self.quantities = quantities_of(self.scene)
        self.curves_of_points = [] if measured is None else group_points(measured)
        rubs = dissipates(self.scene) or self.scene.shear is not None
        self.sensitive = "friction" if rubs else "area"
        self.omega = {name: _frequencies(part) for name, part in _materials(self.scene).items()}
        self._curves = jax.jit(self._all_curves, static_argnames="quadrature")
        self._slopes = jax.jit(self._all_slopes)
        self.has_drafts = False  # set when the curves are compiled, before the first request
        # Set by the thread that compiles sensitivities: end, and reason of a failure.
        self._compiled = threading.Event()
        self.failure = ""

    @property
    def is_ready(self) -> bool:
        """Return True if the compilation of the sensitivities has succeeded or failed."""
        return self._compiled.is_set()

    @property
    def count(self) -> int:
        """Number of points that are computed for one position of the sliders."""
        measured = 0 if self.measured is None else self.measured.velocity.size
        return self._end + measured

    @property
    def _end(self) -> int:
        # The points of curves precede the measured points in all arrays.
        return self.at.size + self.at[::BESIDE].size * len(self.curves_of_points)

    def moved(self, values: CurveValues) -> Scene:
        """Return the scene with all sliders at given values.

        A ValueError is raised if the scene refuses the combination of values.
        """
        scene = moved(self.scene, self.sliders, values)
        temperatures = self.conditions_at(values)[2]
        at = Conditions(np.ones(1), np.ones(1), None if temperatures is None else np.unique(temperatures))
        check_conditions("", at, scene)
        return scene

    def curves(self, values: CurveValues, draft: bool = False) -> dict[str, Any]:
        """Return all curves at the sliders' values.

        If `draft` is True, a coarser quadrature is used.

        Returns
        -------
        dict with "curves" of each quantity, and "moduli" and "spectra" of the solids, as NumPy arrays
            If there are measured points, the dict also has "beside", the friction curves at the conditions of
            the points, and "misfit", the rms of ln(model / measured friction).
        """
        scene = cast(self.moved(values), float)
        v, p, T = self.conditions_at(values)
        quadrature = DRAFT if draft else self.quadrature
        found_all = self._curves(scene, v, p, T, quadrature=quadrature)
        curves, others, moduli, spectra = jax.device_get(found_all)
        found: dict[str, Any] = {"curves": curves, "moduli": moduli, "spectra": spectra}
        if self.measured is not None:
            end = self._end - self.at.size
            found["beside"] = others[:end].reshape(len(self.curves_of_points), -1)
            found["misfit"] = _misfit(others[end:], self.measured.friction)
        return found

    def sensitivities(self, values: CurveValues) -> dict[str, np.ndarray]:
        """Return the sensitivities d ln Q / d ln x by name of the slider, where x is the slider's value.

        Q is the friction, or the area if the scene has no friction. The sensitivities are evaluated at the
        points `at[::EVERY]`.
        """
        self.moved(values)
        x = jnp.array([values[one.name] for one in self.sliders])
        value, slopes = jax.device_get(self._slopes(x))
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = slopes * np.asarray(x) / value[:, None]
        return {one.name: relative[:, i] for i, one in enumerate(self.sliders)}

    def compile(self) -> None:
        """Compile the function that computes the curves.

        If this function takes longer than `PATIENCE`, a function for drafts is compiled too.
        """
        start = {one.name: one.start for one in self.sliders}
        self.curves(start)
        begin = time.perf_counter()
        self.curves(start)
        if time.perf_counter() - begin > PATIENCE:
            self.curves(start, draft=True)
            self.has_drafts = True

    def compile_sensitivities(self) -> None:
        """Compile the function that computes the sensitivities.

        This method runs in a thread, where an error cannot be raised. The text of an error is stored in
        `failure`.
        """
        try:
            self.sensitivities({one.name: one.start for one in self.sliders})
        except Exception as error:  # a thread cannot raise it
            self.failure = str(error) or type(error).__name__
        finally:
            self._compiled.set()

    def conditions_at(self, values: CurveValues) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return velocity, pressure and temperature of all computed points as arrays of shape (count,).

        The points of the curve come first. The points of the curves for measured points follow, and the
        measured points come last.
        """
        curves, measured = self.curves_of_points, self.measured

        def all_of(name, one):
            if name == self.axis:
                parts = [self.at, np.tile(self.at[::BESIDE], len(curves))]
            else:
                each = [getattr(curve, name) for curve in curves]
                beside = np.array([one if x is None else x for x in each])
                parts = [np.full(self.at.size, one), np.repeat(beside, self.at[::BESIDE].size)]
            if measured is not None:
                own = getattr(measured, name)
                parts.append(np.full(measured.velocity.size, one) if own is None else own)
            return np.concatenate(parts).astype(float)

        v, p = (float(x[0]) for x in self.conditions[:2])
        p, T = values.get("pressure", p), values.get("temperature")
        return all_of("velocity", v), all_of("pressure", p), None if T is None else all_of("temperature", T)

    def _all_curves(self, scene, v, p, T, quadrature):
        count = self.at.size

        def at(points, quantities):
            temperature = None if T is None else T[points]
            options = {"quadrature": quadrature, "quantities": quantities}
            found = solve(scene, v[points], p[points], temperature, **options)
            return {name: getattr(found, name) for name in quantities}

        curves = at(slice(count), self.quantities)
        others = None
        if v.shape[0] > count:
            # Other quantities would take several times longer.
            others = at(slice(count, None), ("friction",))["friction"]
        parts = _materials(scene)
        moduli = {name: complex_modulus(parts[name], omega) for name, omega in self.omega.items()}
        moduli = {name: (jnp.real(x), jnp.imag(x)) for name, x in moduli.items()}
        spectra = {}
        for name, body in (("lower", scene.lower), ("upper", scene.upper)):
            if body.spectrum is not None:
                law = body.spectrum.power_law()
                spectra[name] = law.q, law.height2 * jnp.exp(law.log_value) / law.q**2
        return curves, others, moduli, spectra

    def _all_slopes(self, x):
        """Return the quantity that `sensitive` names, and its derivatives with respect to all sliders.

        The quantity has shape (points,), and the derivatives have shape (points, sliders).
        """
        names = [one.name for one in self.sliders]
        base = cast(self.scene, float)

        def scene_of(x):
            return base.replace(changes(base, self.sliders, dict(zip(names, x, strict=True)), jnp))

        at = self.at[::EVERY]
        outside = [name for name in ("pressure", "temperature") if name in names]
        v, p = (float(x[0]) for x in self.conditions[:2])

        def conditions(z):
            given = {"velocity": v, "pressure": p} | dict(zip(outside, z, strict=True)) | {self.axis: at}
            filled = {name: jnp.broadcast_to(value, at.shape) for name, value in given.items()}
            return filled["velocity"], filled["pressure"], filled.get("temperature")

        z = jnp.array([x[names.index(name)] for name in outside])
        quantity, quadrature = self.sensitive, self.quadrature
        value, slopes = value_and_jacobian(scene_of, x, conditions(z), quantity, quadrature)
        scene = scene_of(x)

        def of_conditions(z):
            solution = solve(scene, *conditions(z), quadrature=quadrature, quantities=(quantity,))
            return getattr(solution, quantity)

        if outside:
            # Each point depends only on its own condition, so forward mode is efficient.
            _, push = jax.linearize(of_conditions, z)
            for name, slope in zip(outside, jax.vmap(push)(jnp.eye(len(outside))), strict=True):
                slopes = slopes.at[:, names.index(name)].set(slope)
        return value, slopes


def _axis(conditions: Conditions, count: int) -> tuple[str, np.ndarray]:
    """Return the name of the condition along the abscissa of the curves, and an array of `count` values.

    The condition is "velocity" if there are two different velocities > 0, otherwise "pressure".
    """
    v = conditions.velocity[conditions.velocity > 0]
    if v.size and v.max() > v.min():
        return "velocity", np.geomspace(v.min(), v.max(), count)
    p = conditions.pressure
    low, high = float(p.min()), float(p.max())
    if not high > low:
        low, high = low / _REACH, high * _REACH
    return "pressure", np.geomspace(low, high, count)


def _materials(scene: Scene) -> dict[str, Material]:
    """Return a dict of all materials that deform, with names such as "upper" and "upper, base"."""
    found = {}
    for name, body in (("upper", scene.upper), ("lower", scene.lower)):
        if body.material.deforms:
            found[name] = body.material
        below = None if body.layer is None else body.layer.below
        if below is not None:
            found[f"{name}, base"] = below
    return found


def _frequencies(material: Material) -> np.ndarray:
    """Return the frequencies of a plotted master curve [rad/s]."""
    ends = material.frequency_range()
    low, high = _FREQUENCIES if ends is None else (float(ends[0]) / _BEYOND, float(ends[1]) * _BEYOND)
    return np.geomspace(low, high, FREQUENCIES)


def _misfit(model: np.ndarray, measured: np.ndarray) -> float:
    """Return the rms of ln(model / measured) over the points at which both values are positive.

    The result is NaN if there are no such points.
    """
    both = (model > 0) & (measured > 0)
    return float(np.sqrt(np.mean(np.log(model[both] / measured[both]) ** 2))) if both.any() else math.nan
