"""Files that other groups published, read as they are."""

import numpy as np
import pytest
from support.folders import PUBLIC

import fitting


def test_columns_with_units_behind_underscores():
    data = fitting.read(PUBLIC / "epdm" / "tf_015p.csv", poisson=0.5)
    rows = np.genfromtxt(PUBLIC / "epdm" / "tf_015p.csv", delimiter=",", skip_header=1)[:, 1:5]
    np.testing.assert_allclose(data.omega, 2 * np.pi * rows[:, 0], rtol=1e-14)
    np.testing.assert_allclose(data.temperature, rows[:, 1] + 273.15, rtol=1e-14)
    np.testing.assert_allclose([data.storage, data.loss], 3 * rows[:, 2:].T, rtol=1e-14)


def test_a_negative_loss_is_an_error_or_left_out():
    """A TRIOS export as the instrument wrote it: one point at -40 °C has G'' < 0, and tan(delta) < 0."""
    path = PUBLIC / "trios" / "frequency_sweep_tts.txt"
    said = r"line 538: Loss modulus = '-29\.868376': must be > 0; bad_rows=\"drop\" leaves out such rows$"
    with pytest.raises(ValueError, match=said):
        fitting.read(path, poisson=0.5)
    with pytest.warns(UserWarning, match=r"1 of 340 rows have bad values and are left out: lines 538$"):
        data = fitting.read(path, poisson=0.5, bad_rows="drop")
    assert data.omega.size == 339


def test_a_table_without_units_gets_them_from_the_message():
    path = PUBLIC / "foam" / "foam_dma_-10C.csv"
    with pytest.raises(ValueError, match="names but no units") as error:
        fitting.read(path)
    columns = eval(str(error.value).rpartition("columns=")[2])
    assert columns == ["omega [?]", "E_stor [?]", "E_loss [?]"]
    units = ("rad/s", "kPa", "kPa")
    given = [name.replace("?", unit) for name, unit in zip(columns, units, strict=True)]
    data = fitting.read(path, columns=given, temperature=263.15)
    assert data.omega[0] == 0.3 and data.storage[0] == pytest.approx(55622.4)


def test_files_that_state_the_temperature_in_their_names():
    """A list of files, read with one temperature each, makes one master curve."""
    columns = ["omega [rad/s]", "E_stor [kPa]", "E_loss [kPa]"]
    paths = [PUBLIC / "foam" / f"foam_dma_{T}C.csv" for T in (-5, 0, 5)]
    without = fitting.read(paths[0], columns=columns)
    with pytest.raises(ValueError, match=r"give temperature=\.\.\. to `fitting.read` if only the name"):
        fitting.fit_master_curve(without)
    sweeps = [
        fitting.read(path, columns=columns, temperature=273.15 + T)
        for path, T in zip(paths, (-5, 0, 5), strict=True)
    ]
    curve = fitting.fit_master_curve(sweeps, 273.15)
    np.testing.assert_allclose(curve.T, [268.15, 273.15, 278.15])
    assert np.all(np.diff(curve.log_aT) < -1)


def test_a_melt_of_low_modulus_is_no_unit_slip():
    """E' of an unvulcanised polyisoprene falls to 67 Pa."""
    data = fitting.read(PUBLIC / "polyisoprene" / "PI_raw_isotherms.csv", poisson=0.5)
    assert data.storage.min() == pytest.approx(3 * 22.232)
