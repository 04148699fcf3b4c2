"""Ensembles of thousands of fits, calibration of error bars, and comparison of a few fits."""
