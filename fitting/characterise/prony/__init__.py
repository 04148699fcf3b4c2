"""Prony series from a measured modulus."""
