"""The areal spectrum from lines: broken power laws by quadrature, dense matrices, and random surfaces."""

import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg

import rubberfric as rf
from rubberfric.roughness.periodograms import Sampling, expected_bins

areal = rf.roughness.areal_spectrum

# A plateau, a self-affine range, a steeper one, and an end.
KNOTS = np.array([50.0, 70.0, 110.0, 200.0, 320.0, 500.0, 900.0, 1.3e3, 2e3])
SLOPES = np.array([0.0, 0.0, -3.6, -3.6, -3.6, -4.0, -4.0, -4.0])
TRUTH = 1e-14 * np.exp(np.append(0.0, np.cumsum(SLOPES * np.diff(np.log(KNOTS)))))


def projected(x, end=np.inf):
    """Return 2 int C q / sqrt(q^2 - x^2) dq from x to `end` by quadrature, with q = x cosh u."""
    borders = np.append(KNOTS[np.searchsorted(KNOTS, x * (1 + 1e-12)) :], end)
    borders = np.append(x, borders[borders <= end])

    def integrand(u):
        q = x * np.cosh(u)
        piece = np.clip(np.searchsorted(KNOTS, q, side="right") - 1, 0, SLOPES.size - 1)
        return 2 * q * TRUTH[piece] / TRUTH[0] * (q / KNOTS[piece]) ** SLOPES[piece]

    ends = np.arccosh(np.minimum(borders / x, 1e9))
    return TRUTH[0] * sum(
        scipy.integrate.quad(integrand, a, b, epsabs=0, epsrel=1e-12)[0] for a, b in itertools.pairwise(ends)
    )


def test_a_broken_power_law_is_recovered():
    """C continues, or ends at q1, where C_1D is 0."""
    line = np.array([projected(q) for q in KNOTS])
    found = areal(KNOTS, line, 1e-7)
    np.testing.assert_allclose(found.C, TRUTH, rtol=1e-8)
    assert (found.relative > 0).all() and found.relative.max() < 1e-5
    np.testing.assert_allclose(areal(KNOTS, line).C, TRUTH, rtol=1e-4)
    line = np.array([projected(q, KNOTS[-1]) for q in KNOTS[:-1]])
    found = areal(KNOTS[:-1], line, 1e-7, q1=KNOTS[-1], at=KNOTS)
    np.testing.assert_allclose(found.C[:-1], TRUTH[:-1], rtol=1e-6)


@pytest.mark.slow
def test_derivatives():
    """Both modes, against differences of solutions at the same penalty."""
    line = jnp.array([projected(q) for q in KNOTS])

    def log_C(line, q):
        return jnp.log(areal(q, line, 1e-3).C)

    forward = jax.jit(jax.jacfwd(log_C, (0, 1)))(line, jnp.array(KNOTS))
    reverse = jax.jit(jax.jacrev(log_C, (0, 1)))(line, jnp.array(KNOTS))
    for i, (a, b) in enumerate(zip(forward, reverse, strict=True)):
        np.testing.assert_allclose(a, b, rtol=1e-7, atol=1e-9 * np.abs(a).max())
        step = 1e-6 * np.array([line, KNOTS][i]) * (np.arange(KNOTS.size) == 3)
        up, down = (log_C(line + s * step * (i == 0), KNOTS + s * step * (i == 1)) for s in (1, -1))
        exact = (up - down) / (2 * step[3])
        np.testing.assert_allclose(a[:, 3], exact, rtol=1e-2, atol=1e-2 * np.abs(exact).max())


def test_expected_bins():
    """Against dense matrices of a short profile, with the covariances by quadrature."""
    n, spacing = 16, 1e-4
    q1 = np.pi / spacing

    def C_1D(q):
        return 1e-12 / (1 + (q / 3e3) ** 2)

    distances = spacing * np.arange(n)
    R = [2 * scipy.integrate.quad(C_1D, 0, q1, weight="cos", wvar=x)[0] for x in distances]
    x = np.linspace(-1, 1, n)
    trends = np.linalg.qr(np.stack([np.ones(n), x], 1))[0]
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    change = window[:, None] * (np.eye(n) - trends @ trends.T)
    covariance = change @ scipy.linalg.toeplitz(R) @ change.T
    modes = np.exp(-2j * np.pi * np.outer(np.arange(n), np.arange(n)) / n)
    cell = 2 * np.pi / (n * spacing)
    power = np.diag(modes @ covariance @ modes.conj().T).real / (n**2 * np.mean(window**2) * cell)
    folded = np.where(np.arange(n) > n // 2, n - np.arange(n), np.arange(n))
    groups = [[1], [2], [3, 4], [5, 6, 7, 8]]
    expected = [power[np.isin(folded, group)].mean() for group in groups]
    counts = np.array([np.isin(folded, group).sum() for group in groups])
    found = expected_bins(C_1D, cell, counts, Sampling(window, trends))
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def law(q, q0, qr, q1, hurst):
    """C = 1 on the plateau."""
    return np.where((q >= q0) & (q <= q1), np.maximum(q / qr, 1.0) ** (-2 * (1 + hurst)), 0.0)


def heights(n, q0, qr, q1, hurst, seed):
    """Return a periodic Gaussian surface of n x n points with the spectrum `law`, in units of its modes."""
    q = np.hypot(np.fft.fftfreq(n, 1 / n)[:, None], np.fft.rfftfreq(n, 1 / n))
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((n, n))) * n
    return np.fft.irfft2(noise * np.sqrt(law(q, q0, qr, q1, hurst)), s=(n, n))


def root_moments(q0, qr, q1, hurst):
    """Return the rms height and the rms slope of `law` by the trapezoidal rule."""
    q = np.geomspace(q0, q1, 20001)
    C = law(q, q0, qr, q[-1], hurst)
    return [np.sqrt(2 * np.pi * np.trapezoid(q ** (2 + p) * C, np.log(q))) for p in (0, 2)]


