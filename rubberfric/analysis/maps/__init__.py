"""Friction maps: quantities over velocity, pressure and temperature."""
