"""Readers of measured heights: height maps, traces of profilometers, and their holes."""
