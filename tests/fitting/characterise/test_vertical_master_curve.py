"""Vertical shifts of a master curve reach its laws, the Prony series, the scene and the files."""

import numpy as np
import pytest
from support.cases.isotherms import T, isotherms

import rubberfric as rf
from fitting import fit_master_curve, fit_prony, read
from fitting.commands.main import main


def sweeps(factor, noise=0.0):
    return isotherms(noise=noise, seed=3, factor=factor)


def falling(T):
    return np.exp(-0.008 * (T - 293.15))


def rising(T):
    return T / 293.15 * np.exp(-6e-4 * (T - 293.15))


def ratios(material, data):
    """|E*| of a material divided by the measured |E*|, mean of each sweep."""
    modulus = np.asarray(rf.complex_modulus(material, data.omega, data.temperature))
    ratio = np.abs(modulus) / np.hypot(data.storage, data.loss)
    return np.array([ratio[data.temperature == one].mean() for one in T])


@pytest.fixture(scope="module")
def falling_curve():
    return fit_master_curve(sweeps(falling, 0.01), 293.15, vertical=True)


def test_the_law_and_the_table_have_the_vertical_shift(falling_curve):
    np.testing.assert_allclose(falling_curve.table.vertical.bT, np.exp(falling_curve.log_bT), rtol=1e-12)
    np.testing.assert_allclose(falling_curve.shift.vertical.bT, falling(T), rtol=0.05)
    assert isinstance(falling_curve.shift, rf.WLF)
    for law in (falling_curve.shift, falling_curve.table, falling_curve.arrhenius.shift):
        assert isinstance(law.vertical, rf.TabulatedVertical) and float(law.T_ref) == pytest.approx(293.15)
    assert fit_master_curve(sweeps(np.ones_like), 293.15).shift.vertical is None


@pytest.mark.parametrize("suffix", [".toml", ".h5"])
def test_a_saved_scene_has_the_measured_moduli(falling_curve, suffix, tmp_path):
    """At every temperature, not only at T_ref: 0.78 to 1.38 times the data without the vertical shift."""
    material = fit_prony(falling_curve.data, 2.0, shift=falling_curve.shift).material
    place = tmp_path / f"scene{suffix}"
    rf.save_scene(place, rf.Scene(rf.Body(material), rf.Body(rf.Rigid())))
    loaded = rf.load_scene(place).lower.material
    np.testing.assert_allclose(ratios(loaded, sweeps(falling)), 1.0, atol=0.015)


def test_the_law_and_the_table_have_the_entropic_shift():
    curve = fit_master_curve(sweeps(rising, 0.01), 293.15, vertical="entropic")
    for law in (curve.shift, curve.table):
        assert isinstance(law.vertical, rf.Entropic) and float(law.vertical.expansion) == 6e-4
    assert curve.shift is curve.shift


def advice(curve, **options):
    lines = [line for line in curve.report(**options).splitlines() if "moduli change" in line]
    return lines[0].partition("; ")[2] if lines else ""


def test_advice_follows_the_trend(falling_curve):
    """Entropic moduli rise with temperature, so they are no advice for moduli that fall."""
    falls, rises = (fit_master_curve(sweeps(one, 0.01), 293.15) for one in (falling, rising))
    assert advice(falls) == "vertical=True removes it"
    assert advice(falls, command=True) == "--vertical free removes it"
    assert advice(rises) == 'vertical="entropic" removes it'
    assert advice(rises, command=True) == "--vertical entropic removes it"
    assert advice(falling_curve) == ""
    wrong = fit_master_curve(sweeps(falling, 0.01), 293.15, vertical="entropic")
    assert advice(wrong) == "vertical=True removes it" and "beyond the entropic b_T" in wrong.report()


def test_the_command_writes_the_vertical_shift(tmp_path):
    """`rubberfric-fit mastercurve` with each value of --vertical."""
    data = sweeps(rising, 0.01)
    place, out = tmp_path / "sweeps.csv", tmp_path / "scene.toml"
    data.write(place)
    np.testing.assert_allclose(read(place).storage, data.storage, rtol=1e-6)
    for setting, kind in (("free", rf.TabulatedVertical), ("entropic", rf.Entropic)):
        arguments = ["mastercurve", str(place), "--vertical", setting, "--out", str(out), "--no-cache"]
        assert main(arguments) == 0
        material = rf.load_scene(out).upper.material
        assert isinstance(material.shift.vertical, kind)
        np.testing.assert_allclose(ratios(material, sweeps(rising)), 1.0, atol=0.015)
        out.unlink()
