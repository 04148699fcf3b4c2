"""A Prony solid in series with a spring, against k f / (k + f) itself in 60 digits."""

import itertools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from rubberfric.materials.solids_in_series import in_series, two_in_series


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
    rest, weight, tau = in_series((rest, weight, tau), spring)
    return rest + jnp.sum(weight * (s * tau / (1 + s * tau)))


slopes_at = jax.jit(jax.grad(at, (0, 1, 2, 3)))


@pytest.mark.parametrize(("dtype", "tolerance"), [(jnp.float64, 1e-14), (jnp.float32, 2e-6)])
def test_values(dtype, tolerance):
    rng = np.random.default_rng(0)
    for _ in range(100):
        arguments = [jnp.asarray(x, dtype) for x in draw(rng)]
        given = [np.asarray(x, float).tolist() for x in arguments]
        for s in np.float32([1e-3, 1.0, 1e5]):
            found = float(at(*arguments, jnp.asarray(s, dtype)))
            assert found == pytest.approx(float(exact(*given, float(s))), rel=tolerance), given


@pytest.mark.parametrize("hard", [0.3, 1e6, 1e19])
@pytest.mark.parametrize("apart", [1.0, 1 + 1e-6, 2.0])
def test_derivatives_with_respect_to_every_number(hard, apart):
    """Equal times with separate derivatives, and a term of zero weight."""
    rest, weight, tau = 0.02, np.array([0.1, 0.4, 0.0, 0.2]), np.array([3.0, 1e-2, 1e-4, apart * 1e-2])
    s = 40.0
    slopes = slopes_at(rest, weight, tau, hard, s)
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
    for spring, weight in ((0.0, [0.3, 0.1, 0.1, 0.2]), (1.0, [0.0] * 4)):
        given = 0.0, np.array(weight), np.array([1.0, 1e-3, 1e-2, 1e-4]), spring, 1.0
        assert 0 <= at(*given) < 1e-25
        assert all(np.isfinite(x).all() for x in slopes_at(*given))


def exact_pair(numbers, s):
    """f g / (f + g) of (rest, weights, times) twice, for real s."""
    parts = []
    for rest, weight, tau in (numbers[:3], numbers[3:]):
        parts.append(rest + sum(w * s * t / (1 + s * t) for w, t in zip(weight, tau, strict=True)))
    return parts[0] * parts[1] / sum(parts)


@jax.jit
def pair_at(rest1, weight1, tau1, rest2, weight2, tau2, s):
    """The series solid of two at s."""
    rest, weight, tau = two_in_series((rest1, weight1, tau1), (rest2, weight2, tau2))
    return rest + jnp.sum(weight * (s * tau / (1 + s * tau)))


slopes_of_pair = jax.jit(jax.grad(pair_at, range(6)))


def draw_pair(rng):
    """Two solids 1e-12 ... 1e12 apart, some of their times equal or nearly so, in one or in both."""
    rest1, weight1, tau1, hard = draw(rng)
    rest2, weight2, tau2, _ = draw(rng)
    weight2, tau2, rest2 = hard * weight2[:4], tau2[:4], hard * rest2
    if rng.random() < 0.4:
        tau2[:3] = tau1[:3]
    if rng.random() < 0.3:
        tau2[3] = tau1[4] * (1 + 1e-12)
    return rest1, weight1, tau1, rest2, weight2, tau2


@pytest.mark.parametrize(("dtype", "tolerance"), [(jnp.float64, 2e-14), (jnp.float32, 2e-6)])
def test_two_relaxing_solids(dtype, tolerance):
    rng = np.random.default_rng(0)
    for _ in range(200):
        numbers = [jnp.asarray(x, dtype) for x in draw_pair(rng)]
        if dtype == jnp.float32 and float(numbers[0]) == float(numbers[3]) == 0:
            continue  # two liquids: refused in single precision
        given = [np.asarray(x, float).tolist() for x in numbers]
        for s in np.float32([1e-3, 1.0, 1e5]):
            with mp.workdps(60):
                wide = [mp.mpf(x) if isinstance(x, float) else [mp.mpf(z) for z in x] for x in given]
                exact = float(exact_pair(wide, mp.mpf(float(s))))
            found = float(pair_at(*numbers, jnp.asarray(s, dtype)))
            assert found == pytest.approx(exact, rel=tolerance), given


