"""Whether measured E' and E'' can be of one material."""
