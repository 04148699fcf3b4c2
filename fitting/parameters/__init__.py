"""Free parameters of a scene, the values that they may take, and their priors."""
