"""Make the exports of a laboratory in `laboratory`: what its instruments would write of a known scene.

python data/make_laboratory.py
"""

import csv
from pathlib import Path

import jax
import numpy as np

import rubberfric as rf

FOLDER = Path(__file__).parent
EXPORTS = FOLDER / "laboratory"
SEED = 11
ZERO = 273.15  # 0 degrees Celsius [K]


def truth():
    """The scene that was measured: softening rubber of `tread_on_asphalt.toml` on a coarser road."""
    rubber = rf.load_scene(FOLDER / "tread_on_asphalt.toml").upper.material
    strain, storage, loss = np.loadtxt(FOLDER / "tread_softening.csv", delimiter=",", skiprows=2).T
    return rf.Scene(
        rf.Body(rf.Rigid(), rf.SelfAffine(q0=300.0, qr=3000.0, q1=4.0e5, hurst=0.85, h_rms=1.5e-4)),
        rf.Body(rubber),
        shear=rf.ContactShear(2.0e6, 0.1, 6e-3, rf.Arrhenius(0.97, 293.15)),
        softening=rf.Softening(strain, storage, loss),
    )


def write(name, rows, delimiter, encoding="utf-8"):
    """Rows of text as a table."""
    with (EXPORTS / name).open("w", newline="", encoding=encoding) as file:
        csv.writer(file, delimiter=delimiter, lineterminator="\n").writerows(rows)


def german(value, digits=4):
    """A number with a decimal comma."""
    return f"{value:.{digits}g}".replace(".", ",")


def moduli(scene, rng):
    """Sweeps of a DMA at 15 temperatures: a German export with Hz, MPa and decimal commas."""
    frequency = np.geomspace(0.1, 100.0, 13)
    rows = [["Temperatur", "Frequenz", "Speichermodul", "Verlustmodul"], ["°C", "Hz", "MPa", "MPa"]]
    for celsius in (-50, -45, -40, -35, -30, -25, -20, -15, -10, 0, 10, 20, 40, 60, 80):
        E = np.asarray(
            rf.complex_modulus(scene.upper.material, 2 * np.pi * frequency, celsius + ZERO), complex
        )
        scatter = np.exp(0.02 * rng.standard_normal((2, frequency.size)))
        for f, storage, loss in zip(frequency, E.real * scatter[0], E.imag * scatter[1], strict=True):
            actual = celsius + 0.05 * rng.standard_normal()
            rows.append(
                [german(x, d) for x, d in ((actual, 4), (f, 4), (1e-6 * storage, 4), (1e-6 * loss, 4))]
            )
    write("dma_isothermen.csv", rows, ";", "cp1252")


def strains(scene, rng):
    """A strain sweep at 10 Hz and 20 degrees Celsius: strain in per cent, moduli in MPa, tabulators."""
    softening = scene.softening
    strain = np.geomspace(1e-4, 1.0, 25)
    E = complex(rf.complex_modulus(scene.upper.material, 20 * np.pi, 20 + ZERO))
    factors = (
        np.exp(np.interp(np.log(strain), np.log(softening.strain), np.log(factor)))
        for factor in (softening.storage, softening.loss)
    )
    storage, loss = (
        part * factor * np.exp(0.01 * rng.standard_normal(strain.size))
        for part, factor in zip((E.real, E.imag), factors, strict=True)
    )
    rows = [["Strain (%)", "Storage modulus (MPa)", "Loss modulus (MPa)"]]
    rows += [
        [f"{100 * e:.4g}", f"{1e-6 * s:.4g}", f"{1e-6 * x:.4g}"]
        for e, s, x in zip(strain, storage, loss, strict=True)
    ]
    write("strain_sweep.txt", rows, "\t")


def heights(scene, rng):
    """Six traces of a stylus, 20 mm each: x in mm, heights in micrometres, tilted as it lay."""
    n, step = 2048, 10e-6
    spectrum = scene.lower.spectrum
    q = 2 * np.pi * np.fft.rfftfreq(n, step)[1:]
    # C_1D of a line is the areal C integrated over the other direction.
    across = np.concatenate([[0.0], np.geomspace(1.0, 2 * float(spectrum.q1), 4000)])
    both = np.hypot(q[:, None], across)
    inside = (both >= float(spectrum.q0)) & (both <= float(spectrum.q1))
    C = np.where(inside, rf.power_spectrum(spectrum, np.where(inside, both, float(spectrum.qr))), 0.0)
    line = 2 * np.trapezoid(C, across, axis=1)
    columns = [np.arange(n) * step * 1e3]
    for _ in range(6):
        phase = rng.standard_normal(q.size) + 1j * rng.standard_normal(q.size)
        modes = np.sqrt(line * 2 * np.pi / (n * step) / 2) * phase
        trace = np.fft.irfft(np.concatenate([[0.0], modes]), n) * n
        columns.append(1e6 * trace + rng.normal(0, 60) + columns[0] * rng.normal(0, 3))
    rows = [["x", *(f"trace {k}" for k in range(1, 7))], ["mm", *["um"] * 6]]
    rows += [[f"{row[0]:.2f}", *(f"{z:.1f}" for z in row[1:])] for row in np.array(columns).T]
    write("stylus.csv", rows, ",")


def friction(scene, rng):
    """Runs of a linear tester: mm/s, degrees Celsius and N/mm2, 5 % from run to run."""
    rows = [["Sliding velocity [mm/s]", "Temperature [°C]", "Contact pressure [N/mm²]", "COF [-]"]]
    for celsius in (5.0, 20.0, 40.0):
        for pressure in (0.05, 0.2, 0.8):
            v = np.geomspace(1e-3, 10.0, 7)
            mu = np.asarray(rf.friction(scene, 1e-3 * v, 1e6 * pressure, celsius + ZERO))
            mu = mu * np.exp(0.05 * rng.standard_normal(v.size))
            rows += [
                [f"{a:.3g}", f"{celsius:g}", f"{pressure:g}", f"{m:.3f}"] for a, m in zip(v, mu, strict=True)
            ]
    write("linear_tester.csv", rows, ",")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    EXPORTS.mkdir(exist_ok=True)
    rng = np.random.default_rng(SEED)
    for make in (moduli, strains, heights, friction):
        make(truth(), rng)
