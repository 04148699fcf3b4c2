"""Materials and roughness from measured curves."""
