"""Applications of friction and separation: grip of a patch, conductance of a contact, leak of a seal."""

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
    from rubberfric.applications.leak import leak_conductivity as leak_conductivity
    from rubberfric.applications.leak import leak_rate as leak_rate
    from rubberfric.applications.leak import percolation_pressure as percolation_pressure

lazily(__name__, __file__, load=True)
