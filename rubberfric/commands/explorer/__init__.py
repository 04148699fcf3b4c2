"""The command `rubberfric explore`: a page on which the numbers of a scene are moved."""
