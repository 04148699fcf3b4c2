"""The area of contact: how much of it there is at a stress, S in G, and adhesion."""
