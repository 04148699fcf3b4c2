"""Means of several runs, and the coverage of their intervals, which is 68.3 %."""

import math

import mpmath
import numpy as np
import pytest
from support.exports import put

import fitting
from fitting.data.averages import student_factor


def runs_of(mu, **conditions):
    at = {"velocity": [0.1], "pressure": 2e5} | conditions
    return [fitting.FrictionData(friction=[value], **at) for value in mu]


def test_the_factor_is_a_quantile_of_student():
    """The integral of the density between plus and minus the factor is the probability of one sigma."""
    with mpmath.workdps(20):
        for n in (1, 2, 5, 40):
            norm = (
                mpmath.gamma((n + 1) / mpmath.mpf(2))
                / mpmath.gamma(n / mpmath.mpf(2))
                / mpmath.sqrt(n * mpmath.pi)
            )
            t = student_factor(n)
            inside = 2 * norm * mpmath.quad(lambda x, n=n: (1 + x**2 / n) ** (-(n + 1) / 2), [0, t])
            assert float(inside) == pytest.approx(math.erf(math.sqrt(0.5)), rel=1e-10)
    assert [round(student_factor(n - 1), 2) for n in (2, 3, 4, 10)] == [1.84, 1.32, 1.2, 1.06]


def test_one_condition():
    """Mean 0.83; squared deviations 9, 1 and 16 times 1e-4, so that s^2 = 13e-4."""
    data = fitting.average(runs_of([0.80, 0.82, 0.87]), pooled=False)
    np.testing.assert_allclose(data.friction, [0.83], rtol=1e-14)
    np.testing.assert_allclose(data.sigma, [1.3213 * math.sqrt(13e-4 / 3)], rtol=1e-4)
    assert data.history == (
        "mean of 3 runs at 1 condition; sigma = t x scatter / sqrt(runs) of each condition, t = 1.321",
    )
    pooled = fitting.average(runs_of([0.80, 0.82, 0.87]))
    np.testing.assert_allclose(pooled.relative * 0.83, data.sigma, rtol=1e-14)
    assert "scatter of a run 4.34 %, pooled, degrees of freedom: 2; relative = 1.321 x" in pooled.history[0]


@pytest.mark.parametrize("pooled", [True, False])
def test_intervals_contain_the_truth(pooled):
    """3000 measurements of two conditions with three runs each, with 5 % of noise."""
    rng, inside = np.random.default_rng(3), 0
    for _ in range(1500):
        mu = 0.8 * (1 + 0.05 * rng.normal(size=6))
        run = fitting.FrictionData([0.1, 1.0] * 3, mu, pressure=2e5, sigma=1.0)
        data = fitting.average(run, pooled=pooled)
        error = data.relative * data.friction if pooled else data.sigma
        inside += np.count_nonzero(np.abs(data.friction - 0.8) < error)
    assert inside / 3000 == pytest.approx(0.683, abs=0.025)


def test_conditions_are_told_apart():
    """Velocities within 5 %, pressures within 5 % and temperatures within 2 K are one condition."""
    v = np.array([0.1, 0.102, 0.101, 1.0, 0.98, 0.1, 0.1, 0.1])
    p = np.array([2, 2, 2.05, 2, 2, 4, 2, 2]) * 1e5
    T = np.array([293, 294, 293, 293, 293, 293, 313, 314.0])
    mu = np.array([0.7, 0.8, 0.9, 0.5, 0.7, 0.4, 0.3, 0.5])
    data = fitting.average(fitting.FrictionData(v, mu, pressure=p, temperature=T))
    np.testing.assert_allclose(data.velocity, [0.101, 0.1, 0.1, 0.99], rtol=1e-14)
    np.testing.assert_allclose(data.friction, [0.8, 0.4, 0.4, 0.6], rtol=1e-14)
    np.testing.assert_allclose(data.temperature, [880 / 3, 313.5, 293, 293], rtol=1e-14)
    # Pooled: (1/8)^2 + 0 + (1/8)^2, twice (1/4)^2 and twice (1/6)^2 with four degrees of freedom.
    scatter = math.sqrt((2 / 64 + 2 / 16 + 2 / 36) / 4)
    np.testing.assert_allclose(data.relative * np.sqrt([3, 2, 1, 2]), student_factor(4) * scatter, rtol=1e-12)
    assert "mean of 1 to 3 runs at 4 conditions" in data.history[0]


