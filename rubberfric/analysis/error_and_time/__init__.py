"""Error against run time of one scene."""
