"""Measured data: what a fit compares a model with.

Four kinds, FrictionData, AreaData, ModulusData and SpectrumData, hold float64 NumPy arrays
in SI units, one element for each measured point. A fit sees all of them in the same way:
`measured`, `error` and `logarithmic`, which say that the residual of a point is

    (model - measured) / error              with absolute errors (sigma),
    ln(model / measured) / error            with relative errors (relative),
    ln(model / measured), scale unknown     with none.
"""

import dataclasses
from typing import ClassVar

import numpy as np

from fitting.data.measured import Measured


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class FrictionData(Measured):
    """Friction coefficients measured in steady sliding.

    All arrays broadcast against each other and are kept as vectors of equal length.

    Parameters
    ----------
    velocity : sliding velocity, any sign and order [m/s]
    friction : friction coefficient [-]; > 0 unless sigma is given
    sigma : standard deviation of `friction`, > 0 [-], or None
    pressure : nominal contact pressure, > 0 [Pa]; must be given
    temperature : > 0 [K], or None: the reference temperature of the materials
    relative : standard deviation of ln(friction), > 0 [-], or None
        0.03 stands for 3 %. Given instead of sigma; with neither the errors are unknown.
    name : text on one line, for reports and legends
    check_units : bool
        False accepts values that look like ones in another unit.

    Raises
    ------
    ValueError
        one line naming field, index, value and rule.
    """

    quantity: ClassVar[str] = "friction"
    values: ClassVar[tuple] = ("friction",)
    sigmas: ClassVar[tuple] = ("sigma",)

    velocity: np.ndarray
    friction: np.ndarray
    sigma: np.ndarray | None = None
    pressure: np.ndarray = None
    temperature: np.ndarray | None = None


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class AreaData(Measured):
    """Relative contact areas A/A0 measured in steady sliding; all else as in `FrictionData`.

    Parameters
    ----------
    velocity : sliding velocity, any sign and order [m/s]
    area : real over nominal contact area, 0 < A/A0 <= 1 [-]
        with check_units=False also outside, as noise may have it.
    sigma : standard deviation of `area`, > 0 [-], or None
    pressure, temperature, relative, name, check_units : as in `FrictionData`
    """

    quantity: ClassVar[str] = "area"
    values: ClassVar[tuple] = ("area",)
    sigmas: ClassVar[tuple] = ("sigma",)

    velocity: np.ndarray
    area: np.ndarray
    sigma: np.ndarray | None = None
    pressure: np.ndarray = None
    temperature: np.ndarray | None = None


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class ModulusData(Measured):
    """Complex modulus of a material, measured in oscillation; all else as in `FrictionData`.

    Parameters
    ----------
    omega : angular frequency, > 0, any order [rad/s]
    storage, loss : E' and E'', > 0 [Pa]
    sigma_storage, sigma_loss : standard deviations of E' and E'', > 0 [Pa], both or none
    temperature : > 0 [K], or None: the reference temperature of the material
    relative : standard deviation of ln E' and of ln E'', > 0 [-], or None
    body : "lower", "upper" or None
        the solid of the scene whose material it is.
    name, check_units : as in `FrictionData`

    Notes
    -----
    `measured` and `error` hold E' and then E''; n is twice the number of frequencies.
    """

    quantity: ClassVar[str] = "modulus"
    values: ClassVar[tuple] = ("storage", "loss")
    sigmas: ClassVar[tuple] = ("sigma_storage", "sigma_loss")

    omega: np.ndarray
    storage: np.ndarray
    loss: np.ndarray
    sigma_storage: np.ndarray | None = None
    sigma_loss: np.ndarray | None = None
    temperature: np.ndarray | None = None
    body: str | None = dataclasses.field(default=None, kw_only=True)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SpectrumData(Measured):
    r"""Power spectrum of a surface; all else as in `FrictionData`.

    .. math:: h_\mathrm{rms}^2 = 2\pi \int q\, C(q)\, dq

    Parameters
    ----------
    q : wavenumber, > 0, any order [1/m]
    C : power spectrum in the normalisation above, > 0 [m^4]
    sigma : standard deviation of `C`, > 0 [m^4], or None
    relative : standard deviation of ln C, > 0 [-], or None
    body : "lower", "upper" or None
        the solid of the scene whose surface it is.
    name, check_units : as in `FrictionData`
    """

    quantity: ClassVar[str] = "spectrum"
    values: ClassVar[tuple] = ("C",)
    sigmas: ClassVar[tuple] = ("sigma",)

    q: np.ndarray
    C: np.ndarray
    sigma: np.ndarray | None = None
    body: str | None = dataclasses.field(default=None, kw_only=True)
