"""Analyses based on the theory: maps, profiles, interface, adhesion, accuracy; boundary elements."""

from rubberfric.base.process.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.analysis.adhesion import pull_off_force
    from rubberfric.analysis.boundary_elements import (
        SlidingContact,
        Surface,
        boundary_element,
        random_surface,
        sliding_contact,
    )
    from rubberfric.analysis.interface import (
        DissipatedPower,
        contact_stiffness,
        dissipated_power,
        stress_distribution,
    )
    from rubberfric.analysis.jacobian import value_and_jacobian
    from rubberfric.analysis.maps import FrictionMap, friction_map
    from rubberfric.analysis.profiles import Profile, SeparationProfile, profile, separation_profile
    from rubberfric.analysis.reference import quadrature_for
    from rubberfric.analysis.sweep import accuracy
    from rubberfric.analysis.tables import friction_table
    from rubberfric.analysis.validity import (
        AdhesionVerdict,
        TheoryError,
        adhesion_matters,
        friction_outside_table,
        full_contact_energy,
        theory_error,
    )
    from rubberfric.scene.numerics.settings import fitting_quadrature

__all__ = [
    "AdhesionVerdict",
    "DissipatedPower",
    "FrictionMap",
    "Profile",
    "SeparationProfile",
    "SlidingContact",
    "Surface",
    "TheoryError",
    "accuracy",
    "adhesion_matters",
    "boundary_element",
    "contact_stiffness",
    "dissipated_power",
    "fitting_quadrature",
    "friction_map",
    "friction_outside_table",
    "friction_table",
    "full_contact_energy",
    "profile",
    "pull_off_force",
    "quadrature_for",
    "random_surface",
    "separation_profile",
    "sliding_contact",
    "stress_distribution",
    "theory_error",
    "value_and_jacobian",
]

lazily(
    __name__,
    {
        "rubberfric.analysis.adhesion": "pull_off_force",
        "rubberfric.analysis.boundary_elements": (
            "SlidingContact Surface boundary_element random_surface sliding_contact"
        ),
        "rubberfric.analysis.interface": (
            "DissipatedPower contact_stiffness dissipated_power stress_distribution"
        ),
        "rubberfric.analysis.jacobian": "value_and_jacobian",
        "rubberfric.analysis.maps": "FrictionMap friction_map",
        "rubberfric.analysis.profiles": "Profile SeparationProfile profile separation_profile",
        "rubberfric.analysis.reference": "quadrature_for",
        "rubberfric.analysis.sweep": "accuracy",
        "rubberfric.analysis.tables": "friction_table",
        "rubberfric.analysis.validity": (
            "AdhesionVerdict TheoryError adhesion_matters friction_outside_table full_contact_energy "
            "theory_error"
        ),
        "rubberfric.scene.numerics.settings": "fitting_quadrature",
    },
)
