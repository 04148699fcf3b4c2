"""Kinds of measured data, and their assignment to scenes.

All kinds hold float64 NumPy arrays in SI units, one element for each measured point. A fit compares a model
with FrictionData, AreaData, ModulusData and SpectrumData, and with SlipData and MomentData of
`fitting.data.slip`, which it treats alike. `fitting.fit_prony` converts RelaxationData and CreepData of
`fitting.data.transients` to a material and to ModulusData. `measured`, `error` and `logarithmic` give the
residual of a point:

    (model - measured) / error              with absolute errors (sigma),
    ln(model / measured) / error            with relative errors (relative),
    ln(model / measured), scale unknown     without errors.
"""

import dataclasses
import itertools
from collections.abc import Collection, Mapping, Sequence
from typing import ClassVar

import numpy as np

from fitting.data.fields import Field, GivenArray, OptionalArray, array, measurement
from fitting.data.measured import Measured
from fitting.data.quantities import (
    AREA,
    FREQUENCY,
    FRICTION,
    LOSS,
    PRESSURE,
    RATIO_ERROR,
    SPECTRUM,
    SPECTRUM_ERROR,
    STORAGE,
    TEMPERATURE,
    VELOCITY,
    WAVENUMBER,
)
from fitting.data.slip import MomentData, SlipData
from fitting.data.transients import CreepData, RelaxationData
from rubberfric.base import POSITIVE, closest, either, shown, warn_caller


@measurement
class FrictionData(Measured):
    """Friction coefficients measured in steady sliding.

    All arrays are kept as vectors of equal length. A condition or an error may be one number for all points.

    Parameters
    ----------
    velocity : sliding velocity, any sign and order [m/s]
    friction : friction coefficient [-], one for each point; > 0 unless sigma is given
    sigma : standard deviation of `friction`, > 0 [-], or None
    pressure : nominal contact pressure, > 0 [Pa]; must be given
    temperature : > 0 [K], or None: the reference temperature of the materials
    relative : standard deviation of ln(friction), > 0 [-], or None
        0.03 stands for 3 %. Give either `relative` or `sigma`. If both are None, the errors are unknown.
    name : text on one line, for reports and legends
    history : tuple of texts on one line, which describe how the data were computed from a file
        `fitting.read` fills it. Reports, HTML and files contain it.
    check_units : bool
        False accepts values that look like values in another unit.

    Raises
    ------
    ValueError
        The message is one line that names field, index, value and rule.

    Examples
    --------
    Values with an error of 3 %, and the points up to 5 cm/s:

    >>> data = fitting.FrictionData([1e-3, 1e-2, 0.1], [0.8, 1.0, 0.9], pressure=2e5, relative=0.03)
    >>> slow = data.selected(velocity=(None, 0.05))
    >>> slow.velocity, slow.pressure, slow.error
    (array([0.001, 0.01 ]), array([200000., 200000.]), array([0.03, 0.03]))
    """

    quantity: ClassVar[str] = "friction"
    conditions: ClassVar[tuple[str, ...]] = ("velocity", "pressure", "temperature")
    values: ClassVar[tuple[str, ...]] = ("friction",)
    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)
    others: ClassVar[tuple[str, ...]] = ("F_t",)

    velocity: GivenArray = array(VELOCITY)
    friction: GivenArray = array(FRICTION)
    sigma: OptionalArray = array(RATIO_ERROR, default=None)
    pressure: GivenArray = array(PRESSURE, default=None)
    temperature: OptionalArray = array(TEMPERATURE, default=None)


