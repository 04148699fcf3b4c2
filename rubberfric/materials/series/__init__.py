"""Solids in series as one Prony series."""
