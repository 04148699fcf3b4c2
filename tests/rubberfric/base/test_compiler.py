"""Options of the compiler: the same wherever they are asked for first."""

import jax
import pytest

from rubberfric.base.process.compiler import quick_options


@pytest.fixture
def asked_for_anew(monkeypatch):
    monkeypatch.delenv("XLA_FLAGS", raising=False)
    quick_options.cache_clear()
    yield
    quick_options.cache_clear()


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="options of the compiler for processors")
@pytest.mark.usefixtures("asked_for_anew")
def test_they_are_known_within_a_trace():
    found = []

    def function(x):
        found.append(quick_options())
        return 2 * x

    assert jax.jit(function)(1.0) == 2.0 and found[0] is not None
