"""The command `rubberfric`."""
