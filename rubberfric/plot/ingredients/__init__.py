"""Pictures of what a scene is made of: moduli and power spectra."""
