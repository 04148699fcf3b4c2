"""Records of friction rigs: each is made from known friction, and read."""

import math
import re

import numpy as np
import pytest

import fitting

AREA = 4e-4  # [m^2]
LOAD = 100.0  # [N]


def strokes(speeds, mu, angle=0.0, rows=50, period=2.0, noise=0.0, seed=0, zero=(0.0, 0.0)):
    """Return the record of one stroke forward and one backward for each speed [mm/s] and friction.

    The force axes are turned by `angle` [rad]. `zero` is the zero error of F_t and F_n [N].
    """
    rng = np.random.default_rng(seed)
    v, F_t, F_n = [], [], []
    for speed, friction in zip(speeds, mu, strict=True):
        for sign in (1, -1):
            tangential = sign * friction * LOAD * (1 + noise * rng.normal())
            v += [sign * speed] * rows
            F_t += [tangential * math.cos(angle) + LOAD * math.sin(angle) + zero[0]] * rows
            F_n += [LOAD * math.cos(angle) - tangential * math.sin(angle) + zero[1]] * rows
    t = np.arange(len(v)) * period / rows
    return {"time [s]": t, "v [mm/s]": v, "Fn [N]": F_n, "Ft [N]": F_t}


# --- forces and areas


TITLES = (
    ("v [mm/s]", "normal force [N]", "friction force [N]", "contact area [mm²]"),
    ("Geschwindigkeit [mm/s]", "Normalkraft [N]", "Reibkraft [N]", "Nennfläche [mm^2]"),
    ("vitesse [mm/s]", "charge [N]", "force de frottement [N]", "surface de contact [mm2]"),
)


@pytest.mark.parametrize("titles", TITLES)
def test_forces_and_an_area(titles):
    columns = ([5.0, 6.0], [100.2, 100.2], [82.1, 83.0], [400.0, 200.0])
    run = dict(zip(titles, columns, strict=True))
    data = fitting.read(run)
    np.testing.assert_allclose(data.friction, [82.1 / 100.2, 83.0 / 100.2], rtol=1e-14)
    np.testing.assert_allclose(data.pressure, [250.5e3, 501e3], rtol=1e-14)
    assert data.history == ("mu = |F_t| / |F_n|", "p = |F_n| / A")
    with pytest.raises(ValueError, match=r"^data frame: area = 0\.0004: must not be given; the file has A"):
        fitting.read(run, area=AREA)


def test_a_relative_contact_area_is_no_nominal_area():
    data = fitting.read({"v [mm/s]": [5.0], "contact area [%]": [3.0], "p [bar]": [2.0]})
    np.testing.assert_allclose(data.area, [0.03])


# --- drift of load cells


def drifting(before, after):
    """Return a run of mu = 0.8 at 10 mm/s between readings without load, and with drifting zeros."""
    load = np.concatenate([np.zeros(before), np.full(300, LOAD), np.zeros(after)])
    t = np.arange(load.size) * 0.1
    zero_t, zero_n = 2.0 + 0.1 * t, -5.0 + 0.05 * t
    return {
        "time [s]": t,
        "v [mm/s]": np.full(t.size, 10.0),
        "Fn [N]": load + zero_n,
        "Ft [N]": 0.8 * load + zero_t,
    }


def test_a_linear_drift_is_subtracted():
    run = drifting(20, 40)
    data = fitting.read(run, area=AREA, zero=True)
    assert len(data) == 300
    np.testing.assert_allclose(data.friction, 0.8, rtol=1e-12)
    np.testing.assert_allclose(data.pressure, 2.5e5, rtol=1e-12)
    # The means of both readings are 0.5 * (20 + 40) + 300 rows apart, each 0.1 s.
    assert (
        "zero (20 rows before and 40 rows after the run) subtracted: F_n -4.95 N, drift +1.65 N, F_t 2.09 N,"
        in (data.history[0])
    )
    assert "drift +3.3 N; mean load 100 N" in data.history[0]
    wrong = fitting.read({title: values[20:-40] for title, values in run.items()}, area=AREA)
    assert abs(wrong.friction[-1] / 0.8 - 1) > 0.05


def test_a_zero_on_one_side():
    data = fitting.read(drifting(20, 0), area=AREA, zero=True)
    # The zeros drift by 0.1 and 0.05 N/s from the mean time 0.95 s of the readings.
    t = np.arange(20, 320) * 0.1 - 0.95
    np.testing.assert_allclose(data.friction, (80 + 0.1 * t) / (100 + 0.05 * t), rtol=1e-12)
    assert data.history[0].endswith("; the drift is unknown")


