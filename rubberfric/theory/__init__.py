"""The theory: from the stiffness of two solids to area of contact, friction and separation."""

from rubberfric.theory.model import contact_area, friction, separation, solve
from rubberfric.theory.structure import Solution, quantities_of

__all__ = ["Solution", "contact_area", "friction", "quantities_of", "separation", "solve"]
