"""A relaxing shear with a constant bulk modulus, against complex arithmetic and the oracle."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.cases.stored import as_arrays

import rubberfric as rf

G_INF = 1.2e6  # [Pa]
G = [3e8, 0.0, 5e6, 4e5, 4e5]  # with a modulus of 0 and two equal moduli
TAU = [1e-9, 1e-7, 1e-4, 1e-2, 1e-2]
OMEGA = np.array([0.0, *np.logspace(-6, 14, 21)])


def material(bulk=2e9, shift=None, scale=1.0):
    return rf.PronyShear(scale * G_INF, scale * np.array(G), np.array(TAU), bulk, shift)


def exact(omega, bulk, scale=1.0):
    """G, E, nu and E_r, complex."""
    s = [mp.mpc(0, mp.mpf(float(omega)) * mp.mpf(t)) for t in TAU]
    shear = scale * (G_INF + sum(w * z / (1 + z) for w, z in zip(G, s, strict=True)))
    bulk = mp.mpf(bulk)
    young, poisson = 9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)
    return shear, young, poisson, young / (1 - poisson**2)


@pytest.mark.parametrize("bulk", [1e5, 1e8, 2e9, 1e14])
def test_young(bulk):
    found = np.asarray(rf.complex_modulus(material(bulk), OMEGA))
    with mp.workdps(40):
        young = np.array([complex(exact(omega, bulk)[1]) for omega in OMEGA])
    np.testing.assert_allclose(found.real, young.real, rtol=1e-14)
    # Where the bulk modulus bounds E, its loss is the difference of larger numbers.
    np.testing.assert_allclose(found.imag, young.imag, rtol=1e-14, atol=1e-15 * np.abs(young).max())
    assert float(material(bulk).static_modulus()) == pytest.approx(young[0].real, rel=1e-14)


reduced = jax.jit(lambda solid, omega: solid.reduced_modulus(omega))


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1.0, 1e3])
@pytest.mark.parametrize("bulk", [1e6, 1e8, 2e9])
def test_reduced_modulus(bulk, scale):
    """With Poisson's ratio complex, from nearly 1/2 to below 0 within one spectrum; E'' keeps its digits."""
    solid = material(bulk, scale=scale)
    found = np.asarray(reduced(solid, OMEGA))
    with mp.workdps(40):
        wanted = np.array([complex(exact(omega, bulk, scale)[3]) for omega in OMEGA])
        ends = [float(exact(omega, bulk, scale)[3].real) for omega in (0.0, 1e30)]
    np.testing.assert_allclose(found.real, wanted.real, rtol=1e-13)
    np.testing.assert_allclose(found.imag, wanted.imag, rtol=1e-13)
    found = [float(end) for end in (solid.static_reduced(), solid.glassy_reduced())]
    np.testing.assert_allclose(found, ends, rtol=1e-13)


def test_temperature_shifts_the_shear():
    law = rf.WLF(8.86, 101.6, 293.15)
    moved = rf.complex_modulus(material(shift=law), 10.0, 320.0)
    wanted = rf.complex_modulus(material(), 10.0 * np.exp(float(law.log_factor(320.0))))
    assert complex(moved) == pytest.approx(complex(wanted), rel=1e-12)


def test_single_precision():
    single = reduced(as_arrays(material(1e8), jnp.float32), jnp.asarray(OMEGA, jnp.float32))
    assert single.dtype == jnp.complex64
    np.testing.assert_allclose(single, reduced(material(1e8), OMEGA), rtol=1e-5)
