"""Master curves of measured sweeps that others have published, against their shifts and pyvisco's.

`python -m pytest -m "slow or not slow" -s tests/fitting/characterise/test_public_sweeps.py` prints both
tables.
"""

import functools
import json
import time

import numpy as np
import pytest
from support.public_sweeps import KELVIN, NAMES, OUTSIDE, PASCAL, columns_of
from support.published import PUBLISHED, needs

from fitting import ModulusData, fit_master_curve, kramers_kronig
from fitting.characterise.sweeps import sweeps_of

PYVISCO = json.loads((PUBLISHED / "pyvisco_shifts.json").read_text())
QUICK = ("foam", "TRIOS", "EPDM", "polyisoprene 94.9")  # in the ordinary run


def sweeps_and_shifts(name):
    """Return the data, and published shifts as (temperatures [K], log10 a_T) or None."""
    omega, storage, loss, T, published = columns_of(name)
    factor, good = PASCAL.get(name, 1.0), loss > 0  # as `fitting.read` with bad_rows="drop"
    columns = omega, factor * storage, factor * loss, T + KELVIN
    omega, storage, loss, T = (column[good] for column in columns)
    data = ModulusData(omega, storage, loss, temperature=T, check_units=False, name=name)
    return data, None if published is None else (published[:, 0] + KELVIN, published[:, 1])


def pyvisco(name):
    """Return temperatures [K] and log10 a_T of the sweeps that pyvisco could shift."""
    T, log_a = np.array(PYVISCO[name]["T"]), np.array(PYVISCO[name]["log10_aT"], float)
    return T[np.isfinite(log_a)] + KELVIN, log_a[np.isfinite(log_a)]


def apart(first, second, curve):
    """Return the difference of two tables (T, log10 a_T) at the sweeps of `curve` without its reference.

    The difference is 0 at the reference, and NaN at sweeps that a table lacks.
    """
    each = []
    for T, log_a in (first, second):
        nearest = np.argmin(np.abs(T - curve.T[:, None]), axis=1)
        each.append(np.where(np.abs(T[nearest] - curve.T) < 1.5, log_a[nearest], np.nan))
    difference = each[0] - each[1]
    return np.delete(difference - difference[curve.reference], curve.reference)


def rms(x, axis=None):
    return np.sqrt(np.nanmean(x**2, axis=axis))


def known_sweep(data, published):
    """Return the temperature of a sweep in the middle of those with a published shift."""
    T = np.array([one.T for one in sweeps_of(data, 1.0)])
    known = T if published is None else T[np.abs(published[0] - T[:, None]).min(axis=1) < 1.5]
    return float(known[known.size // 2])


@functools.cache
def fitted(name):
    """Return the master curve, published shifts or None, and the seconds of the fit."""
    data, published = sweeps_and_shifts(name)
    begin = time.perf_counter()
    curve = fit_master_curve(data, known_sweep(data, published))
    return curve, published, time.perf_counter() - begin


def marks(name):
    """Return the marks of a test of one set."""
    slow = [] if name in QUICK else [pytest.mark.slow]
    return [*slow, needs(OUTSIDE[name])] if name in OUTSIDE else slow


@pytest.mark.parametrize("name", [pytest.param(name, marks=marks(name)) for name in NAMES])
def test_every_set_is_accepted_with_the_published_shifts(name):
    """The rms difference to the published shifts is no larger than pyvisco's."""
    curve, published, seconds = fitted(name)
    scatter = rms(curve.residuals - curve.shifts.hidden[curve.of_sweep], axis=1)
    assert np.all(np.isfinite(curve.log_aT)) and np.all(np.diff(curve.log_aT) < 0) and scatter[0] < 0.05
    ours, others = (curve.T, curve.log_aT / np.log(10)), pyvisco(name)
    error = np.median(np.delete(curve.stderr, curve.reference)) / np.log(10)
    line = f"| {name} | {curve.T.size} | {scatter[0]:.1%}, {scatter[1]:.1%} | {seconds:.1f} s | {error:.2f} |"
    line += f" {rms(apart(ours, others, curve)):.2f} |"
    if published is not None:
        off, theirs = apart(ours, published, curve), apart(others, published, curve)
        line += f" {rms(off):.3f}, {np.nanmax(np.abs(off)):.2f} |"
        line += f" {rms(theirs):.3f}, {np.nanmax(np.abs(theirs)):.2f} |"
        assert rms(off) < min(rms(theirs), 0.08 if name.startswith("polyisoprene") else np.inf)
    print(f"\n{line}")


def within_two(name, published):
    """Return for each known shift whether it lies within two standard errors of the fit."""
    curve, *_ = fitted(name)
    off = apart((curve.T, curve.log_aT / np.log(10)), published, curve) * np.log(10)
    return (np.abs(off) < 2 * np.delete(curve.stderr, curve.reference))[np.isfinite(off)]


@pytest.mark.slow
@needs("polyisoprene")
def test_published_shifts_lie_within_the_error_bars():
    """The table of the Eplexor instrument does not superpose its sweeps (below); pyvisco's shifts do."""
    names = [name for name in NAMES if fitted(name)[1] is not None]
    each = {name: within_two(name, fitted(name)[1]) for name in names}
    each["Eplexor, pyvisco's shifts"] = within_two("Eplexor", pyvisco("Eplexor"))
    for name, inside in each.items():
        print(f"\n{name}: {inside.sum()} of {inside.size} within two standard errors")
    instrument = each.pop("Eplexor").mean()
    assert instrument > 0.5 and 0.85 <= np.concatenate(list(each.values())).mean() <= 0.98


@pytest.mark.slow
def test_shifts_of_the_instrument_do_not_superpose_its_warm_sweeps():
    """Above 25 °C the fit and pyvisco agree, and both differ from the table of the Eplexor instrument."""
    curve, published, _ = fitted("Eplexor")
    ours, warm = (curve.T, curve.log_aT / np.log(10)), np.delete(curve.T, curve.reference) > curve.T_ref
    alike, off = (apart(ours, other, curve)[warm] for other in (pyvisco("Eplexor"), published))
    print(f"\nEplexor above 25 °C: rms {rms(alike):.3f} to pyvisco, {rms(off):.3f} to the instrument")
    assert rms(alike) < 0.15 and rms(off) > 0.5


@pytest.mark.slow
@needs("polyisoprene")
@pytest.mark.parametrize("mass", [94.9, 634.5, 1131])
def test_the_contradiction_chooses_the_vertical_shift(mass):
    """The published b_T of the polyisoprenes is that of rubber elasticity within the errors."""
    data, published = sweeps_and_shifts(f"polyisoprene {mass:g}")
    reference = known_sweep(data, published)
    without, entropic, free = (
        kramers_kronig(fit_master_curve(data, reference, vertical=how).data).rms
        for how in (False, "entropic", True)
    )
    print(f"\n{mass:g} kg/mol: {without:.1%} without, {entropic:.1%} entropic, {free:.1%} free")
    assert without > 0.03 and entropic < 0.02 and free < 0.02


@pytest.mark.slow
@needs("polyisoprene")
@needs("epdm")
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
