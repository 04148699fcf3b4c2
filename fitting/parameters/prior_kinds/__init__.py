"""Kinds of priors, one a module."""
