"""Boundary elements: one rough surface in sliding contact, point by point instead of by the theory."""
