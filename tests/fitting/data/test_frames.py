"""Measured data from and to data frames, as notebooks hold them."""

import numpy as np
import pandas
import pytest

import fitting

V = [1.0, 10.0, 100.0]
MU = [0.5, 0.7, 0.9]
T = [10.0, 20.0, 30.0]


def test_a_frame_with_units_in_its_titles():
    frame = pandas.DataFrame({"v [mm/s]": V, "mu": MU, "T (°C)": T, "remark": ["a", "b", "c"]})
    found = fitting.FrictionData.from_frame(frame, pressure=3e5, relative=0.03, name="R20")
    np.testing.assert_allclose(found.velocity, [1e-3, 1e-2, 0.1], rtol=1e-15)
    np.testing.assert_allclose(found.temperature, [283.15, 293.15, 303.15], rtol=1e-15)
    np.testing.assert_array_equal(found.pressure, [3e5] * 3)
    assert (found.name, found.relative[0]) == ("R20", 0.03)


def test_units_beside_the_frame():
    """A mapping is accepted too; logarithms and hertz are converted as in files."""
    found = fitting.FrictionData.from_frame(
        {"v": V, "mu": MU, "p": [0.3] * 3, "relative_sigma": [3.0] * 3},
        {"v": "um/s", "p": "MPa", "relative_sigma": "%"},
    )
    np.testing.assert_allclose(found.velocity, [1e-6, 1e-5, 1e-4], rtol=1e-15)
    np.testing.assert_allclose(found.pressure, [3e5] * 3, rtol=1e-15)
    np.testing.assert_allclose(found.relative, [0.03] * 3, rtol=1e-15)
    modulus = fitting.ModulusData.from_frame({"f [Hz]": [1.0], "E_stor [MPa]": [2.0], "E_loss [MPa]": [0.1]})
    assert modulus.omega[0] == pytest.approx(2 * np.pi)
    assert modulus.storage[0] == 2e6
    spectrum = fitting.SpectrumData.from_frame({"log10_q [1/m]": [3.0], "C": [1e-10]})
    assert spectrum.q[0] == pytest.approx(1e3)


def test_titles_as_instruments_and_other_programs_spell_them():
    found = fitting.ModulusData.from_frame(
        {
            "Angular Frequency [rad/sec]": [2.0],
            "E' (N/mm²)": [3.0],
            "Loss modulus [kPa]": [4.0],
            "Temp. (°C)": [5.0],
        }
    )
    values = [found.omega, found.storage, found.loss, found.temperature]
    np.testing.assert_allclose(np.ravel(values), [2.0, 3e6, 4e3, 278.15], rtol=1e-15)
    found = fitting.FrictionData.from_frame(
        {"sliding velocity [µm/s]": V, "coefficient of friction": MU, "contact pressure": [0.3] * 3},
        {"contact pressure": "N/mm2"},
    )
    np.testing.assert_allclose(found.velocity, [1e-6, 1e-5, 1e-4], rtol=1e-15)
    np.testing.assert_allclose(found.pressure, [3e5] * 3, rtol=1e-15)


def test_there_and_back():
    data = fitting.FrictionData(V, MU, pressure=3e5, temperature=293.15, sigma=0.01)
    frame = data.to_dataframe()
    assert list(frame.columns) == ["v [m/s]", "p [Pa]", "T [K]", "mu [-]", "sigma [-]"]
    again = fitting.FrictionData.from_frame(frame)
    for name in ("velocity", "friction", "pressure", "temperature", "sigma"):
        np.testing.assert_array_equal(getattr(again, name), getattr(data, name))


@pytest.mark.parametrize(
    ("frame", "units", "message"),
    [
        ({"v": V}, None, r"^data frame: no column mu: .* it has the columns v\. Rename a column"),
        ({"v [knots]": V, "mu": MU, "p": V}, None, r"^data frame: column v \[knots\]: unit 'knots': must be"),
        (
            {"v": V, "log10_v": V, "mu": MU, "p": V},
            None,
            r"^data frame: columns 'v' and 'log10_v': both hold",
        ),
        ({"v": V, "mu": ["a"] * 3, "p": V}, None, r"^data frame: row 1: mu = 'a': must be a number$"),
        ({"v": V, "mu": MU}, {"T": "C"}, r"^units: 'T' is not a column that is read$"),
        ({"v [m/s]": V, "mu": MU, "p": V}, {"v": "mm/s"}, r"^column 'v \[m/s\]': unit 'mm/s' contradicts"),
        ({"v": V, "mu": [1.0, np.nan, 1.0], "p": V}, None, r"^data frame: row 2: mu = 'nan': must be finite"),
        ({"v": V, "mu": MU}, None, r"^data frame: no column p: .* it has the columns v, mu\. Rename"),
        ({"v": V, "mu": [1.0]}, None, r"^data frame: columns differ in length \('v' has 3, 'mu' has 1\)"),
    ],
)
def test_wrong_frames(frame, units, message):
    with pytest.raises(ValueError, match=message):
        fitting.FrictionData.from_frame(frame, units)
