"""Prony series as cards of finite-element programs."""
