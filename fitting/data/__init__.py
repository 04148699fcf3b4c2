"""Measured data and their files."""
