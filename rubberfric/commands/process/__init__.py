"""How commands begin, tell what they do, answer signals and end."""
