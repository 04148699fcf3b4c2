"""Free parameters: which numbers of a scene a fit may change, how far, and what is known before."""
