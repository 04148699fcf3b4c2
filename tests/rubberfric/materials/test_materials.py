"""Complex moduli against their definitions in 30 digits."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.oracles.oracle_solids import shift_factor, table_modulus

import rubberfric as rf
from rubberfric.materials.material import plane_strain_factor

OMEGA = np.array([0.0, *np.logspace(-30, 30, 61)])
# With a modulus of 0 and two equal moduli.
E = [7.6e8, 1.5e7, 0.0, 2.2e6, 9e5, 9e5]
TAU = [1e-20, 1e-6, 3e-5, 1e-3, 1.0, 1e20]  # over forty decades
PRONY = rf.Prony(3.6e6, E, TAU)
TABLE = {
    "omega": np.array([1e-3, 1.0, 1e3, 1e6, 1e9]),
    "storage": np.array([3.7e6, 4.8e6, 7.3e6, 3.0e7, 9.0e8]),
    "loss": np.array([2.2e5, 5.1e5, 1.5e6, 1.5e7, 4.5e8]),
}


def exact_prony(omega):
    with mp.workdps(60):
        total = mp.mpc(3.6e6)
        for E_i, tau_i in zip(E, TAU, strict=True):
            s = mp.mpc(0, mp.mpf(omega) * mp.mpf(tau_i))
            total += E_i * s / (1 + s)
        return complex(total)


def test_prony():
    modulus = rf.complex_modulus(PRONY, OMEGA)
    exact = np.array([exact_prony(omega) for omega in OMEGA])
    np.testing.assert_allclose(modulus.real, exact.real, rtol=1e-14)
    np.testing.assert_allclose(modulus.imag, exact.imag, rtol=1e-14)


def test_elastic_and_static():
    np.testing.assert_array_equal(rf.complex_modulus(rf.Elastic(2e6, 0.3), OMEGA), np.full(OMEGA.shape, 2e6))
    for material in (PRONY, rf.Elastic(2e6, 0.3), rf.TabulatedModulus(**TABLE)):
        modulus = rf.complex_modulus(material, 0.0)
        assert modulus.imag == 0
        assert modulus.real == pytest.approx(float(material.static_modulus()), rel=1e-14)


@pytest.mark.parametrize("outside", ["fall", "hold", "none"])
def test_table(outside):
    material = rf.TabulatedModulus(**TABLE, outside=outside)
    omega = OMEGA[1:]
    exact = table_modulus(TABLE | {"outside": outside}, omega)
    modulus = rf.complex_modulus(material, omega)
    np.testing.assert_allclose(modulus.real, exact.real, rtol=1e-12)
    np.testing.assert_allclose(modulus.imag, exact.imag, rtol=1e-12)
    # Straight half way between two entries, and below one by 0.4 of the width times the change of slope.
    middle = np.sqrt(TABLE["omega"][1:] * TABLE["omega"][:-1])
    straight = np.sqrt(TABLE["storage"][1:] * TABLE["storage"][:-1])
    np.testing.assert_allclose(rf.complex_modulus(material, middle).real, straight, rtol=1e-12)
    slopes = np.diff(np.log(TABLE["storage"])) / np.diff(np.log(TABLE["omega"]))
    bends = np.diff([0, *slopes, 0]) * 0.1 / np.sqrt(2 * np.pi)
    at_knots = rf.complex_modulus(material, TABLE["omega"]).real
    np.testing.assert_allclose(at_knots, TABLE["storage"] * np.exp(bends), rtol=1e-12)


SHIFTS = [
    {"kind": "wlf", "C1": 8.86, "C2": 101.6, "T_ref": 293.15},
    {"kind": "arrhenius", "energy": 0.97, "T_ref": 293.15},
    {"kind": "table", "T": [263.15, 303.15, 333.15], "aT": [3e3, 0.2, 4e-3], "T_ref": 293.15},
]


@pytest.mark.parametrize("law", SHIFTS, ids=lambda law: law["kind"])
@pytest.mark.parametrize("T", [270.0, 293.15, 330.0])
def test_shift(law, T):
    """E(omega, T) = E(a_T omega); cold (a_T > 1) is stiff."""
    kinds = {"wlf": rf.WLF, "arrhenius": rf.Arrhenius, "table": rf.TabulatedShift}
    shift = kinds[law["kind"]](**{name: value for name, value in law.items() if name != "kind"})
    omega = np.logspace(-3, 9, 13)
    moved = rf.complex_modulus(rf.Prony(3.6e6, E, TAU, shift=shift), omega, T)
    np.testing.assert_allclose(moved, rf.complex_modulus(PRONY, omega * shift_factor(law, T)), rtol=1e-11)
    moved = rf.complex_modulus(rf.TabulatedModulus(**TABLE, shift=shift), omega, T)
    np.testing.assert_allclose(moved, table_modulus(TABLE, omega * shift_factor(law, T)), rtol=1e-11)


def test_shifted_moduli():
    shifted = rf.Prony(3.6e6, E, TAU, shift=rf.WLF(8.86, 101.6, 293.15))
    assert (rf.complex_modulus(shifted, OMEGA) == rf.complex_modulus(PRONY, OMEGA)).all()
    omega, T = np.array([1e-2, 1.0, 1e5]), np.array([[280.0], [300.0]])
    both = rf.complex_modulus(shifted, omega, T)
    assert both.shape == (2, 3)
    np.testing.assert_allclose(both[1, 2], rf.complex_modulus(shifted, 1e5, 300.0), rtol=1e-14)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_plane_strain(poisson):
    assert plane_strain_factor(rf.Elastic(1e6, poisson)) == pytest.approx(1 / (1 - poisson**2), rel=1e-15)


@pytest.mark.parametrize("material", [PRONY, rf.TabulatedModulus(**TABLE)], ids=["prony", "table"])
@pytest.mark.parametrize("omega", [0.0, 1e-30, 1e2, 1e30])
def test_gradients_finite(material, omega):
    for part in (jnp.real, jnp.imag):
        slopes = jax.jit(jax.grad(lambda m, w, part=part: part(rf.complex_modulus(m, w)), argnums=(0, 1)))(
            material, omega
        )
        assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))


def test_single_precision():
    single = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), PRONY)
    modulus = rf.complex_modulus(single, jnp.asarray(OMEGA, jnp.float32))
    assert modulus.dtype == jnp.complex64
    np.testing.assert_allclose(modulus, rf.complex_modulus(PRONY, OMEGA), rtol=1e-5)


STEP = rf.TabulatedModulus([1e-3, 1e3, 2e3], [1e4, 1e4, 1e8], [1e2, 1e2, 1e7])


def test_a_modulus_that_steps_up_leaves_g_positive():
    """Direct interpolation of the means would give negative values before the step."""
    road = rf.SelfAffine(100.0, 1e3, 1e5, 0.8, 1e-4)
    scene = rf.Scene(rf.Body(STEP), rf.Body(rf.Rigid(), road))
    result = rf.solve(scene, np.logspace(-6, 2, 17), 1e5)
    assert (result.area > 0).all() and (result.friction > 0).all()
    assert np.isfinite(result.separation).all() and (result.separation >= 0).all()  # 0 in full contact


@pytest.mark.slow
def test_a_table_on_a_liquid_at_rest():
    """A spring of no stiffness: no contact stress, full contact."""
    liquid = rf.Body(rf.Prony(0.0, [1e6], [1.0]), rf.SelfAffine(100.0, 1e3, 1e5, 0.8, 1e-4))
    scene = rf.Scene(rf.Body(STEP), liquid)
    result = rf.solve(scene, 0.1, 1e5)
    assert (result.area, result.friction, result.separation) == (1.0, 0.0, 0.0)
    slopes = jax.jit(jax.grad(lambda s: rf.separation(s, 0.1, 1e5)))(scene)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))
