"""Joined and resampled spectra, compared with independent interpolation and integrals."""

import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate

import rubberfric as rf

ROAD = rf.SelfAffine(100.0, 1000.0, 1e6, 0.8, 5e-4)
LOW = rf.TabulatedSpectrum([1e2, 1e3, 1e4], [1e-12, 1e-12, 1e-16])
HIGH = rf.TabulatedSpectrum([2e3, 2e4, 1e6], [4e-14, 4e-17, 1e-23])


def log_C(table, q):
    return np.interp(np.log(q), np.log(table.q), np.log(table.C))


def cut(spectrum, low, high, per_decade=20):
    return rf.roughness.resample(
        spectrum, np.geomspace(low, high, int(per_decade * np.log10(high / low)) + 1)
    )


@pytest.mark.parametrize("method", [pytest.param("crossover", marks=pytest.mark.slow), "mean"])
def test_pieces_of_one_surface_join_to_it(method):
    first, second = cut(ROAD, 100.0, 3e4), cut(ROAD, 5e3, 1e6)
    found = rf.roughness.join_spectra(first, second, method=method)
    q = np.asarray(found.spectrum.q)
    assert (np.diff(q) > 0).all() and q.size == 97
    np.testing.assert_allclose(found.spectrum.C[1:-1], rf.power_spectrum(ROAD, q[1:-1]), rtol=1e-11)
    (joint,) = found.joints
    assert (joint.low, joint.high, joint.overlap) == (5e3, pytest.approx(3e4), True)
    assert abs(joint.jump) < 1e-11 and joint.scatter < 1e-11
    assert found.report().startswith("overlap 5000 ... 3e+04 1/m: the upper spectrum is 1 times the lower")


def test_crossover_and_jump():
    found = rf.roughness.join_spectra(LOW, HIGH)
    np.testing.assert_allclose(found.spectrum.q, [1e2, 1e3, 2e3, 1e4, 2e4, 1e6])
    q = np.array([1e2, 1e3, 2e3, 1e4, 2e4, 1e6])
    expected = np.where(q <= 2e3, log_C(LOW, q), log_C(HIGH, q))
    np.testing.assert_allclose(np.log(found.spectrum.C), expected, rtol=1e-13)
    # The difference is a straight line over the overlap, whose mean and rms are closed.
    ends = np.array([log_C(HIGH, x) - log_C(LOW, x) for x in (2e3, 1e4)])
    assert found.joints[0].jump == pytest.approx(ends.mean(), rel=1e-12)
    assert found.joints[0].scatter == pytest.approx(abs(ends[1] - ends[0]) / np.sqrt(12), rel=1e-12)
    # halfway, both have the same share
    middle = np.sqrt(2e3 * 1e4)
    finer = rf.TabulatedSpectrum(
        [2e3, middle, 2e4, 1e6], np.exp(log_C(HIGH, np.array([2e3, middle, 2e4, 1e6])))
    )
    found = rf.roughness.join_spectra(LOW, finer).spectrum
    halfway = (log_C(LOW, middle) + log_C(HIGH, middle)) / 2
    assert float(log_C(found, middle)) == pytest.approx(halfway, rel=1e-12)
    quarter = 2e3 * 5**0.25
    finer = rf.TabulatedSpectrum([2e3, quarter, 1e6], np.exp(log_C(HIGH, np.array([2e3, quarter, 1e6]))))
    share = 0.25**2 * 2.5
    expected = (1 - share) * log_C(LOW, quarter) + share * log_C(finer, quarter)
    assert float(log_C(rf.roughness.join_spectra(LOW, finer).spectrum, quarter)) == pytest.approx(
        expected, rel=1e-12
    )


def test_weighted_mean():
    found = rf.roughness.join_spectra(LOW, HIGH, method="mean", weights=(3, 1)).spectrum
    q = np.array([2e3, 1e4])
    np.testing.assert_allclose(log_C(found, q), 0.75 * log_C(LOW, q) + 0.25 * log_C(HIGH, q), rtol=1e-12)


def test_gap_is_bridged_and_its_jump_said():
    first, second = cut(ROAD, 100.0, 5e3), cut(rf.SelfAffine(100.0, 1000.0, 1e6, 0.8, 1e-3), 2e4, 1e6)
    found = rf.roughness.join_spectra(first, second)
    (joint,) = found.joints
    assert (joint.overlap, joint.low, joint.high) == (False, pytest.approx(5e3), pytest.approx(2e4))
    assert joint.jump == pytest.approx(np.log(4), rel=1e-9)
    ends = np.log([first.C[-1], second.C[0]])
    np.testing.assert_allclose(np.log(rf.power_spectrum(found.spectrum, 1e4)), ends.mean(), rtol=1e-12)
    assert "gap 5000 ... 2e+04 1/m: the upper spectrum is 4 times the lower" in found.report()
    # ends that touch, and two entries only
    touching = rf.roughness.join_spectra(LOW, rf.TabulatedSpectrum([1.2e4, 1e6], [1e-16, 1e-23]))
    assert touching.spectrum.q.size == 5


