"""Write the files of three laboratories from known materials, roughness and contact shear.

The formulas of moduli, spectra and heights share no code with the package. Friction and forces come from the
package.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

import rubberfric as rf

ZERO = 273.15  # 0 degrees Celsius [K]
SHEAR_T_REF = 293.15  # reference temperature of the contact shear of all laboratories [K]


class Truth(NamedTuple):
    """Material, roughness and contact shear that make the files of a laboratory."""

    E_inf: float
    E: np.ndarray
    tau: np.ndarray
    C1: float
    C2: float
    T_ref: float
    q0: float
    qr: float
    q1: float
    hurst: float
    h_rms: float
    shear: dict[str, float]
    energy: float
    patch: dict[str, float] | None = None

    def log10_shift(self, T):
        return -self.C1 * (T - self.T_ref) / (self.C2 + T - self.T_ref)

    def modulus(self, omega, T):
        """The Prony series E_inf + sum E i x / (1 + i x), x = omega a_T tau."""
        x = 1j * omega * 10 ** self.log10_shift(T) * self.tau
        return self.E_inf + np.sum(self.E * x / (1 + x))

    def areal(self, q):
        """C with a plateau from q0 to qr, of the height h^2 = 2 pi int q C dq."""
        decay = self.qr**2 * (1 - (self.q1 / self.qr) ** (-2 * self.hurst)) / (2 * self.hurst)
        plateau = self.h_rms**2 / (2 * np.pi * ((self.qr**2 - self.q0**2) / 2 + decay))
        inside = (q >= self.q0) & (q <= self.q1)
        return np.where(inside, plateau * (np.maximum(q, self.qr) / self.qr) ** (-2 - 2 * self.hurst), 0.0)

    def along_line(self, q):
        """C_1D = int C dq_y over all q_y."""
        across = np.concatenate([[0.0], np.geomspace(1e-3 * self.q0, self.q1, 6000)])
        return 2 * np.trapezoid(self.areal(np.hypot(q[:, None], across)), across, axis=1)

    def scene(self):
        rubber = rf.Prony(self.E_inf, self.E, self.tau, 0.5, rf.WLF(self.C1, self.C2, self.T_ref))
        road = rf.Body(rf.Rigid(), rf.SelfAffine(self.q0, self.qr, self.q1, self.hurst, self.h_rms))
        shear = rf.ContactShear(**self.shear, shift=rf.Arrhenius(self.energy, SHEAR_T_REF))
        patch = None if self.patch is None else rf.Patch(**self.patch)
        return rf.Scene(road, rf.Body(rubber), shear=shear, patch=patch)


def scatter(rng, values, error=0.025):
    return values * np.exp(error * rng.standard_normal(np.shape(values)))


def put(name, lines, encoding="utf-8"):
    Path(name).write_text("\n".join(lines) + "\n", encoding=encoding)


def megapascals(truth, rng, frequencies, celsius, error):
    """Return E' and E'' at each frequency and one temperature [MPa], with noise."""
    E = 1e-6 * np.array([truth.modulus(2 * np.pi * f, celsius + ZERO) for f in frequencies])
    return scatter(rng, np.array([E.real, E.imag]), error).T


FORCES = Truth(
    *(5e6, np.geomspace(6e8, 2e6, 12), np.logspace(-9, 2, 12), 10.0, 140.0, 293.15),
    *(200.0, 2000.0, 6e5, 0.8, 8e-5, {"tau_f0": 3e6, "c": 0.12, "v0": 2e-2}, 0.9),
)
RECORDS = Truth(
    *(3e6, np.geomspace(9e8, 1e6, 12), np.logspace(-10, 1, 12), 8.0, 130.0, 283.15),
    *(700.0, 4000.0, 5e5, 0.85, 5e-5, {"tau_f0": 4e6, "c": 0.15, "v0": 5e-3}, 1.1),
)
WHEEL = Truth(
    *(4e6, np.geomspace(8e8, 1.5e6, 12), np.logspace(-10, 1, 12), 9.0, 120.0, 293.15),
    *(250.0, 1500.0, 2e5, 0.8, 1.2e-4, {"tau_f0": 2e6, "c": 0.1, "v0": 6e-2}, 0.95),
    {"length": 0.035, "width": 0.018, "stiffness": 6e7},
)


# --- laboratory 1


