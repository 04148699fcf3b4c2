"""Options of the laboratory commands, with results from formulas in NumPy."""

import math
from pathlib import Path

import numpy as np
import pytest

import fitting
import rubberfric as rf
from fitting.commands.job import read_job
from rubberfric.commands.main import main as scene_main

E_INF = 2e6  # [Pa]
E = np.array([3e7, 1e7, 4e6])  # [Pa]
TAU = np.array([1e-4, 1e-2, 1.0])  # [s]
C1 = 8.0
C2 = 110.0  # [K]
T_REF = 293.15  # [K]
SCENE = """
[lower]
material = { kind = "rigid" }
spectrum = { kind = "self_affine", q0 = 1e3, qr = 1e4, q1 = 1e6, hurst = 0.7, h_rms = 1e-5 }
[upper]
material = { kind = "prony", E_inf = 2e6, E = [3e7, 1e7, 4e6], tau = [1e-4, 1e-2, 1.0] }
"""


@pytest.fixture
def run(run):
    """Run a command in a folder with a scene, and return stdout."""
    Path("scene.toml").write_text(SCENE)

    def good(*arguments):
        status, printed, complaint = run(*arguments)
        assert status == 0, complaint
        return printed

    return good


def modulus(omega, T=T_REF):
    """E* of a Prony series that follows a WLF law [Pa]."""
    reduced = omega * 10 ** (-C1 * (T - T_REF) / (C2 + T - T_REF))
    i_omega_tau = 1j * reduced[:, None] * TAU
    return E_INF + (E * i_omega_tau / (1 + i_omega_tau)).sum(1)


def write_moduli(name, T, factor=1.0, head="omega,E_stor,E_loss\nrad/s,Pa,Pa\n", unit=1.0):
    omega = np.logspace(-1, 2, 16)
    found = factor * modulus(omega, T)
    write_rows(name, head, omega, found.real / unit, found.imag / unit)


def write_rows(name, head, *columns):
    rows = [",".join(f"{value:.9g}" for value in row) + "\n" for row in zip(*columns, strict=True)]
    Path(name).write_text(head + "".join(rows))


def test_mastercurve_of_shear_moduli_without_titles_and_temperatures(run):
    """--temperature, --reference, --poisson, --columns and --bad-rows; G = E / (2 (1 + nu)), in MPa."""
    temperatures, nu = (278.15, 293.15, 308.15, 323.15), 0.45
    for T in temperatures:
        write_moduli(f"{T}.csv", T, 1 / (2 * (1 + nu)), head="0.05,n/a,1\n", unit=1e6)
    files = [f"{T}.csv" for T in temperatures]
    columns = ("omega [rad/s]", "G' [MPa]", "G'' [MPa]")
    with pytest.warns(UserWarning, match="line"):
        printed = run(
            "mastercurve", *files, "--temperature", *temperatures, "--reference", T_REF, "--poisson", nu,
            "--columns", *columns, "--bad-rows", "drop", "--out", "new.toml",
        )  # fmt: skip
    assert "WLF" in printed
    omega = np.logspace(-1, 3, 9)  # between the times of the series, the fit is off by 6 %
    material = rf.load_scene("new.toml").upper.material
    found = np.asarray(rf.complex_modulus(material, omega, T_REF))
    np.testing.assert_allclose(np.abs(found), np.abs(modulus(omega)), rtol=0.08)
    assert float(material.poisson) == nu and float(material.shift.T_ref) == pytest.approx(T_REF)
    for T in (283.15, 313.15):
        expected = -C1 * (T - T_REF) / (C2 + T - T_REF) * math.log(10)
        assert float(material.shift.log_factor(T)) == pytest.approx(expected, abs=0.05)


def test_mastercurve_of_a_strain_sweep_without_titles(run):
    write_moduli("one.csv", T_REF)
    strains, storage, loss = (0.001, 0.01, 0.1, 1.0), (5.0, 4.99, 3.5, 2.5), (0.5, 0.5, 0.5, 0.3)
    write_rows("strain.csv", "", strains, storage, loss)
    columns = ("--strain-columns", "strain [-]", "E_stor [MPa]", "E_loss [MPa]")
    run("mastercurve", "one.csv", "--strain", "strain.csv", *columns, "--out", "new.toml")
    softening = rf.load_scene("new.toml").upper.softening
    np.testing.assert_allclose(softening.strain[-1], 1.0)
    np.testing.assert_allclose(np.asarray(softening.storage)[-1], 0.5, rtol=0.02)


H = 0.7
# C_1D / (q C) of a power law without ends.
LINE = math.sqrt(math.pi) * math.gamma(H + 0.5) / math.gamma(H + 1)


def spectrum(qr):
    """q, and a C that is constant up to qr and a power law above it."""
    q = np.logspace(3, 6, 61)
    return q, 1e-18 * np.minimum(1.0, (q / qr) ** (-2 * (1 + H)))


