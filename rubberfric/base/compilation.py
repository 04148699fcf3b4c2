"""The persistent compilation cache, and XLA options for functions that are compiled to run once.

The module sets up JAX's cache [https://docs.jax.dev/en/latest/persistent_compilation_cache.html]. Each
version of jaxlib and each processor has a separate folder, because entries of another version or processor
may crash. The total size of the folders is limited. JAX is imported by the first call.
"""

import contextlib
import functools
import hashlib
import os
import platform
import shutil
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from rubberfric.base.atomic import StrPath, as_path

_Given = ParamSpec("_Given")
_Found = TypeVar("_Found")

# Total size in bytes above which the oldest folders are removed. The entries of a fit have some 2 MB.
LARGEST_CACHE = 2**30


def compilation_cache(folder: StrPath | None = None) -> Path | None:
    """Keep compiled functions in a folder, from which other processes load them.

    ::

        import rubberfric as rf

        rf.compilation_cache()  # first, before anything is computed

    An entry serves all calls with the same scene structure, shapes, quadrature, JAX version, XLA flags and
    processor. Loaded functions give bit-identical results. The commands use the cache unless --no-cache is
    given. JAX_ENABLE_COMPILATION_CACHE=false in the environment switches the cache off everywhere.

    Parameters
    ----------
    folder : the cache folder, or None
        None selects JAX_COMPILATION_CACHE_DIR if it is set. Otherwise None selects a folder for this jaxlib
        version and processor in the user's cache folder, which is XDG_CACHE_HOME if set, otherwise ~/.cache,
        ~/Library/Caches on macOS or %LOCALAPPDATA% on Windows. If all such folders together exceed 1 GiB, the
        oldest folders are removed.

    Returns
    -------
    The folder, or None if the cache is not used. The cache is not used if it is switched off, if the folder
    cannot be written to, or if other users may write to the default folder. The last case would be unsafe
    because the entries are executed.

    Notes
    -----
    On processors with AVX-512, jax 0.10 logs two lines for each function that it loads
    (``+prefer-no-gather is not supported``). The lines are harmless because they name preferences of XLA's
    compiler, not instructions [https://github.com/jax-ml/jax/issues/38445]. TF_CPP_MIN_LOG_LEVEL=3 in the
    environment hides the lines, and the commands set this variable. Some versions of JAX compile again
    instead of loading an entry, which `rubberfric doctor` reports.
    If a killed process or a full disk left an entry incomplete, every process compiles it again, and JAX
    warns.
    """
    import jax

    config: Any = jax.config  # its options are unknown to type checkers
    if not config.jax_enable_compilation_cache:
        return None
    chosen = config.jax_compilation_cache_dir if folder is None else as_path(folder)
    place = Path(chosen) if chosen else default_folder()
    try:
        if chosen is None:
            _remove_oldest(place.parent)
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        if chosen is None and not _is_own(place):
            return None
    except OSError:
        return None
    if not os.access(place, os.W_OK):
        return None
    # A curve consists of ten small functions. The default of JAX keeps only functions that compile for a
    # second.
    for name, value in (
        ("jax_persistent_cache_min_compile_time_secs", 0.0),
        ("jax_persistent_cache_min_entry_size_bytes", -1),
    ):
        if name.upper() not in os.environ:
            config.update(name, value)
    config.update("jax_compilation_cache_dir", str(place))
    return place


def default_folder() -> Path:
    """Return the cache folder for this jaxlib version and this processor."""
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
    """Return the machine type and, if the system reports them, the processor's name and instructions."""
    lines = [platform.machine()]
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="utf-8") as file:
        for line in file:
            if not line.strip():  # end of the first core
                break
            if line.startswith(("model name", "flags", "Features")):
                lines.append(line)
    return "".join(lines)


def _is_own(folder: Path) -> bool:
    if not hasattr(os, "getuid"):  # on Windows it lies in the user's profile
        return True
    status = folder.stat()
    return status.st_uid == os.getuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _remove_oldest(root: Path) -> None:
    """Remove the least recently changed folders in `root` until they take at most `LARGEST_CACHE` bytes."""
    folders = [folder for folder in root.glob("*") if folder.is_dir()]
    sizes = {folder: sum(file.stat().st_size for file in folder.glob("*")) for folder in folders}
    for folder in sorted(folders, key=lambda path: path.stat().st_mtime):
        if sum(sizes.values()) <= LARGEST_CACHE:
            return
        shutil.rmtree(folder, ignore_errors=True)  # another process may do the same
        del sizes[folder]


