"""Scenes by name, with their conditions: what `tests/properties` and many other tests are run on."""

from problems.problem import POINTS, Problem, compiled, solved
from problems.scenes import PROBLEMS, having, stored
from problems.solids import (
    CONTACT_MODELS,
    ELASTIC,
    FINE,
    GROOVES,
    HEATING,
    RIGID,
    ROAD,
    SHEAR,
    SHIFTED_TREAD,
    SOFT,
    SOFTENING,
    STEEL,
    TREAD,
    WLF,
    WORN,
    scene,
)

__all__ = [
    "CONTACT_MODELS",
    "ELASTIC",
    "FINE",
    "GROOVES",
    "HEATING",
    "POINTS",
    "PROBLEMS",
    "RIGID",
    "ROAD",
    "SHEAR",
    "SHIFTED_TREAD",
    "SOFT",
    "SOFTENING",
    "STEEL",
    "TREAD",
    "WLF",
    "WORN",
    "Problem",
    "compiled",
    "having",
    "scene",
    "solved",
    "stored",
]
