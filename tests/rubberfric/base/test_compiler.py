"""Compiler options are the same regardless of the first call."""

import jax
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
