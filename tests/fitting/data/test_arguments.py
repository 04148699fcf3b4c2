"""Arguments of the wrong type are named with their value, and measurements are not repeated."""

import numpy as np
import pytest

import fitting
from fitting import AreaData, FrictionData, ModulusData, SpectrumData

TABLE = "v [m/s];mu;p [Pa]\n1;0.5;1e5\n2;0.6;1e5\n"


def said(call):
    with pytest.raises(ValueError, match="must") as caught:
        call()
    assert "\n" not in str(caught.value)
    return str(caught.value)


WRONG = {
    "columns": (3, "f", (), [], [1], {"v": 1}, [None], {3}),
    "pressure": ("2e5", [None]),
    "temperature": ("20 °C", object()),
    "body": (3, "middle"),
    "relative": ("5%", [1j]),
    "hurst": ("0.8", [0.8]),
    "poisson": ([0.5], "0.5", True),
    "kind": (3, "frictoin"),
    "check_units": ("no", 1),
    "bad_rows": (True, "skip"),
    "area": ("1", [1e-4], True),
    "frequency": ([1, 2], 0.0, "10 Hz"),
    "block": ("a", 1.5),
    "normalisation": (3,),
}


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in WRONG.items() for value in values]
)
def test_arguments_of_read(tmp_path, name, value):
    path = tmp_path / "table.csv"
    path.write_text(TABLE)
    message = said(lambda: fitting.read(path, **{name: value}))
    assert message.startswith(f"{path}: ") or message.startswith(f"{name} = ")
    assert name in message


@pytest.mark.parametrize("value", [3, None, [1.0], b"\0"])
def test_paths(value):
    data = FrictionData([1.0], [0.5], pressure=1e5)
    for call in (fitting.read, data.write, lambda path: fitting.write(path, data)):
        assert "path" in said(lambda call=call: call(value)) or value == b"\0"


@pytest.mark.parametrize("frame", [3, None, "abc", [1, 2]])
def test_frames(frame):
    assert f"mapping of title -> numbers, got a {type(frame).__name__}" in said(
        lambda: FrictionData.from_frame(frame)
    )


@pytest.mark.parametrize("units", [3, "mm/s", {"v": 3}])
def test_units_of_frames(units):
    frame = {"v": [1.0], "mu": [0.5], "p": [1e5]}
    assert said(lambda: FrictionData.from_frame(frame, units)).startswith("units = ")


# --- measured values have one entry for each point

POINTS = [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (
            lambda: FrictionData(POINTS, [0.5], pressure=1e5),
            "FrictionData.friction has shape (1,) for 3 points",
        ),
        (lambda: FrictionData(POINTS, 0.5, pressure=1e5), "FrictionData.friction has shape () for 3 points"),
        (
            lambda: FrictionData(POINTS, [[0.5], [0.6]], pressure=1e5),
            "friction has shape (2, 1) for 6 points",
        ),
        (lambda: AreaData(POINTS, [0.1], pressure=1e5), "AreaData.area has shape (1,) for 3 points"),
        (lambda: ModulusData(POINTS, [1e6], [1e5] * 3), "ModulusData.storage has shape (1,) for 3 points"),
        (lambda: ModulusData(POINTS, [1e6] * 3, 1e5), "ModulusData.loss has shape () for 3 points"),
        (lambda: SpectrumData(POINTS, [1e-10]), "SpectrumData.C has shape (1,) for 3 points"),
        (lambda: FrictionData(1.0, [0.5], pressure=[1e5, 2e5]), "friction has shape (1,) for 2 points"),
    ],
)
def test_measured_values_are_not_repeated(call, field):
    assert f"{field}: must have one value for each point" in said(call)


@pytest.mark.parametrize("name", ["velocity", "sigma", "pressure", "temperature"])
def test_a_list_of_one_number_is_not_repeated(name):
    given = {"velocity": POINTS, "sigma": 0.1, "pressure": 1e5, "temperature": 300.0}
    assert len(FrictionData(friction=[0.5] * 3, **given)) == 3
    one = np.atleast_1d(given[name])[:1]
    message = said(lambda: FrictionData(friction=[0.5] * 3, **given | {name: one}))
    assert (
        f"FrictionData.{name} has shape (1,) for 3 points: must be a number, or one for each point" in message
    )


def test_conditions_may_be_one_number():
    data = FrictionData(2.0, [0.5, 0.6], 0.1, 1e5, 300.0)
    np.testing.assert_array_equal(
        [data.velocity, data.pressure, data.sigma], [[2.0] * 2, [1e5] * 2, [0.1] * 2]
    )


def test_kind_of_an_hdf5_file(tmp_path):
    path = tmp_path / "data.h5"
    FrictionData([1.0, 2.0], [0.5, 0.6], pressure=1e5).write(path)
    np.testing.assert_array_equal(fitting.read(path, kind="friction").friction, [0.5, 0.6])
    for kind, words in (
        ("area", "kind = 'area': the file contains friction data; leave kind out"),
        ("frictoin", "kind = 'frictoin': did you mean 'friction'"),
    ):
        with pytest.raises(ValueError, match=words):
            fitting.read(path, kind=kind)
