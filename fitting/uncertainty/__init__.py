"""Uncertainty of fits: covariance, intervals, posterior, tests of the residuals, design of experiments."""
