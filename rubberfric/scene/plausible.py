"""Plausible numbers and conditions of a scene.

A scene gives a `UnitWarning` about implausible numbers, which are probably in a wrong unit, when it is
created and when it is computed. A scene in a TOML file gives an error. Traced numbers are not checked.
Nothing is changed, so extreme and dimensionless scenes can be computed.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from rubberfric.base.checks import PLAUSIBLE_TEMPERATURE, UnitWarning, is_concrete, warn_caller
from rubberfric.base.objects.physical import PhysicalObject, leaves_of, parts_of

# Likely other units of a number.
_QUESTIONS = {
    "Pa": "is it in MPa or GPa?",
    "K": "is it in °C? then add 273.15",
    "m/s": "is it in mm/s or um/s?",
    "1/m": "is it in 1/mm or 1/um?",
    "m": "is it in mm or um?",
}
# Conditions: lowest and highest plausible magnitude, and unit.
_CONDITIONS = {
    "velocity": (0.0, 500.0, "m/s"),
    "pressure": (1.0, 1e10, "Pa"),
    "temperature": (*PLAUSIBLE_TEMPERATURE, "K"),
}
# End of a warning: how to switch it off.
_OFF = 'warnings.simplefilter("ignore", rubberfric.UnitWarning) silences this warning'


def doubts_of_scene(scene: PhysicalObject) -> Iterator[str]:
    """Yield a message, beginning with its key path, for each implausible number of an object."""
    for key, part in parts_of(scene):
        for name, field in leaves_of(type(part)).items():
            values = getattr(part, name)
            if field.plausible is None or values is None:
                continue
            if field.plus is not None:
                # NumPy arrays, because a sum of JAX arrays within jit would be traced.
                added = np.sum(np.asarray(getattr(part, field.plus)))
                name, values = f"{name} + sum({field.plus})", np.asarray(values) + added
            yield from _doubts(f"{key}.{name}" if key else name, values, *field.plausible, field.unit)
        yield from (f"{key}: {text}" if key else text for text in part.doubts())


def doubts_of_conditions(**conditions: Any) -> Iterator[str]:
    """Yield a message for each condition (velocity, pressure, temperature) with implausible values."""
    for name, values in conditions.items():
        if values is not None and is_concrete(values):
            yield from _doubts(name, values, *_CONDITIONS[name])


def warn_of_conditions(**conditions: Any) -> None:
    """Give a UnitWarning for the first implausible condition (velocity, pressure or temperature)."""
    _warn(doubts_of_conditions(**conditions))


def warn_of_scene(scene: PhysicalObject) -> None:
    """Give a UnitWarning for the first implausible number of a scene."""
    _warn(doubts_of_scene(scene))


def _warn(doubts):
    for text in doubts:
        warn_caller(f"{text} {_OFF}", UnitWarning)
        return


def _doubts(where, values, low, high, unit):
    values = np.abs(np.atleast_1d(np.asarray(values, float)))
    bad = np.argwhere((values < low) | (values > high))
    if bad.size:
        index = "".join(f"[{i}]" for i in bad[0]) if values.size > 1 else ""
        rule = f"{low:g} ... {high:g}" if low else f"at most {high:g}"
        question = _QUESTIONS.get(unit, "is it in SI?")
        yield f"{where}{index} = {values[tuple(bad[0])]:g} {unit}: must be {rule} {unit}; {question}"
