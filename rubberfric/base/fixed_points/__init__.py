"""Fixed points of many independent points at once: by Anderson's method, and by a bracket of one number."""
