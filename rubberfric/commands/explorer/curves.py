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
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.analysis.jacobian import value_and_jacobian
from rubberfric.base.atomic import StrPath, as_path
from rubberfric.base.checks import shown
from rubberfric.base.quadrature import Quadrature
from rubberfric.commands.explorer.sliders import changes, moved, sliders_of, with_cutoffs
from rubberfric.io.results import Conditions, check_conditions, check_plausible
from rubberfric.io.tables import read_table
from rubberfric.materials.material import Material, complex_modulus
from rubberfric.scene.plausible import doubts_of_conditions
from rubberfric.scene.scene import Scene, cast, dissipates, takes_temperature
from rubberfric.scene.settings import default_quadrature
from rubberfric.theory.model import solve
from rubberfric.theory.structure import quantities_of

# Points of a curve. `EVERY` and `BESIDE` divide 60, so that the last point is among every third and second.
POINTS = 61
# Step between points with sensitivities, which take longer than the values.
EVERY = 3
# Step between points of the curves for measured points, which are computed in addition.
BESIDE = 2
# Points of a master curve.
_FREQUENCIES = 121
# Points of a curve with adhesion, where a point takes a hundred times as long.
ADHESIVE_POINTS = 13
# Time of the curves above which drafts are drawn while a slider moves [s].
PATIENCE = 0.04
# Relative step of differences, whose error of rounding and of the third derivative is about 1e-6.
_STEP = 1e-4
# Time for differences in one answer [s], in which a page would wait.
_TURN = 0.3
# Quadrature of drafts, which takes a tenth of the time. Areas of the adhesive scenes in data have errors up
# to 1 %, and the page shows the error of the last draft.
DRAFT = Quadrature(order=8, panels=6, graded=4, ratio=6.0, angular_order=8)
# Factor between a single pressure of the scene and the ends of a curve over pressure.
_PRESSURE_REACH = 30.0
# Factor between the ends of a material's frequencies and the ends of its master curve.
_FREQUENCY_REACH = 100.0
# Frequencies for a material without a frequency range [rad/s].
_ELASTIC_RANGE = 1.0, 1e10

# Most measured points of a page. A page computes them whenever a slider moves.
MOST_POINTS = 2000
# Most curves for measured points on a page, because more would not be told apart.
MOST_CURVES = 12

CurveValues = Mapping[str, float]


class MeasuredPoints(NamedTuple):
    """Measured friction coefficients as arrays of shape (n,); a condition is None if a slider sets it."""

    path: Path
    velocity: np.ndarray  # [m/s]
    friction: np.ndarray  # [-]
    error: np.ndarray | None  # standard deviations [-]
    pressure: np.ndarray | None  # [Pa]
    temperature: np.ndarray | None  # [K]; None also if nothing depends on it
    content: bytes  # of the file
    reading: Mapping[str, Any]  # options with which the file was read


class Curve(NamedTuple):
    """Measured points at about the same pressure and temperature, which share one drawn curve."""

    pressure: float | None  # None: value of the slider
    temperature: float | None
    points: tuple[int, ...]  # indices


