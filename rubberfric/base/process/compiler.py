"""Programs that run seldom, for which half the time to compile is worth more than fast loops."""

import functools
import os
from collections.abc import Callable, Sequence
from typing import ParamSpec, TypeVar

import jax
import jax.numpy as jnp

_Given = ParamSpec("_Given")
_Found = TypeVar("_Found")

# Without XLA's fusion emitters, its newer way to write loops for processors, and with the first of LLVM's
# optimisations only. XLA documents neither, so both are tried before they are used. Measured with jax 0.10.1,
# everything compiled: the fit of data/tread_on_asphalt_fit.toml takes 9.8 s of CPU time instead of 17.3,
# `rubberfric run data/tread_on_asphalt.toml` 2.4 s instead of 3.4.
_QUICK = {"xla_cpu_use_fusion_emitters": False, "xla_backend_optimization_level": 1}


def quick_options() -> dict[str, bool | int] | None:
    """The options for jax.jit; None where XLA does not know them, or XLA_FLAGS is set to the user's own."""
    if jax.default_backend() != "cpu" or "XLA_FLAGS" in os.environ:
        return None
    return dict(_QUICK) if _are_known() else None


@functools.cache
def _are_known() -> bool:
    """Whether XLA takes the options, which nothing but its version decides."""
    try:
        # Compiled ahead of time: what asks may be traced, and a jitted call would become a part of that.
        jax.jit(lambda: jnp.zeros(())).lower().compile(_QUICK)
    except (ValueError, RuntimeError):
        return False
    return True


def quick_jit(
    *, static_argnums: Sequence[int] = (), static_argnames: Sequence[str] = ()
) -> Callable[[Callable[_Given, _Found]], Callable[_Given, _Found]]:
    """jax.jit with `quick_options`, for functions that are called by themselves: not within another's trace.

    They are asked for at each call: the first begins JAX, and XLA_FLAGS may be set between two.
    """

    def decorated(function: Callable[_Given, _Found]) -> Callable[_Given, _Found]:
        @functools.cache
        def compiled(is_quick: bool) -> Callable[_Given, _Found]:
            return jax.jit(
                function,
                static_argnums=static_argnums,
                static_argnames=static_argnames,
                compiler_options=dict(_QUICK) if is_quick else None,
            )

        @functools.wraps(function)
        def called(*given: _Given.args, **named: _Given.kwargs) -> _Found:
            return compiled(quick_options() is not None)(*given, **named)

        return called

    return decorated
