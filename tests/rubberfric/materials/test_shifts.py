"""Time-temperature shifts against their laws in 30 digits, and at their ends."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.scenes.shifts import ARRHENIUS, TABLE, WLF

import rubberfric as rf

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


def solids(shift):
    """One of every material that can be rough's counterpart."""
    table = [1e-2, 1e2, 1e6], [1e6, 1e7, 1e9], [1e5, 5e6, 1e8]
    yield rf.Elastic(2e6, 0.5)
    yield rf.Prony(1e6, [1e6, 1e7], [1.0, 1e-3], shift=shift)
    yield rf.PronyShear(1e6, [1e6, 1e7], [1.0, 1e-3], 1e9, shift=shift)
    yield from (rf.TabulatedModulus(*table, shift=shift, outside=o) for o in ("fall", "hold", "none"))


ROAD = rf.Body(rf.Rigid(), rf.TabulatedSpectrum([1e3, 1e4], [1e-13, 1e-17]))
CHEAP = rf.Quadrature(order=4, panels=2, graded=0, angular_order=4)


# Every kind of solid with a table, every law with Prony terms.
PAIRS = [(TABLE, kind) for kind in range(6)] + [(law, 1) for law in (None, *LAWS) if law is not TABLE]


@pytest.mark.parametrize(("law", "kind"), PAIRS, ids=lambda x: x if isinstance(x, int) else type(x).__name__)
def test_conditions_alone_traced(law, kind):
    """A scene that is closed over is concrete in a trace, where operations on it are staged all the same."""
    material = list(solids(law))[kind]
    shear = rf.ContactShear(6.5e6, 0.1, 6e-3, shift=law)
    scene = rf.Scene(rf.Body(material), ROAD, shear=shear)
    T = 300.0 if law is not None else None

    def area(scene, velocity):
        modulus = rf.complex_modulus(material, velocity, T)
        return rf.friction(scene, velocity, 1e5, T, quadrature=CHEAP), modulus

    as_argument = jax.jit(area)(scene, 0.1)
    for closed_over in (jax.jit(lambda v: area(scene, v)), jax.jit(lambda _: area(scene, 0.1))):
        np.testing.assert_allclose(closed_over(0.1), as_argument, rtol=1e-12)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_concrete_temperatures_are_checked_inside_a_trace(law):
    low = {"WLF": 191.0, "Arrhenius": -1.0, "TabulatedShift": 200.0}[type(law).__name__]
    with pytest.raises(ValueError, match=r"temperature = .*: must be"):
        jax.jit(lambda v: (law.check_temperature(low), v))(1.0)


def test_a_table_made_inside_a_trace_of_one_outside():
    T, aT = TABLE.T, TABLE.aT
    assert jax.jit(lambda v: rf.TabulatedShift(T, aT, 293.15).log_factor(v))(275.0) == TABLE.log_factor(275.0)
    with pytest.raises(ValueError, match=r"T_ref = 200.0: must be inside the table, 263.15 to 333.15 K"):
        jax.jit(lambda v: rf.TabulatedShift(T, aT, 200.0).log_factor(v))(275.0)


def test_a_padded_table_shifts_the_same():
    """Also beyond its ends, where heat may take it under jit and the last values are held."""
    table = rf.TabulatedShift([280.0, 300.0, 320.0], [10.0, 0.5, 0.1], 293.0)
    longer, T = table.padded(), np.array([250.0, 280.0, 291.0, 320.0, 321.5, 400.0])
    assert longer.T.size == longer.aT.size == 8
    np.testing.assert_array_equal(longer.log_factor(T), table.log_factor(T))
    assert rf.WLF(8.0, 100.0, 293.0).padded().C1 == 8.0
