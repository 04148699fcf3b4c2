"""A master curve and its shift factors from sweeps at several temperatures."""
