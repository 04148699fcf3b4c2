"""The command `rubberfric explore`: a page with sliders for the numbers of a scene."""
