"""A Prony solid in series with a spring, against k f / (k + f) itself in 60 digits."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from rubberfric.series import in_series


def exact(rest, weight, tau, spring, s):
    """k f(s) / (k + f(s)) for real s."""
    with mp.workdps(60):
        s, spring = mp.mpf(s), mp.mpf(spring)
        terms = (mp.mpf(w) * s * mp.mpf(t) / (1 + s * mp.mpf(t)) for w, t in zip(weight, tau, strict=True))
        f = mp.mpf(rest) + sum(terms)
        return spring * f / (spring + f)


def draw(rng):
    """Moduli over four decades, times over four to forty, springs 1e-12 ... 1e12; zero and equal terms."""
    span = rng.choice([4, 12, 25, 40])
    tau = 10 ** rng.uniform(-span / 2, span / 2, 5)
    weight = 10 ** rng.uniform(-4, 0, 5)
    rest = 10 ** rng.uniform(-8, 0) if rng.random() < 0.8 else 0.0
    if rng.random() < 0.3:
        weight[2] = 0.0
    if rng.random() < 0.3:
        tau[3] = tau[1]
    if rng.random() < 0.2:
        tau[3] = tau[1] * (1 + 1e-6)
    return rest, weight, tau, 10 ** rng.uniform(-12, 12)


@jax.jit
def at(rest, weight, tau, spring, s):
    """The series solid at s."""
    rest, weight, tau = in_series(rest, weight, tau, spring)
    return rest + jnp.sum(weight * (s * tau / (1 + s * tau)))


@pytest.mark.parametrize(("dtype", "tolerance"), [(jnp.float64, 1e-14), (jnp.float32, 2e-6)])
def test_values(dtype, tolerance):
    rng = np.random.default_rng(0)
    for _ in range(100):
        arguments = [jnp.asarray(x, dtype) for x in draw(rng)]
        given = [np.asarray(x, float).tolist() for x in arguments]
        for s in np.float32([1e-3, 1.0, 1e5]):
            found = float(at(*arguments, jnp.asarray(s, dtype)))
            assert found == pytest.approx(float(exact(*given, float(s))), rel=tolerance), given


@pytest.mark.parametrize("hard", [0.3, 1e6])
@pytest.mark.parametrize("apart", [1.0, 1 + 1e-6, 2.0])
def test_derivatives_with_respect_to_every_number(hard, apart):
    """Equal times, of which each has a derivative of its own, and a term of no weight."""
    rest, weight, tau = 0.02, np.array([0.1, 0.4, 0.0, 0.2]), np.array([3.0, 1e-2, 1e-4, apart * 1e-2])
    s = 40.0
    slopes = jax.grad(at, (0, 1, 2, 3))(rest, weight, tau, hard, s)
    found = np.concatenate([np.ravel(x) for x in slopes])
    flat = np.concatenate([[rest], weight, tau, [hard]])

    def moved(i, step):
        values = [mp.mpf(x) for x in flat]
        values[i] += step
        return exact(values[0], values[1:5], values[5:9], values[9], s)

    with mp.workdps(60):
        step = mp.mpf(10) ** -25
        expected = [float((moved(i, step) - moved(i, -step)) / (2 * step)) for i in range(flat.size)]
    scale = np.where(flat > 0, flat, 0.1)
    np.testing.assert_allclose(scale * found, scale * expected, rtol=1e-8, atol=1e-13)


def test_no_stiffness_at_all():
    for spring, weight in ((0.0, [0.3, 0.1]), (1.0, [0.0, 0.0])):
        value = at(0.0, np.array(weight), np.array([1.0, 1e-3]), spring, 1.0)
        assert 0 <= value < 1e-25
        slopes = jax.grad(at, (0, 1, 2, 3))(0.0, np.array(weight), np.array([1.0, 1e-3]), spring, 1.0)
        assert all(np.isfinite(x).all() for x in slopes)
