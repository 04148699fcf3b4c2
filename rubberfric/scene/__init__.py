"""Scenes: two bodies, their interface, and the version of the theory."""

from rubberfric.base.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.scene.body import Body as Body
    from rubberfric.scene.heating import Heating as Heating
    from rubberfric.scene.heating import ThermalProperties as ThermalProperties
    from rubberfric.scene.interface import Adhesion as Adhesion
    from rubberfric.scene.interface import ContactShear as ContactShear
    from rubberfric.scene.interface import Correlation as Correlation
    from rubberfric.scene.patch import MeasuredPressure as MeasuredPressure
    from rubberfric.scene.patch import Parabolic as Parabolic
    from rubberfric.scene.patch import Patch as Patch
    from rubberfric.scene.patch import PressureShape as PressureShape
    from rubberfric.scene.patch import Trapezoid as Trapezoid
    from rubberfric.scene.patch import Uniform as Uniform
    from rubberfric.scene.scene import Scene as Scene
    from rubberfric.scene.scene import cast as cast
    from rubberfric.scene.scene import check_background as check_background
    from rubberfric.scene.scene import dissipates as dissipates
    from rubberfric.scene.scene import result_dtype as result_dtype
    from rubberfric.scene.scene import same as same
    from rubberfric.scene.scene import shifts as shifts
    from rubberfric.scene.scene import takes_temperature as takes_temperature
    from rubberfric.scene.settings import tuned as tuned
    from rubberfric.scene.softening import Softening as Softening

lazily(__name__, __file__, load=True)
