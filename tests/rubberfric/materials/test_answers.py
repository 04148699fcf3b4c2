"""Methods of materials and layers: limits and series agree with the complex modulus."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.scenes.examples import EXAMPLES

import rubberfric as rf
from rubberfric.materials.material import (
    Material,
    Series,
    plane_strain_factor,
    poisson_of,
    series_modulus,
    series_of,
)

NAMES = ("Elastic", "Prony", "PronyShear", "TabulatedModulus")
RIGID, ELASTIC, PRONY, SHEAR, TABLE = (EXAMPLES[name] for name in ("Rigid", *NAMES))
Q = jnp.logspace(1, 5, 9)


def reduced(material, omega):
    """E_r of the complex modulus; Poisson's ratio of a PronyShear follows from E and its bulk modulus."""
    E = np.asarray(rf.complex_modulus(material, omega))
    if material.poisson is None:
        poisson = 0.5 - E / (6 * float(material.bulk))
        return E / (1 - poisson**2)
    return E * float(plane_strain_factor(material))


@pytest.mark.parametrize("material", [ELASTIC, PRONY, SHEAR, TABLE], ids=NAMES)
def test_ends(material):
    static, glassy = reduced(material, np.array([1e-30, 1e30]))
    assert float(material.static_reduced()) == pytest.approx(static.real, rel=1e-12)
    assert float(material.glassy_reduced()) == pytest.approx(glassy.real, rel=1e-12)


@pytest.mark.parametrize("material", [ELASTIC, PRONY, SHEAR, TABLE], ids=NAMES)
def test_reduced_modulus(material):
    omega = np.logspace(-6, 6, 13)
    found = jax.jit(lambda one, omega: one.reduced_modulus(omega))(material, omega)
    np.testing.assert_allclose(found, reduced(material, omega), rtol=1e-12)
    on_grid = jax.jit(lambda one: one.reduced_on_grid(jnp.asarray(-500.0), 0.02, 1300))(material)
    at_points = reduced(material, np.exp(0.02 * (np.arange(1300) - 500.0)))
    np.testing.assert_allclose(on_grid, at_points, rtol=1e-12, atol=1e-30)


@pytest.mark.parametrize("outside", ["fall", "hold", "none"])
def test_splines_of_a_table(outside):
    """Inside and beyond the table."""
    table, omega = TABLE.replace(outside=outside), np.logspace(-14, 14, 57)
    splines = jax.jit(lambda solid, omega: solid.quick().reduced_modulus(omega))(table, omega)
    np.testing.assert_allclose(splines, reduced(table, omega), rtol=1e-7)


@pytest.mark.parametrize("material", [ELASTIC, PRONY], ids=NAMES[:2])
def test_series(material):
    omega = np.logspace(-6, 6, 13)
    found = 1e5 * jax.jit(lambda one, omega: series_modulus(one.reduced_series(1e5), omega))(material, omega)
    np.testing.assert_allclose(found, reduced(material, omega), rtol=1e-12)
    assert material.has_series


def test_a_table_is_no_series():
    assert TABLE.reduced_series(1.0) is None
    assert not TABLE.has_series
    assert (TABLE.loss_beyond, TABLE.loss_at_rest) == ("hold", True)
    assert not TABLE.replace(outside="fall").loss_at_rest
    with pytest.raises(ValueError, match=r"^material must be a Prony series, got a TabulatedModulus$"):
        series_of(TABLE, 1.0)


def test_flags_and_frequencies():
    assert [m.deforms for m in (RIGID, ELASTIC, PRONY)] == [False, True, True]
    assert [m.relaxes for m in (RIGID, ELASTIC, PRONY, SHEAR, TABLE)] == [False, False, True, True, True]
    with pytest.raises(ValueError, match=r"^material is Rigid, which has no modulus; use a deformable"):
        RIGID.static_modulus()
    np.testing.assert_allclose(PRONY.frequency_range(), [1e-2, 1e3])
    np.testing.assert_allclose(SHEAR.frequency_range(), [1e-2, 1e3])
    np.testing.assert_allclose(TABLE.frequency_range(), [1e-3, 1e2])
    assert ELASTIC.frequency_range() is None
    assert RIGID.frequency_range() is None
    assert TABLE.relaxation_times() is None
    np.testing.assert_array_equal(SHEAR.relaxation_times(), SHEAR.tau)
    # Methods of the base class, which a kind may keep.
    flat = rf.TabulatedModulus([1e-3, 1e-1, 1e1, 1e3], [1e6, 1e6, 3e6, 3e6], [1e5, 2e5, 2e5, 1e5])
    for material in (PRONY, flat):
        assert float(Material.static_modulus(material)) == pytest.approx(float(material.static_modulus()))
        assert float(Material.glassy_reduced(material)) == pytest.approx(float(material.glassy_reduced()))
    assert not PRONY.is_liquid()
    assert PRONY.replace(E_inf=0.0).is_liquid()
    assert SHEAR.replace(G_inf=0.0).is_liquid()
    assert not TABLE.is_liquid()
    assert float(poisson_of(ELASTIC)) == 0.3
    for material in (SHEAR, RIGID):
        with pytest.raises(ValueError, match=r"^material must have a constant Poisson's ratio, got a "):
            poisson_of(material)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_relaxation_without_overflow(dtype):
    largest = np.finfo(dtype).max
    term = Series(jnp.zeros((), dtype), jnp.ones(1, dtype), jnp.ones(1, dtype))
    modulus = series_modulus(term, jnp.asarray([0.0, 1.0, -1.0, largest, -largest], dtype))
    storage, loss = modulus.real, modulus.imag
    np.testing.assert_allclose(storage, [0, 0.5, 0.5, 1, 1], rtol=1e-6)
    np.testing.assert_allclose(loss, [0, 0.5, -0.5, 0, 0], atol=1e-17)


@pytest.mark.parametrize("layer", [rf.Slab(1e-3), rf.Coating(1e-3, ELASTIC)], ids=["slab", "coating"])
def test_layers(layer):
    """The glassy limit of E_r Sbar is `glassy_stiffening`."""
    base = None if layer.below is None else layer.below.glassy_reduced()
    poisson, glassy = PRONY.poisson, PRONY.glassy_reduced()
    found = jax.jit(lambda layer: layer.E_r_S_bar(poisson, Q, glassy, base))(layer)
    np.testing.assert_allclose(found, layer.glassy_stiffening(PRONY, Q) * glassy, rtol=1e-12)
    assert layer.below is (layer.base if isinstance(layer, rf.Coating) else None)
    assert not layer.relaxes and rf.Coating(1e-3, PRONY.replace(shift=None)).relaxes
