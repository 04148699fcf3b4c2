"""The command `rubberfric-fit`."""
