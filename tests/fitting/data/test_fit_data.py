"""Measured data: refusals of the constructors, residuals of a fit, and exact files."""

import dataclasses
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.refusals import one_line
from support.scenes.measured import GOOD, KINDS, absolute, equal, good

from fitting.data.kinds import AreaData, FrictionData, ModulusData, SpectrumData, warn_of_repeated

FIELD = [(cls, name) for cls in KINDS for name in GOOD[cls]]


SIGMA = [(cls, name) for cls in KINDS for name in (*cls.sigmas, "relative")]


@pytest.mark.parametrize(("cls", "name"), [*FIELD, *SIGMA])
@pytest.mark.parametrize(
    ("value", "text"),
    [
        (["a", "b"], " = ['a', 'b']: must be real numbers"),
        (np.array([[1, 2], [3, 4j]]), ": must be real numbers"),
        ([10**400], ": must be real numbers"),
        (np.ma.array([1.0, 2.0], mask=[False, True]), " has masked entries: must have none"),
        ([], " is empty: must have at least one value"),
        ([1.0, np.nan], "[1] = nan: must be finite"),
    ],
)
def test_every_field_must_be_finite_real_numbers(cls, name, value, text):
    for make in (good, absolute) if name != "relative" and name not in cls.sigmas else (good,):
        given = {name: value}
        if name in cls.sigmas:
            given = dict.fromkeys(cls.sigmas, 0.1) | given
        for check_units in (True, False):
            got = one_line(
                lambda make=make, given=given, check=check_units: make(cls, **given, check_units=check)
            )
            assert got.startswith(f"{cls.__name__}.{name}"), got
            assert text in got, got


@pytest.mark.parametrize(("cls", "name"), FIELD)
def test_missing_fields(cls, name):
    if name == "temperature":
        assert good(cls, temperature=None).temperature is None
    else:
        unit = cls.fields()[name].unit
        expected = f"{cls.__name__}.{name} is missing: must be given, in {unit}"
        assert one_line(lambda: good(cls, **{name: None})) == expected


def test_pressure_has_no_default():
    assert "pressure is missing: must be given, in Pa" in one_line(lambda: FrictionData(1.0, 0.5))
    assert "pressure is missing: must be given, in Pa" in one_line(lambda: AreaData(1.0, 0.5, 0.1))


@pytest.mark.parametrize(("cls", "name"), [*FIELD, *SIGMA])
@pytest.mark.parametrize("value", [0.0, -1.0])
def test_signs(cls, name, value):
    given = {name: [0.5, value]}
    if name in cls.sigmas:
        given = dict.fromkeys(cls.sigmas, 0.1) | given
    if name == "velocity":
        assert good(cls, **given).velocity[1] == value
        return
    if name in ("pressure", "temperature", "storage", "loss"):
        given = {name: [1e4, value] if name != "temperature" else [300.0, value]}
    expected = f"{cls.__name__}.{name}[1] = {value}: must be > 0"
    assert expected in one_line(lambda: good(cls, **given))
    if name == "friction":
        assert one_line(lambda: good(cls, **given)).endswith(
            "with relative errors or none; give sigma instead"
        )
        assert expected in one_line(lambda: good(cls, **given, relative=0.1))
        assert absolute(cls, **given).friction[1] == value
    elif name in cls.values:
        assert one_line(lambda: absolute(cls, **given)) == expected
        # noise may leave the range where the residual does not need it
        assert getattr(absolute(cls, **given, check_units=False), name)[1] == value
        assert "give sigma" in one_line(lambda: good(cls, **given, check_units=False))
    else:
        assert expected == one_line(lambda: good(cls, **given, check_units=False))


@pytest.mark.parametrize(
    ("cls", "name", "value", "text"),
    [
        (FrictionData, "velocity", 2e6, "must be -1000 ... 1000 m/s; is it in mm/s or um/s?"),
        (AreaData, "velocity", -2e6, "must be -1000 ... 1000 m/s; is it in mm/s or um/s?"),
        (FrictionData, "pressure", 0.15, "must be >= 1 Pa; is it in MPa or GPa?"),
        (AreaData, "pressure", 1.1e10, "must be <= 1e10 Pa"),
        (FrictionData, "temperature", 20.0, "must be >= 100 K; is it in °C? then add 273.15"),
        (AreaData, "temperature", 2930.0, "must be <= 2000 K"),
        (ModulusData, "temperature", 20.0, "must be >= 100 K; is it in °C? then add 273.15"),
        (FrictionData, "friction", 80.0, "must be -50 ... 50; is it in percent?"),
        (AreaData, "area", 5.0, "must be <= 1; is it in percent, or not divided by A0?"),
        (ModulusData, "storage", 4.3, "must be >= 1e3 Pa; is it in MPa or GPa?"),
        (ModulusData, "storage", 1e14, "must be <= 1e13 Pa"),
        (ModulusData, "loss", 0.3, "must be >= 1 Pa; is it in MPa or GPa, or tan(delta)?"),
        (ModulusData, "loss", 1e14, "must be <= 1e13 Pa"),
        (SpectrumData, "q", 1e13, "must be 1e-6 ... 1e12 1/m"),
        (SpectrumData, "q", 1e-7, "must be 1e-6 ... 1e12 1/m"),
        (SpectrumData, "C", 1e6, "must be <= 1e3 m^4; is it in mm^4 or um^4?"),
        *((cls, "relative", 5.0, "must be <= 1; is it in percent? 3 % is 0.03") for cls in KINDS[:3]),
        (SpectrumData, "relative", 5.0, "must be <= 2.5; is it in percent? 3 % is 0.03"),
    ],
)
def test_values_that_look_like_a_wrong_unit(cls, name, value, text):
    index, given = ("[0]", [value, value]) if name in cls.values else ("", value)
    expected = f"{cls.__name__}.{name}{index} = {value}: {text} (check_units=False accepts it)"
    assert one_line(lambda: good(cls, **{name: given})) == expected
    data = good(cls, **{name: given}, check_units=False)
    np.testing.assert_array_equal(getattr(data, name), [value, value])


