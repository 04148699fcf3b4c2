"""Data frames of pandas, polars, xarray and Arrow, and mappings, with their units; and back to pandas."""

import re

import numpy as np
import pandas
import pytest

import fitting
import rubberfric as rf

V = [1.0, 10.0, 100.0]  # [mm/s]
MU = [0.5, 0.7, 0.9]
T = [10.0, 20.0, 30.0]  # [°C]
TITLES = {"sliding velocity [mm/s]": V, "COF": MU, "Temp. (°C)": T}


def check(data):
    np.testing.assert_allclose(data.velocity, [1e-3, 1e-2, 0.1], rtol=1e-15)
    np.testing.assert_array_equal(data.friction, MU)
    np.testing.assert_allclose(data.temperature, [283.15, 293.15, 303.15], rtol=1e-15)
    np.testing.assert_array_equal(data.pressure, [2e5] * 3)


def test_pandas():
    frame = pandas.DataFrame(TITLES | {"remark": ["a", "b", "c"]})
    check(fitting.read(frame, pressure=2e5))
    data = fitting.FrictionData.from_frame(frame, pressure=2e5, relative=0.03, name="R20")
    check(data)
    assert (data.name, data.relative[0]) == ("R20", 0.03)
    check(fitting.read(TITLES | {"p": 2e5}))
    check(fitting.read(frame.set_index("sliding velocity [mm/s]"), pressure=2e5))
    named = frame.set_axis(["a", "b", "c", "d"], axis=1)
    check(fitting.read(named, pressure=2e5, columns=["v [mm/s]", "mu", "T [C]", "-"]))
    with pytest.raises(
        ValueError, match=r"^data frame: must have a known column; it has the columns a, b, c, d"
    ):
        rf.io.read_columns(named)


def test_units_of_pandas():
    """In `attrs` of the frame or of columns, in a second level of the titles, and as an argument."""
    columns = {"v": pandas.Series(V), "mu": MU, "T": pandas.Series(T)}
    columns["v"].attrs["units"], columns["T"].attrs["unit"] = "mm/s", "°C"
    check(fitting.read(columns, pressure=2e5))
    frame = pandas.DataFrame({"v": V, "mu": MU, "T": T})
    check(fitting.read(rf.io.as_frame(frame, {"v": "mm/s", "T": "°C"}), pressure=2e5))
    frame.attrs["units"] = {"v": "mm/s", "T": "°C"}
    check(fitting.read(frame, pressure=2e5))
    levels = pandas.MultiIndex.from_tuples([("v", "mm/s"), ("mu", "-"), ("T", "°C")])
    check(fitting.read(pandas.DataFrame(np.transpose([V, MU, T]), columns=levels), pressure=2e5))


def test_bad_rows_of_frames():
    frame = pandas.DataFrame({"v": [*V, 1.0], "mu": [*MU, None], "T": [*T, 20.0], "p": [2e5] * 4})
    frame.attrs["units"] = {"v": "mm/s", "T": "°C"}
    with pytest.raises(ValueError, match=r"^data frame: row 4: mu = 'nan': must be finite; bad_rows="):
        fitting.read(frame)
    with pytest.warns(UserWarning, match="^data frame: 1 of 4 rows have bad values and are left out: row 4"):
        check(fitting.read(frame, bad_rows="drop"))


@pytest.mark.parametrize("title", ["std mu", "mu_err", "Standardabweichung", "Error [%]", "±", "95 % CI"])
def test_errors_with_an_unknown_title(title):
    """A fit estimates errors that are not read, although they were measured."""
    frame = {"v [m/s]": [1.0, 2.0], "mu": [0.5, 0.6], title: [0.1, 0.2]}
    message = (
        f"the column {title!r} is not read; if it holds standard errors, name it sigma or relative_sigma"
    )
    for read in (fitting.read, fitting.FrictionData.from_frame):
        with pytest.warns(UserWarning, match=re.escape(message)):
            assert read(frame, pressure=1e5).sigma is None
    assert list(fitting.read({**frame, "sigma": [0.01, 0.02]}, pressure=1e5).sigma) == [0.01, 0.02]


def test_polars():
    polars = pytest.importorskip("polars")
    check(fitting.read(polars.DataFrame(TITLES), pressure=2e5))
    check(fitting.read(polars.DataFrame(TITLES).lazy(), pressure=2e5))
    hole = polars.DataFrame({"v": [*V, 1.0], "mu": [*MU, None], "p": [2e5] * 4})
    with pytest.raises(ValueError, match=r"^data frame: row 4: mu = 'None': must be a number"):
        fitting.read(hole)


