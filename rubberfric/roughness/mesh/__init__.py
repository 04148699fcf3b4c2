"""Radial meshes: nodes of the integrals over wavevectors."""
