"""Sinusoidal strokes, made from a known friction mu(v) that rises with ln v, and read back."""

import math
import re

import numpy as np
import pytest

import fitting

F, STROKE, LOAD, AREA = 2.0, 10e-3, 100.0, 4e-4  # [Hz], [m], [N], [m^2]
V_MAX = math.pi * F * STROKE
# Friction at 10 mm/s, and its rise per unit of ln v.
MU, RISE = 0.8, 0.05


def friction(speed):
    return MU + RISE * np.log(np.maximum(speed, 1e-6) / 0.01)


def record(cycles=4, rows=400, lag=0.0, angle=0.0, noise=0.0, rod=0.0):
    """Return the columns of a sinusoidal run.

    Parameters
    ----------
    lag : mu while slowing down minus mu while speeding up
    angle : misalignment of the force axes [rad]
    noise : rms noise of the position [m]
    rod : second harmonic of a crank drive, relative to the first
    """
    t = np.arange(cycles * rows) / (F * rows)
    phase = 2 * np.pi * F * t
    x = STROKE / 2 * (np.sin(phase) + rod * np.cos(2 * phase))
    v = np.pi * F * STROKE * (np.cos(phase) - 2 * rod * np.sin(2 * phase))
    acceleration = -np.sin(phase)
    mu = friction(np.abs(v)) - lag / 2 * np.sign(v * acceleration)
    tangential, normal = np.sign(v) * mu * LOAD, np.full(t.size, LOAD)
    x = x + noise * np.random.default_rng(0).normal(size=t.size)
    return {
        "t [s]": t,
        "x [mm]": 1e3 * x,
        "v [mm/s]": 1e3 * v,
        "Fn [N]": normal * math.cos(angle) - tangential * math.sin(angle),
        "Ft [N]": tangential * math.cos(angle) + normal * math.sin(angle),
    }


def with_columns(run, *names):
    return {name: values for name, values in run.items() if name.split()[0] in (*names, "Fn", "Ft")}


# Columns, and what else determines the velocity.
WAYS = [
    (("t", "v"), {}, ""),
    (("v",), {}, ""),
    (("t", "x"), {}, "v = dx/dt"),
    (("x",), {"frequency": F}, "v = 2 pi f sqrt("),
    (("t",), {"frequency": 1.01 * F, "stroke": STROKE}, "v = pi f stroke cos("),
]


@pytest.mark.parametrize(("names", "given", "history"), WAYS)
def test_speeds(names, given, history):
    """Each bin gives mu at its mean speed, and the misalignment of 3 deg cancels."""
    run = with_columns(record(angle=math.radians(3.0)), *names)
    data = fitting.read(run, area=AREA, fold="speeds", average=True, **given)
    assert len(data) == 5
    # The logarithm of the mean speed of a bin exceeds the mean of the logarithm by at most 0.009.
    assert data.velocity.min() > 0.1 * V_MAX and data.velocity.max() < V_MAX
    np.testing.assert_allclose(data.friction, friction(data.velocity), atol=1e-3)
    assert any(line.startswith(history) for line in data.history)
    assert any("misalignment of +3 deg" in line for line in data.history)
    assert any("5 bins of |v|, 5 per decade" in line for line in data.history)
    assert any(re.match(r"folded, \d+ bins of cycles: mu = ", line) for line in data.history)


@pytest.mark.parametrize(("names", "given", "history"), WAYS)
def test_middle(names, given, history):
    """The mean of cos over 20 % of the stroke is 0.2 / asin(0.2), and mu belongs to this speed."""
    run = with_columns(record(angle=-0.05), *names)
    data = fitting.read(run, area=AREA, fold="middle", **given)
    # The record begins and ends in the middle of a stroke, so that 7 of 9 strokes are complete.
    assert len(data) == 3
    np.testing.assert_allclose(data.velocity, V_MAX * 0.2 / math.asin(0.2), rtol=1e-3)
    np.testing.assert_allclose(data.friction, friction(data.velocity), atol=1e-4)
    assert any(line.startswith("middle 20% of each of ") for line in data.history)
    assert any(line.startswith(history) for line in data.history)


def test_strokes_at_the_ends_count_if_they_are_nearly_complete():
    """The record begins and ends a few rows inside of its first and its seventh stroke."""
    run = {name: values[105:1495] for name, values in record().items()}
    data = fitting.read(run, area=AREA, fold="middle")
    assert len(data) == 3
    assert any(line.startswith("middle 20% of each of 7 strokes") for line in data.history)


def test_the_velocity_of_a_crank_drive_with_noise():
    """dx/dt follows the second harmonic, which the closed form of a sinusoid does not know."""
    run = with_columns(record(rod=0.1, noise=2e-6, rows=1000), "t", "x")
    data = fitting.read(run, area=AREA, fold="speeds", average=True)
    np.testing.assert_allclose(data.friction, friction(data.velocity), atol=2e-3)
    # Without noise, the cubic is right within 1e-3 of the largest velocity.
    run = record(rod=0.1)
    own = fitting.read(with_columns(run, "t", "x"), area=AREA, fold="middle").velocity
    np.testing.assert_allclose(own, fitting.read(run, area=AREA, fold="middle").velocity, rtol=1e-3)


