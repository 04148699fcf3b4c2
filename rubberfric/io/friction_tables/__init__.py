"""Tables of mu(v, p, T) for the programs that use friction: one module a format."""
