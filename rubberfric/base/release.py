"""The version, and the number of cores that this process may use."""

import os

VERSION = "0.1.0"  # pyproject.toml reads it, so that it is known without an installation


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
