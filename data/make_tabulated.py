"""Make the CSV files of tabulated_tread.toml from the numbers in tread_on_asphalt.toml.

Run in this folder: python make_tabulated.py
"""

import tomllib
from pathlib import Path

import numpy as np

from rubberfric.io.text_tables.writing import write_table

here = Path(__file__).parent
scene = tomllib.loads((here / "tread_on_asphalt.toml").read_text())
rubber, road = scene["upper"]["material"], scene["lower"]["spectrum"]


def rounded(values):
    """To 7 digits, as a measurement would be written, and alike on every machine."""
    return [float(f"{value:.6e}") for value in values]


# E(omega) = E_inf + sum_i E_i i omega tau_i / (1 + i omega tau_i), 8 points per decade
omega = np.logspace(-6, 14, 161)
a = omega[:, None] * np.array(rubber["tau"])
E = np.array(rubber["E"])
storage = rubber["E_inf"] + np.sum(E * a**2 / (1 + a**2), axis=1)
loss = np.sum(E * a / (1 + a**2), axis=1)
write_table(
    here / "tread_master_curve.csv",
    {"omega": rounded(omega), "E_stor": rounded(storage), "E_loss": rounded(loss)},
    comment="Prony series of tread_on_asphalt.toml at 293.15 K; made by make_tabulated.py",
)

shift = rubber["shift"]
T = np.arange(263.15, 354.0, 5.0)
log10_aT = -shift["C1"] * (T - shift["T_ref"]) / (shift["C2"] + T - shift["T_ref"])
write_table(
    here / "tread_shift.csv",
    {"T": [round(float(t), 2) for t in T], "aT": rounded(10**log10_aT)},
    comment="WLF shift of tread_on_asphalt.toml; made by make_tabulated.py",
)

# C = C0 up to qr, then C0 (q/qr)^(-2 (1 + H)); h_rms^2 = 2 pi int q C dq
q0, qr, q1, H, h_rms = (road[name] for name in ("q0", "qr", "q1", "hurst", "h_rms"))
q = np.concatenate([np.geomspace(q0, qr, 5), np.geomspace(qr, q1, 9)[1:]])
C0 = h_rms**2 / (np.pi * qr**2) / (1 - (q0 / qr) ** 2 + (1 - (q1 / qr) ** (-2 * H)) / H)
C = C0 * np.maximum(q / qr, 1.0) ** (-2 * (1 + H))
write_table(
    here / "road_spectrum.csv",
    {"q": rounded(q), "C": rounded(C)},
    comment="Self-affine road of tread_on_asphalt.toml; made by make_tabulated.py",
)
