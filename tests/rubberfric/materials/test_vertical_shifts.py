"""Vertical shifts, E(omega, T) = b_T E(a_T omega): laws, materials and scenes."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.oracles.oracle_solids import tabulated_factor
from support.scenes import scene_files
from support.scenes.fits import AFFINE as ROAD

import fitting
import rubberfric as rf

T_REF = 293.15
ENTROPIC = rf.Entropic(6e-4)
TABLE = rf.TabulatedVertical([250.0, 300.0, 400.0], [1.3, 1.0, 0.6])
LAWS = [ENTROPIC, TABLE]
V = np.array([1e-3, 0.1, 5.0])  # [m/s]
T = np.array([273.0, 320.0, 350.0])  # [K]


def name_of(law):
    return type(law).__name__


def wlf(vertical=None):
    return rf.WLF(8.86, 101.6, T_REF, vertical=vertical)


def shifts(vertical):
    """One of every kind."""
    yield wlf(vertical)
    yield rf.Arrhenius(0.97, T_REF, vertical=vertical)
    yield rf.TabulatedShift([250.0, 300.0, 400.0], [1e3, 0.7, 1e-3], T_REF, vertical=vertical)


def factor(law, T):
    """b_T, of the table by the monotone cubics of SciPy."""
    if isinstance(law, rf.Entropic):
        return T / T_REF * np.exp(-6e-4 * (T - T_REF))
    return float(tabulated_factor(law.T, law.bT, T, T_REF))


@pytest.mark.parametrize("law", LAWS, ids=name_of)
@pytest.mark.parametrize("at", [250.0, 280.0, T_REF, 301.0, 400.0])
def test_law(law, at):
    assert jnp.exp(law.log_factor(at, T_REF)) == pytest.approx(factor(law, at), rel=1e-14)
    slope = jax.jit(jax.grad(law.log_factor))(at + 1e-3, T_REF)
    ends = [law.log_factor(at + 1e-3 + h, T_REF) for h in (1e-4, -1e-4)]
    assert slope == pytest.approx(float(ends[0] - ends[1]) / 2e-4, rel=1e-6)


@pytest.mark.parametrize("law", LAWS, ids=name_of)
@pytest.mark.parametrize("at", [-10.0, 0.0, 1e-3, 1e300])
def test_finite_under_jit_at_every_temperature(law, at):
    value, slopes = jax.jit(jax.value_and_grad(lambda law, T: law.log_factor(T, T_REF), (0, 1)))(law, at)
    assert np.isfinite(value) and all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))


@pytest.mark.parametrize("shift", list(shifts(TABLE)), ids=name_of)
def test_temperatures_outside_the_law(shift):
    with pytest.raises(ValueError, match=r"temperature = 410.0: must be inside the table, 250 to 400 K"):
        shift.check_temperature(410.0)
    scene = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(prony(shift)))
    with pytest.raises(ValueError, match=r"temperature = 410.0: must be inside the table, 250 to 400 K"):
        rf.friction(scene, 1.0, 1e5, 410.0)


def test_bad_tables():
    with pytest.raises(ValueError, match=r"TabulatedVertical\.T has 1 entries: must have at least 2"):
        rf.TabulatedVertical([300.0], [1.0])
    with pytest.raises(ValueError, match=r"TabulatedVertical\.T"):
        rf.TabulatedVertical([300.0, 280.0], [1.0, 1.1])


def prony(shift, soft=1.0):
    E = soft * np.array([8e8, 7e8, 9e7, 1.5e7])
    return rf.Prony(soft * 4e6, E, [1e-9, 1e-7, 1e-5, 1e-3], shift=shift)


def table(shift):
    omega = np.logspace(-2, 10, 30)
    return rf.TabulatedModulus(omega, 1e6 * (1 + omega**0.3), 3e5 * omega**0.29, shift=shift)


@pytest.mark.parametrize("make", [prony, table])
@pytest.mark.parametrize("kind", [0, pytest.param(1, marks=pytest.mark.slow), 2])
def test_modulus(make, kind):
    for law in LAWS:
        plain, shifted = (make(list(shifts(vertical))[kind]) for vertical in (None, law))
        omega = np.array([[0.1], [1e3], [1e8]])
        b = np.array([factor(law, x) for x in T])
        wanted = b * rf.complex_modulus(plain, omega, T)
        np.testing.assert_allclose(rf.complex_modulus(shifted, omega, T), wanted, rtol=1e-13)
        wanted = rf.complex_modulus(plain, omega)
        np.testing.assert_array_equal(rf.complex_modulus(shifted, omega), wanted)


def on_road(material):
    return rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(material))


def test_contact_shear():
    scene = on_road(prony(None))
    laws = (rf.Arrhenius(0.5, T_REF, vertical=vertical) for vertical in (None, ENTROPIC))
    shears = (rf.ContactShear(6.5e6, 0.1, 6e-3, shift=law) for law in laws)
    plain, shifted = (dataclasses.replace(scene, shear=shear) for shear in shears)
    found, wanted = (
        rf.solve(s, V, 3e5, T, quantities=("shear_friction",)).shear_friction for s in (shifted, plain)
    )
    np.testing.assert_allclose(found / wanted, [factor(ENTROPIC, x) for x in T], rtol=1e-12)


def test_bulk_modulus():
    with pytest.raises(ValueError, match=r"^PronyShear\.shift\.vertical is given: must be None"):
        rf.PronyShear(1e6, [1e6], [1.0], 2e9, wlf(ENTROPIC))


def test_scene_files(tmp_path):
    (tmp_path / "b.csv").write_text("T,bT\nK,-\n250,1.2\n300,1\n400,0.7\n")

    def loaded(vertical):
        content = scene_files.put(scene_files.FULL, {"lower.material.shift.vertical": vertical})
        return rf.load_scene(scene_files.write_scene(tmp_path, content)).lower.material.shift.vertical

    assert loaded({"kind": "table", "file": "b.csv"}).bT.tolist() == [1.2, 1.0, 0.7]
    assert loaded({"kind": "entropic", "expansion": 6e-4}) == ENTROPIC
    with pytest.raises(ValueError, match=r"lower\.material\.shift\.vertical\.kind = 'entropc'"):
        loaded({"kind": "entropc", "expansion": 6e-4})


def measured(law):
    omega = np.tile(np.logspace(-1, 3, 20), 4)
    at = np.repeat([263.0, 283.0, 303.0, 323.0], 20)
    E = rf.complex_modulus(prony(wlf(law)), omega, at)
    return fitting.ModulusData(omega, E.real, E.imag, temperature=at)


def test_fit_of_a_modulus_at_several_temperatures():
    data = measured(rf.Entropic(8e-4))
    start = on_road(prony(wlf(rf.Entropic(1e-4))))
    free = {
        "upper.material.shift.vertical.expansion": fitting.Positive(),
        "upper.material.shift.C1": fitting.Positive(),
    }
    result = fitting.fit(start, data, free)
    assert result.success
    np.testing.assert_allclose(result.values, [8e-4, 8.86], rtol=1e-6)


def test_prony_fit_of_raw_curves():
    tau, none = [1e-5, 1e-3], 1e-4
    omega, at = np.tile(np.logspace(-1, 5, 30), 3), np.repeat([273.0, 293.0, 313.0], 30)
    solid = rf.Prony(4e6, [9e7, 1.5e7], tau, shift=wlf(rf.Entropic(2e-2)))
    E = rf.complex_modulus(solid, omega, at)
    found = fitting.fit_prony(
        fitting.ModulusData(omega, E.real, E.imag, temperature=at), tau=[*tau, none], shift=solid.shift
    )
    assert found.dropped.tolist() == [none]
    np.testing.assert_allclose(found.material.E, solid.E, rtol=1e-7)
    assert np.abs(found.residuals).max() < 1e-7
