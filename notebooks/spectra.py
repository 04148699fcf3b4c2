"""Draw figures/spectra.png, one surface in all normalisations, for spectra.md.

    python notebooks/spectra.py

Needs matplotlib.
"""

from pathlib import Path

import jax
import numpy as np

import rubberfric as rf
from rubberfric.roughness.normalisation import NORMALISATIONS

jax.config.update("jax_enable_x64", True)
FIGURE = Path(__file__).resolve().parent / "figures" / "spectra.png"
SURFACE = rf.SelfAffine(q0=1e3, qr=5e3, q1=1e6, hurst=0.8, h_rms=1e-5)


def curves():
    """Return a dict from the name of a normalisation to wavevectors [rad/m] and its density."""
    q = np.geomspace(1.0001e3, 0.97e6, 200)
    C, line = rf.power_spectrum(SURFACE, q), rf.roughness.line_spectrum(SURFACE, q)
    return {
        name: (q, np.asarray(about.factor * (line if about.line else q * C if about.radial else C)))
        for name, about in NORMALISATIONS.items()
    }


def draw(path):
    """Draw densities of a surface, of abs(q), and along a line."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.2), layout="constrained")
    titles = ("surface [m$^4$]", "all directions of q [m$^3$]", "along a line [m$^3$]")
    for axes, title in zip(figure.subplots(1, 3), titles, strict=True):
        axes.set(xscale="log", yscale="log", xlabel="q [rad/m]", title=title)
        for name, (q, density) in curves().items():
            about = NORMALISATIONS[name]
            if titles[2 if about.line else 1 if about.radial else 0] == title:
                dashed = {"linestyle": "--"} if name == "W1" else {}
                axes.plot(q, density, label=name, **dashed)
        axes.legend(fontsize=7)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    draw(FIGURE)
