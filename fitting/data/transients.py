"""Relaxation moduli and creep compliances over time, which `fitting.fit_prony` converts to a material."""

import dataclasses
from typing import ClassVar

from fitting.data.fields import Field, GivenArray, OptionalArray, array, measurement
from fitting.data.measured import Measured
from fitting.data.quantities import COMPLIANCE, RELAXATION, TEMPERATURE, TIME
from rubberfric.base import POSITIVE


@measurement
class RelaxationData(Measured):
    """Relaxation modulus of a material: stress after a step of strain, divided by the strain.

    Parameters
    ----------
    time : time since the step, > 0, any order [s]
    modulus : E(t), > 0 [Pa]
    sigma : standard deviation of `modulus`, > 0 [Pa], or None
    temperature : > 0 [K], or None: the reference temperature of the material
    relative : standard deviation of ln E(t), > 0 [-], or None
    body : "lower", "upper" or None
        Body of the scene that has this material.
    name, check_units : as in `FrictionData`

    Examples
    --------
    >>> data = fitting.RelaxationData([0.1, 1.0, 10.0], [3e6, 2e6, 1.5e6], relative=0.02, temperature=293.15)
    >>> data.selected(time=(0.5, None)).modulus
    array([2000000., 1500000.])
    """

    quantity: ClassVar[str] = "relaxation"
    conditions: ClassVar[tuple[str, ...]] = ("time", "temperature")
    values: ClassVar[tuple[str, ...]] = ("modulus",)
    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)
    others: ClassVar[tuple[str, ...]] = ("G_relax",)

    time: GivenArray = array(TIME)
    modulus: GivenArray = array(RELAXATION)
    sigma: OptionalArray = array(Field("sigma_relax", "Pa", POSITIVE), default=None)
    temperature: OptionalArray = array(TEMPERATURE, default=None)
    body: str | None = dataclasses.field(default=None, kw_only=True)


@measurement
class CreepData(Measured):
    """Creep compliance of a material: strain after a step of stress, divided by the stress.

    Parameters
    ----------
    time : time since the step, > 0, any order [s]
    compliance : D(t), > 0 [1/Pa]
    sigma : standard deviation of `compliance`, > 0 [1/Pa], or None
    temperature, relative, body, name, check_units : as in `RelaxationData`

    Examples
    --------
    The compliance of a rubber of 3 MPa that creeps:

    >>> data = fitting.CreepData([0.1, 1.0, 10.0], [3.3e-7, 4e-7, 6e-7], relative=0.02)
    >>> (1e-6 / data.compliance).round(2)  # in MPa
    array([3.03, 2.5 , 1.67])
    """

    quantity: ClassVar[str] = "creep"
    conditions: ClassVar[tuple[str, ...]] = ("time", "temperature")
    values: ClassVar[tuple[str, ...]] = ("compliance",)
    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)
    others: ClassVar[tuple[str, ...]] = ("J_creep",)

    time: GivenArray = array(TIME)
    compliance: GivenArray = array(COMPLIANCE)
    sigma: OptionalArray = array(Field("sigma_creep", "1/Pa", POSITIVE), default=None)
    temperature: OptionalArray = array(TEMPERATURE, default=None)
    body: str | None = dataclasses.field(default=None, kw_only=True)
