"""Count the compilations of a test."""

import contextlib

import jax


@contextlib.contextmanager
def compilations():
    """List of the functions compiled in the block, by name.

    It begins without compiled functions. JAX keeps the last few thousand that it traced, and a
    process that has run hundreds of tests drops old ones at any moment, one in use included: JAX
    calls that by another road, so that its cache holds it for long unused.
    """
    compiled = []

    def listen(event, *_, fun_name=None, **__):
        if event == "/jax/core/compile/backend_compile_duration":
            compiled.append(fun_name)

    jax.clear_caches()
    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        yield compiled
    finally:
        jax.monitoring.clear_event_listeners()
