"""A fit as the prior of the next: two successive fits find the result of one fit to all data."""

import dataclasses

import numpy as np
import pytest
from support.scenes.fits import AFFINE, E_INF, FAST, E, friction_data, linear_data, modulus_data
from support.scenes.fits import THREE as SCENE

import fitting
import rubberfric as rf
from fitting import Bounded, Correlated, FitResult, Free, ModulusData, Positive
from fitting.uncertainty.posterior import joint_prior

RUBBER = SCENE.upper.material
TAU = RUBBER.tau
OMEGA = np.logspace(-1, 6, 24)


def moduli(seed, noise=0.03, **options):
    """DMA data of the rubber."""
    return modulus_data(RUBBER, OMEGA, noise, seed, **options)


FREE = {E: Positive(), E_INF: Bounded(1e5, 1e8)}
ONE = moduli(0)
TWO = moduli(1)


@pytest.fixture(scope="module")
def first():
    return fitting.fit(SCENE, ONE, FREE, quadrature=FAST)


@pytest.mark.slow  # the same holds exactly for a linear problem
def test_two_fits_in_a_row_are_one_fit_of_all(first):
    second = fitting.fit(first.scene, TWO, FREE, prior=first.as_prior(), quadrature=FAST)
    both = fitting.fit(SCENE, [ONE, TWO], FREE, quadrature=FAST)
    # The first posterior differs from a normal distribution by some hundredths of an error.
    np.testing.assert_array_less(np.abs(second.values - both.values), 0.05 * both.stderr)
    np.testing.assert_allclose(second.stderr, both.stderr, rtol=0.03)
    np.testing.assert_allclose(second.correlation, both.correlation, atol=0.03)
    assert "known from another fit, fitted values" in second.report()


def test_of_a_linear_problem_exactly():
    """Free numbers and absolute errors: the posterior is normal, nothing is neglected."""
    free = {E: Free(), E_INF: Free()}
    sets = [linear_data(RUBBER, OMEGA, 0.05, seed) for seed in (3, 4)]
    known = fitting.fit(SCENE, sets[0], free, quadrature=FAST)
    second = fitting.fit(known.scene, sets[1], free, prior=known.as_prior(), quadrature=FAST)
    both = fitting.fit(SCENE, sets, free, quadrature=FAST)
    np.testing.assert_allclose(second.values, both.values, rtol=1e-7)
    np.testing.assert_allclose(second.covariance, both.covariance, rtol=1e-6)


def test_a_bootstrap_draws_the_priors():
    """The scatter is the error bars, which are exact here, and the correlations."""
    free, count = {E: Free(), E_INF: Free()}, 300
    sets = [linear_data(RUBBER, OMEGA, 0.05, seed) for seed in (3, 4)]
    known = fitting.fit(SCENE, sets[0], free, quadrature=FAST)
    second = fitting.fit(known.scene, sets[1], free, prior=known.as_prior(), quadrature=FAST)
    values = second.bootstrap(count).values
    np.testing.assert_allclose(values.std(0, ddof=1), second.stderr, rtol=4 / np.sqrt(2 * count))
    np.testing.assert_allclose(np.corrcoef(values.T), second.correlation, atol=4 / np.sqrt(count))


@pytest.mark.slow
def test_what_the_first_fit_leaves_open_stays_open():
    """Only the ratio of moduli matters to friction at light load: the prior knows it and not the size."""
    v = np.logspace(-4, 1, 12)
    friction = friction_data(SCENE, v, 1e4, error=0.0, relative=0.01)
    free = {E: Positive(), E_INF: Positive()}
    known = fitting.fit(SCENE, friction, free, quadrature=FAST)
    assert known.unidentified
    [prior] = known.as_prior().values()
    assert isinstance(prior, Correlated)
    direction = np.ones(4) / 2
    assert direction @ np.array(prior.covariance) @ direction > 1.0
    stiffer = rf.complex_modulus(rf.Prony(6e6, 2 * RUBBER.E, TAU), np.array([1e-2]))
    value = ModulusData([1e-2], stiffer.real, stiffer.imag, relative=0.02)
    second = fitting.fit(known.scene, value, free, prior=known.as_prior(), quadrature=FAST)
    np.testing.assert_allclose(second.values, [1e8, 1.6e7, 4e6, 6e6], rtol=0.02)