@pytest.mark.slow
def test_three_spectra_and_a_formula():
    parts = [cut(ROAD, a, b) for a, b in ((100.0, 2e3), (1e3, 3e4))]
    found = rf.roughness.join_spectra(*parts, ROAD.__class__.from_C0(1.5e4, 2e4, 1e6, 0.8, 1e-18))
    assert len(found.joints) == 2 and float(found.spectrum.q[-1]) == pytest.approx(1e6)


@pytest.mark.slow
def test_gradient_in_C():
    def log_moment(C):
        joined = rf.roughness.join_spectra(rf.TabulatedSpectrum(LOW.q, C), HIGH)
        return jnp.log(rf.roughness.moment(joined.spectrum, 0))

    value = jax.grad(log_moment)(LOW.C) * LOW.C
    for i in range(3):
        up, down = (float(log_moment(LOW.C.at[i].multiply(np.exp(s)))) for s in (1e-5, -1e-5))
        assert value[i] == pytest.approx((up - down) / 2e-5, rel=1e-6, abs=1e-9)


def scattered():
    q = np.geomspace(100.0, 1e6, 81)
    noise = np.exp(0.4 * np.random.default_rng(0).standard_normal(81))
    return rf.TabulatedSpectrum(q, 1e-13 * np.minimum(1, (q / 1000) ** -3.6) * noise)


SCATTERED = scattered()


def test_resampling_is_the_line_between():
    q = np.array([120.0, 130.0, 5e3, 9e5])
    np.testing.assert_allclose(np.log(rf.roughness.resample(SCATTERED, q).C), log_C(SCATTERED, q), rtol=1e-12)
    same = rf.roughness.resample(SCATTERED, SCATTERED.q)
    np.testing.assert_allclose(same.C, SCATTERED.C, rtol=1e-12)
    assert rf.roughness.resample(SCATTERED, per_decade=7).q.size == 29


def test_how_well_height_and_slope_are_kept():
    spectrum = rf.SelfAffine(100.0, 1100.0, 1e6, 0.8, 5e-4)
    plain = rf.roughness.resample(spectrum, per_decade=10)
    assert abs(np.sqrt(rf.roughness.moment(plain, 0)) / 5e-4 - 1) < 1e-2
    assert abs(rf.rms_slope(plain) / rf.rms_slope(spectrum) - 1) < 4e-4


@pytest.mark.parametrize("per_decade", [1, 10])
@pytest.mark.parametrize("spectrum", [ROAD, SCATTERED], ids=["self-affine", "scattered"])
@pytest.mark.slow
def test_moments_are_preserved(spectrum, per_decade):
    table = rf.roughness.resample(spectrum, per_decade=per_decade, preserve=True)
    for order in (0, 2):
        np.testing.assert_allclose(
            rf.roughness.moment(table, order), rf.roughness.moment(spectrum, order), rtol=1e-12
        )


@pytest.mark.slow
def test_moments_of_a_part_are_preserved():
    """Moments between the first and the last new wavevector, by scipy."""
    q = np.geomspace(150.0, 4e5, 12)
    table = rf.roughness.resample(SCATTERED, q, preserve=True)
    knots = np.log(np.asarray(SCATTERED.q))
    values = np.log(np.asarray(SCATTERED.C))
    ends = np.log(q[[0, -1]])
    borders = np.concatenate([ends[:1], knots[(knots > ends[0]) & (knots < ends[1])], ends[1:]])
    for order in (0, 2):

        def f(t, order=order):
            return 2 * np.pi * np.exp((2 + order) * t + np.interp(t, knots, values))

        parts = [
            scipy.integrate.quad(f, a, b, epsabs=0, epsrel=1e-11)[0] for a, b in itertools.pairwise(borders)
        ]
        np.testing.assert_allclose(rf.roughness.moment(table, order), sum(parts), rtol=1e-10)


join = rf.roughness.join_spectra
resample = rf.roughness.resample


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: join(LOW), "join_spectra got 1 spectra: must be at least two"),
        (lambda: join(HIGH, LOW), "spectrum 1 covers 100 ... 10000 1/m and spectrum 0 covers 2000 ..."),
        (lambda: join(LOW, HIGH, method="max"), "method = 'max': must be one of crossover, mean"),
        (lambda: join(LOW, HIGH, weights=(1, -1)), "weights = [1.0, -1.0]: must be two numbers >= 0"),
        (lambda: join(LOW, rf.SelfAffine(1e3, 1e3, 1e6, 0.8, 0.0)), "spectrum 1 is zero: must be rough"),
        (lambda: resample(LOW), "pass exactly one of q and per_decade"),
        (lambda: resample(LOW, [50.0, 1e3]), "q = 50 ... 1000: must be within the spectrum's 100 ... 10000"),
        (lambda: resample(LOW, [1e3, 500.0]), "must be at least two wavevectors, strictly increasing"),
        (lambda: resample(LOW, per_decade=-1), "per_decade = -1: must be a number > 0"),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        call()
    assert "\n" not in str(error.value)
