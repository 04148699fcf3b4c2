"""Applications of friction and separation: grip of a patch that slips, conductance of a contact."""

from rubberfric.base.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.applications.brush_model import Grip as Grip
    from rubberfric.applications.brush_model import PeakGrip as PeakGrip
    from rubberfric.applications.brush_model import friction_points as friction_points
    from rubberfric.applications.brush_model import grip as grip
    from rubberfric.applications.brush_model import grip_of_friction as grip_of_friction
    from rubberfric.applications.brush_model import peak_grip as peak_grip
    from rubberfric.applications.brush_model import slip_stiffness as slip_stiffness
    from rubberfric.applications.conductance import contact_conductance as contact_conductance

lazily(__name__, __file__, load=True)