class Explorer:
    """A scene with its sliders and curves, from the contents of a scene file and measured points or None.

    The abscissa of the curves is the velocity, or the pressure if the file does not have two different
    velocities > 0.
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
        self.compiled = threading.Event()
        self.ready = threading.Event()  # set when the curves are compiled
        # Position of the sliders, and differences there by name of the slider.
        self._differences: tuple[dict[str, float], dict[str, np.ndarray]] = {}, {}
        self.failure = ""

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
        """Return the scene at the sliders' values, or raise ValueError if the scene refuses them."""
        scene = moved(self.scene, self.sliders, values)
        temperatures = self.conditions_at(values)[2]
        at = Conditions(np.ones(1), np.ones(1), None if temperatures is None else np.unique(temperatures))
        check_conditions("", at, scene)
        return scene

    def curves(self, values: CurveValues, draft: bool = False) -> dict[str, Any]:
        """Return all curves at the sliders' values, for a `draft` with a coarser quadrature.

        The result is a dict with "curves" of each quantity, and "moduli" and "spectra" of solids, as arrays.
        Measured points add "beside", the friction curves at their conditions, and "misfit", the rms of
        ln(model / measured friction).
        """
        scene = cast(self.moved(values), float)
        v, p, T = self.conditions_at(values)
        quadrature = DRAFT if draft else self.quadrature
        found_all = self._curves(scene, v, p, T, quadrature=quadrature)
        curves, others, moduli, spectra = jax.device_get(found_all)
        content: dict[str, Any] = {"curves": curves, "moduli": moduli, "spectra": spectra}
        if self.measured is not None:
            end = self._end - self.at.size
            content["beside"] = others[:end].reshape(len(self.curves_of_points), -1)
            content["misfit"] = _misfit(others[end:], self.measured.friction)
        return content

    def sensitivities(self, values: CurveValues) -> dict[str, np.ndarray]:
        """Return d ln Q / d ln x at the points `at[::EVERY]` by name of the slider, where x is its value.

        Q is the friction, or the area if the scene has no friction.
        """
        self.moved(values)
        x = jnp.array([values[slider.name] for slider in self.sliders])
        value, slopes = jax.device_get(self._slopes(x))
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = slopes * np.asarray(x) / value[:, None]
        return {slider.name: relative[:, i] for i, slider in enumerate(self.sliders)}

    def differences(self, values: CurveValues) -> dict[str, np.ndarray]:
        """Return sensitivities by differences of the curves, for use until `sensitivities` are compiled.

        Each call adds sliders for at most `_TURN` seconds. Sliders at an end of their range use a one-sided
        difference.
        """
        if dict(values) != self._differences[0]:
            self._differences = dict(values), {}
        by_name, begin, count = self._differences[1], time.perf_counter(), 0
        for slider in self.sliders:
            if slider.name in by_name:
                continue
            if count and time.perf_counter() - begin > _TURN:
                break
            count += 1
            x = values[slider.name]
            step = _STEP * (abs(x) or slider.high - slider.low)
            ends = [min(max(x + sign * step, slider.low), slider.high) for sign in (-1, 1)]
            low, high = (self._at_slopes({**values, slider.name: end}) for end in ends)
            with np.errstate(divide="ignore", invalid="ignore"):
                by_name[slider.name] = x * (high - low) / (ends[1] - ends[0]) * 2 / (high + low)
        return dict(by_name)

    def _at_slopes(self, values):
        """Return the `sensitive` quantity at the points of the sensitivities."""
        return np.asarray(self.curves(values)["curves"][self.sensitive], float)[::EVERY]

    def compile(self) -> None:
        """Compile the curves, and drafts if the curves take longer than `PATIENCE`."""
        start = {slider.name: slider.start for slider in self.sliders}
        self.curves(start)
        begin = time.perf_counter()
        self.curves(start)
        if time.perf_counter() - begin > PATIENCE:
            self.curves(start, draft=True)
            self.has_drafts = True
        self.ready.set()

    def compile_sensitivities(self) -> None:
        """Compile the sensitivities in a thread, and store the text of an error in `failure`."""
        try:
            self.sensitivities({slider.name: slider.start for slider in self.sliders})
        except Exception as error:  # a thread cannot raise it
            self.failure = str(error) or type(error).__name__
        finally:
            self.compiled.set()

    def conditions_at(self, values: CurveValues) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return velocity, pressure and temperature of all computed points as arrays of shape (count,).

        The order is points of the curve, points of the curves for measured points, measured points.
        """
        curves, measured = self.curves_of_points, self.measured

        def all_of(name, value):
            if name == self.axis:
                parts = [self.at, np.tile(self.at[::BESIDE], len(curves))]
            else:
                each = [getattr(curve, name) for curve in curves]
                beside = np.array([value if x is None else x for x in each])
                parts = [np.full(self.at.size, value), np.repeat(beside, self.at[::BESIDE].size)]
            if measured is not None:
                own = getattr(measured, name)
                parts.append(np.full(measured.velocity.size, value) if own is None else own)
            return np.concatenate(parts).astype(float)

        v, p = (float(x[0]) for x in self.conditions[:2])
        p, T = values.get("pressure", p), values.get("temperature")
        return all_of("velocity", v), all_of("pressure", p), None if T is None else all_of("temperature", T)

    def _all_curves(self, scene, v, p, T, quadrature):
        count = self.at.size

        def at(points, quantities):
            temperature = None if T is None else T[points]
            options = {"quadrature": quadrature, "quantities": quantities}
            solution = solve(scene, v[points], p[points], temperature, **options)
            return {name: getattr(solution, name) for name in quantities}

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
        """Return the `sensitive` quantity, (points,), and its derivatives, (points, sliders)."""
        names = [slider.name for slider in self.sliders]
        base = cast(self.scene, float)

        def scene_of(x):
            return base.replace(changes(base, self.sliders, dict(zip(names, x, strict=True)), jnp))

        at = self.at[::EVERY]
        outside = [name for name in ("pressure", "temperature") if name in names]
        v, p = (float(x[0]) for x in self.conditions[:2])

        def conditions(z):
            columns = {"velocity": v, "pressure": p} | dict(zip(outside, z, strict=True)) | {self.axis: at}
            filled = {name: jnp.broadcast_to(value, at.shape) for name, value in columns.items()}
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
    """Return "velocity" or "pressure", the abscissa of the curves, and an array of `count` values."""
    v = conditions.velocity[conditions.velocity > 0]
    if v.size and v.max() > v.min():
        return "velocity", np.geomspace(v.min(), v.max(), count)
    p = conditions.pressure
    low, high = float(p.min()), float(p.max())
    if not high > low:
        low, high = low / _PRESSURE_REACH, high * _PRESSURE_REACH
    return "pressure", np.geomspace(low, high, count)


def _materials(scene: Scene) -> dict[str, Material]:
    """Return a dict of all materials that deform, with names such as "upper" and "upper, base"."""
    materials = {}
    for name, body in (("upper", scene.upper), ("lower", scene.lower)):
        if body.material.deforms:
            materials[name] = body.material
        if body.below is not None:
            materials[f"{name}, base"] = body.below
    return materials


def _frequencies(material: Material) -> np.ndarray:
    """Return the frequencies of a plotted master curve [rad/s]."""
    ends = material.frequency_range()
    if ends is None:
        low, high = _ELASTIC_RANGE
    else:
        low, high = float(ends[0]) / _FREQUENCY_REACH, float(ends[1]) * _FREQUENCY_REACH
    return np.geomspace(low, high, _FREQUENCIES)


def _misfit(model: np.ndarray, measured: np.ndarray) -> float:
    """Return the rms of ln(model / measured) where both values are positive, or NaN without such points."""
    both = (model > 0) & (measured > 0)
    return float(np.sqrt(np.mean(np.log(model[both] / measured[both]) ** 2))) if both.any() else math.nan


def read_points(path: StrPath, scene: Scene, conditions: Conditions, **reading: Any) -> MeasuredPoints:
    """Read points from a table with v, mu and optionally p, T, and sigma or relative_sigma.

    `reading` are the options `columns` and `bad_rows` of `rubberfric.io.read_table`. A ValueError is raised
    for an invalid table, or for points at which the scene cannot be computed.
    """
    optional = ("p", "T", "sigma", "relative_sigma")
    table = read_table(path, ("v", "mu"), optional, increasing=False, **reading)
    if table["v"].size > MOST_POINTS:
        raise ValueError(f"{path}: has {table['v'].size} points: must have at most {MOST_POINTS}")
    if np.any(table["v"] <= 0):
        raise ValueError(f"{path}: v = {shown(table['v'].min())}: must be > 0 on a logarithmic axis")
    p, T = table.get("p"), table.get("T")
    if not takes_temperature(scene):
        T = None
    elif T is not None and conditions.temperature is None:
        raise ValueError(f"{path}: has temperatures, but [run] of the scene has none; add one")
    at = Conditions(
        table["v"], conditions.pressure if p is None else p, conditions.temperature if T is None else T
    )
    check_conditions(f"{path}: ", at, scene)
    check_plausible(f"{path}: ", doubts_of_conditions(**at._asdict()))
    error = table.get("sigma")
    if error is None and "relative_sigma" in table:
        error = table["relative_sigma"] * np.abs(table["mu"])
    content = as_path(path).read_bytes()
    return MeasuredPoints(as_path(path), table["v"], table["mu"], error, p, T, content, reading)


def group_points(measured: MeasuredPoints) -> list[Curve]:
    """Return the `MOST_CURVES` largest groups of points at equal pressure (1 %) and temperature (1 K)."""
    size = measured.velocity.size
    p = np.zeros(size) if measured.pressure is None else np.round(np.log(measured.pressure) / 0.01)
    T = np.zeros(size) if measured.temperature is None else np.round(measured.temperature)
    sets, which = np.unique(np.stack([p, T], 1), axis=0, return_inverse=True)
    chosen = [np.flatnonzero(which.ravel() == i) for i in range(len(sets))]
    if len(chosen) > MOST_CURVES:
        largest = sorted(range(len(chosen)), key=lambda i: -chosen[i].size)[:MOST_CURVES]
        chosen = [chosen[i] for i in sorted(largest)]
    return [
        Curve(
            None if measured.pressure is None else float(np.median(measured.pressure[points])),
            None if measured.temperature is None else float(np.median(measured.temperature[points])),
            tuple(points.tolist()),
        )
        for points in chosen
    ]
