"""How the area of contact departs from that of the plain theory: S in G, and adhesion."""