# Halve the compile time at the cost of slower loops: no fusion emitters (XLA's newer code generator for loops
# on CPUs; jax 0.12 has no such option), and LLVM's first optimisation level. XLA documents neither, so each
# is probed before use. With jax 0.10.1, compilation included, the fit of data/tread_on_asphalt_fit.toml takes
# 9.8 s of CPU time instead of 17.3, and `rubberfric run data/tread_on_asphalt.toml` 2.4 s instead of 3.4.
_QUICK = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 1}


def quick_options() -> dict[str, bool | int] | None:
    """Return options for jax.jit that shorten compilation, or None.

    None is returned if XLA knows none of the options, the backend is not the CPU, the user has set XLA_FLAGS,
    or JAX_DISABLE_JIT switches compilation off.
    """
    import jax

    config: Any = jax.config  # its options are unknown to type checkers
    if config.jax_disable_jit or jax.default_backend() != "cpu" or "XLA_FLAGS" in os.environ:
        return None
    return _known() or None


@functools.cache
def _known() -> dict[str, bool | int]:
    """Return those options in `_QUICK` that this version of XLA accepts."""
    import jax
    import jax.numpy as jnp

    accepted = {}
    for name, value in _QUICK.items():
        # Compile ahead of time: the caller may be traced, and a jitted call would join its trace.
        with contextlib.suppress(ValueError, RuntimeError):
            jax.jit(lambda: jnp.zeros(())).lower().compile({name: value})
            accepted[name] = value
    return accepted


def quick_jit(**options: Any) -> Callable[[Callable[_Given, _Found]], Callable[_Given, _Found]]:
    """Return a decorator that applies jax.jit with `options` and with `quick_options`.

    Within another trace, such as that of a caller's jax.jit or jax.grad, the function is compiled with the
    caller, and the options have no effect. They are evaluated at each call. They are not evaluated when the
    function is decorated, because this would start JAX, and because XLA_FLAGS may change later.
    """

    def decorated(function: Callable[_Given, _Found]) -> Callable[_Given, _Found]:
        @functools.cache
        def compiled(is_quick: bool) -> Callable[_Given, _Found]:
            import jax

            return jax.jit(function, compiler_options=quick_options() if is_quick else None, **options)

        @functools.wraps(function)
        def called(*arguments: _Given.args, **named: _Given.kwargs) -> _Found:
            is_quick = quick_options() is not None and not _is_traced(arguments, named)
            return compiled(is_quick)(*arguments, **named)

        return called

    return decorated


def _is_traced(*arguments: Any) -> bool:
    """Return True within a trace, in which jax.jit refuses options of the compiler.

    In jax.jit all new arrays are traced. In jax.grad and jax.vmap without jit only the arguments are.
    """
    import jax

    from rubberfric.base.checks import is_concrete

    return not all(map(is_concrete, (_compiled_zero()(), *jax.tree.leaves(arguments))))


@functools.cache
def _compiled_zero() -> Callable[[], Any]:
    """Return a compiled function of no arguments: its call takes 4 us, and jnp.zeros(()) 50 us."""
    import jax

    return jax.jit(lambda: 0.0)


def exact_products(function: Callable[_Given, _Found]) -> Callable[_Given, _Found]:
    """Return a function whose matrix products do not round float32 factors, as GPUs do by default.

    NVIDIA GPUs otherwise keep 11 bits of the factors. The function also promotes dtypes by JAX's standard
    rules, whatever the user's `jax_numpy_dtype_promotion` is. A derivative rule is traced on its own, so it
    needs this decorator as well.
    """

    @functools.wraps(function)
    def exact(*arguments: _Given.args, **named: _Given.kwargs) -> _Found:
        import jax

        with jax.default_matmul_precision("highest"), jax.numpy_dtype_promotion("standard"):
            return function(*arguments, **named)

    return exact
