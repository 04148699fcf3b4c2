"""What follows from the theory, and boundary elements that it is held against.

Maps, each length scale's part, the interface, power, errors against run time.
"""

from rubberfric.base.process.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.analysis.by_wavevector import Profile as Profile
    from rubberfric.analysis.by_wavevector import profile as profile
    from rubberfric.analysis.derivatives.jacobian import value_and_jacobian as value_and_jacobian
    from rubberfric.analysis.elements.expected import TheoryError as TheoryError
    from rubberfric.analysis.elements.expected import theory_error as theory_error
    from rubberfric.analysis.elements.realisation import Surface as Surface
    from rubberfric.analysis.elements.realisation import random_surface as random_surface
    from rubberfric.analysis.elements.sliding import SlidingContact as SlidingContact
    from rubberfric.analysis.elements.sliding import boundary_element as boundary_element
    from rubberfric.analysis.elements.sliding import sliding_contact as sliding_contact
    from rubberfric.analysis.error_and_time.settings import quadrature_for as quadrature_for
    from rubberfric.analysis.error_and_time.sweep import accuracy as accuracy
    from rubberfric.analysis.extrapolation import friction_outside_table as friction_outside_table
    from rubberfric.analysis.interface.adhesion import AdhesionProfile as AdhesionProfile
    from rubberfric.analysis.interface.adhesion import AdhesionVerdict as AdhesionVerdict
    from rubberfric.analysis.interface.adhesion import adhesion_matters as adhesion_matters
    from rubberfric.analysis.interface.adhesion import adhesion_profile as adhesion_profile
    from rubberfric.analysis.interface.adhesion import full_contact_energy as full_contact_energy
    from rubberfric.analysis.interface.pull_off import pull_off_force as pull_off_force
    from rubberfric.analysis.interface.separations import SeparationProfile as SeparationProfile
    from rubberfric.analysis.interface.separations import separation_profile as separation_profile
    from rubberfric.analysis.interface.stresses import contact_stiffness as contact_stiffness
    from rubberfric.analysis.interface.stresses import stress_distribution as stress_distribution
    from rubberfric.analysis.maps.friction_map import FrictionMap as FrictionMap
    from rubberfric.analysis.maps.friction_map import friction_map as friction_map
    from rubberfric.analysis.maps.friction_table import friction_table as friction_table
    from rubberfric.analysis.power import DissipatedPower as DissipatedPower
    from rubberfric.analysis.power import dissipated_power as dissipated_power
    from rubberfric.scene.numerics.settings import fitting_quadrature as fitting_quadrature

lazily(__name__, __file__)
