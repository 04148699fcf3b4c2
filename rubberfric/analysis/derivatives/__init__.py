"""Derivatives of a quantity at many points by a few parameters."""