@measurement
class AreaData(Measured):
    """Relative contact areas A/A0 measured in steady sliding.

    Parameters
    ----------
    velocity : sliding velocity, any sign and order [m/s]
    area : real contact area divided by nominal contact area, 0 < A/A0 <= 1 [-]
        check_units=False accepts values outside this range, because noise may cause them.
    sigma : standard deviation of `area`, > 0 [-], or None
    pressure, temperature, relative, name, history, check_units : as in `FrictionData`

    Examples
    --------
    >>> data = fitting.AreaData([1e-3, 1e-2], [0.021, 0.016], sigma=0.001, pressure=2e5, temperature=293.15)
    >>> len(data), data.error
    (2, array([0.001, 0.001]))
    """

    quantity: ClassVar[str] = "area"
    conditions: ClassVar[tuple[str, ...]] = ("velocity", "pressure", "temperature")
    values: ClassVar[tuple[str, ...]] = ("area",)
    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)

    velocity: GivenArray = array(VELOCITY)
    area: GivenArray = array(AREA)
    sigma: OptionalArray = array(RATIO_ERROR, default=None)
    pressure: GivenArray = array(PRESSURE, default=None)
    temperature: OptionalArray = array(TEMPERATURE, default=None)


@measurement
class ModulusData(Measured):
    """Complex modulus of a material, measured in oscillation.

    Parameters
    ----------
    omega : angular frequency, > 0, any order [rad/s]
    storage, loss : E' and E'', > 0 [Pa]
    sigma_storage, sigma_loss : standard deviations of E' and E'', > 0 [Pa], both or none
    temperature : > 0 [K], or None: the reference temperature of the material
    relative : standard deviation of ln E' and of ln E'', > 0 [-], or None
    body : "lower", "upper" or None
        Body of the scene that has this material.
    name, history, check_units : as in `FrictionData`

    Notes
    -----
    `measured` and `error` hold E' and then E''; n is twice the number of frequencies.

    Examples
    --------
    >>> data = fitting.ModulusData([1.0, 10.0, 100.0], [3e6, 4e6, 6e6], [0.3e6, 0.8e6, 2e6], relative=0.02)
    >>> data.measured / 1e6  # E' and then E'', in MPa
    array([3. , 4. , 6. , 0.3, 0.8, 2. ])
    """

    quantity: ClassVar[str] = "modulus"
    conditions: ClassVar[tuple[str, ...]] = ("omega", "temperature")
    values: ClassVar[tuple[str, ...]] = ("storage", "loss")
    sigmas: ClassVar[tuple[str, ...]] = ("sigma_storage", "sigma_loss")
    others: ClassVar[tuple[str, ...]] = (
        *("G_stor", "E_comp", "G_comp"),
        *("D_stor", "D_comp", "J_stor", "J_comp"),
    )

    omega: GivenArray = array(FREQUENCY)
    storage: GivenArray = array(STORAGE)
    loss: GivenArray = array(LOSS)
    sigma_storage: OptionalArray = array(Field("sigma_stor", "Pa", POSITIVE), default=None)
    sigma_loss: OptionalArray = array(Field("sigma_loss", "Pa", POSITIVE), default=None)
    temperature: OptionalArray = array(TEMPERATURE, default=None)
    body: str | None = dataclasses.field(default=None, kw_only=True)


@measurement
class SpectrumData(Measured):
    r"""Power spectrum of a measured surface.

    .. math:: h_\mathrm{rms}^2 = 2\pi \int q\, C(q)\, dq

    Parameters
    ----------
    q : wavenumber, > 0, any order [1/m]
    C : power spectrum in the normalisation above, > 0 [m^4]
    sigma : standard deviation of `C`, > 0 [m^4], or None
    relative : standard deviation of ln C, > 0 [-], or None; up to 2.5, as `MeasuredSpectrum.relative`
    body : "lower", "upper" or None
        Body of the scene that has this surface.
    name, history, check_units : as in `FrictionData`

    Examples
    --------
    >>> data = fitting.SpectrumData([1e3, 1e4, 1e5], [1e-14, 2.5e-18, 6.3e-22], relative=0.1, body="lower")
    >>> data.selected(q=(None, 5e4)).q
    array([ 1000., 10000.])
    """

    quantity: ClassVar[str] = "spectrum"
    conditions: ClassVar[tuple[str, ...]] = ("q",)
    values: ClassVar[tuple[str, ...]] = ("C",)
    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)
    others: ClassVar[tuple[str, ...]] = ("C_1D",)
    remark: ClassVar[str] = "normalisation C"

    relative: OptionalArray = array(SPECTRUM_ERROR, default=None, kw_only=True)
    q: GivenArray = array(WAVENUMBER)
    C: GivenArray = array(SPECTRUM)
    sigma: OptionalArray = array(Field("sigma_C", "m^4", POSITIVE), default=None)
    body: str | None = dataclasses.field(default=None, kw_only=True)


