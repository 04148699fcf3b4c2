"""Inputs that a fit refuses with a one-line message."""

import os
import subprocess
import sys

import jax
import numpy as np
import pytest
from support.scenes.fits import AFFINE, PLAIN, ROAD, SHEAR, E
from support.scenes.fits import FAST as QUADRATURE
from support.scenes.fits import SCENE as COLD
from support.scenes.fits import WARM as SCENE

import rubberfric as rf
from fitting import (
    AreaData,
    Bounded,
    FrictionData,
    Gaussian,
    ModulusData,
    Positive,
    Smooth,
    SpectrumData,
    fit,
)

FREE = {E: Positive()}
ELASTIC = rf.Scene(ROAD, rf.Body(rf.Elastic(1e7, 0.5)))
SHEARED = ELASTIC.replace(shear=SHEAR)
POINT = ModulusData([1.0], [1e7], [1e6])
SPECTRUM = SpectrumData([1e3], [1e-14])
MODULUS = ModulusData([1e2, 1e3, 1e4], [5e6, 8e6, 1e7], [2e6, 4e6, 4e6], relative=0.05)


def refused(text, *arguments, error=ValueError, **options):
    """Check that a fit is refused, with one line in which `text` stands."""
    with pytest.raises(error) as caught:
        fit(*arguments, **options)
    message = str(caught.value)
    assert text in message
    assert "\n" not in message and len(message) < 400


# --- arguments


@pytest.mark.parametrize("scene", ["scene.toml", ROAD])
def test_scene(scene):
    refused(f"scene is a {type(scene).__name__}: must be a Scene", scene, MODULUS, FREE)


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ([], "data is empty: must hold at least one data set"),
        (None, "data is a NoneType: must be FrictionData, AreaData, ModulusData, SpectrumData, SlipData or"),
        ("friction.csv", "data is a str: must be"),
        ({"a": MODULUS}, "data is a dict: must be"),
        (ModulusData, "data is a type: must be"),
        ([MODULUS, None], "data[1] is a NoneType: must be FrictionData, AreaData, ModulusData, Spec"),
        ([[MODULUS]], "data[0] is a list: must be"),
    ],
)
def test_data(data, text):
    refused(text, SCENE, data, FREE)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"method": "newton"}, "method = 'newton': must be one of lm, lbfgs, adam"),
        ({"loss": "l2"}, "loss = 'l2': must be one of linear, huber, soft_l1, cauchy"),
        ({"loss_width": 0.0, "loss": "huber"}, "loss_width = 0.0: must be a finite number > 0"),
        ({"starts": 0}, "starts = 0: must be an integer, 1 to 10000"),
        ({"starts": True}, "starts = True: must be an integer, 1 to 10000"),
        ({"max_steps": 0}, "max_steps = 0: must be an integer, 1 to 1000000"),
        ({"scale_errors": "yes"}, "scale_errors = 'yes': must be \"auto\", True or False"),
        ({"tolerance": 0.0}, "tolerance = 0.0: must be a finite number > 0"),
        ({"decades": np.nan, "starts": 2}, "decades = nan: must be a finite number > 0"),
        ({"key": 3, "starts": 2}, "key = 3: must be a jax.random.key, such as jax.random.key(1)"),
        ({"callback": 3}, "callback = 3: must be a function of (step, cost), or None"),
        ({"prior": [Smooth()]}, "must be a dict of key path -> Gaussian, Smooth, Sum or Correlated, or None"),
        ({"quadrature": 16}, "quadrature is a int: must be a Quadrature, or None"),
    ],
)
def test_options(options, text):
    refused(text, SCENE, MODULUS, FREE, **options)


def test_integers_of_any_kind_are_integers():
    assert fit(SCENE, MODULUS, FREE, starts=np.int64(1), max_steps=np.int32(1)).njev == 1


# --- data that the scene cannot predict


@pytest.mark.parametrize(
    ("scene", "data", "text"),
    [
        (
            COLD,
            FrictionData([1.0], [0.3], pressure=1e5, temperature=300.0),
            "no part of the scene has a shift: add a shift to the scene, or remove the temperature",
        ),
        (COLD, AreaData([1.0], [0.3], pressure=1e5, temperature=300.0), "no part of the scene has a shift"),
        (COLD, ModulusData([1.0], [1e7], [1e6], temperature=300.0), "but upper.material has no shift"),
        (SCENE, FrictionData([1.0], [0.3], pressure=1e5, temperature=120.0), "temperature[0] = 120.0: must"),
        (SCENE, ModulusData([1.0], [1e7], [1e6], body="lower"), "body = 'lower'; body must be 'upper', a"),
        (
            rf.Scene(rf.Body(PLAIN, AFFINE), rf.Body(PLAIN)),
            POINT,
            "no body is given; body must be 'lower' or 'upper', a viscoelastic solid",
        ),
        (ELASTIC, POINT, "the scene has no viscoelastic solid; modulus data need one"),
        (
            rf.Scene(ROAD, rf.Body(PLAIN, AFFINE)),
            SPECTRUM,
            "no body is given; body must be 'lower' or 'upper', a solid with a spectrum",
        ),
        (SCENE, SpectrumData([1e3], [1e-14], body="upper"), "body = 'upper'; body must be 'lower', a solid"),
    ],
)
def test_data_that_the_scene_cannot_predict(scene, data, text):
    refused(text, scene, data, {"gamma": Bounded(0.0, 1.0)})
    refused(data.label, scene, data, {"gamma": Bounded(0.0, 1.0)})