@pytest.mark.parametrize("shared", ["none", "one", "all", "three", "near", "twins"])
def test_derivatives_of_two_relaxing_solids(shared):
    """Each of several equal times has a separate derivative."""
    tau1, tau2 = np.array([3.0, 1e-2, 1e-4, 2e-6, 1e-7]), np.array([1.7, 2e-2, 3e-4, 5e-6])
    if shared in ("one", "three"):
        tau2[1] = tau1[1]
    if shared == "three":
        tau1[2] = tau1[1]
    if shared == "near":
        tau2[1] = tau1[1] * (1 + 1e-9)
    if shared == "twins":  # within one solid, both with weights
        tau1[3] = tau1[1]
    if shared == "all":
        tau2[:] = tau1[:4]
    sizes = [np.array(0.02), np.array([0.1, 0.4, 0.0, 0.2, 0.1]), tau1]
    sizes += [np.array(3e-3), np.array([2.0, 0.1, 0.0, 0.3]), tau2]
    flat, splits = np.concatenate([np.ravel(x) for x in sizes]), np.cumsum([np.size(x) for x in sizes])[:-1]
    s = 40.0
    found = np.concatenate([np.ravel(x) for x in slopes_of_pair(*sizes, s)])
    with mp.workdps(60):
        step = mp.mpf(10) ** -25

        def moved(i, by):
            values = [mp.mpf(x) for x in flat]
            values[i] += by
            parts = np.split(np.array(values, object), splits)
            return exact_pair([p[0] if i in (0, 3) else list(p) for i, p in enumerate(parts)], mp.mpf(s))

        exact = [float((moved(i, step) - moved(i, -step)) / (2 * step)) for i in range(flat.size)]
    scale = np.where(flat > 0, flat, 0.1)
    np.testing.assert_allclose(scale * found, scale * exact, rtol=1e-8, atol=1e-12)


SOFT = (0.02, np.array([0.1, 0.4, 0.05, 0.2]), np.array([3.0, 1e-2, 1e-4, 2e-2]))
HARD = (np.array(0.1), np.array([0.3, 0.2]), np.array([1.0, 1e-3]))
STIFF = tuple(map(jnp.asarray, HARD))


def modulus(solid, s):
    """f(s) of (rest, weights, times), in mpmath numbers."""
    rest, weight, tau = solid
    return rest + sum(w * s * t / (1 + s * t) for w, t in zip(weight, tau, strict=True))


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("relaxes", [False, True], ids=["spring", "solid"])
def test_derivatives_by_what_is_far_stiffer(mode, relaxes):
    """(f/(f+k))^2: nothing is left of it if it is a difference of numbers of order f/k."""

    @jax.jit
    @mode
    def slope(stiff, s):
        if relaxes:
            return pair_at(*SOFT, stiff * HARD[0], stiff * HARD[1], HARD[2], s)
        return at(*SOFT, stiff, s)

    for stiff in (1e5, 1e12, 1e20, 1e30):
        for s in (1e-3, 40.0, 1e5):
            with mp.workdps(60):
                soft = modulus(SOFT, mp.mpf(s))
                one = modulus(HARD, mp.mpf(s)) if relaxes else 1
                exact = float(one * (soft / (stiff * one + soft)) ** 2)
            assert slope(stiff, s) == pytest.approx(exact, rel=1e-12, abs=0), (stiff, s)


def loss_of(solid, omega):
    """Im f(i omega)."""
    a = omega * solid[2]
    return jnp.sum(solid[1] * (a / (1 + a * a)))


@pytest.mark.parametrize("relaxes", [False, True], ids=["spring", "solid"])
def test_a_term_of_no_weight_loses_nothing(relaxes):
    """Neither energy nor a derivative, however far its time is from the others."""
    rest, weight, times = SOFT

    @jax.jit
    @jax.value_and_grad
    def loss(weight, times, omega):
        first = jnp.array(rest), weight, times
        series = two_in_series(first, STIFF) if relaxes else in_series(first, jnp.array(7.0))
        return loss_of(series, omega)

    # 1e-2 is one of the others' times, and half another one.
    for tau, omega in itertools.product([1e-20, 1e-9, 1e-2, 1.0, 1e9, 1e20], [1e-25, 1e-3, 10.0, 1e25]):
        value, slopes = loss(np.append(weight, 0.0), np.append(times, tau), omega)
        without, slopes_without = loss(weight, times, omega)
        np.testing.assert_allclose(value, without, rtol=1e-13)
        np.testing.assert_allclose(slopes[:-1], slopes_without, rtol=1e-11)
        with mp.workdps(60):
            s = mp.mpc(0, omega)
            f, g = modulus(SOFT, s), modulus(HARD, s) if relaxes else mp.mpf(7)
            exact = float(((g / (f + g)) ** 2 * s * tau / (1 + s * tau)).imag)
        np.testing.assert_allclose(slopes[-1], exact, rtol=1e-11)


def test_a_solid_of_no_weights():
    """It has a rest alone: the series has the loss of the other, and nothing is 0/0."""
    still, times = jnp.array(0.3), jnp.array([1e-20, 1e20])

    @jax.jit
    @jax.value_and_grad
    def loss(weight, omega):
        return loss_of(two_in_series((still, weight, times), STIFF), omega)

    for omega in (1e-25, 1e-3, 10.0, 1e25):
        value, slopes = loss(jnp.zeros(2), omega)
        with mp.workdps(60):
            s, rest = mp.mpc(0, omega), mp.mpf(0.3)
            g = modulus(HARD, s)
            exact = float((rest * g / (rest + g)).imag)
            by_weight = [float(((g / (rest + g)) ** 2 * s * t / (1 + s * t)).imag) for t in (1e-20, 1e20)]
        np.testing.assert_allclose(value, exact, rtol=1e-13)
        np.testing.assert_allclose(slopes, by_weight, rtol=1e-11)
