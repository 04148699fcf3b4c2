"""Scene files: TOML written by hand, HDF5 written by the library."""
