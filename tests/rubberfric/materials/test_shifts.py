"""Time-temperature shifts against their laws in 30 digits, and at their ends."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.scenes.shifts import ARRHENIUS, TABLE, WLF

LAWS = [WLF, ARRHENIUS, TABLE]
LARGEST = 0.25 * np.log(np.finfo(float).max)  # where ln a_T saturates


@pytest.mark.parametrize("T", [191.6, 200.0, 250.0, 293.15, 293.1500001, 400.0, 1e4])
def test_wlf(T):
    with mp.workdps(30):
        above = mp.mpf(T) - mp.mpf(293.15)
        exact = -mp.log(10) * mp.mpf(8.86) * above / (mp.mpf(101.6) + above)
    # Rounding of the temperature itself is magnified towards the pole at 191.55 K.
    assert WLF.log_factor(T) == pytest.approx(min(float(exact), LARGEST), rel=1e-10, abs=1e-14)


@pytest.mark.parametrize("T", [1.0, 200.0, 293.15, 293.1500001, 1e4])
def test_arrhenius(T):
    with mp.workdps(30):
        exact = mp.mpf(0.97) / mp.mpf("8.617333262e-5") * (1 / mp.mpf(T) - 1 / mp.mpf(293.15))
    assert ARRHENIUS.log_factor(T) == pytest.approx(min(float(exact), LARGEST), rel=1e-13, abs=1e-14)


def test_table():
    log_aT = np.log([3e3, 20.0, 0.2, 4e-3])
    at_reference = 0.5 * (log_aT[1] + log_aT[2])
    np.testing.assert_allclose(TABLE.log_factor(293.15), 0.0, atol=1e-15)
    np.testing.assert_allclose(
        TABLE.log_factor(273.15), 0.5 * (log_aT[0] + log_aT[1]) - at_reference, rtol=1e-14
    )
    np.testing.assert_allclose(TABLE.log_factor(333.15), log_aT[3] - at_reference, rtol=1e-14)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_one_at_reference_and_falling(law):
    assert law.log_factor(law.T_ref) == 0.0
    temperatures = jnp.linspace(264.0, 333.0, 30)
    assert (jnp.diff(law.log_factor(temperatures)) < 0).all()


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_derivative(law):
    slope = jax.grad(law.log_factor)(275.0)
    h = 1e-2
    difference = (law.log_factor(275.0 + h) - law.log_factor(275.0 - h)) / (2 * h)
    assert slope == pytest.approx(float(difference), rel=1e-6)


@pytest.mark.parametrize(
    ("law", "bad"),
    [
        (WLF, 191.5),
        (WLF, 190.0),
        (WLF, -1.0),
        (WLF, np.nan),
        (ARRHENIUS, 0.0),
        (ARRHENIUS, -3.0),
        (TABLE, 263.0),
        (TABLE, 334.0),
    ],
)
def test_temperatures_outside_a_law(law, bad):
    with pytest.raises(ValueError, match=r"temperature = .*: must be"):
        law.check_temperature(bad)


@pytest.mark.parametrize(("law", "good"), [(WLF, 191.6), (ARRHENIUS, 1e-3), (TABLE, 263.15), (TABLE, 333.15)])
def test_temperatures_at_the_edge(law, good):
    law.check_temperature(good)
    law.check_temperature(jnp.array([good, good]))


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("T", [-10.0, 0.0, 1e-3, 191.5499, 191.55, 191.5501, 1e300])
def test_finite_under_jit_at_every_temperature(law, T):
    """Where eager code raises, jitted code saturates: value and every derivative finite."""
    value, slopes = jax.jit(jax.value_and_grad(lambda law, T: law.log_factor(T), argnums=(0, 1)))(law, T)
    assert np.isfinite(value)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))


def test_table_holds_its_ends_under_jit():
    assert jax.jit(TABLE.log_factor)(200.0) == TABLE.log_factor(263.15)
    assert jax.jit(TABLE.log_factor)(400.0) == TABLE.log_factor(333.15)
