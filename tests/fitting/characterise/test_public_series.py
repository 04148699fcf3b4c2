"""Prony series of two published master curves, against the series that ANSYS fitted to the same data.

`python -m pytest -s tests/fitting/characterise/test_public_series.py` prints the table of how_true.md.
"""

import numpy as np
import pytest
from support.public_sweeps import numbers
from support.published import PUBLISHED

import rubberfric as rf
from fitting import ModulusData, fit_prony, kramers_kronig

FOLDER = PUBLISHED / "pyvisco"
CURVES = {
    "freq_raw": (FOLDER / "verification" / "freq_raw" / "input_master.csv", 1, 0.121),
    "freq_master": (FOLDER / "examples" / "freq_user_master.csv", 2, 0.377),
}


def ansys_terms(name):
    """Return the relative moduli and the relaxation times in ANSYS's file."""
    lines = (FOLDER / "verification" / name / "prony_terms.MPL").read_text().splitlines()
    values = [float(x) for line in lines if line.startswith("TBDATA") for x in line.split(",")[2:]]
    return np.array(values[0::2]), np.array(values[1::2])


def ansys_modulus(omega, size, weights, tau):
    """Return the modulus of ANSYS's terms, with the glassy modulus that fits |E*| = size best."""
    z = 1j * omega[:, None] * tau
    relative = 1 - weights.sum() + np.sum(weights * z / (1 + z), axis=1)
    return relative * np.exp(np.mean(np.log(size / np.abs(relative))))


def misfit(data, modulus):
    """Return the rms logarithmic differences of |E*|, E' and E''."""
    measured = data.storage + 1j * data.loss
    parts = [(np.abs(x), x.real, x.imag) for x in (np.asarray(modulus), measured)]
    return np.array([np.sqrt(np.mean(np.log(a / b) ** 2)) for a, b in zip(*parts, strict=True)])


@pytest.mark.parametrize("name", CURVES)
def test_series_are_no_worse_than_those_of_ansys(name):
    """ANSYS fits E' alone; weights=(1, 0) do the same. E' and E'' of these curves contradict each other."""
    path, first, contradiction = CURVES[name]
    f, storage, loss = numbers(path, first, slice(3)).T
    data = ModulusData(2 * np.pi * f, 1e6 * storage, 1e6 * loss)
    weights, tau = ansys_terms(name)
    ansys = misfit(data, ansys_modulus(data.omega, np.hypot(data.storage, data.loss), weights, tau))
    fits = {
        "E' alone, ANSYS's times": fit_prony(data, tau=tau, weights=(1, 0)),
        "E' alone, own times": fit_prony(data, weights=(1, 0)),
        "E' and E'', ANSYS's times": fit_prony(data, tau=tau),
        "E' and E'', own times": fit_prony(data),
    }
    ours = {how: misfit(data, rf.complex_modulus(fit.material, data.omega)) for how, fit in fits.items()}
    for how, rms in {"ANSYS": ansys, **ours}.items():
        count = np.size(fits[how].material.E) if how in fits else tau.size
        print(f"\n| {name}, {how} | {count} | {' | '.join(f'{x:.1%}' for x in rms)} |")
    for how, rms in ours.items():
        assert rms[0 if "alone" in how else 2] < ansys[0 if "alone" in how else 2]
    assert kramers_kronig(data).rms == pytest.approx(contradiction, rel=0.02)