# Points and modes of the surface; profiles are 0.7 of it and contain eleven of the longest waves.
POINTS, LONGEST, SHORTEST = 1024, 16, 512


def errors(hurst, ratio, draws, shortest=SHORTEST):
    """Return the relative errors of rms height and slope of the mean over profiles of every draw."""
    surface = (LONGEST, ratio * LONGEST, shortest, hurst)
    exact, found = root_moments(*surface), []
    for seed in range(draws):
        z = heights(POINTS, *surface, seed)[:720, ::16].T
        spectrum = rf.roughness.spectrum_of_profile(2 * np.pi / POINTS, z)
        result = spectrum.areal()
        assert (result.C > 0).all() and (result.relative > 0).all()
        table = result.table()
        found.append([float(rf.roughness.rms_height(table)), float(rf.rms_slope(table))])
        assert 0 < result.moment_error(0) < 0.2 and 0 < result.moment_error(2) < 0.2
    return np.array(found) / exact - 1


@pytest.mark.parametrize(("hurst", "ratio"), [pytest.param(0.65, 2, marks=pytest.mark.slow), (0.8, 4)])
def test_profiles_of_a_random_surface(hurst, ratio):
    error = np.abs(errors(hurst, ratio, 1))
    assert error[:, 0].max() < 0.03 and error[:, 1].max() < 0.05


def test_profiles_that_a_filter_has_smoothed():
    """Empty bins beyond the filter would otherwise remove the penalty of all kinks."""
    error = np.abs(errors(0.8, 4, 1, shortest=400))
    assert error[:, 0].max() < 0.03 and error[:, 1].max() < 0.05


def test_doubled_heights_have_four_times_the_spectrum():
    z = heights(POINTS, LONGEST, 2 * LONGEST, SHORTEST, 0.8, 3)[:720, ::64].T
    one, two = (rf.roughness.spectrum_of_profile(2 * np.pi / POINTS, a * z) for a in (1.0, 2.0))
    np.testing.assert_allclose(two.areal().C, 4 * np.asarray(one.areal().C), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1, 2, 4])
@pytest.mark.parametrize("hurst", [0.5, 0.65, 0.8, 1.0])
def test_profiles_of_ten_random_surfaces(hurst, ratio):
    """The mean over the draws, and every draw with a plateau; with q_r = q0 the surfaces differ by 2 %."""
    error = errors(hurst, ratio, 10)
    assert abs(error[:, 0].mean()) < 0.01 and np.abs(error[:, 1]).max() < 0.05
    assert ratio == 1 or np.abs(error[:, 0]).max() < 0.03


@pytest.mark.slow
def test_standard_errors_are_the_scatter():
    """The scatter of ln C over 40 draws of chi-squared distributed bins, in units of the stated error."""
    modes = np.maximum(KNOTS / 25, 1.0).repeat(3)
    q = np.geomspace(50.0, 1.9e3, modes.size)
    line = np.array([projected(x) for x in q])
    random = np.random.default_rng(3)
    relative = np.sqrt(scipy.special.polygamma(1, modes))
    exact = np.exp(np.interp(np.log(q), np.log(KNOTS), np.log(TRUTH)))
    pulls = []
    for _ in range(40):
        found = areal(q, line * random.gamma(modes) / modes, relative)
        pulls.append(np.log(found.C / exact) / found.relative)
    pulls = np.array(pulls)
    # Bins of two to four modes do not show the roll-off in every draw.
    pulls = pulls[:, q > 110.0]
    assert 0.5 < np.sqrt(np.mean(pulls**2)) < 1.3 and np.abs(pulls.mean(0)).max() < 1.0


def test_a_factor_is_refused_by_a_warning_at_a_rolloff():
    q = np.geomspace(50.0, 1.9e3, 30)
    line = np.array([projected(x) for x in q])
    with pytest.warns(UserWarning, match=r"hurst = 0\.8: C_1D falls only as q\^-0\..* leave hurst out"):
        rf.roughness.spectrum_from("C_1D", q, line, 0.8)
    rf.roughness.spectrum_from("C_1D", q[15:], line[15:], 0.8)  # beyond the roll-off, without a warning


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: areal([1.0, 2.0], [1.0, 2.0]), "C_1D[-1] = 2: must be below the largest entry"),
        (lambda: areal([1.0], [1.0]), "q has 1 entries: must have at least 2"),
        (lambda: areal([1.0, 2.0], [1.0, -1.0]), "C_1D[1] = -1.0: must be > 0"),
        (lambda: areal([2.0, 1.0], [1.0, 0.5]), "q[1] = 1.0 after 2.0: must increase strictly"),
        (lambda: areal([1.0, 2.0], [1.0, 0.5], 0.0), "relative = 0.0: must be > 0"),
        (lambda: areal([1.0, 2.0], [1.0, 0.5], q1=2.0), "q1 = 2: must be > q[-1] = 2 1/m"),
        (lambda: rf.roughness.spectrum_of_topography(np.eye(9), 1.0).areal(), "areal() is for profiles"),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        call()
    assert "\n" not in str(error.value)


def test_single_precision():
    """In SI, where C would be as small as 1e-30."""
    q = np.geomspace(1e3, 1e7, 25)
    line = 1e-3 * q**-2.6
    found = areal(np.float32(q), np.float32(line), 0.01)
    assert found.C.dtype == np.float32
    np.testing.assert_allclose(found.C, areal(q, line, 0.01).C, rtol=2e-4)
    np.testing.assert_allclose(found.relative, areal(q, line, 0.01).relative, rtol=2e-3)
