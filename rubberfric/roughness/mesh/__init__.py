"""Where the integrals over wavevectors are evaluated: borders of panels, and the nodes in them."""