def test_xarray():
    """A grid over temperature and velocity is read point by point."""
    xarray = pytest.importorskip("xarray")
    mu = np.array([MU, [0.4, 0.6, 0.8]])
    coordinates = {
        "T": ("T", [20.0, 40.0], {"units": "°C"}),
        "v": ("v", V, {"units": "mm/s"}),
        "p": ((), 2.0, {"units": "bar"}),
    }
    grid = xarray.Dataset({"mu": (("T", "v"), mu, {"units": "-"})}, coordinates)
    for source in (grid, grid.mu):
        data = fitting.read(source)
        np.testing.assert_array_equal(data.friction, mu.ravel())
        np.testing.assert_allclose(data.velocity, [1e-3, 1e-2, 0.1] * 2, rtol=1e-15)
        np.testing.assert_allclose(data.temperature, np.repeat([293.15, 313.15], 3), rtol=1e-15)
        np.testing.assert_allclose(data.pressure, 2e5, rtol=1e-15)


class Table:
    """The interface of pyarrow.Table that is used."""

    def __init__(self, columns):
        self.columns, self.to_pydict = list(columns.values()), lambda: columns


def test_arrow():
    check(fitting.read(Table(TITLES), pressure=2e5))


def test_units_and_titles_of_other_quantities():
    """Units beside a mapping, logarithms, hertz, and titles as instruments and other programs spell them."""
    data = fitting.FrictionData.from_frame(
        {
            "sliding velocity [µm/s]": V,
            "friction coefficient": MU,
            "contact pressure": 0.3,
            "relative_sigma": 3.0,
        },
        {"contact pressure": "N/mm2", "relative_sigma": "%"},
    )
    np.testing.assert_allclose(data.velocity, [1e-6, 1e-5, 1e-4], rtol=1e-15)
    np.testing.assert_allclose([data.pressure, data.relative], [[3e5] * 3, [0.03] * 3], rtol=1e-15)
    titles = ("Angular Frequency [rad/sec]", "E' (N/mm²)", "Loss modulus [kPa]", "Temp. (°C)")
    data = fitting.ModulusData.from_frame(dict(zip(titles, ([2.0], [3.0], [4.0], [5.0]), strict=True)))
    values = np.ravel([data.omega, data.storage, data.loss, data.temperature])
    np.testing.assert_allclose(values, [2.0, 3e6, 4e3, 278.15], rtol=1e-15)
    data = fitting.read(pandas.DataFrame({"f [Hz]": [1.0], "E' [MPa]": [2.0], "E'' [MPa]": [0.1]}))
    np.testing.assert_allclose([data.omega, data.storage], [[2 * np.pi], [2e6]], rtol=1e-15)
    data = fitting.SpectrumData.from_frame({"log10_q [1/m]": [3.0], "C": [1e-10]})
    np.testing.assert_allclose(data.q, 1e3, rtol=1e-15)
    data = fitting.read({"q [1/um]": [1.0, 2.0], "C [um^4]": [1.0, 0.1]}, normalisation="C")
    np.testing.assert_allclose([data.q, data.C], [[1e6, 2e6], [1e-24, 1e-25]], rtol=1e-14)
    table = rf.io.read_table(pandas.DataFrame({"T (°C)": T, "lg aT": [1.0, 0.0, -1.0]}), ["T", "aT"])
    np.testing.assert_allclose(table["aT"], [10.0, 1.0, 0.1], rtol=1e-15)


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
        (
            {"v [m/s]": V, "mu": MU, "p": V},
            {"v": "mm/s"},
            r"^column 'v \[m/s\]': unit 'mm/s' contradicts the title; must be equal$",
        ),
        ({"v": V, "mu": MU}, None, r"^data frame: no column p: .* it has the columns v, mu\. Rename"),
        ({"v": V, "mu": [1.0]}, None, r"^data frame: columns differ in length \('v' has 3, 'mu' has 1\)"),
    ],
)
def test_wrong_frames(frame, units, message):
    with pytest.raises(ValueError, match=message):
        fitting.FrictionData.from_frame(frame, units)


@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        (TITLES, {"block": 1}, "^data frame: block = 1: must not be given; a data frame has no"),
        (TITLES, {"columns": ["v"]}, "^data frame: columns = .*: must be a list of 3 texts"),
        (TITLES, {}, r"^data frame: no column p: add it to the table, or give pressure"),
        ({"a": V, "b": MU}, {}, r"^data frame: columns .*must be the columns of one kind of data"),
    ],
)
def test_frames_that_read_refuses(source, options, message):
    with pytest.raises(ValueError, match=message):
        fitting.read(source, **options)
