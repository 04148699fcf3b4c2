"""The next experiment: designs known in closed form, all designs of small problems, and twins."""

import itertools

import numpy as np
import pytest
from numpy.polynomial import legendre
from problems import RIGID, SHIFTED_TREAD, scene

import fitting
import rubberfric as rf
from fitting.uncertainty.information import exchange, gain, information

# --- linear models


def powers(x, degree):
    return np.vander(x, degree + 1, increasing=True)[None]


def chosen(x, index):
    """{point: how often} of a design."""
    return {round(float(x[i]), 9): int(np.sum(index == i)) for i in sorted(set(index.tolist()))}


@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_polynomials_have_their_points_of_guest(degree):
    """D-optimal: the ends and the zeros of P_d', equally often [Guest, Ann. Math. Stat. 29, 294 (1958)]."""
    guest = np.array([-1.0, *np.sort(legendre.legroots(legendre.legder([0] * degree + [1])).real), 1.0])
    x = np.union1d(np.linspace(-1, 1, 201), guest)
    index = exchange(powers(x, degree), 1e-9 * np.eye(degree + 1), 2 * (degree + 1))
    assert chosen(x, index) == {round(float(g), 9) + 0.0: 2 for g in guest}


def test_other_criteria():
    x = np.linspace(-1, 1, 41)
    # A-optimal for a parabola: 1/4, 1/2, 1/4 [Pukelsheim, Optimal Design of Experiments, section 9.13]
    index = exchange(powers(x, 2), 1e-9 * np.eye(3), 8, target=np.eye(3)[None])
    assert chosen(x, index) == {-1.0: 2, 0.0: 4, 1.0: 2}
    # A line extrapolated to x = 2: weights as the moduli of Lagrange's polynomials, 1/2 and 3/2
    f = np.array([1.0, 2.0])
    index = exchange(powers(x, 1), 1e-9 * np.eye(2), 8, target=np.outer(f, f)[None])
    assert chosen(x, index) == {-1.0: 2, 1.0: 6}


def criterion(matrices, target):
    if target is None:
        return np.mean(np.linalg.slogdet(matrices)[1])
    return -np.mean([np.log(np.trace(L @ np.linalg.inv(M))) for L, M in zip(target, matrices, strict=True)])


@pytest.mark.parametrize("seed", range(4))
def test_the_best_of_all_designs_is_found(seed):
    rng = np.random.default_rng(seed)
    rows, base = rng.normal(size=(2, 7, 3)), 0.1 * np.eye(3)
    for target in (None, np.tile(np.diag([1.0, 2.0, 0.5]), (2, 1, 1))):
        index = exchange(rows, base, 4, target=target)
        found = criterion(information(rows, base, index), target)
        every = itertools.combinations_with_replacement(range(7), 4)
        best = max(criterion(information(rows, base, list(one)), target) for one in every)
        assert found == pytest.approx(best, rel=1e-12)
        before = information(rows, base, index[:2])
        after = [
            criterion(information(rows, before[0] * 0 + base, [*index[:2], i]), target) for i in range(7)
        ]
        np.testing.assert_allclose(
            gain(rows, before, target), np.array(after) - criterion(before, target), 1e-9
        )


def test_costs():
    rows = np.ones((1, 3, 1))
    cost = np.array([3.0, 1.0, 2.0])
    assert exchange(rows, np.eye(1), 4.5, cost).tolist() == [1, 1, 1, 1]
    assert exchange(rows * np.array([3.0, 1.0, 1.0])[:, None], np.eye(1), 3.0, cost).tolist() == [0]
    assert exchange(rows, np.eye(1), 0.5, cost).size == 0


# --- scenes

TRUTH = scene((SHIFTED_TREAD,), (RIGID, rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 3e-4)))
FREE = {
    "lower.material.E_inf": fitting.Positive(),
    "lower.material.E": fitting.Positive(),
    "upper.spectrum.h_rms": fitting.Positive(),
    "upper.spectrum.hurst": fitting.Bounded(0.3, 1.0),
}
QUICK = rf.Quadrature(order=8, panels=3)
V = np.logspace(-5, -1, 17)  # [m/s]
T = np.array([278.15, 293.15, 313.15])  # [K]
CANDIDATES = (V[:, None], 2e5, T)
# Faster than measured, at another pressure: superposition must tell.
WANTED = fitting.prediction([0.3, 1.0, 3.0], 3e5, 303.15)
PRIOR = {"lower.material.E_inf": fitting.Gaussian(3e6, 1e6)}