def write_trios(truth, rng):
    """TA Instruments TRIOS: tabs, UTF-16, and a step for each of 10 temperatures."""
    lines = ["Filename\ttread.tri", "Instrument serial number\t4010-0420", ""]
    titles = ("Angular frequency", "Storage modulus", "Loss modulus", "Tan(delta)", "Frequency")
    frequencies = np.geomspace(0.1, 100.0, 15)
    for celsius in range(-40, 51, 10):
        lines += ["[step]", f"Frequency sweep at {celsius} °C", f"Number of points\t{frequencies.size}"]
        lines += ["\t".join([*titles, "Temperature", "Step time"]), "rad/s\tMPa\tMPa\t\tHz\t°C\ts"]
        rows = zip(frequencies, megapascals(truth, rng, frequencies, celsius, 0.02), strict=True)
        lines += [
            f"{2 * np.pi * f:.9g}\t{a:.5g}\t{b:.5g}\t{b / a:.5f}\t{f:.9g}\t{celsius}\t12.5"
            for f, (a, b) in rows
        ]
    put("trios.txt", lines, "utf-16")


def write_stylus(truth, rng):
    """Eight traces of 32 mm: x in mm, tilted heights in micrometres. Each is half of a periodic line."""
    n, step = 4000, 8e-6
    q = 2 * np.pi * np.fft.rfftfreq(2 * n, step)[1:]
    amplitude = np.sqrt(truth.along_line(q) * 2 * np.pi / (2 * n * step) / 2)
    x, columns = np.arange(n) * step, []
    for _ in range(8):
        modes = amplitude * (rng.standard_normal(q.size) + 1j * rng.standard_normal(q.size))
        heights = np.fft.irfft(np.concatenate([[0.0], modes]), norm="forward")[:n]
        columns.append(1e6 * heights + rng.normal(0, 60) + 1e3 * x * rng.normal(0, 3))
    lines = [",".join(["x", *(f"trace {k}" for k in range(1, 9))]), ",".join(["mm", *["um"] * 8])]
    rows = zip(x, np.array(columns).T, strict=True)
    put(
        "stylus.csv", [*lines, *(",".join([f"{1e3 * a:.3f}", *(f"{z:.2f}" for z in row)]) for a, row in rows)]
    )


def write_forces(truth, rng):
    """Forces and nominal areas of a linear tester, with 3 % of noise in the friction force."""
    velocity = np.geomspace(1e-5, 1e-1, 9)
    lines = ["velocity [mm/s];temperature [°C];normal force [N];friction force [N];contact area [mm²]"]
    for celsius in (5, 25, 45):
        for load, area in ((100.0, 500.0), (100.0, 200.0)):
            mu = rf.friction(truth.scene(), velocity, 1e6 * load / area, celsius + ZERO)
            forces = scatter(rng, load * np.asarray(mu), 0.03)
            rows = zip(velocity, forces, strict=True)
            lines += [f"{1e3 * v:.6g};{celsius};{load};{F:.4g};{area}" for v, F in rows]
    put("forces.csv", lines)


# --- laboratory 2


def write_eplexor(truth, rng):
    """Gabo Eplexor in German: decimal commas, many columns, and an E'' with a double quote."""
    titles = (
        "Nr.;Zeit [s];Temperatur [°C];Frequenz [Hz];Stat. Dehnung [%];|E*| [MPa];E' [MPa];E\" [MPa];tan d [-]"
    )
    rows, frequencies = [], np.geomspace(0.5, 50.0, 11)
    for celsius in range(-45, 66, 10):
        values = megapascals(truth, rng, frequencies, celsius, 0.02)
        rows += [(celsius, f, a, b) for f, (a, b) in zip(frequencies, values, strict=True)]
    lines = [
        f"{k};{10 * k};{celsius:.1f};{f:.5g};1.0;{np.hypot(a, b):.5g};{a:.5g};{b:.5g};{b / a:.5f}"
        for k, (celsius, f, a, b) in enumerate(rows, 1)
    ]
    put(
        "eplexor.csv",
        ["Eplexor 500 N;;;;;;;;", titles, *(line.replace(".", ",") for line in lines)],
        "latin-1",
    )


