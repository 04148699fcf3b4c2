"""Measured friction of two tyre compounds: fits of one, and blind predictions of the other.

`python -m pytest -m slow -s tests/whole_scenes/test_tyre_friction.py` prints a line for each contact model.
Moduli and road are measured. The free parameters are the largest stress of contact shear, its velocity, and
the cut-off wavevector q1 of the road. The six points of each compound have no errors; 5 % is assumed.
"""

import functools

import numpy as np
import pytest
from problems import CONTACT_MODELS
from support.published import needs
from support.scenes.tyre import PRESSURE, read, road, rubber

import fitting
import rubberfric as rf

pytestmark = [pytest.mark.slow, needs("tyre")]
FREE = {
    "shear.tau_f0": fitting.Positive(),
    "shear.v0": fitting.Positive(),
    "lower.spectrum.q1": fitting.Bounded(2e3, 1e6, start=1e5),
}
SETTING = rf.Quadrature(order=10, panels=10, angular_order=12)


def scene(compound, **model):
    """Return a scene with the measured modulus of a compound on the measured road."""
    shear = rf.ContactShear(6.5e6, 0.1, 6e-3)
    return rf.Scene(rf.Body(rf.Rigid(), road()), rf.Body(rubber(compound)), shear=shear, **model)


def measured(compound):
    """Return the measured friction of a compound."""
    v, mu = read(f"measured_friction_{compound}.csv")
    return fitting.FrictionData(v, mu, pressure=PRESSURE, relative=0.05, name=compound)


@functools.cache
def fitted(compound, model):
    """Return the fit to the friction of a compound with a contact model."""
    options = CONTACT_MODELS[model]
    return fitting.fit(scene(compound, **options), measured(compound), FREE, quadrature=SETTING)


@pytest.mark.parametrize(("one", "other"), [("R20", "R40"), ("R40", "R20")])
def test_fit_and_blind_prediction(one, other):
    for model, options in CONTACT_MODELS.items():
        fit = fitted(one, model)
        data = measured(other)
        numbers = dict(zip(fit.names, fit.values, strict=True))
        blind = scene(other, **options).replace({name: float(value) for name, value in numbers.items()})
        found = rf.friction(blind, data.velocity, PRESSURE, quadrature=SETTING)
        error = np.log(np.asarray(found) / data.friction)
        area = np.asarray(rf.contact_area(fit.scene, data.velocity, PRESSURE, quadrature=SETTING))
        misfit = np.log(np.asarray(fit.data[0].friction)) - np.log(data_of_model(fit))
        print(
            f"\n{model}: fit of {one} {percent(misfit)}, A/A0 {area.min():.3f} ... {area.max():.3f}, "
            + ", ".join(f"{name} {value:.3g}" for name, value in numbers.items())
            + f"; blind {other} {percent(error)}, mean {100 * error.mean():+.1f} %"
        )
        assert np.sqrt(np.mean(misfit**2)) < 0.12 and np.sqrt(np.mean(error**2)) < 0.2


@pytest.mark.parametrize("model", CONTACT_MODELS)
def test_next_measurement(model):
    """Contact shear and cut-off compensate each other in R20.

    Friction at a much larger velocity or another pressure separates them, and so does a contact area.
    """
    fit, pressure = fitted("R20", model), np.array([1e5, 3e5, 6e5])
    aim = fitting.prediction(np.geomspace(1e-2, 10, 7)[:, None], pressure)
    candidates = (np.geomspace(1e-4, 10, 11)[:, None], pressure)
    designs = {
        quantity: fitting.design(
            fit, candidates=candidates, n=1, criterion=aim, relative=0.05, quantity=quantity
        )
        for quantity in ("friction", "area")
    }
    for quantity, design in designs.items():
        print(f"\n{model}, one measured {quantity}:\n{design.report()}")
        before, after = design.predicted
        assert after < 0.05 < before
    assert not np.isfinite(fit.stderr[list(fit.names).index("lower.spectrum.q1")])
    best = designs["friction"]
    assert best.velocity[0] > 10 * fit.data[0].velocity.max() or best.pressure[0] > 1.5 * PRESSURE
    errors = dict(zip(FREE, designs["area"].rate * designs["area"].after, strict=True))
    assert errors["shear.tau_f0"] < 0.1 and errors["lower.spectrum.q1"] < 0.15


def data_of_model(fit):
    """Return the friction of the fitted scene at the velocities of its data."""
    return np.asarray(rf.friction(fit.scene, fit.data[0].velocity, PRESSURE, quadrature=SETTING))


def percent(error):
    """Return the root mean square of logarithms as text."""
    return f"rms {100 * np.sqrt(np.mean(error**2)):.1f} %"
