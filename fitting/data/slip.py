"""Forces and aligning moments of a patch that slips: tyre trailers, drums, LAT100 and other wheel testers.

A fit predicts them by `rubberfric.grip`, with the patch of the scene, `Scene(..., patch=Patch(...))`.
"""

from typing import ClassVar

import numpy as np

from fitting.data.fields import GivenArray, OptionalArray, array, measurement
from fitting.data.measured import Measured
from fitting.data.quantities import (
    ANGLE,
    FORCE,
    FORCE_ERROR,
    LOAD,
    MOMENT,
    MOMENT_ERROR,
    RATIO,
    SPEED,
    TEMPERATURE,
)


@measurement
class SlipData(Measured):
    """Side forces over the slip angle, or brake and drive forces over the slip ratio.

    ::

        data = fitting.SlipData(angle=alpha, force=F, speed=10.0, load=3e3, temperature=300.0, relative=0.03)
        tyre = scene.replace(patch=rf.Patch(length=0.12, width=0.15, stiffness=5e7))
        result = fitting.fit(tyre, data, {"patch.stiffness": Positive(), "shear.tau_f0": Positive()})

    All arrays are kept as vectors of equal length. A condition or an error may be one number for all points.

    Parameters
    ----------
    angle : slip angle, between -pi/2 and pi/2 [rad], or None
    ratio : slip ratio, > -1 and negative in braking [-], or None; give either `angle` or `ratio`
    force : tangential force of the patch, with the sign of the slip [N]; > 0 unless sigma is given
    speed : travelling speed, > 0 [m/s]
    load : normal force on the patch, > 0 [N]
    sigma : standard deviation of `force`, > 0 [N], or None
    temperature : > 0 [K], or None: the reference temperature of the materials
    relative, name, check_units : as in `FrictionData`

    Raises
    ------
    ValueError
        The message is one line that names field, index, value and rule.

    Notes
    -----
    At small slip all elements stick, and the force depends on stiffness * length^2 * width / 2 alone. If a
    measured pressure contains zeros, the lengths of the contacts replace the length of the patch
    (`rubberfric.applications.slip_stiffness`). A fit separates stiffness and length by aligning moments
    (`MomentData`). The error of the brush model is not known; no fit was compared with measured slip curves.

    Examples
    --------
    >>> angle, force = np.radians([1.0, 4.0, 8.0]), [900.0, 2500.0, 2800.0]
    >>> data = fitting.SlipData(angle, force=force, speed=10.0, load=3000.0, relative=0.03)
    >>> (data.force / data.load).round(2)
    array([0.3 , 0.83, 0.93])
    """

    quantity: ClassVar[str] = "force"
    conditions: ClassVar[tuple[str, ...]] = ("angle", "ratio", "speed", "load", "temperature")
    values: ClassVar[tuple[str, ...]] = ("force",)
    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)

    angle: OptionalArray = array(ANGLE, default=None)
    ratio: OptionalArray = array(RATIO, default=None)
    force: GivenArray = array(FORCE, default=None)
    speed: GivenArray = array(SPEED, default=None)
    load: GivenArray = array(LOAD, default=None)
    sigma: OptionalArray = array(FORCE_ERROR, default=None)
    temperature: OptionalArray = array(TEMPERATURE, default=None)

    def _arrays(self) -> dict[str, np.ndarray]:
        if (self.angle is None) == (self.ratio is None):
            stated = "both are given" if self.angle is not None else "none is given"
            raise ValueError(f"SlipData: {stated}; must be one of angle [rad] and ratio [-]")
        return super()._arrays()


@measurement
class MomentData(Measured):
    """Aligning moments over the slip angle.

    Parameters
    ----------
    angle : slip angle, between -pi/2 and pi/2 [rad]
    moment : aligning moment about the centre of the patch [N m]; > 0 unless sigma is given
        At small slip it has the sign of the slip, as in `rubberfric.grip`.
    speed, load, temperature, relative, name, check_units : as in `SlipData`
    sigma : standard deviation of `moment`, > 0 [N m], or None

    Examples
    --------
    >>> angle, moment = np.radians([1.0, 4.0, 8.0]), [17.0, 25.0, 6.0]
    >>> data = fitting.MomentData(angle, moment, speed=10.0, load=3000.0, sigma=2.0)
    >>> (1e3 * data.moment / 900.0)[0].round(1)  # pneumatic trail at a side force of 900 N, in mm
    np.float64(18.9)
    """

    quantity: ClassVar[str] = "moment"
    conditions: ClassVar[tuple[str, ...]] = ("angle", "speed", "load", "temperature")
    values: ClassVar[tuple[str, ...]] = ("moment",)
    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)

    angle: GivenArray = array(ANGLE, default=None)
    moment: GivenArray = array(MOMENT, default=None)
    speed: GivenArray = array(SPEED, default=None)
    load: GivenArray = array(LOAD, default=None)
    sigma: OptionalArray = array(MOMENT_ERROR, default=None)
    temperature: OptionalArray = array(TEMPERATURE, default=None)


def with_sign_of_slip(
    cls: type[Measured], values: dict[str, np.ndarray], history: list[str]
) -> dict[str, np.ndarray]:
    """Return the fields of `SlipData` or `MomentData` with the measured values in the sign of the slip.

    Tyre testers often count a side force negative at a positive slip angle [ISO 8855]. The sign is reversed
    if no value has the sign of the slip, and `history` says so.
    """
    (name,) = cls.values
    slip = next((values[field] for field in ("angle", "ratio") if field in values), None)
    if slip is None or name not in values or np.any(values[name] * slip >= 0):
        return values
    history.append(f"{name} reversed, because no value had the sign of the slip")
    return values | {name: -values[name]}
