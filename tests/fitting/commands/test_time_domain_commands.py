"""Scenes from relaxation moduli and creep compliances, by commands only."""

import numpy as np
import pytest
from support.scenes.fits import SCENE

import rubberfric as rf

TAU = np.geomspace(1e-6, 1e6, 25)
E = 3e5 * np.exp(-((np.log10(TAU) / 4) ** 2))
REST = 1e6
TIMES = np.geomspace(1e-1, 1e3, 25)


def ratio(path, omega, T=None):
    """|E*| of a scene, divided by that of the true series at 293.15 K."""
    found = rf.complex_modulus(rf.load_scene(path).upper.material, np.array(omega), T)
    s = 1j * np.array(omega)[:, None] * TAU
    return np.abs(np.asarray(found)) / np.abs(REST + (s / (1 + s)) @ E)


@pytest.mark.slow
def test_isotherms_of_stress_relaxation(run, tmp_path):
    """a_T shifts times. The reference sweep has E* of the truth, and WLF has the true constants."""
    rows = []
    for T in (273.15, 283.15, 293.15, 303.15, 313.15):
        a_T = 10 ** (-6.0 * (T - 293.15) / (110 + T - 293.15))
        modulus = REST + np.exp(-TIMES[:, None] / a_T / TAU) @ E
        rows += [f"{t:.8g},{m / 1e6:.8g},{T}" for t, m in zip(TIMES, modulus, strict=True)]
    table = "Time [s],Relaxation modulus E(t) [MPa],T [K]\n"
    (tmp_path / "relaxation.csv").write_text(table + "\n".join(rows) + "\n")
    status, printed, _ = run("mastercurve", "relaxation.csv", "--out", "scene.toml", "--plot", "one.png")
    assert status == 0 and "WLF" in printed and (tmp_path / "one.png").stat().st_size > 10_000
    shift = rf.load_scene("scene.toml").upper.material.shift
    for T, exact in ((273.15, 6.0 * 20 / 90), (313.15, -6.0 * 20 / 130)):
        assert float(shift.log_factor(T)) / np.log(10) == pytest.approx(exact, rel=0.02)
    np.testing.assert_allclose(ratio("scene.toml", [1e-3, 1e-1, 1e1, 1e2], 293.15), 1, atol=0.02)


def test_creep_at_one_temperature(run, tmp_path):
    """E* = 1 / D* of the retardation series whose D(t) is measured."""
    D_0, D = 2e-7, 2e-13 * E
    creep = D_0 - np.expm1(-TIMES[:, None] / TAU) @ D
    rows = "\n".join(f"{t:.8g},{3 * d * 1e6:.8g}" for t, d in zip(TIMES, creep, strict=True))
    (tmp_path / "creep.csv").write_text(f"Step time (s),J(t) (1/MPa)\n{rows}\n")
    files = ("mastercurve", "creep.csv", "--poisson", "0.5")
    assert run(*files, "--out", "scene.toml")[0] == 0
    omega = np.array([1e-2, 1e-1, 1.0])
    exact = D_0 + np.sum(D / (1 + 1j * omega[:, None] * TAU), axis=1)
    modulus = np.asarray(rf.complex_modulus(rf.load_scene("scene.toml").upper.material, omega))
    np.testing.assert_allclose(np.abs(modulus * exact), 1, atol=0.005)
    assert run(*files, "--out", "moduli.csv")[0] == 0
    table = rf.io.read_table("moduli.csv", ("omega", "E_stor", "E_loss", "sigma_stor", "sigma_loss"))
    assert table["omega"].size == 21 and (table["sigma_stor"] < 0.1 * table["E_stor"]).all()


def test_one_of_two_samples_beside_each_other(run, tmp_path):
    omega = np.geomspace(1e-2, 1e2, 17)
    s = 1j * omega[:, None] * TAU
    modulus = REST + (s / (1 + s)) @ E
    titles = ";".join(["Frequency [rad/s];E' [Pa];E'' [Pa]"] * 2)
    rows = "\n".join(
        f"{w};9e6;1e6;{w};{x.real:.9g};{x.imag:.9g}" for w, x in zip(omega, modulus, strict=True)
    )
    (tmp_path / "two.csv").write_text(f"{titles}\n{rows}\n")
    assert run("mastercurve", "two.csv", "--block", 2, "--out", "scene.toml")[0] == 0
    np.testing.assert_allclose(ratio("scene.toml", [1e-1, 1.0, 1e1]), 1, atol=0.005)


def test_the_kind_of_stress_and_strain_over_time(run, tmp_path):
    """A strain of 1 % under stress E(t) / 100."""
    modulus = REST + np.exp(-TIMES[:, None] / TAU) @ E
    rows = "\n".join(f"{t:.8g},{m / 1e8:.8g},1" for t, m in zip(TIMES, modulus, strict=True))
    (tmp_path / "stress.csv").write_text(f"Time (s),Tensile stress (MPa),Tensile strain (%)\n{rows}\n")
    status, _, errors = run("mastercurve", "stress.csv", "--out", "scene.toml")
    assert status == 2 and "no column E_stor" in errors
    assert run("mastercurve", "stress.csv", "--kind", "relaxation", "--out", "scene.toml")[0] == 0
    np.testing.assert_allclose(ratio("scene.toml", [1e-2, 1e-1, 1.0]), 1, atol=0.005)


def test_a_job_refuses_data_over_time(run, tmp_path):
    (tmp_path / "relaxation.csv").write_text("t,E_relax\ns,Pa\n1,2e6\n2,1e6\n")
    rf.save_scene("scene.toml", SCENE)
    status, _, errors = run("job", "scene.toml", "relaxation.csv", "--out", "job.toml")
    assert status == 2 and "fit_prony(data).moduli() converts it" in errors
