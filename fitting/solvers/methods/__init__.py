"""Methods that find a minimum, behind the same init and step."""