def test_the_history_of_all_runs_is_kept():
    runs = [{"v [mm/s]": [5], "Fn [N]": [100], "Ft [N]": [force]} for force in (80, 82, 87)]
    data = fitting.average([fitting.read(run, area=4e-4) for run in runs])
    np.testing.assert_allclose(data.friction, [0.83], rtol=1e-14)
    assert data.history[:2] == ("mu = |F_t| / |F_n|", "p = |F_n| / area, area = 0.0004")


def test_repeated_rows_of_a_table(tmp_path):
    text = "v [mm/s];µ, run 1;µ, run 2;µ, run 3\n5;0.80;0.82;0.87\n50;0.90;0.91;0.95\n"
    data = fitting.read(put(tmp_path, text), pressure=2e5, average=True)
    np.testing.assert_allclose(data.friction, [0.83, 0.92], rtol=1e-14)
    scatter = math.sqrt((26e-4 / 0.83**2 + 14e-4 / 0.92**2) / 4)
    np.testing.assert_allclose(data.relative, student_factor(4) * scatter / math.sqrt(3), rtol=1e-12)


def test_sections_of_records_are_averaged():
    """Rows of a record are no runs: the errors are unknown, because each velocity was measured once."""
    i = np.arange(100)
    mu = 0.8 + 0.01 * (-1) ** i
    steps = {"t [s]": 0.1 * i, "v [mm/s]": np.where(i < 50, 10, 20), "mu [-]": mu, "p [bar]": 2}
    data = fitting.read(steps, average=True)
    np.testing.assert_allclose([data.velocity, data.friction], [[0.01, 0.02], [0.8, 0.8]], rtol=1e-12)
    assert data.relative is None and data.sigma is None
    assert data.history[-1] == "mean of 1 run at 2 conditions; no scatter, errors are unknown"


def test_errors_of_single_runs_are_kept():
    """Such as the hysteresis of one cycle at each velocity."""
    run = {"v [mm/s]": [5, -5, 50, -50], "Fn [N]": [100] * 4, "Ft [N]": [82, -78, 93, -87]}
    data = fitting.read(run, area=4e-4, fold=True, average=True)
    np.testing.assert_allclose([data.friction, data.velocity], [[0.8, 0.9], [5e-3, 5e-2]], rtol=1e-14)
    # Offsets 2 and 3 % of the load: scatter 1 / sqrt(2) %, times 1.8371.
    np.testing.assert_allclose(data.sigma, 1.8371e-2 / np.sqrt(2), rtol=1e-3)
    assert data.history[-1] == "mean of 1 run at 2 conditions; no scatter, errors of the runs are kept"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fitting.average([]), r"^runs = \[\]: must be FrictionData, or a list of them$"),
        (lambda: fitting.average(3), "^runs = 3: must be FrictionData"),
        (
            lambda: fitting.average(runs_of([0.8]), pooled=False),
            "1 of 1 conditions have one run: must have two",
        ),
        (lambda: fitting.average(runs_of([0.8]), pooled=1), "^pooled = 1: must be True or False$"),
        (lambda: fitting.average(runs_of([0.8]), tolerance=0.0), "^tolerance = 0.0: must be > 0"),
        (
            lambda: fitting.average([*runs_of([0.8]), *runs_of([0.8], temperature=293.0)]),
            "^runs: only some of them have a temperature",
        ),
        (lambda: fitting.average(runs_of([-0.8, 0.7], sigma=0.1)), r"must be > 0.*; pass pooled=False"),
    ],
)
def test_wrong_runs(call, message):
    with pytest.raises(ValueError, match=message):
        call()
