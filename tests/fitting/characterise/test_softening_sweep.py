"""Softening from strain sweeps: against the law they were made of, and as a laboratory hands them in."""

import warnings

import numpy as np
import pytest
from problems import ROAD, TREAD

import rubberfric as rf
from fitting import softening_from_sweep

STRAIN = np.geomspace(1e-4, 0.4, 17)


def kraus(strain, E0=9e6, E_inf=2.5e6, peak=1.1e6, loss_inf=3e5, critical=8e-3, m=0.6):
    """E' and E'' of agglomerates that break and form again, and their limits at small strains.

    Kraus, J. Appl. Polym. Sci. Appl. Polym. Symp. 39 (1984) 75.
    """
    x = (strain / critical) ** m
    return E_inf + (E0 - E_inf) / (1 + x**2), loss_inf + 2 * peak * x / (1 + x**2)


def test_factors_of_a_known_law():
    storage, loss = kraus(STRAIN)
    found = softening_from_sweep(STRAIN, storage / 1e6, loss / 1e6, linear=STRAIN[0])  # any unit
    np.testing.assert_array_equal(found.strain, STRAIN)
    np.testing.assert_allclose(found.storage * storage[0], storage, rtol=1e-14)
    np.testing.assert_allclose(found.loss * loss[0], loss, rtol=1e-14)
    assert found.factor == 1.0
    # Rows in any order are the same sweep.
    turned = softening_from_sweep(STRAIN[::-1], storage[::-1], loss[::-1], factor=0.7)
    np.testing.assert_allclose(turned.storage, found.storage, rtol=1e-14)
    assert turned.factor == 0.7


def test_the_linear_range_is_averaged():
    noise = 1 + 0.01 * np.array([1, -1, 0.5, -0.5, 0, *np.zeros(12)])
    storage, loss = kraus(STRAIN, critical=0.3, m=2.0)
    flat = STRAIN <= 1e-3
    found = softening_from_sweep(STRAIN, storage * noise, loss * noise, linear=1e-3)
    assert np.mean(found.storage[flat]) == pytest.approx(1, rel=1e-14)
    assert np.mean(found.loss[flat]) == pytest.approx(1, rel=1e-14)
    np.testing.assert_allclose(found.storage[~flat], storage[~flat] / 9e6, rtol=2e-3)


def test_a_sweep_for_every_temperature():
    measured = {293.2: kraus(STRAIN), 333.0: kraus(STRAIN, E0=5e6)}
    # Data with drift, one temperature after the other.
    drift = np.linspace(-0.3, 0.3, STRAIN.size)
    T = np.concatenate([333.0 + drift, 293.2 + drift])
    columns = np.concatenate([(STRAIN, *measured[333.0]), (STRAIN, *measured[293.2])], axis=1)
    found = softening_from_sweep(*columns, T)
    assert list(found) == pytest.approx([293.2, 333.0], abs=1e-9)
    for softening, (storage, _) in zip(found.values(), measured.values(), strict=True):
        np.testing.assert_allclose(softening.storage, storage / storage[0], rtol=1e-14)
    assert list(softening_from_sweep(STRAIN, *measured[333.0], 333.0)) == [333.0]


def test_from_a_file_to_friction(tmp_path):
    """Read percent and MPa from an instrument's table, then make a scene and a scene file."""
    storage, loss = kraus(STRAIN)
    columns = np.column_stack([100 * STRAIN, storage / 1e6, loss / 1e6])
    titles = "strain,E_stor,E_loss\n%,MPa,MPa"
    np.savetxt(tmp_path / "sweep.csv", columns, delimiter=",", header=titles, comments="")
    table = rf.io.read_table(tmp_path / "sweep.csv", ["strain", "E_stor", "E_loss"], ["T"], increasing=False)
    softening = softening_from_sweep(table["strain"], table["E_stor"], table["E_loss"], table.get("T"))
    np.testing.assert_allclose(softening.storage, storage / storage[0], rtol=1e-12)
    plain = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(TREAD))
    soft = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(TREAD), softening=softening)
    before, after = (float(rf.contact_area(s, 0.1, 3e5)) for s in (plain, soft))
    assert after > 1.1 * before
    rf.save_scene(tmp_path / "soft.h5", soft)
    again = rf.load_scene(tmp_path / "soft.h5")
    assert float(rf.contact_area(again, 0.1, 3e5)) == after


def test_a_sweep_that_begins_too_late_is_named():
    late = STRAIN > 3e-3
    storage, loss = kraus(STRAIN[late])
    with pytest.warns(UserWarning, match=r"E' falls by 1\d\.\d % between its first strains, 0\.00\d+ and"):
        softening_from_sweep(STRAIN[late], storage, loss)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        softening_from_sweep(STRAIN[late], storage, loss, linear=STRAIN[late][0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"storage": [1e6, -1.0, 1e6]}, r"^storage\[1\] = -1: must be finite and > 0$"),
        ({"loss": [1e5, np.nan, 1e5]}, r"^loss\[1\] = nan: must be finite and > 0$"),
        ({"strain": [0.0, 1e-2, 1e-1]}, r"^strain\[0\] = 0: must be finite and > 0$"),
        ({"loss": [1e5, 1e5]}, r"^loss has shape \(2,\): must be \(n,\), with the length of strain$"),
        (
            {"strain": [1e-3, 1e-2, 1e-3]},
            r"^the sweep has two rows at the strain 0\.001. If the strain goes up and down",
        ),
        ({"linear": 1e-5}, r"^linear = 1e-05: must be >= the smallest strain, 0\.001$"),
        ({"linear": -1}, r"^linear = -1: must be a strain > 0, or None$"),
        ({"temperature": [300.0, 300.0, 320.0]}, r"^the sweep at 320 K has 1 strains: must have at least 2$"),
        ({"factor": 0.0}, r"^Softening\.factor = 0\.0: must be > 0$"),
    ],
)
def test_wrong_sweeps(arguments, message):
    given = {"strain": [1e-3, 1e-2, 1e-1], "storage": [1e6, 1e6, 8e5], "loss": [1e5, 1e5, 1e5]}
    with pytest.raises(ValueError, match=message):
        softening_from_sweep(**given | arguments)