def write_line(head):
    """Write C_1D of a power law; return its q and C."""
    q, C = spectrum(1e2)
    write_rows("line.csv", head, q, LINE * q * C)
    return q, C


@pytest.mark.parametrize(("name", "factor"), [("C", 1.0), ("C_iso", 4 * math.pi**2)])
def test_spectrum_of_two_normalisations(run, name, factor):
    q, C = spectrum(1e4)
    write_rows("psd.csv", "q,C\n1/m,m^4\n", q, factor * C)
    run("spectrum", "psd.csv", "--normalisation", name, "--q1", "5e5", "--out", "road.toml")
    found = rf.load_scene("road.toml").lower.spectrum
    assert float(found.hurst) == pytest.approx(0.7, abs=0.01)
    assert float(found.qr) == pytest.approx(1e4, rel=0.05)
    assert float(found.q1) == pytest.approx(5e5, rel=0.06)  # the last wavevector below
    inside = q <= 5e5
    height = math.sqrt(2 * math.pi * np.trapezoid(q[inside] ** 2 * C[inside], np.log(q[inside])))
    assert float(found.h_rms) == pytest.approx(height, rel=0.03)


def test_spectrum_along_a_line(run):
    q, C = write_line("500,bad\n")
    columns = ("--columns", "q [1/m]", "C_1D [m^3]", "--bad-rows", "drop")
    with pytest.warns(UserWarning, match="line"):
        run("spectrum", "line.csv", "--normalisation", "C_1D", "--hurst", H, *columns, "--out", "areal.csv")
    found = fitting.read("areal.csv", normalisation="C")
    np.testing.assert_allclose(found.q, q, rtol=1e-8)
    np.testing.assert_allclose(found.C, C, rtol=1e-6)


def test_a_job_of_moduli(run):
    """--body, --poisson, --columns and --kind go into the job, whose fit finds E_inf."""
    write_moduli("g.txt", T_REF, 1 / 3, head="", unit=1e6)
    columns = ("omega [rad/s]", "G' [MPa]", "G'' [MPa]")
    run(
        "job", "scene.toml", "g.txt", "--body", "upper", "--poisson", "0.5", "--kind", "modulus",
        "--columns", *columns, "--relative", "0.01", "--free", "upper.material.E_inf", "--out", "job.toml",
    )  # fmt: skip
    text = Path("job.toml").read_text().replace('"positive"', '{ rule = "positive", start = 1e6 }')
    Path("job.toml").write_text(text)
    run("job.toml", "--out", "fit.h5")
    result = fitting.FitResult.load("fit.h5")
    assert result["upper.material.E_inf"].value == pytest.approx(E_INF, rel=1e-4)


def test_a_job_of_a_spectrum_along_a_line(run):
    q, C = write_line("q,C_1D\n1/m,m^3\n")
    given = ("--body", "lower", "--normalisation", "C_1D", "--hurst", H, "--relative", "0.01")
    run("job", "scene.toml", "line.csv", *given, "--free", "lower.spectrum.hurst", "--out", "job.toml")
    (data,) = read_job("job.toml").data
    np.testing.assert_allclose(data.C, C, rtol=1e-6)
    np.testing.assert_allclose(data.q, q, rtol=1e-8)


def test_a_job_of_unusual_values(run, call):
    """A pressure of 0.5 Pa is refused, unless the option accepts it, which the job keeps."""
    Path("f.csv").write_text("v,mu,p\nm/s,-,Pa\n1e-3,0.1,0.5\n1e-2,0.2,0.5\n1e-1,0.3,0.5\n")
    status, _, complaint = call("job", "scene.toml", "f.csv", "--out", "job.toml", "--no-cache")
    assert status == 2 and "(--no-check-units accepts it)" in complaint
    printed = run("job", "scene.toml", "f.csv", "--no-check-units", "--out", "job.toml")
    assert "check_units = false" in printed
    np.testing.assert_array_equal(read_job("job.toml").data[0].pressure, 0.5)


@pytest.mark.usefixtures("run")
def test_a_map_on_a_number_of_devices(call_main):
    """In this process JAX has started with one device; the map has the same numbers as the run."""
    conditions = "[run]\nvelocity = [1e-3, 1e-2, 0.1]\npressure = [1e5, 4e5]\n"
    Path("scene.toml").write_text(SCENE + conditions)
    for command, *options in (("map", "--devices", "1"), ("run",)):
        arguments = (command, "scene.toml", *options, "--out", f"{command}.h5", "--no-cache")
        assert call_main(scene_main, *arguments)[0] == 0
    found, expected = (rf.io.load_result(name) for name in ("map.h5", "run.h5"))
    np.testing.assert_allclose(found.solution.friction, expected.solution.friction, rtol=1e-8)
