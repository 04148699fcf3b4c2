"""Ensembles: thousands of fits as one program."""
