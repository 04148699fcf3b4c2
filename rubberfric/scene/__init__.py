"""Scenes: two bodies, their interface, and the version of the theory."""

from rubberfric.scene.adhesion import Adhesion
from rubberfric.scene.correlation import Correlation
from rubberfric.scene.heating import Heating, ThermalProperties
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
from rubberfric.scene.shear import ContactShear
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
