"""Frictional heat: temperatures that follow from the friction, and the branches on which they lie."""