@pytest.fixture(scope="module")
def designed():
    return fitting.design(
        TRUTH, FREE, candidates=CANDIDATES, n=12, criterion=WANTED, prior=PRIOR, quadrature=QUICK
    )


def test_rows_are_derivatives(designed):
    """By differences of the friction."""
    assert designed.names[:2] == ("lower.material.E_inf", "lower.material.E[0]") and len(designed.names) == 6
    v, p, temperature = designed.candidates
    h = 1e-5

    def log_mu(sign):
        moved = TRUTH.replace("upper.spectrum.h_rms", 3e-4 * np.exp(sign * h))
        return np.log(np.asarray(rf.friction(moved, v, p, temperature, quadrature=QUICK)))

    np.testing.assert_allclose(designed.rows[:, 4] * 0.05, (log_mu(1) - log_mu(-1)) / (2 * h), atol=1e-8)
    base = np.eye(6) / 100**2
    base[0, 0] += (3e6 / 1e6) ** 2  # of the prior
    with_all = base + designed.rows[designed.index].T @ designed.rows[designed.index]
    np.testing.assert_allclose(designed.before, np.sqrt(np.diag(np.linalg.inv(base))), rtol=1e-6)
    np.testing.assert_allclose(designed.after, np.sqrt(np.diag(np.linalg.inv(with_all))), rtol=1e-5)
    assert designed.index.size == 12 and designed.predicted[1] < 0.05 < designed.predicted[0]
    np.testing.assert_array_equal(designed.velocity, v[designed.index])


def test_gain_is_the_part_of_the_variance_that_one_measurement_takes():
    """The variance of the wanted predictions, from the inverse of the information with it and without."""
    numbers = {"n": 1, "prior": PRIOR, "draws": 1, "quadrature": QUICK}
    found = fitting.design(TRUTH, FREE, candidates=CANDIDATES, criterion=WANTED, **numbers)
    wanted = fitting.design(TRUTH, FREE, candidates=([0.3, 1.0, 3.0], 3e5, 303.15), **numbers).rows
    base = np.eye(6) / 100**2
    base[0, 0] += (3e6 / 1e6) ** 2  # of the prior

    def variance(information):
        return np.trace(wanted @ np.linalg.inv(information) @ wanted.T)

    part = [1 - variance(base + np.outer(row, row)) / variance(base) for row in found.rows]
    np.testing.assert_allclose(found.gain, part, rtol=1e-6, atol=1e-9)


def test_gain_in_the_variance_of_the_numbers():
    """A number at its bound counts with the variance of x, not of x / stretch."""
    rubber, omega = TRUTH.lower.material, np.logspace(0, 6, 12)
    E = rf.complex_modulus(rubber, omega)
    data = fitting.ModulusData(omega, E.real, E.imag, relative=0.05)
    free = {"lower.material.E_inf": fitting.Bounded(2 * float(rubber.E_inf), 1e8, start=1e7)}
    fit = fitting.fit(TRUTH, data, free | {"lower.material.E": fitting.Positive()}, quadrature=QUICK)
    assert list(fit.uncertainty.withheld) == ["lower.material.E_inf"]
    found = fitting.design(fit, candidates=CANDIDATES, criterion="A", n=1)
    part = 1 - np.sum(found.after**2) / np.sum(found.before**2)
    assert found.gain[found.index[0]] == pytest.approx(part, rel=1e-6)


def test_measurements_that_will_be_made_anyway_count(designed):
    free = {"quadrature": QUICK, "prior": PRIOR, "criterion": WANTED}
    later = fitting.design(TRUTH, FREE, candidates=CANDIDATES, n=3, already=designed, **free)
    assert later.predicted[0] == pytest.approx(designed.predicted[1], rel=1e-6)
    assert later.predicted[1] < later.predicted[0]


