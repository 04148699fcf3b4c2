"""Contact, friction, roughness and separations at each length scale."""