# Kinds that a fit compares with a model.
FITTED = (FrictionData, AreaData, ModulusData, SpectrumData, SlipData, MomentData)
# Kinds over time, which `fitting.fit_prony` converts.
TRANSIENTS = (RelaxationData, CreepData)
KINDS: dict[str, type[Measured]] = {cls.quantity: cls for cls in (*FITTED, *TRANSIENTS)}


def as_data_sets(data: Measured | Sequence[Measured]) -> list[Measured]:
    """Return one data set or several as a list.

    Raise ValueError if `data` is empty or contains an object that is not measured data.
    """
    kinds = either([cls.__name__ for cls in FITTED])
    if isinstance(data, Measured):
        data = [data]
    if not isinstance(data, list | tuple):
        raise ValueError(f"data is a {type(data).__name__}: must be {kinds}, or a list of them")
    if not data:
        raise ValueError("data is empty: must hold at least one data set")
    for i, dataset in enumerate(data):
        if not isinstance(dataset, Measured):
            raise ValueError(f"data[{i}] is a {type(dataset).__name__}: must be {kinds}")
        if isinstance(dataset, TRANSIENTS):
            raise ValueError(
                f"data[{i}] is a {type(dataset).__name__}: must be {kinds};"
                " fit_prony(data).moduli() converts it"
            )
    return list(data)


DataSets = Measured | Sequence[Measured]


def data_by_scene(
    data: DataSets | Mapping[str, DataSets], names: Collection[str] | None
) -> tuple[list[Measured], list[str]]:
    """Return all data sets, and the names of the scenes to which they belong.

    Parameters
    ----------
    data : one data set or several; for several scenes a dict of scene name -> data sets
    names : names of the scenes; None for a single scene

    Returns
    -------
    list of the data sets, and list of the scene's name for every data set. The name of a single scene is "".
    If there are several scenes, the label of a data set begins with the name of the scene.

    Raises
    ------
    ValueError
        `data` is not a dict although there are several scenes, or the keys of `data` are not the names of the
        scenes.
    """
    if names is None:
        sets = as_data_sets(data)  # pyright: ignore[reportArgumentType]  # or its error
        return sets, [""] * len(sets)
    if not isinstance(data, Mapping):
        known = ", ".join(f"{name!r}: ..." for name in names)
        raise ValueError(f"data is a {type(data).__name__}: must be a dict of name -> data, {{{known}}}")
    for name in data:
        if name not in names:
            raise ValueError(f"data has the name {shown(name)}, which no scene has: {closest(name, names)}")
    sets, of = [], []
    for name in names:
        if name not in data:
            raise ValueError(f"scene {name!r} has no data; add data, or leave out the scene")
        try:
            own = as_data_sets(data[name])
        except ValueError as error:
            raise ValueError(f"scene {name!r}: {error}") from None
        sets += [_named(dataset, name) for dataset in own]
        of += [name] * len(own)
    return sets, of


def equal_data(data: Measured, other: Measured) -> bool:
    """Return True if two data sets have the same kind, body and numbers. Their names may differ."""
    if type(data) is not type(other) or getattr(data, "body", None) != getattr(other, "body", None):
        return False
    return all(np.array_equal(getattr(data, name), getattr(other, name)) for name in data.fields())


def warn_of_repeated(data: Sequence[Measured], of: Sequence[str]) -> None:
    """Warn if two data sets of a scene are equal, because repeated data shrink error bars."""
    for (i, dataset), (j, other) in itertools.combinations(enumerate(data), 2):
        if of[i] == of[j] and equal_data(dataset, other):
            warn_caller(
                f"data sets {i + 1} and {j + 1} are equal, so the data count twice and error bars shrink by "
                "sqrt(2). Leave one out.",
                UserWarning,
            )


def _named(data: Measured, scene: str) -> Measured:
    if data.name.split(":")[0] == scene:
        return data
    return dataclasses.replace(data, name=f"{scene}: {data.label}", check_units=False)