def test_bounds_leave_real_measurements_alone():
    FrictionData(
        [-300.0, 0.0, 1e-12], [1e-4, 2.5, 10.0], pressure=[10.0, 1e9, 1e5], temperature=[110, 300, 1300]
    )
    AreaData(1e-9, [1e-9, 1.0], pressure=[1.0, 1e10])
    ModulusData([1e-12, 1e14], [1e3, 1e12], [1.0, 1e11])
    SpectrumData([1e-2, 1e11], [1.0, 1e-48])


@pytest.mark.parametrize("cls", KINDS)
def test_errors_are_absolute_or_relative(cls):
    both = " and ".join(cls.sigmas)
    expected = f"{cls.__name__}: {both} and relative are given: must be one of them"
    assert one_line(lambda: absolute(cls, relative=0.1)) == expected


def test_errors_of_a_modulus_come_together():
    got = one_line(lambda: good(ModulusData, sigma_storage=1e4))
    assert got == "ModulusData.sigma_loss is missing: must be given together with sigma_storage"
    got = one_line(lambda: good(ModulusData, sigma_loss=1e4))
    assert got == "ModulusData.sigma_storage is missing: must be given together with sigma_loss"


@pytest.mark.parametrize(("cls", "name"), [*FIELD, *SIGMA])
def test_shapes_that_do_not_broadcast(cls, name):
    given = {
        name: np.full(3, {"pressure": 1e5, "temperature": 300.0, "storage": 1e6, "loss": 1e5}.get(name, 0.5))
    }
    if name in cls.sigmas:
        given = dict.fromkeys(cls.sigmas, 0.1) | given
    got = one_line(lambda: good(cls, **given))
    assert got.startswith(f"{cls.__name__}: shapes differ (")
    assert f"{name} has (3,)" in got
    assert "has (2,)" in got
    assert got.endswith("; they must broadcast")


@pytest.mark.parametrize("cls", KINDS)
def test_texts_and_flags(cls):
    for name in (1.0, None, "two\nlines", "\0"):
        assert f"{cls.__name__}.name = {name!r}: must be text on one line" in one_line(
            lambda name=name: good(cls, name=name)
        )
    assert f"{cls.__name__}.check_units = 1: must be True or False" in one_line(
        lambda: good(cls, check_units=1)
    )
    if cls in (ModulusData, SpectrumData):
        for body in ("middle", 1, True, ["lower"]):
            expected = f"{cls.__name__}.body = {body!r}: must be 'lower', 'upper' or None"
            assert one_line(lambda body=body: good(cls, body=body)) == expected
        assert [good(cls, body=body).body for body in ("lower", "upper", None)] == ["lower", "upper", None]
    else:
        with pytest.raises(TypeError, match="body"):
            good(cls, body="lower")


def test_order_of_arguments():
    data = FrictionData(1.0, 0.5, 0.1, 1e5, 300.0)
    assert [x.item() for x in (data.sigma, data.pressure, data.temperature)] == [0.1, 1e5, 300.0]
    data = AreaData(1.0, 0.5, 0.1, 1e5, 300.0)
    assert [x.item() for x in (data.sigma, data.pressure, data.temperature)] == [0.1, 1e5, 300.0]
    data = ModulusData(1.0, 2e6, 3e5, 4e4, 5e3, 300.0)
    values = (data.omega, data.storage, data.loss, data.sigma_storage, data.sigma_loss, data.temperature)
    assert [x.item() for x in values] == [1.0, 2e6, 3e5, 4e4, 5e3, 300.0]
    data = SpectrumData(1e3, 1e-12, 1e-13)
    assert [x.item() for x in (data.q, data.C, data.sigma)] == [1e3, 1e-12, 1e-13]


