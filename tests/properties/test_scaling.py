"""Scaling identities: units, heights over pressure, the direction of sliding, the order of the solids."""

import numpy as np
import pytest
from problems import PROBLEMS, covering, distinct, each, having

from rubberfric.base.objects.physical import leaves_of, parts_of

# Exponents of stress, time and length of every unit.
DIMENSIONS = {
    "Pa": (1, 0, 0),
    "Pa/m": (1, 0, -1),
    "s": (0, 1, 0),
    "rad/s": (0, -1, 0),
    "m": (0, 0, 1),
    "1/m": (0, 0, -1),
    "m^4": (0, 0, 4),
    "m/s": (0, -1, 1),
    "J/m^2": (1, 0, 1),
    "kg/m^3": (1, 2, -2),
    "J/(kg K)": (0, -2, 2),
    "W/(m K)": (1, -1, 2),
    **dict.fromkeys(("-", "K", "1/K", "rad", "eV"), (0, 0, 0)),
}
# Other units of stress, time and length: how large the old ones are in them.
UNITS = {
    "stress": (7.0, 1.0, 1.0),
    "softer": (1e-3, 1.0, 1.0),
    "time": (1.0, 3.0, 1.0),
    "length": (1.0, 1.0, 0.2),
}
ORDINARY = ("rubber", "slab", "contact shear", "grooves", "softening")


def tolerance(problem):
    """Relative error: rounding, and what fixed points leave."""
    return 1e-8 if problem.tags & {"heating", "adhesion"} else 1e-9 if "tabulated" in problem.tags else 1e-11


def in_units(problem, units):
    """A problem in other units: all numbers of its scene, velocity and pressure."""

    def factor(unit):
        return np.prod(np.power(units, np.array(DIMENSIONS[unit], float)))

    changes = {
        f"{path}.{name}" if path else name: factor(leaf.unit) * getattr(part, name)
        for path, part in parts_of(problem.scene)
        for name, leaf in leaves_of(type(part)).items()
        if any(DIMENSIONS[leaf.unit]) and getattr(part, name) is not None
    }
    velocity, pressure = factor("m/s") * problem.velocity, factor("Pa") * problem.pressure
    return problem._replace(scene=problem.scene.replace(changes), velocity=velocity, pressure=pressure)


@each(distinct(PROBLEMS.values()), ORDINARY)
def test_units(problem):
    """Area, friction and temperatures are the same in all units, the separation is a length."""
    expected = problem.solved()
    for changed, units in UNITS.items():
        scaled = in_units(problem, units).solved()
        for quantity in problem.names:
            wanted = expected[quantity] * (units[2] if quantity == "separation" else 1.0)
            error = np.abs(scaled[quantity] - wanted)
            assert (error <= tolerance(problem) * np.abs(wanted)).all(), (changed, quantity, scaled, wanted)


@each(
    distinct(having(without=("softening", "adhesion", "heating", "shear"))),
    ("rubber", "slab", "grooves"),
)
def test_heights_over_pressure(problem):
    """Elasticity is linear: heights and pressure times 7 leave the area."""
    spectra = {
        path: part for path, part in parts_of(problem.scene) if {"h_rms", "C"} & set(leaves_of(type(part)))
    }
    changes = {
        f"{path}.{key}": factor * getattr(part, key)
        for path, part in spectra.items()
        for key, factor in (("h_rms", 7.0), ("C", 49.0))
        if hasattr(part, key)
    }
    higher = problem.solved(scene=problem.scene.replace(changes), pressure=7 * problem.pressure)
    for quantity, exact in problem.solved().items():
        factor = 1.0 if quantity in ("area", "converged") else 7.0
        np.testing.assert_allclose(
            higher[quantity], factor * exact, rtol=tolerance(problem), err_msg=quantity
        )


@each(distinct(having(without=("rest",))), ORDINARY)
def test_signs(problem):
    """Friction is odd in the velocity and 0 at rest; all else is even, and has its limit there."""
    v = abs(problem.velocity)
    for quantity, values in problem.solved(velocity=np.array([v, -v, 0.0, 1e-14])).items():
        forth, back, rest, slow = values
        if quantity.endswith("friction"):
            assert back == pytest.approx(-forth, rel=1e-14, abs=0) and rest == 0.0
            assert forth >= 0.0 or quantity == "transverse_friction"
        else:
            assert back == pytest.approx(forth, rel=1e-14, abs=0), quantity
            assert slow == pytest.approx(rest, rel=1e-9), quantity


@each(covering(PROBLEMS.values(), also=("rubber",)), ("rubber",))
def test_solids_exchanged(problem):
    """Case IV is Case I with the solids exchanged; so is every other scene."""
    lower, upper = problem.scene.lower, problem.scene.upper
    exchanged = problem.solved(scene=problem.scene.replace({"lower": upper, "upper": lower}))
    for quantity, exact in problem.solved().items():
        np.testing.assert_allclose(exchanged[quantity], exact, rtol=10 * tolerance(problem), err_msg=quantity)


@each(distinct(having(without=("adhesion", "heating"))), (*ORDINARY, "S in G"))
def test_light_load(problem):
    """A ~ load, friction independent of it, the separation falls by the same amount every decade."""
    # The first correction is proportional to the load. At 1e-3 Pa it is 3e-8 for a liquid.
    at = problem.solved(pressure=np.array([1e-5, 1e-4, 1e-3]))
    rtol = 1e-4 if "law" in problem.tags else 2e-7
    np.testing.assert_allclose(at["area"] / at["area"][0], [1, 10, 100], rtol=rtol)
    for quantity in (name for name in problem.names if name.endswith("friction")):
        np.testing.assert_allclose(at[quantity], at[quantity][0], rtol=rtol, err_msg=quantity)
    gap = at["separation"]
    assert gap[1] - gap[0] == pytest.approx(gap[2] - gap[1], rel=rtol) and gap[0] > gap[1] > 0
