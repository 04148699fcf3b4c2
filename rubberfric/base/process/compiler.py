"""Programs that run seldom, for which half the time to compile is worth more than fast loops."""

import functools
import os
from collections.abc import Callable, Sequence
from typing import ParamSpec, TypeVar

import jax
import jax.numpy as jnp

_Given = ParamSpec("_Given")
_Found = TypeVar("_Found")

# XLA's newer way to write loops for processors takes twice the time to compile, and is no faster here; nor
# are more than the first of LLVM's optimisations.
_QUICK = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 1}


@functools.cache
def quick_options() -> dict[str, bool | int] | None:
    """The options for jax.jit; None where XLA does not know them, or a user has set some."""
    if jax.default_backend() != "cpu" or "XLA_FLAGS" in os.environ:
        return None
    try:
        # Compiled ahead of time: what asks may be traced, and a jitted call would become a part of that.
        jax.jit(lambda: jnp.zeros(())).lower().compile(_QUICK)
    except (ValueError, RuntimeError):
        return None
    return dict(_QUICK)


def quick_jit(
    *, static_argnums: Sequence[int] = (), static_argnames: Sequence[str] = ()
) -> Callable[[Callable[_Given, _Found]], Callable[_Given, _Found]]:
    """jax.jit with `quick_options`, for functions that are called by themselves: not within another's trace.

    They are asked for at the first call, as that begins JAX.
    """

    def decorated(function: Callable[_Given, _Found]) -> Callable[_Given, _Found]:
        @functools.cache
        def compiled() -> Callable[_Given, _Found]:
            return jax.jit(
                function,
                static_argnums=static_argnums,
                static_argnames=static_argnames,
                compiler_options=quick_options(),
            )

        @functools.wraps(function)
        def called(*given: _Given.args, **named: _Given.kwargs) -> _Found:
            return compiled()(*given, **named)

        return called

    return decorated
