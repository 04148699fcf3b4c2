"""Contributions to the errors of fitted parameters beyond the noise of the data."""
