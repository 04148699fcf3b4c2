"""Files as instruments and other groups write them. Numbers without a source are invented."""

import numpy as np
import pytest
from support.exports import put
from support.published import PUBLISHED

import fitting

# Titles of dma-prony-validation (https://github.com/MarcusNi96/dma-prony-validation).
UNITS_BEHIND_UNDERSCORES = """\
run,freq_hz,temperature_C,G_storage_pa,G_loss_pa,G_abs_pa,tan_delta,force_dyn_N,strain_dyn_pct
tf_1,1.0,-9.97,7.2e6,8.0e5,7.244e6,0.1111,3.2,0.145
tf_1,1.39,-10.01,7.4e6,8.5e5,7.449e6,0.1149,3.4,0.151
tf_1,100.0,-10.0,9.1e6,1.6e6,9.24e6,0.1758,4.4,0.149
tf_1,1.0,0.02,5.6e6,4.2e5,5.616e6,0.075,2.5,0.15
"""
# Titles of the polyisoprenes of RepTate (https://github.com/jorge-ramirez-upm/RepTate).
MELT = """\
Mw_kg_mol,T_C,omega_rad_s,G_storage_Pa,G_loss_Pa
33.6,20,0.1,22.5,3100
33.6,20,1,2050,30500
33.6,20,10,98000,185000
"""


def test_columns_with_units_behind_underscores(tmp_path):
    data = fitting.read(put(tmp_path, UNITS_BEHIND_UNDERSCORES), poisson=0.5)
    np.testing.assert_allclose(data.omega, 2 * np.pi * np.array([1.0, 1.39, 100.0, 1.0]), rtol=1e-14)
    np.testing.assert_allclose(data.temperature, [263.18, 263.14, 263.15, 273.17], rtol=1e-14)
    np.testing.assert_allclose(data.storage, 3e6 * np.array([7.2, 7.4, 9.1, 5.6]), rtol=1e-14)
    np.testing.assert_allclose(data.loss, 3e5 * np.array([8.0, 8.5, 16.0, 4.2]), rtol=1e-14)


def test_a_negative_loss_is_an_error_or_left_out():
    """A TRIOS export as the instrument wrote it: one point at -40 °C has G'' < 0, and tan(delta) < 0."""
    path = PUBLISHED / "rheojax" / "trios_export.txt"
    said = r"line 186: Loss modulus = '-29\.868376': must be > 0; bad_rows=\"drop\" leaves out such rows$"
    with pytest.raises(ValueError, match=said):
        fitting.read(path, poisson=0.5)
    with pytest.warns(UserWarning, match=r"1 of 85 rows have bad values and are left out: line 186$"):
        data = fitting.read(path, poisson=0.5, bad_rows="drop")
    assert data.omega.size == 84


def write_foam(folder, celsius):
    """Write the sweep of a foam at one temperature, as its authors did; return the path."""
    T, *columns = np.loadtxt(PUBLISHED / "rheojax" / "foam_isotherms.csv", delimiter=",", skiprows=1).T
    path = folder / f"foam_dma_{celsius}C.csv"
    rows = np.column_stack(columns)[celsius == T]
    titles = "Angular Frequency\tStorage Modulus\tLoss Modulus"
    np.savetxt(path, rows, fmt="%.6g", delimiter="\t", header=titles, comments="")
    return path


def test_a_table_without_units_gets_them_from_the_message(tmp_path):
    path = write_foam(tmp_path, -10)
    with pytest.raises(ValueError, match="names but no units") as error:
        fitting.read(path)
    columns = eval(str(error.value).rpartition("columns=")[2])
    assert columns == ["omega [?]", "E_stor [?]", "E_loss [?]"]
    units = ("rad/s", "kPa", "kPa")
    given = [name.replace("?", unit) for name, unit in zip(columns, units, strict=True)]
    data = fitting.read(path, columns=given, temperature=263.15)
    assert data.omega[0] == 0.3 and data.storage[0] == pytest.approx(55622.4)


def test_files_that_state_the_temperature_in_their_names(tmp_path):
    """A list of files, read with one temperature each, makes one master curve."""
    columns = ["omega [rad/s]", "E_stor [kPa]", "E_loss [kPa]"]
    paths = {T: write_foam(tmp_path, T) for T in (-5, 0, 5)}
    without = fitting.read(paths[0], columns=columns)
    with pytest.raises(ValueError, match=r"give temperature=\.\.\. when reading it if only the name"):
        fitting.fit_master_curve(without)
    sweeps = [fitting.read(path, columns=columns, temperature=273.15 + T) for T, path in paths.items()]
    curve = fitting.fit_master_curve(sweeps, 273.15)
    np.testing.assert_allclose(curve.T, [268.15, 273.15, 278.15])
    assert np.all(np.diff(curve.log_aT) < -1)


def test_a_melt_of_low_modulus_is_no_unit_slip(tmp_path):
    """G' of an unvulcanised rubber may be as low as 20 Pa."""
    data = fitting.read(put(tmp_path, MELT), poisson=0.5)
    assert data.storage.min() == pytest.approx(3 * 22.5)
