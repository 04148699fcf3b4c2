"""From the files of a DMA, a texture spectrum and a wheel tester to a fitted patch, by commands only.

The formulas of the instruments and of the truth share no code with the package, except the forces.
"""

from pathlib import Path

import numpy as np
import pytest

import fitting
import rubberfric as rf
from fitting.commands.main import main
from rubberfric.commands.main import main as scene_main

ZERO = 273.15  # 0 degrees Celsius [K]
E_INF, MODULI, TIMES = 4e6, np.geomspace(8e8, 1.5e6, 12), np.logspace(-10, 1, 12)
C1, C2, T_REF = 9.0, 120.0, 293.15
Q0, QR, Q1, HURST, HEIGHT = 250.0, 1500.0, 2e5, 0.8, 1.2e-4
SHEAR = {"tau_f0": 2e6, "c": 0.1, "v0": 6e-2}
ENERGY = 0.95
PATCH = {"length": 0.035, "width": 0.018, "stiffness": 6e7}


def log10_shift(T):
    return -C1 * (T - T_REF) / (C2 + T - T_REF)


def modulus(omega, T):
    """The Prony series E_inf + sum E i x / (1 + i x), x = omega a_T tau."""
    x = 1j * omega * 10 ** log10_shift(T) * TIMES
    return E_INF + np.sum(MODULI * x / (1 + x))


def areal(q):
    """C with a plateau from q0 to qr, of the height h^2 = 2 pi int q C dq."""
    decay = QR**2 * (1 - (Q1 / QR) ** (-2 * HURST)) / (2 * HURST)
    plateau = HEIGHT**2 / (2 * np.pi * ((QR**2 - Q0**2) / 2 + decay))
    inside = (q >= Q0) & (q <= Q1)
    return np.where(inside, plateau * (np.maximum(q, QR) / QR) ** (-2 - 2 * HURST), 0.0)


def scatter(rng, values, error=0.025):
    return values * np.exp(error * rng.standard_normal(np.shape(values)))


def write_moduli(rng):
    """NETZSCH Proteus: a block of columns for each frequency."""
    frequencies = (0.5, 1.0, 2.5, 5.0, 10.0, 25.0, 50.0)
    titles = (f"E'({f:.3f} Hz)/MPa;E''({f:.3f} Hz)/MPa" for f in frequencies)
    lines = ["#EXPORTTYPE:\tDATA ALL", "#INSTRUMENT:\tNETZSCH DMA 242E", f"##Temp./°C;{';'.join(titles)}"]
    for celsius in range(-40, 69, 6):
        E = [1e-6 * modulus(2 * np.pi * f, celsius + ZERO) for f in frequencies]
        cells = [f"{x:.5f}" for e in E for x in scatter(rng, [e.real, e.imag])]
        lines += [";".join([f"{celsius:.3f}", *cells])]
    Path("netzsch.csv").write_text("\n".join(lines), encoding="utf-8")


def write_texture(rng):
    """ISO 13473-4: G_d over n in cycles/m, h^2 = int G_d dn, from C_1D = int C dq_y."""
    n = np.geomspace(1.02 * Q0, 8e4, 41) / (2 * np.pi)
    across = np.concatenate([[0.0], np.geomspace(1e-3 * Q0, Q1, 6000)])
    line = 2 * np.trapezoid(areal(np.hypot(2 * np.pi * n[:, None], across)), across, axis=1)
    rows = zip(n, scatter(rng, 4 * np.pi * line, 0.03), strict=True)
    lines = ["Profile spectrum according to ISO 13473-4", "spatial frequency n [cycles/m];PSD Gd [m^3]"]
    Path("texture.csv").write_text("\n".join([*lines, *(f"{a:.6g};{b:.6g}" for a, b in rows)]))


def truth():
    rubber = rf.Prony(E_INF, MODULI, TIMES, 0.5, rf.WLF(C1, C2, T_REF))
    road = rf.Body(rf.Rigid(), rf.SelfAffine(Q0, QR, Q1, HURST, HEIGHT))
    shear = rf.ContactShear(**SHEAR, shift=rf.Arrhenius(ENERGY, T_REF))
    return rf.Scene(road, rf.Body(rubber), shear=shear, patch=rf.Patch(**PATCH))