def test_a_run_of_both_directions_with_zeros():
    """All steps together: 3 deg of misalignment, drift, start-up, five cycles at two speeds."""
    angle, speeds, mu = math.radians(3.0), [5.0, 20.0] * 5, [0.7, 0.9] * 5
    run = {
        name: np.asarray(values) for name, values in strokes(speeds, mu, angle, rows=100, noise=0.01).items()
    }
    within = np.arange(run["time [s]"].size) % 100
    run["Ft [N]"] = run["Ft [N]"] * (1 + 0.5 * np.exp(-within / 4.0))
    rest = np.zeros(30)
    run = {name: np.concatenate([rest, values, rest]) for name, values in run.items()}
    t = run["time [s]"] = np.arange(run["v [mm/s]"].size) * 0.02
    run["Fn [N]"] += 3.0 - 0.02 * t
    run["Ft [N]"] += -4.0 + 0.03 * t
    data = fitting.read(run, area=AREA, zero=True, discard="1 s", fold=True, average=True)
    np.testing.assert_allclose(data.velocity, [5e-3, 20e-3], rtol=1e-12)
    np.testing.assert_allclose(data.friction, [0.7, 0.9], rtol=0.01)
    # The means of the loads of both directions differ from the load by cos(angle) and by the noise.
    np.testing.assert_allclose(data.pressure, LOAD * math.cos(angle) / AREA, rtol=1e-3)
    # Five cycles of two strokes with 1 % of noise each.
    assert data.relative[0] == pytest.approx(0.01 / math.sqrt(10), rel=0.6)
    assert [text.split(" ")[0] for text in data.history] == ["zero", "first", "folded,", "mu", "p", "mean"]
    assert f"a misalignment of +{math.degrees(angle):.0f}" in data.history[2] or "+2.9" in data.history[2]


# --- reciprocating runs


@pytest.mark.parametrize("angle", [0.0, math.radians(3.0), -0.2])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_misalignment_cancels(angle, sign):
    """mu is exact, while each direction alone is wrong by (1 + mu^2) tan(angle) / (1 -+ mu tan(angle))."""
    run = strokes([5.0, 20.0, 5.0, 20.0], [0.7, 0.9, 0.7, 0.9], angle)
    run["Fn [N]"] = [sign * force for force in run["Fn [N]"]]
    data = fitting.read(run, area=AREA, fold=True)
    np.testing.assert_allclose(data.friction, [0.7, 0.9, 0.7, 0.9], rtol=1e-12)
    np.testing.assert_allclose(data.velocity, [5e-3, 20e-3, 5e-3, 20e-3], rtol=1e-12)
    assert f"offset of mu {sign * math.tan(angle) + 0.0:+.3g}," in data.history[0]
    assert f"misalignment of {sign * math.degrees(angle) + 0.0:+.3g} deg" in data.history[0]


def test_friction_with_the_sign_of_the_velocity_reversed():
    """Some rigs record the force on the sample, others that on the counterface."""
    run = strokes([5.0, 20.0], [0.7, 0.9], angle=0.05)
    run["Ft [N]"] = [-force for force in run["Ft [N]"]]
    np.testing.assert_allclose(fitting.read(run, area=AREA, fold=True).friction, [0.7, 0.9], rtol=1e-12)
    run = {"v [mm/s]": [5, 5, -5, -5], "mu": [-0.85, -0.83, 0.76, 0.76], "p [bar]": [2.0] * 4}
    np.testing.assert_allclose(fitting.read(run, fold=True).friction, [0.8], rtol=1e-14)


def test_a_zero_error_of_the_friction_force_cancels():
    data = fitting.read(strokes([5.0], [0.8], zero=(6.0, 0.0)), area=AREA, fold=True)
    np.testing.assert_allclose(data.friction, [0.8], rtol=1e-14)
    # With one cycle, the offset is the error.
    np.testing.assert_allclose(data.sigma, [0.06], rtol=1e-12)


def test_a_column_of_signed_friction_is_folded():
    run = {"v [mm/s]": [5, 5, -5.2, -5.2], "mu": [0.85, 0.83, -0.76, -0.76], "p [bar]": [2.0] * 4}
    data = fitting.read(run, fold=True)
    np.testing.assert_allclose([data.friction, data.velocity], [[0.8], [5.1e-3]], rtol=1e-14)
    np.testing.assert_allclose(data.sigma, [0.04], rtol=1e-12)


def test_the_sign_of_the_force_gives_the_direction():
    run = strokes([5.0, 5.0], [0.7, 0.7], angle=0.05)
    run["v [mm/s]"] = np.abs(run["v [mm/s]"])
    data = fitting.read(run, area=AREA, fold=True)
    np.testing.assert_allclose(data.friction, [0.7, 0.7], rtol=1e-12)


