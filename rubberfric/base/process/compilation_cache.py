"""Compiled programs that are kept in a folder, for the next process that needs them.

JAX does it [https://docs.jax.dev/en/latest/persistent_compilation_cache.html]; what is added is a folder for
each version of jaxlib and processor, as no other one may run what is in it, and a limit to its size.
"""

import contextlib
import hashlib
import os
import platform
import shutil
import stat
import sys
from pathlib import Path
from typing import Any

from rubberfric.base.atomic import StrPath, as_path

# Bytes of all folders beyond which the oldest are removed; a fit has some 2 MB.
LARGEST = 2**30


def compilation_cache(folder: StrPath | None = None) -> Path | None:
    """Keep what JAX compiles in a folder, and take it from there in another process.

    ::

        import rubberfric as rf

        rf.compilation_cache()  # first, before anything is computed

    A program is found again for the same scene structure, shapes, quadrature, JAX, XLA flags and processor;
    what it computes is the same to the last bit. The commands do this by themselves, unless they are told
    --no-cache; JAX_ENABLE_COMPILATION_CACHE=false in the environment switches it off for all.

    Parameters
    ----------
    folder : where; None: JAX_COMPILATION_CACHE_DIR, or a folder of this version of jaxlib and processor in
        that of the user's caches (XDG_CACHE_HOME, else ~/.cache; ~/Library/Caches, %LOCALAPPDATA%). If
        those of all versions have more than 1 GiB, the oldest are removed.

    Returns
    -------
    The folder, or None if programs cannot be kept: it cannot be written to, or others may write to it, for
    what is in it is run.

    Notes
    -----
    On processors with AVX-512 jax 0.10 logs two lines of the C++ library for each program that it loads
    (``+prefer-no-gather is not supported``), which mean nothing: these are preferences of its compiler, no
    instructions [https://github.com/jax-ml/jax/issues/38445]. TF_CPP_MIN_LOG_LEVEL=3 in the environment hides
    them, as the commands do. Some versions compile again instead: `rubberfric doctor` says whether this one
    does. An entry that a killed process or a full disk left incomplete is compiled again by every process,
    with a warning of JAX.
    """
    import jax

    config: Any = jax.config  # whose options checkers do not know
    if not config.jax_enable_compilation_cache:
        return None
    given = config.jax_compilation_cache_dir if folder is None else as_path(folder)
    place = Path(given) if given else default_folder()
    try:
        if given is None:
            _remove_oldest(place.parent)
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if given is None and not _is_own(place):
            return None
    except OSError:
        return None
    if not os.access(place, os.W_OK):
        return None
    # Programs here are many and small, and compiled quickly; a curve is made of ten.
    for name, value in (
        ("jax_persistent_cache_min_compile_time_secs", 0.0),
        ("jax_persistent_cache_min_entry_size_bytes", -1),
    ):
        if name.upper() not in os.environ:
            config.update(name, value)
    config.update("jax_compilation_cache_dir", str(place))
    return place


def default_folder() -> Path:
    """The folder of this jaxlib and processor, as no other one may run what was compiled for it."""
    from jaxlib.version import __version__ as version

    home = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(home):  # as the XDG specification says
        if sys.platform == "win32":
            home = os.environ.get("LOCALAPPDATA") or "~/AppData/Local"
        else:
            home = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
    digest = hashlib.sha256(_processor().encode()).hexdigest()[:8]
    return Path(home).expanduser() / "rubberfric" / f"jaxlib-{version}-{digest}"


def _processor() -> str:
    """What this processor is, and which instructions it has, as far as the system says."""
    lines = [platform.machine()]
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="utf-8") as file:
        for line in file:
            if not line.strip():  # the first core will do
                break
            if line.startswith(("model name", "flags", "Features")):
                lines.append(line)
    return "".join(lines)


def _is_own(folder: Path) -> bool:
    """Whether nobody else could have put programs there."""
    if not hasattr(os, "getuid"):  # Windows, where it is in the user's profile
        return True
    found = folder.stat()
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _remove_oldest(root: Path) -> None:
    """Remove the folders that were written to the longest ago until all have at most `LARGEST` bytes."""
    folders = [folder for folder in root.glob("*") if folder.is_dir()]
    sizes = {folder: sum(file.stat().st_size for file in folder.glob("*")) for folder in folders}
    for folder in sorted(folders, key=lambda one: one.stat().st_mtime):
        if sum(sizes.values()) <= LARGEST:
            return
        shutil.rmtree(folder, ignore_errors=True)  # another process may do the same
        del sizes[folder]
