"""Time-temperature shifts against their laws in 30 digits, and at their ends."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.cases.stored import slow_if
from support.oracles.oracle_solids import interpolated_log
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


def test_slopes_of_wlf_vanish_at_and_below_its_pole():
    """ln a_T does not change there, see `WLF`."""
    for T in (WLF.T_ref - WLF.C2, 150.0):
        assert WLF.log_factor(T) == LARGEST
        slopes = jax.grad(lambda law, T: law.log_factor(T), (0, 1))(jax.tree.map(float, WLF), T)
        assert all(float(slope) == 0 for slope in jax.tree.leaves(slopes))


@pytest.mark.parametrize("T", [1.0, 200.0, 293.15, 293.1500001, 1e4])
def test_arrhenius(T):
    with mp.workdps(30):
        exact = mp.mpf(0.97) / mp.mpf("8.617333262e-5") * (1 / mp.mpf(T) - 1 / mp.mpf(293.15))
    assert ARRHENIUS.log_factor(T) == pytest.approx(min(float(exact), LARGEST), rel=1e-13, abs=1e-14)


TABLES = {
    "two": ([280.0, 300.0], [30.0, 0.1]),
    "falling": ([263.15, 283.15, 303.15, 333.15], [3e3, 20.0, 0.2, 4e-3]),
    "uneven": ([263.0, 264.0, 290.0, 291.0, 330.0], [1e4, 9e3, 3.0, 0.9, 1e-3]),
    "not monotone": ([263.0, 273.0, 283.0, 303.0, 313.0, 320.0], [10.0, 2.0, 2.0, 3.0, 1.0, 1.5]),
    "long": (np.linspace(250.0, 350.0, 80), np.exp(-0.1 * np.linspace(-50, 50, 80) + np.sin(range(80)))),
}


@jax.jit
def log_factor_and_slopes(law, T):
    return law.log_factor(T), jax.vmap(jax.grad(law.log_factor))(T)


@pytest.mark.parametrize("name", TABLES)
def test_table(name):
    T, factor = map(np.asarray, TABLES[name])
    at = np.concatenate([np.linspace(T[0] - 60.0, T[-1] + 60.0, 301), T])
    table, exact = rf.TabulatedShift(T, factor, 291.0), interpolated_log(T, factor)
    found, slopes = log_factor_and_slopes(table, at)
    np.testing.assert_allclose(found, exact(at) - exact(291.0), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(found[301:], np.log(factor) - exact(291.0), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(slopes, exact(at, 1), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("name", ["two", "falling", "uneven", "long"])
def test_derivatives_of_a_table_at_its_entries(name):
    """By temperature and by every entry: forward, reverse, and a difference across the entry."""
    T, factor = map(np.asarray, TABLES[name])

    def of(log_factor, x):
        return rf.TabulatedShift(T, jnp.exp(log_factor), 291.0).log_factor(x)

    log, h = np.log(factor), 1e-6
    forward, reverse = (jax.jit(mode(of, (0, 1))) for mode in (jax.jacfwd, jax.jacrev))
    one, value = jax.jit(of), jax.jit(jax.vmap(of, (0, None)))
    steps = h * np.eye(T.size)
    for x in T if T.size < 10 else T[[0, 1, 40, -1]]:
        by_entry = (value(log + steps, x) - value(log - steps, x)) / (2 * h)
        # The second derivative jumps there.
        by_T = (one(log, x + 1e-7) - one(log, x - 1e-7)) / 2e-7
        for found in (forward(log, x), reverse(log, x)):
            np.testing.assert_allclose(found[0], by_entry, rtol=1e-6, atol=1e-8)
            np.testing.assert_allclose(found[1], by_T, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_references_and_derivatives(law):
    h = 1e-2
    T = np.concatenate([np.linspace(264.0, 333.0, 30), [float(law.T_ref), 275.0, 275.0 + h, 275.0 - h]])
    found, slopes = log_factor_and_slopes(law, T)
    assert law.log_factor(law.T_ref) == found[30] == 0.0
    assert (np.diff(found[:30]) < 0).all()
    assert float(slopes[31]) == pytest.approx(float(found[32] - found[33]) / (2 * h), rel=1e-6)


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


@jax.jit
def log_factor_and_all_slopes(law, T):
    return jax.value_and_grad(lambda law, T: law.log_factor(T), argnums=(0, 1))(law, T)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
@pytest.mark.parametrize("T", [-10.0, 0.0, 1e-3, 191.5499, 191.55, 191.5501, 1e300])
def test_finite_under_jit_at_every_temperature(law, T):
    """Where eager code raises, jitted code saturates: value and every derivative finite."""
    value, slopes = log_factor_and_all_slopes(law, T)
    assert np.isfinite(value)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))


ROAD = rf.Body(rf.Rigid(), rf.TabulatedSpectrum([1e3, 1e4], [1e-13, 1e-17]))
CHEAP = rf.Quadrature(order=4, panels=2, graded=0, angular_order=4)


@pytest.mark.parametrize("law", slow_if(lambda name: name != "WLF", {type(x).__name__: x for x in LAWS}))
def test_conditions_alone_traced(law):
    """A scene that is closed over is concrete in a trace, where operations on it are staged all the same."""
    material = rf.Prony(1e6, [1e6, 1e7], [1.0, 1e-3], shift=law)
    scene = rf.Scene(rf.Body(material), ROAD, shear=rf.ContactShear(6.5e6, 0.1, 6e-3, shift=law))

    def area(scene, velocity):
        modulus = rf.complex_modulus(material, velocity, 300.0)
        return rf.friction(scene, velocity, 1e5, 300.0, quadrature=CHEAP), modulus

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
    """Also beyond its ends, where heat may take it under jit."""
    table = rf.TabulatedShift([280.0, 300.0, 320.0], [10.0, 0.5, 0.1], 293.0)
    longer, T = table.padded(), np.array([250.0, 280.0, 291.0, 320.0, 321.5, 400.0])
    assert longer.T.size == longer.aT.size == 8
    # The added entries lie on the last line, of rounded slopes.
    found, expected = (log_factor_and_slopes(one, T)[0] for one in (longer, table))
    np.testing.assert_allclose(found, expected, rtol=1e-13)
    assert rf.WLF(8.0, 100.0, 293.0).padded().C1 == 8.0


@pytest.mark.parametrize("C1", [-12.0, 0.0])
def test_a_negative_wlf_constant_gets_a_hint_on_its_sign(C1):
    """Some programs and papers write the law without the minus."""
    law = r"log10 a_T = -C1 \(T - T_ref\) / \(C2 \+ T - T_ref\); check its sign"
    with pytest.raises(ValueError, match=rf"WLF\.C1 = {C1}: must be > 0, as in {law}"):
        rf.WLF(C1, 150.0, 293.15)
