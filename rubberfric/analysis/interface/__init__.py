"""The contact seen as an interface: stresses, separations, and whether adhesion matters."""
