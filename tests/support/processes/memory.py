"""Bounds on the memory of a run of tests. They need Linux; elsewhere nothing is measured or dropped."""

import ctypes
import gc
from pathlib import Path

import jax

GB = 1e9
# Largest resident memory of a process in the ordinary run [bytes], so that two fit into a laptop with 8 GB.
MOST = 2 * GB
# Resident memory above which compiled functions are dropped [bytes]. Tests add up to 0.6 GB.
MUCH = 1.1 * GB
# Functions are dropped again if memory has grown by this factor since. Otherwise each test would compile them
# again if results of fixtures hold much.
GROWTH = 1.2
_STATUS = Path("/proc/self/status")
_dropped = [0.0]  # resident memory after functions were last dropped [bytes]


def collect_rarely():
    """Make garbage collections rare: objects from tracing live long, and each collection takes a second."""
    gc.set_threshold(100_000, 50, 20)


def _of_status(name):
    """Return a size in the process's status [bytes], 0 on systems without it."""
    if not _STATUS.exists():
        return 0.0
    line = next(line for line in _STATUS.read_text().splitlines() if line.startswith(name))
    return 1024.0 * int(line.split()[1])


def resident():
    """Return the resident memory of this process [bytes]."""
    return _of_status("VmRSS")


def peak():
    """Return the largest resident memory that this process had [bytes]."""
    return _of_status("VmHWM")


def drop_if_much():
    """Drop compiled functions if memory exceeds `MUCH`.

    Compiled functions also hold memory maps. Linux allows 65530 per process, and XLA's compiler ends in a
    segmentation fault above that. Dropped functions return their memory to the C library only, and
    `malloc_trim` of glibc returns it to the system.
    """
    if resident() <= max(MUCH, GROWTH * _dropped[0]):
        return
    jax.clear_caches()
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
    _dropped[0] = resident()


def line_of(peaks):
    """Return a line with the peaks of all processes, and with the bound if one exceeds it; "" if unknown."""
    if not any(peaks):
        return ""
    text = f"peak memory: {', '.join(f'{size / GB:.2f}' for size in peaks)} GB"
    return f"{text}; must be at most {MOST / GB:g} GB in the ordinary run" if max(peaks) > MOST else text
