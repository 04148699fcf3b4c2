"""fitting: inverse fits of scenes to measurements."""
