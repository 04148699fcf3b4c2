"""The curves of a scene where the sliders are: one compiled program for all, another for sensitivities.

The programs take the numbers of the scene as arguments: moving one compiles nothing. Their quadrature is the
one for ten decades at any load, so that it need not change with them. Where the curves take too long to
follow a slider, as with adhesion, there is a third program with a coarser one, for drafts while it moves.
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

# Points of a curve, of which every third has sensitivities and every second is on the curves beside measured
# points; points of a master curve.
POINTS, EVERY, BESIDE, FREQUENCIES = 61, 3, 2, 121
# With adhesion a point takes a hundred times as long.
ADHESIVE_POINTS = 13
# Drafts are drawn where the curves take longer than this [s], by this quadrature: a tenth of the time. Areas
# of adhesive scenes in data are 1 % off at most, and the page says by how much the last draft was.
PATIENCE = 0.04
DRAFT = Quadrature(order=8, panels=6, graded=4, ratio=6.0, angular_order=8)
# How far pressures reach where the scene says one only, and frequencies beyond those of a material.
_REACH, _BEYOND = 30.0, 100.0
# Of a material that does not say any [rad/s].
_FREQUENCIES = 1.0, 1e10

CurveValues = Mapping[str, float]


class Explorer:
    """A scene, its sliders, and what is drawn.

    Parameters
    ----------
    scene, conditions, title : of the scene file; the curves are over its velocities, or over pressures if
        there are no two velocities > 0
    measured : points to compare with, or None
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
                f"{measured.path}: points over velocity: [run] of the scene must have two velocities > 0"
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
        self.has_drafts = False  # known when the curves are compiled, before requests come
        # Of the thread that compiles sensitivities: that it has ended, and then why it failed.
        self._compiled = threading.Event()
        self.failure = ""

    @property
    def is_ready(self) -> bool:
        """Whether sensitivities are compiled, or `failure` says why they could not be."""
        return self._compiled.is_set()

    @property
    def count(self) -> int:
        """Points that are computed for one position of the sliders."""
        measured = 0 if self.measured is None else self.measured.velocity.size
        return self._end + measured

    @property
    def _end(self) -> int:
        """Points of curves."""
        return self.at.size + self.at[::BESIDE].size * len(self.curves_of_points)

    def moved(self, values: CurveValues) -> Scene:
        """The scene with the sliders at these values; ValueError if they do not go together."""
        scene = moved(self.scene, self.sliders, values)
        temperatures = self.conditions_at(values)[2]
        at = Conditions(np.ones(1), np.ones(1), None if temperatures is None else np.unique(temperatures))
        check_conditions("", at, scene)
        return scene

    def curves(self, values: CurveValues, draft: bool = False) -> dict[str, Any]:
        """All that is drawn where the sliders are; a draft with the coarser quadrature.

        Returns
        -------
        dict : "curves" of each quantity, "beside" the friction at the conditions of measured points,
            "misfit" rms of ln(mu / measured), "moduli" and "spectra" of the solids; NumPy arrays
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
        """d ln Q / d ln slider by its name, at `at[::EVERY]`; Q is the friction, without any the area."""
        self.moved(values)
        x = jnp.array([values[one.name] for one in self.sliders])
        value, slopes = jax.device_get(self._slopes(x))
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = slopes * np.asarray(x) / value[:, None]
        return {one.name: relative[:, i] for i, one in enumerate(self.sliders)}

    def compile(self) -> None:
        """Compile the program of the curves, and that of drafts if the first takes too long."""
        start = {one.name: one.start for one in self.sliders}
        self.curves(start)
        begin = time.perf_counter()
        self.curves(start)
        if time.perf_counter() - begin > PATIENCE:
            self.curves(start, draft=True)
            self.has_drafts = True

    def compile_sensitivities(self) -> None:
        """Compile that of the sensitivities; what failed is kept, as it may happen in a thread."""
        try:
            self.sensitivities({one.name: one.start for one in self.sliders})
        except Exception as error:  # a thread has nobody to raise it to
            self.failure = str(error) or type(error).__name__
        finally:
            self._compiled.set()

    def conditions_at(self, values: CurveValues) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Velocity, pressure and temperature of the curve, of those beside points, and of the points."""
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
            # Its other quantities would take several times as long.
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
        """The quantity at points, and its derivatives with respect to all sliders, (points, sliders)."""
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
            # A function of each condition alone, not of all points' together: forward mode.
            _, push = jax.linearize(of_conditions, z)
            for name, slope in zip(outside, jax.vmap(push)(jnp.eye(len(outside))), strict=True):
                slopes = slopes.at[:, names.index(name)].set(slope)
        return value, slopes


def _axis(conditions: Conditions, count: int) -> tuple[str, np.ndarray]:
    """Which condition the curves are over, and its values."""
    v = conditions.velocity[conditions.velocity > 0]
    if v.size and v.max() > v.min():
        return "velocity", np.geomspace(v.min(), v.max(), count)
    p = conditions.pressure
    low, high = float(p.min()), float(p.max())
    if not high > low:
        low, high = low / _REACH, high * _REACH
    return "pressure", np.geomspace(low, high, count)


def _materials(scene: Scene) -> dict[str, Material]:
    """The solids that deform, by where they are."""
    found = {}
    for name, body in (("upper", scene.upper), ("lower", scene.lower)):
        if body.material.deforms:
            found[name] = body.material
        below = None if body.layer is None else body.layer.below
        if below is not None:
            found[f"{name}, base"] = below
    return found


def _frequencies(material: Material) -> np.ndarray:
    """Where a master curve is drawn [rad/s]."""
    ends = material.frequency_range()
    low, high = _FREQUENCIES if ends is None else (float(ends[0]) / _BEYOND, float(ends[1]) * _BEYOND)
    return np.geomspace(low, high, FREQUENCIES)


def _misfit(model: np.ndarray, measured: np.ndarray) -> float:
    """Root mean square of ln(model / measured) of what has a logarithm; NaN if nothing has."""
    both = (model > 0) & (measured > 0)
    return float(np.sqrt(np.mean(np.log(model[both] / measured[both]) ** 2))) if both.any() else math.nan
