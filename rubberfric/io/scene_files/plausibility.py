"""Whether the numbers of a scene file can be in SI: what only a wrong unit would explain is an error.

Asked where a file is read that people write (TOML), unless it says `plausible = false`; the
constructors take any number, so that extreme and dimensionless scenes can be computed.
"""

import dataclasses

import jax
import numpy as np

from rubberfric.materials.elastic import Elastic
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.scene.shear import ContactShear

_STRESS = (1e2, 1e13, "Pa", "is it in MPa or GPa?")
_TEMPERATURE = (1e2, 1e3, "K", "is it in °C? then add 273.15")
# Of conditions: lowest and highest magnitude, unit, and what it may be instead.
_CONDITIONS = {
    "velocity": (0.0, 1e4, "m/s", "is it in mm/s or um/s?"),
    "pressure": (1.0, 1e10, "Pa", "is it in MPa or GPa?"),
    "temperature": _TEMPERATURE,
}
# Of objects: what is looked at, in words, and its values.
_OBJECTS = {
    Elastic: ("young", _STRESS, lambda m: m.young),
    Prony: ("E_inf + sum(E)", _STRESS, lambda m: m.E_inf + np.sum(m.E)),
    PronyShear: ("G_inf + sum(G)", _STRESS, lambda m: m.G_inf + np.sum(m.G)),
    TabulatedModulus: ("storage", _STRESS, lambda m: m.storage),
    ContactShear: ("tau_f0", _STRESS, lambda m: m.tau_f0),
    WLF: ("T_ref", _TEMPERATURE, lambda m: m.T_ref),
    Arrhenius: ("T_ref", _TEMPERATURE, lambda m: m.T_ref),
    TabulatedShift: ("T_ref", _TEMPERATURE, lambda m: m.T_ref),
}


def check_plausible_scene(where, scene):
    """ValueError naming the first number of a scene that is hardly in SI; `where` begins its line."""
    for key, part in _parts("", scene):
        name, limits, values = _OBJECTS[type(part)]
        _check(f"{where}{key}.{name}", values(part), limits)


def check_plausible_conditions(where, conditions):
    """The same of conditions."""
    for name, limits in _CONDITIONS.items():
        values = getattr(conditions, name)
        if values is not None:
            _check(f"{where}{name}", values, limits)


def _parts(key, part):
    """(key path, object) of everything in a scene that has a rule."""
    if type(part) in _OBJECTS:
        yield key, part
    for field in dataclasses.fields(part) if dataclasses.is_dataclass(part) else ():
        value = getattr(part, field.name)
        if dataclasses.is_dataclass(value) and not isinstance(value, jax.Array):
            yield from _parts(f"{key}.{field.name}" if key else field.name, value)


def _check(where, values, limits):
    low, high, unit, question = limits
    values = np.abs(np.atleast_1d(np.asarray(values, float)))
    bad = np.flatnonzero((values < low) | (values > high))
    if bad.size:
        index = f"[{bad[0]}]" if values.size > 1 else ""
        rule = f"{low:g} ... {high:g}" if low else f"at most {high:g}"
        raise ValueError(
            f"{where}{index} = {values[bad[0]]:g} {unit}: must be {rule} {unit}; {question}"
            " plausible = false at the top of the file accepts it"
        )
