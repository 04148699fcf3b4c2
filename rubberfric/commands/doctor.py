"""The command `rubberfric doctor`, which reports versions, devices and a test of the compilation cache."""

import argparse
import importlib.metadata
import importlib.util
import platform
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.compilation import compilation_cache
from rubberfric.base.progress import Progress
from rubberfric.base.release import VERSION, cores

_PACKAGES = ("jax", "jaxlib", "numpy", "scipy", "h5py", "optax", "matplotlib")

# Versions of JAX with known faults, and what to do.
_FAULTS = {"0.10.2": "it computes wrong numbers on processors (jax-ml/jax#39103): pip install 'jax!=0.10.2'"}
_EVENT = "/jax/compilation_cache/cache_hits"


def run_doctor(arguments: argparse.Namespace, show: Progress) -> tuple[str, None]:
    """Run `rubberfric doctor`, and return the text to print and None, because no file is written."""
    show("trying the devices")
    return "\n".join(_lines(arguments)), None


def _lines(arguments: argparse.Namespace) -> Iterator[str]:
    yield f"{'rubberfric':12} {VERSION}"
    yield f"{'python':12} {platform.python_version()}, {platform.platform()}"
    for name in _PACKAGES:
        yield f"{name:12} {_version(name)}"
    yield f"{'cores':12} {cores()}"
    yield f"{'devices':12} {', '.join(f'{d.platform} {d.device_kind}' for d in jax.devices())}"
    exact = jnp.asarray(1.0) + 2.0**-52 > 1
    yield f"{'float64':12} {'yes' if exact else 'no: results have 7 digits'}"
    yield from _about_cache(arguments)
    if (fault := _FAULTS.get(jax.__version__)) is not None:
        yield f"{'FAULT':12} jax {jax.__version__}: {fault}"


def _version(name: str) -> str:
    if importlib.util.find_spec(name) is None:
        return "is not installed"
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "is importable, but not installed"


def _about_cache(arguments: argparse.Namespace) -> Iterator[str]:
    """Compile a function twice, and yield lines about the cache folder and the cache hits."""
    if arguments.no_cache:
        yield f"{'cache':12} not used: --no-cache"
        return
    folder = compilation_cache()
    if folder is None:
        config: Any = jax.config  # whose options checkers do not know
        off = not config.jax_enable_compilation_cache
        why = "JAX_ENABLE_COMPILATION_CACHE is false" if off else "its folder cannot be written to"
        yield f"{'cache':12} not used: {why}"
        return
    size = sum(file.stat().st_size for file in folder.glob("*"))
    yield f"{'cache':12} {size / 1e6:.3g} MB in {folder}"
    first, again = _is_found(), _is_found()
    yield f"{'':12} first compilation: {'hit' if first else 'miss'}; second: {'hit' if again else 'miss'}"
    if not again:
        yield (
            f"{'':12} entries are not found again: jax {jax.__version__} refuses entries of some processors "
            "(jax-ml/jax#38445), or the disk is full"
        )


def _is_found() -> bool:
    """Return True if a test function is loaded from the cache instead of compiled."""
    events: list[str] = []

    def listener(event: str, **_: object) -> None:
        events.append(event)

    jax.clear_caches()
    jax.monitoring.register_event_listener(listener)
    try:
        sums = jax.jit(lambda x: jnp.cumsum(jnp.exp(x)) * 0.5)(np.arange(7.0))
    finally:
        jax.monitoring.unregister_event_listener(listener)
    assert np.isfinite(np.asarray(sums)).all()
    return _EVENT in events
