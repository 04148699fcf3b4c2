"""Two stiffnesses in series against 150 digits."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from rubberfric.materials.in_series import in_series

SIZES = [1e-30, 1e-12, 1.0, 3.0, 1e12, 1e30]
LOSSES = [0.0, 1e-12, 0.3, 1e6]


def pairs():
    solids = [complex(size, size * loss) for size in SIZES for loss in LOSSES]
    return [(a, b) for a in solids for b in solids]


def test_both_parts_keep_all_digits():
    a, b = (np.array(x) for x in zip(*pairs(), strict=True))
    found = np.asarray(jax.jit(in_series)(a, b))
    with mp.workdps(150):
        exact = np.array([complex(mp.mpc(x) * mp.mpc(y) / (mp.mpc(x) + mp.mpc(y))) for x, y in pairs()])
    np.testing.assert_allclose(found.real, exact.real, rtol=1e-14)
    np.testing.assert_allclose(found.imag, exact.imag, rtol=1e-14)


def test_real_and_complex():
    assert not np.iscomplexobj(in_series(jnp.ones(2), jnp.full(2, 3.0)))
    np.testing.assert_allclose(in_series(jnp.ones(2), jnp.full(2, 3.0)), 0.75, rtol=1e-15)
    np.testing.assert_allclose(in_series(jnp.ones(()), 1.0 + 0.0j), 0.5, rtol=1e-15)
    for nothing in (0.0, 0.0j):
        assert in_series(jnp.asarray(nothing), jnp.asarray(2.0)) == 0
        assert in_series(jnp.asarray(nothing), jnp.asarray(0.0)) == 0


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_derivatives(mode):
    """d F = (F/a)^2 da + (F/b)^2 db, also where a solid is a liquid at rest."""

    def parts(x):
        F = in_series(jax.lax.complex(x[0], x[1]), x[2])
        return jnp.stack([F.real, F.imag])

    for a, b in ((2.0 + 1e-9j, 1e-12), (1e-20 + 3e-15j, 5.0), (1.0 + 2.0j, 0.0)):
        found = jax.jit(mode(parts))(jnp.array([a.real, a.imag, b]))
        by_a, by_b = (b / (a + b)) ** 2, (a / (a + b)) ** 2
        exact = np.array([[by_a.real, -by_a.imag, by_b.real], [by_a.imag, by_a.real, by_b.imag]])
        np.testing.assert_allclose(found, exact, rtol=1e-12, atol=1e-14 * abs(by_b))
    at_rest = jax.jit(mode(lambda x: in_series(x[0], x[1])))(jnp.zeros(2))
    assert np.isfinite(at_rest).all()


def test_single_precision():
    a, b = np.float32([1e-18, 1.0, 1e18]), np.float32([1e18, 1e-9, 1e18])
    found = in_series(jnp.asarray(a), jnp.asarray(b))
    assert found.dtype == jnp.float32
    np.testing.assert_allclose(found, 1 / (1 / a.astype(float) + 1 / b.astype(float)), rtol=1e-6)
