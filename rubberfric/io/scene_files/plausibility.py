"""Whether the numbers of a scene file can be in SI: what only a wrong unit would explain is an error.

Asked where a file is read that people write (TOML), unless it says `plausible = false`; the
constructors take any number, so that extreme and dimensionless scenes can be computed.
"""

from collections.abc import Iterator

import numpy as np

from rubberfric.base.checks import PLAUSIBLE_TEMPERATURE
from rubberfric.base.objects.physical import PhysicalObject, fields_of, leaves_of
from rubberfric.io.scene_files.conditions import Conditions
from rubberfric.io.toml import join

# What a number in a unit may be instead.
_QUESTIONS = {
    "Pa": "is it in MPa or GPa?",
    "K": "is it in °C? then add 273.15",
    "m/s": "is it in mm/s or um/s?",
}
# Of conditions: lowest and highest magnitude, and unit.
_CONDITIONS = {
    "velocity": (0.0, 1e4, "m/s"),
    "pressure": (1.0, 1e10, "Pa"),
    "temperature": (*PLAUSIBLE_TEMPERATURE, "K"),
}


def check_plausible_scene(where: str, scene: PhysicalObject) -> None:
    """ValueError naming the first number of a scene that is hardly in SI; `where` begins its line."""
    for key, part in _parts("", scene):
        for name, field in leaves_of(type(part)).items():
            values = getattr(part, name)
            if field.plausible is None or values is None:
                continue
            if field.plus is not None:
                name, values = f"{name} + sum({field.plus})", values + np.sum(getattr(part, field.plus))
            _check(f"{where}{join(key, name)}", values, *field.plausible, field.unit)


def check_plausible_conditions(where: str, conditions: Conditions) -> None:
    """The same of conditions."""
    for name, limits in _CONDITIONS.items():
        values = getattr(conditions, name)
        if values is not None:
            _check(f"{where}{name}", values, *limits)


def _parts(key: str, part: PhysicalObject) -> Iterator[tuple[str, PhysicalObject]]:
    """(key path, object) of an object and of everything in it."""
    yield key, part
    for name in fields_of(type(part)):
        value = getattr(part, name)
        if isinstance(value, PhysicalObject):
            yield from _parts(join(key, name), value)


def _check(where, values, low, high, unit):
    values = np.abs(np.atleast_1d(np.asarray(values, float)))
    bad = np.flatnonzero((values < low) | (values > high))
    if bad.size:
        index = f"[{bad[0]}]" if values.size > 1 else ""
        rule = f"{low:g} ... {high:g}" if low else f"at most {high:g}"
        raise ValueError(
            f"{where}{index} = {values[bad[0]]:g} {unit}: must be {rule} {unit}; "
            f"{_QUESTIONS.get(unit, 'is it in SI?')} plausible = false at the top of the file accepts it"
        )