def write_wheel(rng):
    """A table of a LAT100 with side forces and aligning moments, the moments with absolute errors."""
    scene = truth()
    titles = (
        "slip angle [deg];speed [km/h];load [N];side force [N];aligning moment [N mm];sigma_moment [N mm]"
    )
    lines, angle = [f"{titles};temperature [°C]"], np.array([0.5, 1, 1.5, 2, 3, 4.5, 7, 10, 14])
    for celsius in (5, 25, 45):
        for speed, load in ((0.2, 75.0), (2.0, 75.0), (12.0, 75.0), (2.0, 120.0)):
            found = rf.grip(scene, scene.patch, np.radians(angle), speed / 3.6, load, celsius + ZERO)
            forces = scatter(rng, np.asarray(found.force))
            moments = 1e3 * np.asarray(found.moment) + rng.standard_normal(angle.size)
            rows = zip(angle, forces, moments, strict=True)
            lines += [f"{a};{speed};{load};{f:.3f};{m:.3f};1;{celsius}" for a, f, m in rows]
    Path("wheel.csv").write_text("\n".join(lines), encoding="utf-8")


@pytest.mark.slow
def test_from_a_wheel_tester_to_a_patch(call_main, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(72)
    for write in (write_moduli, write_texture, write_wheel):
        write(rng)

    def call(*arguments, program=main):
        status, printed, complaint = call_main(program, *arguments, "--no-cache")
        assert (status, complaint) == (0, ""), complaint
        return printed

    assert "WLF" in call("mastercurve", "netzsch.csv", "--out", "material.toml")
    call("spectrum", "texture.csv", "--scene", "material.toml", "--slope", "0.7", "--out", "scene.toml")
    guess = "\n[patch]\nlength = 0.04\nwidth = 0.018\nstiffness = 4e7\n"
    Path("scene.toml").write_text(Path("scene.toml").read_text() + guess)
    options = ("--relative", "0.025", "--kind", "force", "moment", "--shear", "--out", "job.toml")
    call("job", "scene.toml", "wheel.csv", *options)
    call("job.toml", "--out", "fit.h5")

    scene = rf.load_scene("scene.toml")
    for celsius in (0.0, 20.0, 50.0):
        T = celsius + ZERO
        for f in (0.1, 10.0, 1e3):
            found = complex(rf.complex_modulus(scene.upper.material, 2 * np.pi * f, T))
            assert abs(found / modulus(2 * np.pi * f, T) - 1) < 0.05, (celsius, f)
        shift = float(scene.upper.material.shift.log_factor(T)) / np.log(10)
        base = float(scene.upper.material.shift.log_factor(T_REF)) / np.log(10)
        assert abs(shift - base - log10_shift(T)) < 0.1
    road = scene.lower.spectrum
    assert float(rf.roughness.rms_height(road)) == pytest.approx(HEIGHT, rel=0.05)
    for q in (1e3, 1e4, 6e4):
        assert float(rf.power_spectrum(road, q)) == pytest.approx(float(areal(np.array(q))), rel=0.2)
    result = fitting.FitResult.load("fit.h5")
    assert result.verdict.explains
    for name, value in {"patch.length": PATCH["length"], "patch.stiffness": PATCH["stiffness"]}.items():
        assert abs(result[name].value - value) < 3 * result[name].stderr, name
    for name, value in {"shear.c": SHEAR["c"], "shear.shift.energy": ENERGY}.items():
        assert result[name].value == pytest.approx(value, rel=0.2), name
    velocity = np.array([1e-3, 1e-2, 1e-1])
    friction = [np.asarray(rf.friction(one, velocity, 1.2e5, T_REF)) for one in (result.scene, truth())]
    np.testing.assert_allclose(*friction, rtol=0.05)
    # The patch of the scene that was fitted.
    rf.save_scene("fitted.toml", result.scene)
    at = ("--slip", "0.05", "--speed", "0.5", "--load", "75", "--temperature", "298.15")
    row = call("grip", "fitted.toml", *at, program=scene_main).splitlines()[1].split()
    scene = truth()
    exact = rf.grip(scene, scene.patch, 0.05, 0.5, 75.0, 298.15)
    assert float(row[3]) == pytest.approx(float(exact.force), rel=0.03)