def test_the_hysteresis_of_the_speed():
    data = fitting.read(record(lag=0.04), area=AREA, fold="speeds")
    (text,) = [line for line in data.history if line.startswith("mu while slowing down minus")]
    assert "+0.04 on average" in text
    # Both halves are averaged in each bin.
    np.testing.assert_allclose(data.friction, friction(data.velocity), atol=2e-3)


def test_the_start_of_a_stroke_is_discarded():
    """Friction is 0 over the first 0.5 mm after each turning point, where the rig deforms."""
    run = record()
    x = run["x [mm]"]
    gone = np.where(run["v [mm/s]"] > 0, x + 5, 5 - x) < 0.5
    run["Ft [N]"] = np.where(gone, 0.0, run["Ft [N]"])
    wrong = fitting.read(run, area=AREA, fold="speeds", average=True)
    assert abs(wrong.friction - friction(wrong.velocity)).max() > 0.05
    data = fitting.read(run, area=AREA, fold="speeds", average=True, discard="0.5 mm")
    np.testing.assert_allclose(data.friction, friction(data.velocity), atol=2e-3)


def test_two_speeds_in_a_record():
    """Steps from 2 to 0.5 Hz: the bins of each speed are down to 10 % of its largest value."""
    fast, slow = record(), record()
    slow = {name: values * {"t": 4.0, "v": 0.25}.get(name[0], 1.0) for name, values in slow.items()}
    slow["t [s]"] = slow["t [s]"] + fast["t [s]"][-1] + 1 / (F * 400)
    run = {name: np.concatenate([fast[name], slow[name]]) for name in ("t [s]", "x [mm]", "Fn [N]")}
    v = np.concatenate([fast["v [mm/s]"], slow["v [mm/s]"]])
    run["Ft [N]"] = LOAD * np.sign(v) * friction(np.abs(v) / 1e3)
    data = fitting.read(run, area=AREA, fold="speeds", average=True)
    # Speeds from the largest one down to 1 / 40 of it are five bins per decade. The slow strokes have a part
    # of one of them, which gives two conditions.
    assert len(data) == math.floor(5 * math.log10(40)) + 1
    np.testing.assert_allclose(data.friction, friction(data.velocity), atol=3e-3)


def test_frequency_and_stroke_above_a_table(tmp_path):
    run = with_columns(record(), "t")
    rows = "\n".join(",".join(map(repr, map(float, row))) for row in zip(*run.values(), strict=True))
    (tmp_path / "srv.csv").write_text(f"Frequency: 2 Hz\nStroke: 10 mm\nt [s],Fn [N],Ft [N]\n{rows}\n")
    data = fitting.read(tmp_path / "srv.csv", area=AREA, fold="middle")
    np.testing.assert_allclose(data.velocity, V_MAX * 0.2 / math.asin(0.2), rtol=1e-3)


def test_constant_velocity_is_not_expected_of_sinusoids():
    with pytest.warns(UserWarning, match='velocity varies along the strokes.*fold="middle" or fold="speeds"'):
        fitting.read(with_columns(record(), "t", "x"), area=AREA, fold=True)


@pytest.mark.parametrize(
    ("run", "options", "message"),
    [
        (with_columns(record(), "t", "x"), {}, 'give fold="middle" or fold="speeds" if the velocity is'),
        (with_columns(record(), "t"), {}, "frequency=... [Hz] and stroke=... [m] if the velocity"),
        (with_columns(record(), "t"), {"fold": "middle"}, "give frequency=... [Hz] and stroke=... [m], from"),
        (with_columns(record(), "x"), {"fold": "middle"}, "do not determine v: give frequency=... [Hz]"),
        (with_columns(record()), {"fold": "middle"}, "add v, t and x, x with frequency=... [Hz]"),
        (record(), {"fold": "ends"}, "fold = 'ends': must be True or False, 'middle' or 'speeds'"),
        (record(), {"fold": "middle", "frequency": 2.0}, "must not be given; the table has v"),
        (record(), {"fold": True, "stroke": 0.01}, 'must come with fold="middle" or fold="speeds"'),
        (record(), {"fold": True, "frequency": 2.0}, "must not be given without fold="),
        (record(), {"fold": "speeds", "discard": "settling"}, "must be a length or a time with fold"),
        (record(), {"fold": "middle", "discard": "8 mm"}, "must leave the middle of the strokes"),
        (
            with_columns(record(), "t"),
            {"fold": "middle", "frequency": 2.3, "stroke": STROKE},
            "the friction repeats with 2 Hz; must agree within 5%",
        ),
        (
            with_columns(record(), "t") | {"Ft [N]": np.full(1600, 80.0)},
            {"fold": "middle", "frequency": F, "stroke": STROKE},
            "the friction has one sign in all rows",
        ),
        (with_columns(record(rows=30), "t", "x"), {"fold": "middle"}, "a stroke must have 20 rows"),
    ],
)
def test_motions_that_are_not_known(run, options, message):
    with pytest.raises(ValueError, match=r"^") as caught:
        fitting.read(run, area=AREA, **options)
    assert message in str(caught.value)
