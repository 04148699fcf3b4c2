"""The theory: from the stiffness of two solids to area of contact, friction and separation."""

from rubberfric.theory.model import Solution, contact_area, friction, quantities_of, separation, solve

__all__ = [
    "Solution",
    "contact_area",
    "friction",
    "quantities_of",
    "separation",
    "solve",
]