def test_the_hysteresis_is_the_scatter_of_the_folded_friction():
    """Over 400 cycles with 2 % of noise in each stroke, sigma is the scatter 0.02 mu / sqrt(2) of a cycle."""
    run = strokes([5.0] * 400, [0.8] * 400, angle=0.1, rows=2, noise=0.02)
    data = fitting.read(run, area=AREA, fold=True)
    expected = 0.02 * 0.8 / math.sqrt(2)
    assert data.sigma[0] == pytest.approx(expected, rel=0.1)
    assert data.friction.std(ddof=1) == pytest.approx(expected, rel=0.1)


def test_the_hysteresis_of_three_cycles():
    """Offsets 1, 2 and 6 % of the load: mean 3 %, squared deviations 4, 1 and 9, and the factor 1.3213."""
    forces = [81.0, -79.0, 82.0, -78.0, 86.0, -74.0]
    run = {"v [mm/s]": [5.0, -5.0] * 3, "Fn [N]": [100.0] * 6, "Ft [N]": forces}
    data = fitting.read(run, area=AREA, fold=True)
    np.testing.assert_allclose(data.friction, 0.8, rtol=1e-14)
    np.testing.assert_allclose(data.sigma, 1.3213 * math.sqrt(14 / 2) / 100, rtol=1e-4)
    assert "offset of mu +0.03, a misalignment of +1.72 deg" in data.history[0]


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_position_gives_the_velocity(noise):
    """Three cycles over 20 mm, from 37 mm, in 2 s per stroke, with noise [mm] of position, between rests."""
    t = np.arange(0.0, 14.0, 0.02)
    position = np.interp(t, 1 + 2 * np.arange(7), [0, 20, 0, 20, 0, 20, 0])
    sign = np.where((t - 1) // 2 % 2 == 0, 1, -1)
    position += 37 + noise * np.random.default_rng(2).normal(size=t.size)
    sliding = (t >= 1) & (t < 13)
    run = {
        "time [s]": t,
        "position [mm]": position,
        "Fn [N]": LOAD * sliding,
        "Ft [N]": (80 * sign + 5) * sliding,
    }
    data = fitting.read(run, area=AREA, zero=True, discard="2 mm", fold=True, average=True)
    np.testing.assert_allclose(data.velocity, [0.01], rtol=0.02 if noise else 1e-9)
    np.testing.assert_allclose(data.friction, [0.8], rtol=0.01 if noise else 1e-9)
    assert data.history[1] == "v = median of dx / dt in each of 6 strokes"


@pytest.mark.parametrize(
    ("run", "options", "message"),
    [
        (
            strokes([5.0], [0.8]) | {"v [mm/s]": [5.0] * 100, "Ft [N]": [80.0] * 100},
            {"fold": True},
            "no sections in",
        ),
        (strokes([5.0], [0.8]), {"fold": 1}, "fold = 1: must be True or False"),
        (
            strokes([5.0], [0.8]),
            {"discard": "10"},
            'must be "settling", or a length or time > 0 such as "10 mm"',
        ),
        (strokes([5.0], [0.8]), {"discard": 10.0}, 'must be "settling", or a length or time > 0'),
        (strokes([5.0], [0.8]), {"discard": "-1 s"}, 'must be "settling", or a length or time > 0'),
        (strokes([5.0], [0.8]), {"discard": "60 s"}, "leaves no row of 2 sections; must be less"),
        (
            {"v [mm/s]": [5.0], "mu": [0.8], "p [bar]": [2.0]},
            {"discard": "1 s"},
            "must be a length, because the table has no column t",
        ),
        (
            {"v [mm/s]": [5.0], "mu": [0.8], "p [bar]": [2.0]},
            {"discard": "1 mm"},
            "a length needs a column x or t",
        ),
        ({"v [mm/s]": [5.0], "mu": [0.8], "p [bar]": [2.0]}, {"zero": True}, "the table must have F_n"),
        (drifting(0, 0), {"area": AREA, "zero": True}, "must have rows without load before or after the run"),
        ({"f [Hz]": [5.0], "E' [MPa]": [8.0], "E'' [MPa]": [2.0]}, {"fold": True}, "modulus data have none"),
    ],
)
def test_records_that_cannot_be_reduced(run, options, message):
    with pytest.raises(ValueError, match=f"^data frame: .*{re.escape(message)}") as error:
        fitting.read(run, **options)
    assert "\n" not in str(error.value)
