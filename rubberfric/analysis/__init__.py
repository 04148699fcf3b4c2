"""Analyses based on the theory (maps, profiles, interface, adhesion, accuracy), and boundary elements."""

from rubberfric.base.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.analysis.adhesion import AdhesionVerdict as AdhesionVerdict
    from rubberfric.analysis.adhesion import adhesion_matters as adhesion_matters
    from rubberfric.analysis.adhesion import full_contact_energy as full_contact_energy
    from rubberfric.analysis.adhesion import pull_off_force as pull_off_force
    from rubberfric.analysis.boundary_elements import SlidingContact as SlidingContact
    from rubberfric.analysis.boundary_elements import boundary_element as boundary_element
    from rubberfric.analysis.boundary_elements import sliding_contact as sliding_contact
    from rubberfric.analysis.interface import DissipatedPower as DissipatedPower
    from rubberfric.analysis.interface import contact_stiffness as contact_stiffness
    from rubberfric.analysis.interface import dissipated_power as dissipated_power
    from rubberfric.analysis.interface import stress_distribution as stress_distribution
    from rubberfric.analysis.jacobian import uses_forward_mode as uses_forward_mode
    from rubberfric.analysis.jacobian import value_and_jacobian as value_and_jacobian
    from rubberfric.analysis.maps import FrictionMap as FrictionMap
    from rubberfric.analysis.maps import friction_map as friction_map
    from rubberfric.analysis.random_roughness import Surface as Surface
    from rubberfric.analysis.random_roughness import random_surface as random_surface
    from rubberfric.analysis.reference import quadrature_for as quadrature_for
    from rubberfric.analysis.scales.profiles import Profile as Profile
    from rubberfric.analysis.scales.profiles import profile as profile
    from rubberfric.analysis.scales.separations import SeparationProfile as SeparationProfile
    from rubberfric.analysis.scales.separations import separation_profile as separation_profile
    from rubberfric.analysis.sweep import accuracy as accuracy
    from rubberfric.analysis.tables import friction_table as friction_table
    from rubberfric.analysis.validity import TheoryError as TheoryError
    from rubberfric.analysis.validity import contact_model_name as contact_model_name
    from rubberfric.analysis.validity import friction_outside_table as friction_outside_table
    from rubberfric.analysis.validity import theory_error as theory_error
    from rubberfric.scene.settings import default_quadrature as default_quadrature

lazily(__name__, __file__)
