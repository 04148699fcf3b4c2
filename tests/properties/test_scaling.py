"""Scaling identities: units, heights over pressure, the direction of sliding, the order of the solids."""

import numpy as np
import pytest
from problems import PROBLEMS, having
from support.cases.stored import slow_if

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
ORDINARY = (
    *("rubber", "rough rubber", "two rubbers", "slab", "contact shear", "tabulated modulus", "grooves"),
    *("softening", "law"),
)
each_problem = pytest.mark.parametrize("name", slow_if(lambda name: name not in ORDINARY, PROBLEMS.keys()))


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


@each_problem
def test_units(name):
    """Area, friction and temperatures are the same in all units, the separation is a length."""
    problem = PROBLEMS[name]
    expected = problem.solved()
    for changed, units in UNITS.items():
        found = in_units(problem, units).solved()
        for quantity in problem.names:
            wanted = expected[quantity] * (units[2] if quantity == "separation" else 1.0)
            error = np.abs(found[quantity] - wanted)
            assert (error <= tolerance(problem) * np.abs(wanted)).all(), (changed, quantity, found, wanted)


LINEAR = {one.name for one in having(without=("softening", "adhesion", "heating", "shear"))}


@pytest.mark.parametrize(
    "name", slow_if(lambda name: name not in ORDINARY, [n for n in PROBLEMS if n in LINEAR])
)
def test_heights_over_pressure(name):
    """Elasticity is linear: heights and pressure times 7 leave the area."""
    problem = PROBLEMS[name]
    spectra = {
        path: part for path, part in parts_of(problem.scene) if {"h_rms", "C"} & set(leaves_of(type(part)))
    }
    changes = {
        f"{path}.{key}": factor * getattr(part, key)
        for path, part in spectra.items()
        for key, factor in (("h_rms", 7.0), ("C", 49.0))
        if hasattr(part, key)
    }
    found = problem.solved(scene=problem.scene.replace(changes), pressure=7 * problem.pressure)
    for quantity, exact in problem.solved().items():
        factor = 1.0 if quantity in ("area", "converged") else 7.0
        np.testing.assert_allclose(found[quantity], factor * exact, rtol=tolerance(problem), err_msg=quantity)


@pytest.mark.parametrize(
    "name",
    slow_if(lambda name: name not in ORDINARY, [n for n, one in PROBLEMS.items() if "rest" not in one.tags]),
)
def test_signs(name):
    """Friction is odd in the velocity and 0 at rest; all else is even, and has its limit there."""
    problem = PROBLEMS[name]
    v = abs(problem.velocity)
    found = problem.solved(velocity=np.array([v, -v, 0.0, 1e-14]))
    for quantity, values in found.items():
        forth, back, rest, slow = values
        if quantity.endswith("friction"):
            assert back == pytest.approx(-forth, rel=1e-14, abs=0) and rest == 0.0
            assert forth >= 0.0 or quantity == "transverse_friction"
        else:
            assert back == pytest.approx(forth, rel=1e-14, abs=0), quantity
            assert slow == pytest.approx(rest, rel=1e-9), quantity


@pytest.mark.parametrize("name", slow_if(lambda name: name not in ("rubber",), PROBLEMS.keys()))
def test_solids_exchanged(name):
    """Case IV is Case I with the solids exchanged; so is every other scene."""
    problem = PROBLEMS[name]
    lower, upper = problem.scene.lower, problem.scene.upper
    found = problem.solved(scene=problem.scene.replace({"lower": upper, "upper": lower}))
    for quantity, exact in problem.solved().items():
        np.testing.assert_allclose(found[quantity], exact, rtol=10 * tolerance(problem), err_msg=quantity)


LIGHT = [one.name for one in having(without=("adhesion", "heating"))]


@pytest.mark.parametrize("name", slow_if(lambda name: name not in (*ORDINARY, "S in G"), LIGHT))
def test_light_load(name):
    """A ~ load, friction independent of it, the separation falls by the same amount every decade."""
    problem = PROBLEMS[name]
    found = problem.solved(pressure=np.array([1e-4, 1e-3, 1e-2]))
    rtol = 1e-4 if "law" in problem.tags else 2e-7
    np.testing.assert_allclose(found["area"] / found["area"][0], [1, 10, 100], rtol=rtol)
    for quantity in (name for name in problem.names if name.endswith("friction")):
        np.testing.assert_allclose(found[quantity], found[quantity][0], rtol=rtol, err_msg=quantity)
    gap = found["separation"]
    assert gap[1] - gap[0] == pytest.approx(gap[2] - gap[1], rel=rtol) and gap[0] > gap[1] > 0
