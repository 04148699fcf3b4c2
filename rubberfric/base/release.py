"""The version, and how much of the machine is this process's."""

import os

VERSION = "0.1.0"  # pyproject.toml reads it here, so that a package that is not installed has it, too


def cores() -> int:
    """Cores of the processor that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
