"""Start-up parts of records, which are made from known friction, and read."""

import numpy as np
import pytest

import fitting


def start_up(n=1000):
    """Return mu rising to 0.8 with a decay of 30 rows, with noise, at 10 mm/s in 10 s."""
    t = np.arange(n) * 10.0 / n
    mu = 0.8 * (1 - 0.5 * np.exp(-np.arange(n) / 30.0)) + 0.005 * np.random.default_rng(1).normal(size=n)
    return {
        "t [s]": t,
        "x [mm]": 10.0 * t,
        "v [mm/s]": np.full(n, 10.0),
        "mu": mu,
        "p [bar]": np.full(n, 2.0),
    }


@pytest.mark.parametrize("without", [(), ("x [mm]",), ("t [s]",)])
@pytest.mark.parametrize("discard", ["20 mm", "2 cm", "2 s", "2000 ms"])
def test_the_start_is_discarded(discard, without):
    run = {name: values for name, values in start_up().items() if name not in without}
    if "t [s]" in without and discard.endswith("s"):
        with pytest.raises(ValueError, match="must be a length, because the table has no column t"):
            fitting.read(run, discard=discard)
        return
    data = fitting.read(run, discard=discard)
    np.testing.assert_array_equal(data.friction, run["mu"][200:])
    assert data.history == (f"first {discard} of each of 1 sections discarded: 200 of 1000 rows",)


def test_settling():
    """The rule removes about five decays. The mean is then right within its standard error of 0.0002."""
    run = start_up()
    data = fitting.read(run, discard="settling")
    assert 90 < 1000 - len(data) < 300
    # The rule itself, term by term.
    mu = run["mu"]
    errors = [np.sum((mu[d:] - mu[d:].mean()) ** 2) / (1000 - d) ** 2 for d in range(500)]
    assert 1000 - len(data) == np.argmin(errors)
    assert data.friction.mean() == pytest.approx(0.8, abs=5e-4)
    assert "rows before mu settles (MSER) of each of 1 sections discarded: " in data.history[0]
    slow = run | {"mu": np.linspace(0.4, 0.8, 1000)}
    with pytest.raises(ValueError, match="mu does not settle within half of a section of 1000 rows"):
        fitting.read(slow, discard="settling")


def test_sinusoidal_motion():
    """mu is constant, so that the mean is right, but the mean velocity is 2/pi of the largest one."""
    t = np.arange(0.0, 3.0, 0.002) + 0.001
    v = 30.0 * np.sin(2 * np.pi * t)
    run = {"t [s]": t, "v [mm/s]": v, "mu": 0.7 * np.sign(v) + 0.02, "p [bar]": 2.0}
    with pytest.warns(
        UserWarning, match="velocity varies by up to .* % within a section, whose mean is used"
    ):
        data = fitting.read(run, fold=True)
    np.testing.assert_allclose(data.friction, 0.7, rtol=1e-12)
    assert 1e3 * data.velocity.max() == pytest.approx(30 * 2 / np.pi, rel=0.1)
    assert any("velocity varies" in text for text in data.history)