@pytest.mark.slow  # two fits in a row are one fit of all data
def test_from_a_prony_series_to_friction_in_one_line():
    series = fitting.fit_prony(ONE, tau=TAU)
    scene = SCENE.replace(upper=rf.Body(series.material), gamma=0.4)
    v = np.logspace(-4, 0, 6)
    data = friction_data(SCENE, v, error=0.0, relative=0.01)
    free = {E: Positive(), E_INF: Positive(), "lower.spectrum.h_rms": Positive()}
    result = fitting.fit(scene, data, free, prior=series.as_prior("upper"), quadrature=FAST)
    assert result.success and not result.withheld
    # Friction alone cannot tell the moduli, moduli say nothing on the roughness.
    assert np.all(result.stderr[:4] <= series.stderr * 1.01)
    np.testing.assert_allclose(np.log(result.values[:4] / [5e7, 8e6, 2e6, 3e6]), 0, atol=0.1)
    alone = fitting.fit(scene, data, free, quadrature=FAST)
    assert alone.unidentified


def test_widening_and_bodies(first):
    [(key, prior)] = first.as_prior().items()
    assert key == f"{E}, {E_INF}"
    assert prior.places is not None
    np.testing.assert_allclose(prior.places, [*TAU, np.nan])
    np.testing.assert_allclose(prior.mean, first.values, rtol=1e-12)
    assert prior.low == (0.0, 0.0, 0.0, 1e5) and prior.high == (np.inf, np.inf, np.inf, 1e8)
    [(key, wide)] = first.as_prior("lower", widen=3.0).items()
    assert key == "lower.material.E, lower.material.E_inf"
    np.testing.assert_allclose(wide.covariance, 9 * np.array(prior.covariance), rtol=1e-12)
    with pytest.raises(ValueError, match=r"^widen = 0: must be a number > 0$"):
        first.as_prior(widen=0)
    with pytest.raises(ValueError, match=r"^body = 'rubber': must be 'lower', 'upper' or None$"):
        first.as_prior("rubber")
    failed = dataclasses.replace(first, status=3)
    with pytest.raises(ValueError, match="as_prior: the fit did not converge \\(stalled"):
        failed.as_prior()


@pytest.mark.parametrize(
    ("paths", "body", "expected"),
    [
        (["lower.material.E", "gamma"], "upper", "upper.material.E, gamma"),
        (["lower.material.E"], "R20.upper", "R20.upper.material.E"),
        (["R20.lower.material.E", "*.shear.tau_f0"], "lower", "lower.material.E, *.shear.tau_f0"),
        (
            ["R20.lower.material.E", "R40.lower.material.E"],
            None,
            "R20.lower.material.E, R40.lower.material.E",
        ),
        (
            ["R20.lower.material.E", "R40.lower.material.E"],
            "lower",
            "R20.lower and R40.lower, but all must belong to one body",
        ),
        (
            ["lower.spectrum.q1", "upper.material.E"],
            "lower",
            "lower and upper, but all must belong to one body",
        ),
        (["gamma", "shear.c"], "lower", "but all must belong to one body"),
    ],
)
def test_whose_numbers_they_are_there(paths, body, expected):
    n = len(paths)
    mean, limits = np.ones(n), (np.zeros(n), np.full(n, np.inf))
    try:
        [key] = joint_prior(paths, mean, np.eye(n), limits, np.full(n, np.nan), body, 1.0)
    except ValueError as error:
        key = str(error)
    assert key == expected or (key.startswith("body = ") and expected in key)


def test_a_prior_of_another_material_is_refused(first):
    other = SCENE.replace(upper=rf.Body(rf.Prony(3e6, [5e7, 8e6, 2e6], [1e-5, 2e-3, 1e-1])))
    with pytest.raises(ValueError, match=r"had upper\.material\.tau = 0\.001, but has 0\.002"):
        fitting.fit(other, TWO, FREE, prior=first.as_prior())
    shorter = SCENE.replace(upper=rf.Body(rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3])))
    with pytest.raises(ValueError, match=r"names 3 numbers, but the prior has 4"):
        fitting.fit(shorter, TWO, FREE, prior=first.as_prior())
    held = first.scene.replace(upper=rf.Body(rf.Prony(6e6, first.scene.upper.material.E, TAU)))
    with pytest.raises(
        ValueError, match=r"upper\.material\.E_inf is fixed at 6e\+06, but its prior mean is "
    ):
        fitting.fit(held, TWO, {E: Positive()}, prior=first.as_prior())


