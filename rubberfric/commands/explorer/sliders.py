"""Sliders of the page, which change numbers of a scene within a range.

The fields of the objects of a scene determine its sliders. Each single number has a slider. Series and tables
have sliders for a factor of all moduli, of all frequencies and of the moduli in each decade of relaxation
times.
"""

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rubberfric.base.checks import PLAUSIBLE_TEMPERATURE, closest, shown
from rubberfric.base.objects.fields import Leaf
from rubberfric.base.objects.physical import PhysicalObject, leaves_of, parts_of
from rubberfric.io.results import Conditions, check_conditions
from rubberfric.scene.scene import Scene

# Factors by which a slider can raise or lower a number, by unit of the number.
_REACH = {"1/m": 100.0, "m/s": 1000.0, "m": 10.0, "Pa": 10.0, "J/m^2": 10.0}
# Factor for numbers in other units, such as densities and conductivities, which vary little between solids.
_OTHER_REACH = 3.0
# Factor for arrays, such as all moduli or all heights.
_FACTOR_REACH = 10.0
# Factor for the frequencies of a material, which differ by decades between rubbers.
_FREQUENCY_REACH = 1000.0
# Factor for the nominal pressure, below the smallest and above the largest of the conditions.
_PRESSURE_REACH = 30.0
# Distance of the slider's ends from the temperatures of the conditions [K].
_TEMPERATURE_REACH = 60.0
# Bisections for an end of a range that the scene accepts. They leave 1e-9 of the range.
_HALVINGS = 30


class Target(NamedTuple):
    """A number or an array of the scene that a slider changes."""

    path: str
    elements: tuple[int, ...] | None = None  # elements of an array; None: all
    power: float | None = None  # power of the slider's factor; None: the slider is the number


class Slider(NamedTuple):
    """A slider of the page."""

    name: str  # key path if it is a number of the scene
    group: str
    label: str
    unit: str  # "-" without unit, "" for a factor
    start: float
    low: float
    high: float
    logarithmic: bool
    targets: tuple[Target, ...] = ()  # empty for a condition
    free: tuple[str, ...] = ()  # corresponding free parameters of a fit

    def at(self, part: float) -> float:
        """Return the value at a share `part` of the way from `start` to `high`, or to `low` if negative."""
        end = self.high if part > 0 else self.low
        if self.logarithmic:
            return self.start * (end / self.start) ** abs(part)
        return self.start + (end - self.start) * abs(part)


def sliders_of(scene: Scene, conditions: Conditions, axis: str = "velocity") -> list[Slider]:
    """Return the sliders for the numbers of a scene, the pressure and the temperature.

    The scene has concrete numbers and comes from `with_cutoffs`. The middle pressure and temperature of the
    conditions are start values. `axis` is the condition on the abscissa, which has no slider. Constructors
    accept the ends of each slider, while all other sliders have their start values.
    """
    sliders = [slider for slider in _of_conditions(scene, conditions) if slider.name != axis]

    def try_value(slider, value):
        scene.replace(changes(scene, [slider], {slider.name: value}, np))

    for path, part in parts_of(scene):
        sliders += [_within(slider, try_value) for slider in _of_object(path, part)]
    return [slider for slider in sliders if slider.low < slider.high]


def with_cutoffs(scene: Scene) -> Scene:
    """Return the scene with explicit cutoffs q1 of tabulated spectra, because None would have no slider."""
    paths = [
        (f"{path}.q1", part)
        for path, part in parts_of(scene)
        if "q1" in leaves_of(type(part)) and leaves_of(type(part))["q1"].optional
    ]
    changes = {path: float(part.q[-1]) for path, part in paths if part.q1 is None}  # pyright: ignore[reportAttributeAccessIssue]
    return scene.replace(changes) if changes else scene


def slider_values(sliders: Sequence[Slider], content: Any) -> dict[str, float]:
    """Return the value of every slider: from the object `content` by slider name, or the start value.

    A ValueError is raised for an unknown slider, and for a value that is not a number within its range.
    """
    if not isinstance(content, dict):
        raise ValueError(f"values = {shown(content)}: must be an object with numbers by slider name")
    known = {slider.name: slider for slider in sliders}
    values = {slider.name: slider.start for slider in sliders}
    for name, value in content.items():
        if name not in known:
            raise ValueError(f"{shown(name)}: unknown slider; {closest(name, tuple(known))}")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{name} = {shown(value)}: must be a number")
        low, high = known[name].low, known[name].high
        # These comparisons reject NaN and do not overflow for long integers.
        if not low <= value <= high:
            raise ValueError(f"{name} = {shown(value)}: must be between {low!r} and {high!r}")
        values[name] = float(value)
    return values


def changes(scene: Scene, sliders: Sequence[Slider], values: Mapping[str, Any], array: Any) -> dict[str, Any]:
    """Return a dict from key path to new value, for `Scene.replace`, from sliders and their values.

    `scene` has the start values. `array` is numpy, or jax.numpy for traced values.
    """
    changed: dict[str, Any] = {}
    for slider in sliders:
        value = values[slider.name]
        for path, elements, power in slider.targets:
            if power is None:
                changed[path] = value
                continue
            old = changed[path] if path in changed else array.asarray(operator.attrgetter(path)(scene))
            factor = value if power == 1 else value**power
            if elements is not None:
                chosen = np.isin(np.arange(old.shape[0]), elements)
                factor = array.where(chosen, factor, 1.0)
            changed[path] = old * factor
    return changed