@pytest.mark.parametrize(
    "scene",
    [
        rf.Scene(rf.Body(rf.Rigid()), rf.Body(PLAIN, AFFINE)),  # Case II: the roughness moves with the rubber
        ELASTIC,
        rf.Scene(rf.Body(rf.Rigid()), rf.Body(PLAIN)),
    ],
)
@pytest.mark.parametrize("errors", [{"relative": 0.1}, {"sigma": 0.1}])
def test_friction_of_a_scene_that_has_none(scene, errors):
    """ln 0 with relative errors; with absolute ones, a fit of nothing."""
    data = FrictionData([1e-3, 1.0], [0.3, 0.4], pressure=1e5, name="dry run", **errors)
    refused(
        "data 'dry run': the scene has no friction; a rough solid must face a viscoelastic one,"
        " or the scene must have contact shear",
        scene,
        [AreaData([1.0, 2.0], [0.1, 0.1], pressure=1e5), data],
        {"gamma": Bounded(0.0, 1.0)},
    )


def test_contact_shear_is_friction():
    """With absolute errors at rest and backwards, too."""
    data = FrictionData([1e-3, 0.1, 0.0, -0.1], [0.3, 0.4, 0.05, -0.3], [0.1] * 4, pressure=1e5)
    result = fit(SHEARED, data, {"shear.tau_f0": Positive()}, quadrature=QUADRATURE)
    assert result.success and 0 < result.stderr[0] < 0.3 * result.values[0]


@pytest.mark.parametrize("velocity", [0.0, -1e-2])
def test_logarithm_of_a_friction_that_is_not_positive(velocity):
    """The model is 0 at rest and odd in the velocity; the data have relative errors."""
    data = FrictionData([1e-3, velocity], [0.3, 0.4], pressure=1e5, relative=0.1)
    text = (
        f"the model is not finite at the start at 1 of 2 values, first at velocity = {velocity:g} m/s,"
        " pressure = 100000 Pa: check the start values of the free parameters, and give absolute"
        " errors (sigma) where the model may be 0 or less, as at velocities <= 0"
    )
    free = {"shear.tau_f0": Positive()}
    refused(text, SHEARED, data, free, error=FloatingPointError, quadrature=QUADRATURE)


def test_a_smooth_prior_of_a_series_with_a_zero_in_it():
    scene = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, [5e7, 0.0, 8e6], [1e-5, 1e-4, 1e-3])))
    refused(
        f"prior['{E}']: {E} starts at 0: must be > 0, because Smooth uses logarithms",
        scene,
        MODULUS,
        {E + "[0]": Positive()},
        prior={E: Smooth()},
    )


# --- too many parameters


def test_more_parameters_than_data():
    data = ModulusData([1e3], [8e6], [4e6], relative=0.05)
    free = FREE | {"upper.material.E_inf": Positive()}
    text = "3 free parameters, but only 2 measured values and 0 rows of priors; free fewer, tie some, or add"
    refused(text, SCENE, data, free)
    result = fit(SCENE, data, free, prior={E: Gaussian(1e7, 1e6), "upper.material.E_inf": Gaussian(3e6, 3e5)})
    assert result.success and not result.withheld and np.isfinite(result.stderr).all()


def test_as_many_parameters_as_data_leave_no_scatter():
    """No estimate of the error, no reduced chi square; but values, and the error that was assumed."""
    result = fit(SCENE, ModulusData([1e4], [1.15e7], [5.9e6]), FREE)
    assert result.success and result.cost < 1e-12
    assert result.freedom == pytest.approx(0.0, abs=1e-6) and np.isnan(result.redchi)
    assert result.estimated == (0.1,) and np.isfinite(result.stderr).all()


# --- single precision

SINGLE = """
import numpy as np
from fitting import ModulusData, Positive, fit
from support.scenes.fits import SCENE, maxwell_columns, noise

omega = np.logspace(1, 6, 10)
exact = maxwell_columns(omega, [1e-5, 1e-3]) @ [5e7, 8e6, 3e6]
data = ModulusData(omega, *np.split(exact * noise(20, 0.03), 2), relative=0.03)
result = fit(SCENE, data, {"upper.material.E": Positive(1e7)})
print(result.success, result.values.dtype, *result.values, *result.stderr, sep=",")
"""


@pytest.mark.slow
def test_single_precision():
    """In a new process without x64, compared with the fit in double precision."""
    environment = {**os.environ, "JAX_ENABLE_X64": "0", "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-W", "error", "-c", SINGLE]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    success, dtype, *numbers = done.stdout.strip().split(",")
    assert (success, dtype) == ("True", "float32")
    values, stderr = np.split(np.array(numbers, float), 2)
    here = {}
    exec(SINGLE, here)  # in this process, with x64
    np.testing.assert_allclose(
        values, here["result"].values, atol=0.05 * here["result"].stderr.min(), rtol=1e-3
    )
    np.testing.assert_allclose(stderr, here["result"].stderr, rtol=1e-2)


def test_a_single_precision_scene_is_fitted_in_its_own_precision():
    scene = rf.scene.scene.cast(SCENE, np.float32)
    result = fit(scene, MODULUS, FREE, starts=2)
    assert result.success
    assert {leaf.dtype for leaf in jax.tree.leaves(result.scene)} == {np.dtype(np.float32)}
    np.testing.assert_allclose(result.values, fit(SCENE, MODULUS, FREE).values, rtol=1e-2)