def test_files_and_jobs(first, tmp_path):
    from fitting.commands.job import read_job

    first.save(tmp_path / "dma.h5")
    second = fitting.fit(first.scene, TWO, FREE, prior=first.as_prior())
    second.save(tmp_path / "second.h5")
    again = FitResult.load(tmp_path / "second.h5")
    [(key, prior)], [(other_key, other)] = again.prior.items(), second.prior.items()
    assert key == other_key and dataclasses.replace(prior, places=None) == dataclasses.replace(
        other, places=None
    )
    np.testing.assert_array_equal(prior.places, other.places)
    assert again.report() == second.report()

    rf.save_scene(tmp_path / "scene.h5", first.scene)
    fitting.write(tmp_path / "two.csv", TWO)
    (tmp_path / "job.toml").write_text(f"""
    scene = "scene.h5"
    [[data]]
    file = "two.csv"
    body = "upper"
    [free]
    "{E}" = "positive"
    "{E_INF}" = {{ rule = "bounded", low = 1e5, high = 1e8 }}
    [prior]
    "{E_INF} + {E}" = {{ high = 1e9, sigma = 0.1 }}
    fit = {{ file = "dma.h5", body = "upper", widen = 1.5 }}
    """)
    job = read_job(tmp_path / "job.toml")
    assert list(job.prior) == [f"{E_INF} + {E}", f"{E}, {E_INF}"]
    np.testing.assert_allclose(
        job.prior[f"{E}, {E_INF}"].covariance,
        next(iter(first.as_prior(widen=1.5).values())).covariance,
        rtol=1e-12,
    )
    text = (tmp_path / "job.toml").read_text()
    for old, new, said in (
        ("dma.h5", "none.h5", "prior.fit: "),
        ("widen = 1.5", "widen = -1", "prior.fit: widen = -1.0: must be a number > 0"),
        ('body = "upper", widen', "bdy = 1, widen", "prior.fit.bdy: unknown key; did you mean 'body'"),
        ("high = 1e9", "high = -1", "must be numbers > 0"),
    ):
        (tmp_path / "job.toml").write_text(text.replace(old, new))
        with pytest.raises(ValueError, match=r"job\.toml: ") as caught:
            read_job(tmp_path / "job.toml")
        assert said in str(caught.value) and "\n" not in str(caught.value)


def test_shifts_of_sweeps_are_known_to_the_next_fit():
    T = np.repeat([273.15, 283.15, 293.15, 303.15], 8)
    shift = rf.WLF(10.0, 120.0, 293.15)
    omega = np.tile(np.logspace(0, 2, 8), 4)
    terms = 10.0 ** (8.3 - 0.35 * np.arange(9)), 10.0 ** -np.arange(6, -3, -1.0)
    E_exact = np.asarray(rf.complex_modulus(rf.Prony(2e6, *terms, shift=shift), omega, T))
    noise = np.exp(0.01 * np.random.default_rng(5).standard_normal((2, 32)))
    sweeps = ModulusData(omega, E_exact.real * noise[0], E_exact.imag * noise[1], temperature=T)
    curve = fitting.fit_master_curve(sweeps)
    [(key, prior)] = curve.as_prior("upper").items()
    if isinstance(curve.shift, rf.WLF):
        assert key == "upper.material.shift.C1, upper.material.shift.C2"
        np.testing.assert_allclose(prior.mean, [curve.shift.C1, curve.shift.C2], rtol=1e-12)
    table = dataclasses.replace(curve, wlf=None, arrhenius=None)
    [(key, prior)] = table.as_prior().items()
    assert key == "lower.material.shift.aT[:2], lower.material.shift.aT[3:]"
    np.testing.assert_allclose(np.sqrt(np.diag(prior.covariance)), np.delete(curve.stderr, 2), rtol=1e-9)
    scene = rf.Scene(rf.Body(rf.Prony(2e6, *terms, shift=curve.table)), rf.Body(rf.Rigid(), AFFINE))
    data = dataclasses.replace(sweeps, relative=0.01, check_units=False)
    result = fitting.fit(scene, data, {"lower.material.shift.aT[:2]": Positive()}, prior=table.as_prior())
    assert result.success and np.all(result.stderr / result.values < curve.stderr[:2])