def moved(scene: Scene, sliders: Sequence[Slider], values: Mapping[str, float]) -> Scene:
    """Return the scene at the sliders' values, or raise ValueError if the scene refuses them."""
    away = [slider for slider in sliders if values[slider.name] != slider.start]
    changed = changes(scene, away, values, np)
    return scene.replace(changed) if changed else scene


def _of_conditions(scene: Scene, conditions: Conditions) -> Iterator[Slider]:
    low, p, high = _middle(conditions.pressure)
    low, high = low / _PRESSURE_REACH, high * _PRESSURE_REACH
    yield Slider("pressure", "conditions", "pressure", "Pa", p, low, high, logarithmic=True)
    if conditions.temperature is None:
        return
    low, T, high = _middle(conditions.temperature)
    low, high = max(low - _TEMPERATURE_REACH, 1.0), high + _TEMPERATURE_REACH
    slider = Slider("temperature", "conditions", "temperature", "K", T, low, high, logarithmic=False)

    def try_value(_, value):
        check_conditions("", conditions._replace(temperature=np.array([value])), scene)

    yield _within(slider, try_value)


def _middle(values: np.ndarray) -> tuple[float, float, float]:
    """Return the smallest, the (lower) middle and the largest value."""
    ordered = np.sort(values).tolist()
    return ordered[0], ordered[(len(ordered) - 1) // 2], ordered[-1]


def _of_object(path: str, part: PhysicalObject) -> Iterator[Slider]:
    leaves = {name: field for name, field in leaves_of(type(part)).items() if getattr(part, name) is not None}
    group, dot = path or "scene", f"{path}." if path else ""
    for name, field in leaves.items():
        if field.ndim == 0 and field.plausible != PLAUSIBLE_TEMPERATURE:
            yield from _of_number(dot + name, group, name, field, float(getattr(part, name)))
    # Moduli of a series or a table.
    moduli = [n for n, f in leaves.items() if f.unit == "Pa" and (f.ndim == 1 or f.plus is not None)]
    if moduli:
        targets = [Target(dot + name, None, 1.0) for name in moduli]
        # Not for tables or a modulus of 0.
        free = [n for n in moduli if leaves[n].column is None and np.all(np.asarray(getattr(part, n)) > 0)]
        yield _factor(f"{dot}moduli", group, "all moduli", targets, [dot + name for name in free])
        powers = {"rad/s": 1.0, "s": -1.0}
        targets = [Target(dot + n, None, powers[f.unit]) for n, f in leaves.items() if f.unit in powers]
        yield _factor(f"{dot}frequencies", group, "all frequencies", targets, reach=_FREQUENCY_REACH)
    for name, field in leaves.items():
        if field.column == "C":
            yield _factor(f"{dot}heights", group, "all heights", [Target(dot + name, None, 2.0)])
        if name in moduli and field.over is not None and leaves[field.over].unit == "s":
            yield from _by_decade(dot + name, group, name, np.asarray(getattr(part, field.over)))


def _of_number(path: str, group: str, name: str, field: Leaf, start: float) -> Iterator[Slider]:
    """Yield a linear slider for an angle or a bounded number, a logarithmic one for another number > 0."""
    allowed = field.rule[1]
    if field.unit == "rad":
        low, high, logarithmic = start - math.pi / 2, start + math.pi / 2, False
    elif field.unit == "-" and not allowed(np.array(1e6)):
        low = next((x for x in (-1.0, 0.0) if allowed(np.array(x))), start)
        high, logarithmic = next((x for x in (1.0, 0.5) if allowed(np.array(x))), start), False
    elif start > 0:
        reach = _REACH.get(field.unit, _OTHER_REACH)
        low, high, logarithmic = start / reach, start * reach, True
    else:
        return  # 0 has no scale
    yield Slider(path, group, name, field.unit, start, low, high, logarithmic, (Target(path),), (path,))


def _factor(
    name: str,
    group: str,
    label: str,
    targets: Sequence[Target],
    free: Sequence[str] = (),
    reach: float = _FACTOR_REACH,
) -> Slider:
    return Slider(name, group, label, "", 1.0, 1 / reach, reach, True, tuple(targets), tuple(free))


def _by_decade(path: str, group: str, name: str, times: np.ndarray) -> Iterator[Slider]:
    """Yield a slider for the moduli of every decade of relaxation times, if there are several decades."""
    # Powers of ten begin their decade, regardless of rounding.
    decades = np.floor(np.log10(times) + 1e-6).astype(int)
    for decade in np.unique(decades) if np.ptp(decades) else ():
        elements = tuple(np.flatnonzero(decades == decade).tolist())
        index = ",".join(map(str, elements))
        label = f"{name}, tau 1e{decade} s"
        free = [f"{path}[{i}]" for i in elements]
        yield _factor(f"{path}[{index}]", group, label, [Target(path, elements, 1.0)], free)


def _within(slider: Slider, try_value: Callable[[Slider, float], None]) -> Slider:
    """Return the slider with a range whose ends are accepted, found by bisection from the start.

    `try_value` raises ValueError if the scene refuses a value of the slider, the others at their start.
    """

    def accepts(part):
        try:
            try_value(slider, slider.at(part))
        except ValueError:
            return False
        return True

    ends = {}
    for name, side in (("low", -1.0), ("high", 1.0)):
        if accepts(side):
            continue
        good, bad = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (good + bad)
            good, bad = (middle, bad) if accepts(side * middle) else (good, middle)
        ends[name] = slider.at(side * good)
    return slider._replace(**ends)
