"""Stiffness of two solids in series, and its means over the direction of sliding."""
