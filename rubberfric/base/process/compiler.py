"""Options of XLA for programs that run seldom: they compile in half the time."""

import functools
import os

import jax
import jax.numpy as jnp

# XLA's newer way to write loops for processors takes twice the time to compile, and is no faster here; nor
# are more than the first of LLVM's optimisations.
_QUICK = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 1}


@functools.cache
def quick_options() -> dict[str, bool | int] | None:
    """The options for jax.jit; None where XLA does not know them, or a user has set some."""
    if jax.default_backend() != "cpu" or "XLA_FLAGS" in os.environ:
        return None
    try:
        jax.jit(lambda: jnp.zeros(()), compiler_options=_QUICK)()
    except (ValueError, RuntimeError):
        return None
    return dict(_QUICK)