def test_fields_broadcast():
    data = FrictionData([1.0, 2.0, 3.0], np.full((2, 3), 0.5), 0.1, [[1e5], [2e5]], np.float32(300))
    np.testing.assert_array_equal(data.velocity, [1, 2, 3, 1, 2, 3])
    np.testing.assert_array_equal(data.pressure, [1e5, 1e5, 1e5, 2e5, 2e5, 2e5])
    for name in ("velocity", "friction", "sigma", "pressure", "temperature"):
        assert getattr(data, name).shape == (6,)
        assert getattr(data, name).dtype == np.float64
    assert FrictionData(1, 0.5, pressure=100_000).temperature is None
    assert len(data) == 6


def test_arrays_are_the_data_s_own():
    velocity = np.array([1.0, 2.0])
    data = FrictionData(velocity, jnp.array([0.5, 0.6]), pressure=1e5)
    velocity[0] = np.nan
    assert data.velocity[0] == 1.0
    assert isinstance(data.friction, np.ndarray)
    with pytest.raises(ValueError, match="read-only"):
        data.velocity[0] = 2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        data.velocity = velocity
    assert "must be real numbers" in one_line(
        lambda: jax.jit(lambda v: FrictionData(v, 0.5, pressure=1e5))(1.0)
    )


@pytest.mark.parametrize("cls", KINDS)
def test_measured_values_and_their_errors(cls):
    values = np.concatenate([GOOD[cls][name] for name in cls.values])
    n = len(values)
    unknown, relative, known = good(cls), good(cls, relative=[0.1, 0.2]), absolute(cls)
    for data in (unknown, relative, known):
        np.testing.assert_array_equal(data.measured, values)
        assert len(data) == n
    assert (unknown.logarithmic, relative.logarithmic, known.logarithmic) == (True, True, False)
    assert unknown.error is None
    np.testing.assert_array_equal(relative.error, [0.1, 0.2] * (n // 2))
    np.testing.assert_array_equal(known.error, [0.1, 0.2, 0.3, 0.4][:n])


@pytest.mark.parametrize("cls", KINDS)
def test_replaced(cls):
    n = len(good(cls))
    for data in (good(cls, name="name", relative=0.1), absolute(cls, name="name")):
        other = data.replaced(jnp.asarray(data.measured)[::-1])
        np.testing.assert_array_equal(other.measured, data.measured[::-1])
        rest = {name: getattr(data, name) for name in cls.values}
        equal(data, dataclasses.replace(other, **rest))
        got = one_line(lambda data=data: data.replaced(np.ones(n + 1)))
        assert got == f"{cls.__name__}.measured has shape ({n + 1},): must be ({n},)"
        assert "must be finite" in one_line(lambda data=data: data.replaced(np.full(n, np.nan)))
        assert "measured = ['x']: must be real" in one_line(lambda data=data: data.replaced(["x"]))
    # noise changes values unless they have no logarithm
    np.testing.assert_array_equal(absolute(cls).replaced(np.full(n, -7.0)).measured, np.full(n, -7.0))
    assert "must be > 0 with relative" in one_line(lambda: good(cls).replaced(np.full(n, -7.0)))
    np.testing.assert_array_equal(good(cls).replaced(np.full(n, 1e20)).measured, np.full(n, 1e20))


def test_labels():
    assert FrictionData(np.arange(40.0), [0.5] * 40, pressure=0.15e6, temperature=293.15).label == (
        "friction, 40 points, 0.15 MPa, 20 °C"
    )
    data = AreaData(1.0, [0.5, 0.5], pressure=[1e5, 3e5], temperature=[273.15, 313.15])
    assert data.label == "area, 2 points, 0.1 ... 0.3 MPa, 0 ... 40 °C"
    assert AreaData(1.0, 0.5, pressure=1e5).label == "area, 1 point, 0.1 MPa"
    assert good(ModulusData).label == "modulus, 2 points, 20 °C"
    assert good(SpectrumData, body="lower").label == "spectrum of the lower body, 2 points"
    assert good(SpectrumData, name="asphalt").label == "asphalt"
    assert repr(good(SpectrumData, name="asphalt")) == "<SpectrumData: asphalt>"
    assert [cls.quantity for cls in KINDS] == ["friction", "area", "modulus", "spectrum"]


def test_data_given_twice_are_noticed():
    """They count twice, so error bars would shrink by sqrt(2)."""
    one = ModulusData([1.0, 10.0], [1e6, 2e6], [1e5, 2e5], relative=0.1)
    same = ModulusData([1.0, 10.0], [1e6, 2e6], [1e5, 2e5], relative=0.1, name="copy")
    other = ModulusData([1.0, 10.0], [1e6, 2e6], [1e5, 2.1e5], relative=0.1)
    with pytest.warns(UserWarning, match="data sets 1 and 3 are equal"):
        warn_of_repeated([one, other, same], ["", "", ""])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_repeated([one, other], ["", ""])
        warn_of_repeated([one, same], ["R20", "R40"])
