"""Compiler options are the same regardless of the first call."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rubberfric.base import compilation
from rubberfric.base.compilation import quick_jit, quick_options


@pytest.fixture
def asked_for_anew(monkeypatch):
    monkeypatch.delenv("XLA_FLAGS", raising=False)
    compilation._known.cache_clear()
    yield
    compilation._known.cache_clear()


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="options of the compiler for processors")
@pytest.mark.usefixtures("asked_for_anew")
def test_they_are_known_within_a_trace():
    found = []

    def function(x):
        found.append(quick_options())
        return 2 * x

    assert jax.jit(function)(1.0) == 2.0 and found[0] is not None


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="options of the compiler for processors")
@pytest.mark.usefixtures("asked_for_anew")
def test_flags_that_are_set_later_count(monkeypatch):
    """A result is not kept when the environment changes."""
    options = []
    jit = jax.jit

    def seen(function, **named):
        if "compiler_options" in named:
            options.append(named["compiler_options"])
        return jit(function, **named)

    monkeypatch.setattr(jax, "jit", seen)
    twice = quick_jit()(lambda x: 2 * x)
    assert quick_options() is not None and twice(1.0) == 2.0
    monkeypatch.setenv("XLA_FLAGS", "")
    assert quick_options() is None and twice(1.0) == 2.0
    monkeypatch.delenv("XLA_FLAGS")
    assert quick_options() is not None and twice(1.0) == 2.0
    with jax.disable_jit():
        assert quick_options() is None and twice(1.0) == 2.0
    assert [one is None for one in options] == [False, True]  # each compiled once


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="options of the compiler for processors")
@pytest.mark.usefixtures("asked_for_anew")
def test_quick_compilation_joins_the_trace_of_a_caller():
    """jax.jit would refuse options of the compiler there, also for arguments that are constants."""
    assert quick_options() is not None
    cube = quick_jit()(lambda x: x**3)
    assert float(cube(2.0)) == 8.0
    assert float(jax.jit(cube)(2.0)) == 8.0 and float(jax.grad(cube)(2.0)) == 12.0
    assert float(jax.jit(lambda x: x * cube(2.0))(3.0)) == 24.0
    np.testing.assert_array_equal(jax.vmap(cube)(jnp.arange(3.0)), [0.0, 1.0, 8.0])
