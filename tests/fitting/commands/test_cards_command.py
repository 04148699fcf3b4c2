"""`rubberfric-fit cards`: cards of scenes, fits and tables, read back with the same modulus."""

import functools

import numpy as np
import pytest
from support.scenes.fits import ROAD

import fitting
import rubberfric as rf
from fitting.commands.arguments import CARD_SUFFIXES
from rubberfric.io.prony_cards import FORMATS

E, TAU = np.array([4e6, 2e6, 1e6]), np.array([1e-6, 1e-4, 1e-2])
RUBBER = rf.Prony(1e6, E, TAU, 0.499, rf.WLF(8.86, 101.6, 293.15, vertical=rf.Entropic()))
PLAIN = rf.Prony(1e6, E, TAU, 0.5)
OMEGA = np.geomspace(1.0, 1e7, 15)
MODULUS = 1e6 + (E * 1j * OMEGA[:, None] * TAU / (1 + 1j * OMEGA[:, None] * TAU)).sum(axis=1)


@pytest.fixture
def run(run):
    """Run `rubberfric-fit cards` in a folder with three scenes: exit status, stdout, stderr."""
    rf.save_scene("rubber.toml", rf.Scene(ROAD, rf.Body(RUBBER)))
    rf.save_scene("plain.toml", rf.Scene(ROAD, rf.Body(PLAIN)))
    rf.save_scene("two.toml", rf.Scene(rf.Body(PLAIN), rf.Body(RUBBER)))
    return functools.partial(run, "cards")


def test_suffixes_name_all_programs():
    assert sorted(CARD_SUFFIXES.values()) == sorted(FORMATS)


@pytest.mark.parametrize("suffix", CARD_SUFFIXES)
def test_round_trip_of_a_scene(run, suffix):
    """E* of the cards is that of the scene; LS-DYNA's fields hold 6 digits."""
    program = CARD_SUFFIXES[suffix]
    options = [] if program in ("abaqus", "pyvisco") else ["--bulk", "2e9"]
    options += ["--density", "1100"] if program in ("lsdyna", "openradioss") else []
    status, printed, _ = run("plain.toml", "--out", f"cards{suffix}", *options)
    assert status == 0 and f"terms for {program}, in MPa and s" in printed
    back = rf.io.read_prony(f"cards{suffix}", unit_stress=None if program == "pyvisco" else "MPa")
    rtol = 2e-5 if program == "lsdyna" else 1e-6
    np.testing.assert_allclose(np.asarray(rf.complex_modulus(back, OMEGA)), MODULUS, rtol=rtol)
    s = 1j * 1e3 * TAU
    exact = 1e6 + np.sum(E * s / (1 + s))
    assert f"omega = 1000 rad/s: E' = {exact.real:.6g} Pa, E'' = {exact.imag:.6g} Pa" in printed


def test_a_vertical_shift_and_one_temperature(run):
    given = ("rubber.toml", "--out", "tread.inp", "--unit-temperature", "C")
    status, _, errors = run(*given)
    assert status == 2 and "--temperature is missing: must be (lowest, highest) [K]" in errors
    assert run(*given, "--temperature", 273.15, 333.15, "--hyperelastic", "--name", "TREAD")[0] == 0
    units = {"unit_stress": "MPa", "unit_temperature": "C"}
    warm = complex(rf.complex_modulus(rf.io.read_prony("tread.inp", name="tread", **units), 10.0, 333.15))
    assert warm == pytest.approx(complex(rf.complex_modulus(RUBBER, 10.0, 333.15)), rel=1e-4)
    assert run("rubber.toml", "--out", "warm.inp", "--no-shift", "--temperature", 333.15)[0] == 0
    found = complex(rf.complex_modulus(rf.io.read_prony("warm.inp", unit_stress="MPa"), 10.0))
    assert found == pytest.approx(complex(rf.complex_modulus(RUBBER, 10.0, 333.15)), rel=1e-9)


def test_a_master_curve_and_a_creep_compliance(run):
    fitting.ModulusData(OMEGA, MODULUS.real, MODULUS.imag).write("curve.csv")
    assert run("curve.csv", "--out", "cards.inp", "--unit-stress", "Pa")[0] == 0
    found = np.asarray(rf.complex_modulus(rf.io.read_prony("cards.inp", unit_stress="Pa"), OMEGA))
    np.testing.assert_allclose(np.abs(found), np.abs(MODULUS), rtol=0.02)
    t = np.geomspace(1e-7, 1e-1, 25)
    fitting.RelaxationData(t, 1e6 + np.exp(-t[:, None] / TAU) @ E).write("relaxation.csv")
    status, printed, _ = run("relaxation.csv", "--out", "cards.csv", "--program", "pyvisco")
    assert status == 0 and "rms of ln(fit / measured): E(t)" in printed
    found = np.asarray(rf.complex_modulus(rf.io.read_prony("cards.csv"), OMEGA))
    np.testing.assert_allclose(np.abs(found), np.abs(MODULUS), rtol=0.02)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("two.toml", "--out", "a.inp"), "two.toml: body must be given, lower, upper"),
        (("plain.toml", "--out", "a.k"), "density is missing: must be given for lsdyna"),
        (("plain.toml", "--out", "a.mac"), "--bulk is missing: must be given for ansys"),
        (("plain.toml", "--out", "a.pdf"), "must be .inp or .mac or .txt or .k or .rad or .csv"),
        (("plain.toml", "--out", "a.txt", "--hyperelastic", "--bulk", "2e9"), "must be False for comsol"),
        (("plain.toml", "--out", "a.inp", "--temperature", "300"), "must not be given"),
    ],
)
def test_refusals(run, arguments, message, tmp_path):
    status, _, errors = run(*arguments)
    assert status == 2 and message in errors, errors
    assert not (tmp_path / arguments[2]).exists()


def test_the_body_is_chosen(run):
    assert run("two.toml", "--body", "lower", "--out", "a.inp")[0] == 0
    assert float(rf.io.read_prony("a.inp", unit_stress="MPa").poisson) == 0.5
