"""Master curves of measured sweeps that others have published, against their shifts.

`python -m pytest -m slow -s tests/fitting/characterise/test_public_sweeps.py` prints both tables.
"""

import csv
import time

import numpy as np
import pytest
from support.folders import PUBLIC

from fitting import ModulusData, fit_master_curve
from fitting.characterise.sweeps import sweeps_of

pytestmark = pytest.mark.skipif(not PUBLIC.is_dir(), reason="the public data are not beside the project")

POLYISOPRENES = (2.4, 5.1, 23.4, 33.6, 94.9, 634.5, 1131.0)  # kg/mol
NAMES = (*(f"polyisoprene {mass:g}" for mass in POLYISOPRENES), "Eplexor", "EPDM", "foam", "TRIOS")
KELVIN = 273.15
PASCAL = {"Eplexor": 1e6, "foam": 1e3}  # of the units of the files


def numbers(path, first, columns=slice(None)):
    """Return the numbers of a CSV file from a line on."""
    with open(path, encoding="utf-8-sig") as file:
        return np.array([[float(x) for x in row[columns]] for row in list(csv.reader(file))[first:]])


def columns_of(name):
    """Return omega, E', E'' and T in degrees Celsius, and published (T, log10 a_T) or None."""
    if name.startswith("polyisoprene"):
        mass = float(name.split()[1])
        raw = numbers(PUBLIC / "polyisoprene" / "PI_raw_isotherms.csv", 1)
        shifts = numbers(PUBLIC / "polyisoprene" / "PI_published_shifts.csv", 1)
        _, T, omega, storage, loss = raw[raw[:, 0] == mass].T
        return omega, storage, loss, T, shifts[shifts[:, 0] == mass][:, [1, 4]]
    if name == "Eplexor":
        f, storage, loss, T, _ = numbers(PUBLIC / "pyvisco" / "examples" / "freq_user_raw.csv", 2).T
        folder = PUBLIC / "pyvisco" / "verification" / "freq_raw"
        return 2 * np.pi * f, storage, loss, T, numbers(folder / "freq_Eplexor_raw__shift_factors.csv", 2)
    if name == "EPDM":
        f, T, storage, loss = numbers(PUBLIC / "epdm" / "tf_015p.csv", 1, slice(1, 5)).T
        return 2 * np.pi * f, storage, loss, T, None
    if name == "foam":
        tables = {
            float(file.stem[9:-1]): np.loadtxt(file, skiprows=1) for file in (PUBLIC / "foam").iterdir()
        }
        omega, storage, loss = np.concatenate(list(tables.values())).T
        return omega, storage, loss, np.repeat(list(tables), [len(x) for x in tables.values()]), None
    T, omega, storage, loss, _ = numbers(PUBLIC / "trios" / "trios_tts_isotherms.csv", 1).T
    good = loss > 0
    return omega[good], storage[good], loss[good], T[good], None


def sweeps_and_shifts(name):
    """Return the data, and published shifts as (temperatures [K], log10 a_T) or None."""
    omega, storage, loss, T, published = columns_of(name)
    factor = PASCAL.get(name, 1.0)
    data = ModulusData(
        omega, factor * storage, factor * loss, temperature=T + KELVIN, check_units=False, name=name
    )
    return data, None if published is None else (published[:, 0] + KELVIN, published[:, 1])


def differences(curve, published):
    """Return log10 a_T less the published one, and its standard error, without the reference."""
    T, log_a = published
    nearest = np.argmin(np.abs(T - curve.T[:, None]), axis=1)
    known = np.abs(T[nearest] - curve.T) < 1.5
    difference = curve.log_aT / np.log(10) - log_a[nearest]
    moved = known & (np.arange(curve.T.size) != curve.reference)
    return (difference - difference[curve.reference])[moved], curve.stderr[moved] / np.log(10)


def known_sweep(data, published):
    """Return the temperature of a sweep in the middle of those with a published shift."""
    T = np.array([one.T for one in sweeps_of(data, 1.0)])
    known = T if published is None else T[np.abs(published[0] - T[:, None]).min(axis=1) < 1.5]
    return float(known[known.size // 2])


# Largest rms difference to the published shifts, in decades. Eplexor's own shifts use E' alone.
RMS = {"Eplexor": 0.9, "polyisoprene 634.5": 0.08}


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] * (n not in ("EPDM", "polyisoprene 94.9"))) for n in NAMES],
)
def test_every_set_is_accepted_with_the_published_shifts(name):
    data, published = sweeps_and_shifts(name)
    begin = time.perf_counter()
    curve = fit_master_curve(data, known_sweep(data, published))
    seconds = time.perf_counter() - begin
    rms = np.sqrt(np.nanmean((curve.residuals - curve.shifts.hidden[curve.of_sweep]) ** 2, axis=1))
    line = f"| {name} | {curve.T.size} | {seconds:.1f} s | {rms[0]:.1%}, {rms[1]:.1%} |"
    assert np.all(np.isfinite(curve.log_aT)) and np.all(np.diff(curve.log_aT) < 0) and rms[0] < 0.05
    if published is not None:
        off, error = differences(curve, published)
        within = np.mean(np.abs(off) < 2 * error)
        rms = np.sqrt(np.mean(off**2))
        line += f" {rms:.3f} | {np.abs(off).max():.3f} | {np.median(error):.3f} | {within:.0%} |"
        assert rms < RMS.get(name, 0.05)
        assert within >= (0.5 if name == "Eplexor" else 0.75)
    print(f"\n{line}")


@pytest.mark.slow
def test_sweeps_that_are_left_out_are_predicted():
    inside, count = 0, 0
    for name in NAMES:
        data, _ = sweeps_and_shifts(name)
        sweeps = sweeps_of(data, 1.0)
        here = []
        for out in sweeps[1:-1]:
            rows = np.abs(data.temperature - out.T) > 0.8
            kept = {key: getattr(data, key)[rows] for key in ("omega", "storage", "loss", "temperature")}
            curve = fit_master_curve(ModulusData(**kept, check_units=False))
            y, error = curve.moduli(np.exp(out.t), out.T)
            here.append((np.abs(out.y - y) < 1.96 * error)[np.isfinite(out.y)])
        here = np.concatenate(here)
        print(f"\n{name}: {here.size} values, {here.mean():.1%} within their intervals")
        inside, count = inside + here.sum(), count + here.size
    print(f"all: {count} values, {inside / count:.1%}")
    assert 0.90 <= inside / count <= 0.98
