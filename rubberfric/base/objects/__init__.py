"""Physical objects: dataclasses whose fields describe units, rules and structure."""