def write_map(truth, rng):
    """Gwyddion: a tilted map of 400 x 400 heights [m] with dropouts, part of a larger periodic surface."""
    n, whole, step = 400, 1024, 25e-6
    q = 2 * np.pi * np.fft.fftfreq(whole, step)
    C = truth.areal(np.hypot(q[:, None], q[: whole // 2 + 1]))
    # White noise has real modes of the variance 1 per point.
    white = np.fft.rfft2(rng.standard_normal((whole, whole)))
    surface = np.fft.irfft2(white * np.sqrt(C) * 2 * np.pi / step, (whole, whole))
    x = step * np.arange(n)
    heights = surface[:n, :n] + 2e-3 * x + 5e-3 * x[:, None]
    heights[rng.random((n, n)) < 0.005] = np.nan
    size = 1e3 * n * step
    lines = ["# Channel: Height", f"# Width: {size:.2f} mm", f"# Height: {size:.2f} mm", "# Value units: m"]
    put("map.txt", [*lines, *("\t".join(f"{z:.5e}" for z in row) for row in heights)])


def write_records(truth, rng):
    """Reciprocating runs with drift, misalignment and start-up. Each file has one temperature and load."""
    velocity, angle = np.geomspace(1e-4, 1e-1, 7), np.radians(1.5)
    start_up = 1 - 0.6 * np.exp(-np.arange(40) / 1.5)
    titles = "Zeit [s];Geschwindigkeit [mm/s];Normalkraft [N];Reibkraft [N];Temperatur [°C]"
    for celsius in (5, 25, 45):
        for load in (80, 240):
            mu = np.asarray(rf.friction(truth.scene(), velocity, load / 4e-4, celsius + ZERO))
            # Three cycles at each velocity, with 3 % of noise in the friction of each stroke.
            sign = np.tile([1.0, -1.0], 3 * velocity.size)
            v, tangential = sign * np.tile(np.repeat(velocity, 2), 3), sign * np.tile(np.repeat(mu, 2), 3)
            tangential = load * np.outer(scatter(rng, tangential, 0.03), start_up).ravel()
            normal = load * np.cos(angle) - tangential * np.sin(angle)
            tangential = tangential * np.cos(angle) + load * np.sin(angle)
            # Fifteen rows without load, before and after the run.
            columns = [np.pad(x, 15) for x in (1e3 * np.repeat(v, start_up.size), normal, tangential)]
            t = 0.2 * np.arange(columns[0].size)
            rows = zip(t, columns[0], columns[1] + 2 + 0.002 * t, columns[2] - 1 + 0.003 * t, strict=True)
            lines = [f"{a:.1f};{b:.6g};{n:.4f};{f:.4f};{celsius}" for a, b, n, f in rows]
            put(f"run_{celsius}C_{load}N.csv", [titles, *lines])


# --- laboratory 3


def write_netzsch(truth, rng):
    """NETZSCH Proteus: a block of columns for each frequency."""
    frequencies = (0.5, 1.0, 2.5, 5.0, 10.0, 25.0, 50.0)
    titles = (f"E'({f:.3f} Hz)/MPa;E''({f:.3f} Hz)/MPa" for f in frequencies)
    lines = ["#EXPORTTYPE:\tDATA ALL", "#INSTRUMENT:\tNETZSCH DMA 242E", f"##Temp./°C;{';'.join(titles)}"]
    for celsius in range(-40, 69, 6):
        values = megapascals(truth, rng, frequencies, celsius, 0.025)
        lines += [";".join([f"{celsius:.3f}", *(f"{x:.5f}" for x in values.ravel())])]
    put("netzsch.csv", lines)


def write_texture(truth, rng):
    """ISO 13473-4: G_d over n in cycles/m, h^2 = int G_d dn, from C_1D."""
    n = np.geomspace(1.02 * truth.q0, 8e4, 41) / (2 * np.pi)
    rows = zip(n, scatter(rng, 4 * np.pi * truth.along_line(2 * np.pi * n), 0.03), strict=True)
    lines = ["Profile spectrum according to ISO 13473-4", "spatial frequency n [cycles/m];PSD Gd [m^3]"]
    put("texture.csv", [*lines, *(f"{a:.6g};{b:.6g}" for a, b in rows)])


def write_wheel(truth, rng):
    """A table of a LAT100 with side forces and aligning moments, the moments with absolute errors."""
    scene = truth.scene()
    titles = (
        "slip angle [deg];speed [km/h];load [N];side force [N];aligning moment [N mm];sigma_moment [N mm]"
    )
    lines, angle = [f"{titles};temperature [°C]"], np.array([0.5, 1, 1.5, 2, 3, 4.5, 7, 10, 14])
    for celsius in (5, 25, 45):
        for speed, load in ((0.2, 75.0), (2.0, 75.0), (12.0, 75.0), (2.0, 120.0)):
            grip = rf.grip(scene, scene.patch, np.radians(angle), speed / 3.6, load, celsius + ZERO)
            forces = scatter(rng, np.asarray(grip.force))
            moments = 1e3 * np.asarray(grip.moment) + rng.standard_normal(angle.size)
            rows = zip(angle, forces, moments, strict=True)
            lines += [f"{a};{speed};{load};{f:.3f};{m:.3f};1;{celsius}" for a, f, m in rows]
    put("wheel.csv", lines)


def write_patch(truth, rng):
    """The initial guess of the patch, as a table of a scene file."""
    del truth, rng
    put("patch.toml", ["", "[patch]", "length = 0.04", "width = 0.018", "stiffness = 4e7"])
