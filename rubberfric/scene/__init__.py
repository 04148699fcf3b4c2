"""Scenes: two bodies, their interface, and the version of the theory."""

from rubberfric.scene.heating import Heating, ThermalProperties
from rubberfric.scene.interface import Adhesion, ContactShear, Correlation
from rubberfric.scene.scene import (
    Body,
    Scene,
    cast,
    check_background,
    dissipates,
    result_dtype,
    same,
    shifts,
    takes_temperature,
)
from rubberfric.scene.settings import tuned
from rubberfric.scene.softening import Softening

__all__ = [
    "Adhesion",
    "Body",
    "ContactShear",
    "Correlation",
    "Heating",
    "Scene",
    "Softening",
    "ThermalProperties",
    "cast",
    "check_background",
    "dissipates",
    "result_dtype",
    "same",
    "shifts",
    "takes_temperature",
    "tuned",
]
