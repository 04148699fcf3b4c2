"""What knows no physics: objects and their rules, quadrature, units, files that appear whole, progress."""
