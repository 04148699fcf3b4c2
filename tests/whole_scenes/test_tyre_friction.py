"""Measured friction of two tyre compounds: fits of one, and blind predictions of the other.

`python -m pytest -m slow -s tests/whole_scenes/test_tyre_friction.py` prints a line for each contact model.
Moduli and road are measured. The free parameters are the largest stress of contact shear, its velocity, and
the cut-off wavevector q1 of the road. The six points of each compound have no errors; 5 % is assumed.
"""

import numpy as np
import pytest
from support.folders import TYRE
from support.scenes.common import CONTACT_MODELS
from support.scenes.tyre import PRESSURE, read, road

import fitting
import rubberfric as rf

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not TYRE.is_dir(), reason="no measured tyre data beside the project"),
]
FREE = {
    "shear.tau_f0": fitting.Positive(),
    "shear.v0": fitting.Positive(),
    "lower.spectrum.q1": fitting.Bounded(2e3, 1e6, start=1e5),
}
SETTING = rf.Quadrature(order=10, panels=10, angular_order=12)


def scene(compound, **model):
    """Return a scene with the measured modulus of a compound on the measured road."""
    f, storage, loss = read(f"master_curve_{compound}.csv")
    rubber = rf.TabulatedModulus(2 * np.pi * f, storage, loss, poisson=0.5)
    return rf.Scene(
        rf.Body(rf.Rigid(), road()), rf.Body(rubber), shear=rf.ContactShear(6.5e6, 0.1, 6e-3), **model
    )


def measured(compound):
    """Return the measured friction of a compound."""
    v, mu = read(f"measured_friction_{compound}.csv")
    return fitting.FrictionData(v, mu, pressure=PRESSURE, relative=0.05, name=compound)


@pytest.mark.parametrize(("one", "other"), [("R20", "R40"), ("R40", "R20")])
def test_fit_and_blind_prediction(one, other):
    for model, options in CONTACT_MODELS.items():
        fit = fitting.fit(scene(one, **options), measured(one), FREE, quadrature=SETTING)
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


def data_of_model(fit):
    """Return the friction of the fitted scene at the velocities of its data."""
    return np.asarray(rf.friction(fit.scene, fit.data[0].velocity, PRESSURE, quadrature=SETTING))


def percent(error):
    """Return the root mean square of logarithms as text."""
    return f"rms {100 * np.sqrt(np.mean(error**2)):.1f} %"
