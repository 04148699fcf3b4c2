"""What a fit knows: as the prior of another, as draws, and how well it predicts."""
