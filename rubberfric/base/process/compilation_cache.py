"""Compiled programs that are kept in a folder, for the next process that needs them.

JAX does it [https://docs.jax.dev/en/latest/persistent_compilation_cache.html]; what is added is a folder, and
what makes it safe to have it always on: JAX writes entries in place, so that a process that is killed, or a
full disk, leaves a part of one, which would be complained of for ever after; nor does it remove old ones.
"""

import contextlib
import hashlib
import os
import platform
import stat
import sys
import time
import warnings
import zlib
from pathlib import Path
from typing import Any

from rubberfric.base.atomic import StrPath, as_path

# Bytes of all entries beyond which the oldest are removed, to half of it; a fit has some 2 MB.
LARGEST = 2**30

_ENTRIES = "*-cache"  # as JAX names them
_CHECKED = "checked"  # the file whose time says up to when entries are known to be whole


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
    folder : where; None: JAX_COMPILATION_CACHE_DIR, or a folder of this version and processor in that of the
        user's caches (XDG_CACHE_HOME, else ~/.cache; ~/Library/Caches, %LOCALAPPDATA%), where entries
        beyond 1 GiB are removed.

    Returns
    -------
    The folder, or None if programs cannot be kept: it cannot be written to, or others may write to it, for
    what is in it is run.

    Notes
    -----
    On processors with AVX-512 jax 0.10 logs two lines of the C++ library for each program that it loads
    (``+prefer-no-gather is not supported``), which mean nothing: these are preferences of its compiler, no
    instructions [https://github.com/jax-ml/jax/issues/38445]. They are not shown if this is called before
    JAX is imported; errors are exceptions, and shown. Some versions compile again instead:
    `rubberfric doctor` says whether this one does.
    """
    # 1 is what JAX itself sets it to, and what a program with JAX hands on to those that it starts.
    if "jax" not in sys.modules and os.environ.get("TF_CPP_MIN_LOG_LEVEL", "1") == "1":
        os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"  # fatal errors only
    import jax

    config: Any = jax.config  # whose options checkers do not know
    if not config.jax_enable_compilation_cache:
        return None
    given = config.jax_compilation_cache_dir if folder is None else as_path(folder)
    place = Path(given) if given else default_folder()
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if given is None and not _is_own(place):
            return None
    except OSError:
        return None
    if not os.access(place, os.W_OK):
        return None
    if given is None:
        with contextlib.suppress(OSError):  # another process may do the same
            _remove_parts(place)
            _remove_oldest(place.parent)
    # Programs here are many and small, and compiled quickly; a curve is made of ten.
    for name, value in (
        ("jax_persistent_cache_min_compile_time_secs", 0.0),
        ("jax_persistent_cache_min_entry_size_bytes", -1),
    ):
        if name.upper() not in os.environ:
            config.update(name, value)
    config.update("jax_compilation_cache_dir", str(place))
    # That an entry could not be read or written is no news to a user: it is compiled.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
    return place


def default_folder() -> Path:
    """The folder of this JAX and processor, as no other one may run what was compiled for it."""
    import jax

    home = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(home):  # as the XDG specification says
        if sys.platform == "win32":
            home = os.environ.get("LOCALAPPDATA") or "~/AppData/Local"
        else:
            home = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
    digest = hashlib.sha256(_processor().encode()).hexdigest()[:8]
    return Path(home).expanduser() / "rubberfric" / f"jax-{jax.__version__}-{digest}"


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


def _remove_parts(folder: Path) -> None:
    """Remove entries, of those written since the last time, that were not written to their end."""
    began, checked = time.time(), folder / _CHECKED
    last = checked.stat().st_mtime if checked.exists() else 0.0
    for entry in folder.glob(_ENTRIES):
        if entry.stat().st_mtime < last:
            continue
        content = entry.read_bytes()
        try:
            # Where JAX compresses otherwise, it finds out itself.
            if not content or content[0] == 0x78:
                zlib.decompress(content)
        except zlib.error:
            entry.unlink(missing_ok=True)
    checked.touch()
    os.utime(checked, (began, began))


def _remove_oldest(root: Path) -> None:
    """Remove entries of all versions until half of what may be there is left."""
    entries = [(entry.stat(), entry) for entry in root.glob(f"*/{_ENTRIES}")]
    size = sum(found.st_size for found, _ in entries)
    if size <= LARGEST:
        return
    for found, entry in sorted(entries, key=lambda pair: pair[0].st_mtime):
        entry.unlink(missing_ok=True)
        size -= found.st_size
        if size <= LARGEST // 2:
            return