def off(rng, size=0.3):
    """The truth with every free number off by 30 %, up or down."""
    moved = TRUTH
    for path in ("lower.material.E_inf", "lower.material.E", "upper.spectrum.h_rms"):
        owner, name = path.rsplit(".", 1)
        value = np.asarray(getattr(_at(moved, owner), name))
        moved = moved.replace(path, value * np.exp(size * rng.choice([-1.0, 1.0], value.shape)))
    return moved


def _at(part, path):
    for name in path.split("."):
        part = getattr(part, name)
    return part


def log_uniform(rng, count):
    """Measurements where one would make them without a design."""
    return 10.0 ** rng.uniform(-5, -1, count), np.full(count, 2e5), rng.choice(T, count)


def test_report_picture_and_file(designed, tmp_path):
    text = designed.report()
    assert "Design of 12 measurements (prediction), most useful first" in text
    assert (
        "v = " in text
        and "°C" in text
        and "lower.material.E[2]" in text
        and "error of the prediction" in text
    )
    axes = designed.plot()
    assert (
        axes[0].get_ylabel() == "temperature [°C]"
        and "part of the variance" in axes[0].figure.axes[-1].get_ylabel()
    )
    rf.plot.save_figure(tmp_path / "design.png", rf.plot.auto(designed))
    designed.write(tmp_path / "next.csv")
    back = rf.io.read_columns(tmp_path / "next.csv")
    np.testing.assert_array_equal(back["v"], designed.velocity)
    np.testing.assert_array_equal(back["T"], designed.temperature)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"criterion": "E"}, "criterion = 'E': must be 'D', 'A' or fitting.prediction"),
        ({"candidates": V}, "candidates: must be .velocity, pressure. or"),
        ({"candidates": (-V, 1e5)}, r"candidates: velocity\[0\] = -.*: must be > 0"),
        ({"candidates": (V, [1e5, 2e5])}, "candidates: shapes .* must broadcast"),
        ({"n": 0}, "n = 0: must be >= 1, the cost of the cheapest measurement"),
        ({"n": 1e9}, "n = 1000000000.0: must be <= 10000, the cost of 10000 measurements"),
        ({"cost": 0.0}, r"cost.* must be > 0"),
        ({"cost": [1.0, 2.0]}, "cost: must be a number, or 51 numbers, one for each candidate"),
        ({"free": None}, "free: must be a dict of key paths"),
        ({"free": {"lower.material.F": fitting.Positive()}}, "unknown key path; did you mean"),
        ({"draws": 0}, "draws = 0: must be an integer >= 1"),
    ],
)
def test_refused(options, message):
    given = {"free": FREE, "candidates": CANDIDATES, "n": 12} | options
    with pytest.raises(ValueError, match=message) as caught:
        fitting.design(TRUTH, **given)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_hundred_twins():
    """Fits of noisy data: bands of 12 designed points and of 40 log-uniform points."""
    rng = np.random.default_rng(7)
    wanted = (WANTED.velocity, WANTED.pressure, WANTED.temperature)
    exact = np.asarray(rf.friction(TRUTH, *wanted, quadrature=QUICK))
    widths, held = [], []
    for twin in range(100):
        start = off(rng) if twin % 2 else TRUTH
        plan = fitting.design(
            start, FREE, candidates=CANDIDATES, n=12, criterion=WANTED, prior=PRIOR, draws=4, quadrature=QUICK
        )
        row = []
        for at in ((plan.velocity, plan.pressure, plan.temperature), log_uniform(rng, 40)):
            mu = np.asarray(rf.friction(TRUTH, *at, quadrature=QUICK))
            noisy = mu * np.exp(0.05 * rng.normal(size=mu.size))
            data = fitting.FrictionData(at[0], noisy, pressure=at[1], temperature=at[2], relative=0.05)
            result = fitting.fit(start, data, FREE, prior=PRIOR, quadrature=QUICK)
            band = result.band(*wanted)
            row.append(np.mean(np.log(band.high / band.low)))
            held.append(np.mean((band.low < exact) & (exact < band.high)))
        widths.append(row)
    widths = np.array(widths)
    for part in (widths[::2], widths[1::2]):  # designed at the truth, and 30 % off
        print(np.median(part, 0), np.mean(part[:, 0] <= part[:, 1]))
        assert np.median(part[:, 0]) <= np.median(part[:, 1])
    assert np.mean(held) > 0.9
