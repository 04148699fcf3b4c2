"""The fast functions against the paper's equations, evaluated one by one (`rubberfric.theory.paper`).

The quadrature error of `paper.solve` with its default nodes is 1e-14 in area and friction and 1e-10 in the
separation, from twice the nodes. Nothing of the fast path is in it: the comparison is of two programs.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import RIGID, ROAD, SHEAR, SHIFTED_TREAD, SOFT, TREAD, WLF, WORN, scene
from support.cases.stored import QUANTITIES, arguments, reference, slow_if

import rubberfric as rf
from rubberfric.theory import paper

STEEL = rf.Elastic(1e8, 0.3)
TABLE = rf.TabulatedModulus(
    np.logspace(0, 6, 7),
    np.geomspace(3e6, 3e8, 7),
    np.geomspace(1e5, 1e8, 7),
    shift=rf.TabulatedShift([273.15, 293.15, 313.15], [30.0, 1.0, 0.1], 293.15),
)
PLATE = rf.TabulatedSpectrum(np.geomspace(100.0, 3.1e4, 6), np.geomspace(1e-13, 1e-19, 6))
SHEARED = rf.PronyShear(1e6, [1e8, 1e7], [1e-6, 1e-3], 2e9, WLF)
HOT = rf.Prony(2e6, [2e8, 2e7], [1e-6, 1e-4], 0.49, rf.Arrhenius(1.0, 293.15, vertical=rf.Entropic()))

# Scene, velocity, pressure, temperature.
SCENES = {
    "smooth rubber on a road": (scene((RIGID, ROAD), (TREAD,)), 1e-2, 3e5, None),
    "light load": (scene((RIGID, ROAD), (TREAD,)), 1e-2, 1e1, None),
    "heavy load": (scene((RIGID, ROAD), (TREAD,)), 1e-2, 1e7, None),
    "backwards": (scene((RIGID, ROAD), (TREAD,)), -3.0, 3e5, None),
    "flat spectrum": (scene((RIGID, ROAD.replace(hurst=0.0)), (TREAD,)), 1e-2, 3e5, None),
    "no plateau": (scene((RIGID, ROAD.replace(qr=150.0)), (SOFT,)), 1.0, 3e5, None),
    "rough rubber": (scene((RIGID, ROAD), (SHIFTED_TREAD, WORN)), 1e-3, 2e5, 283.15),
    "two rubbers": (scene((SOFT, WORN), (SHIFTED_TREAD, ROAD)), 1e-1, 3e5, 283.15),
    "vertical shift": (scene((HOT, WORN), (SHIFTED_TREAD, ROAD)), 1e-1, 3e5, 303.15),
    "slab": (scene((RIGID, ROAD), (TREAD, None, rf.Slab(1e-3))), 1e-2, 1e6, None),
    "slabs": (
        scene((STEEL, WORN, rf.Slab(1e-3, "frictionless")), (SOFT, ROAD, rf.Slab(2e-3))),
        1e-2,
        1e6,
        None,
    ),
    "shear relaxes": (scene((RIGID, ROAD), (SHEARED,)), 1e-1, 3e5, 283.15),
    "shear relaxes on elastic": (scene((STEEL, WORN), (SHEARED, ROAD)), 3e-2, 2e5, 283.15),
    "shear relaxes on a slab": (
        scene((SOFT, WORN, rf.Slab(1e-3)), (SHEARED.replace(bulk=1e6), ROAD)),
        3e-2,
        2e5,
        283.15,
    ),
    "elastic": (scene((STEEL, ROAD), (rf.Elastic(1e7, 0.5),)), 1.0, 3e5, None),
    "rigid on rough rubber": (scene((TREAD, ROAD), (RIGID,)), 1.0, 3e5, None),
    "tabulated spectrum": (scene((RIGID, PLATE), (TREAD,)), 1e-2, 1e5, None),
    "S in G, contact shear": (
        scene((RIGID, ROAD), (SHIFTED_TREAD,), gamma=0.6, area_correction=True, shear=SHEAR),
        1e-2,
        3e5,
        283.15,
    ),
    "S in G": (scene((RIGID, ROAD), (TREAD,), gamma=0.6, area_correction=True), 1e-2, 3e5, None),
    "contact shear": (scene((RIGID, ROAD), (SHIFTED_TREAD,), shear=SHEAR), 1e-2, 3e5, 283.15),
    "tabulated modulus": (scene((RIGID, ROAD), (TABLE,)), 1e-2, 3e5, 283.15),
}


# Scenes of parts that other scenes have as well.
SLOW = (
    "shear relaxes",
    "shear relaxes on a slab",
    "shear relaxes on elastic",
    "rough rubber",
    "vertical shift",
    "tabulated spectrum",
    "no plateau",
    "S in G",
    "contact shear",
)


@functools.partial(jax.jit, static_argnames="tabulated")
def slope_of_paper(given, direction, tabulated):
    """Return values of the paper's equations and their derivatives along a direction."""
    nodes = paper.gauss_nodes(step=0.06, panels=12) if tabulated else paper.gauss_nodes()
    return jax.jvp(lambda *given: jnp.stack(paper.solve(*given, nodes=nodes)[:3]), given, direction)


@jax.jit
def slope_of_library(given, direction):
    return jax.jvp(lambda *given: jnp.stack(rf.solve(*given)[:3]), given, direction)


@pytest.mark.parametrize("name", slow_if(SLOW.__contains__, SCENES.keys()))
def test_values_and_derivatives_are_those_of_the_paper(name):
    """Derivatives by all parameters and conditions, along two random directions in their logarithms."""
    *given, temperature = SCENES[name]
    given = jax.tree.map(jnp.asarray, (*given, *(() if temperature is None else (temperature,))))
    assert paper.covers(given[0])
    rng = np.random.default_rng(0)
    directions = jax.tree.map(lambda x: jnp.asarray(x * rng.uniform(0.5, 1.5, (2, *x.shape))), given)

    for i in (0, 1):
        direction = jax.tree.map(lambda x, i=i: x[i], directions)
        value, slope = slope_of_library(given, direction)
        exact, exact_slope = slope_of_paper(given, direction, "modulus" in name)
        np.testing.assert_allclose(value, exact, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(slope, exact_slope, rtol=1e-6, atol=1e-9)


# Structures of scene of the brute force of `oracle.py`, which shares no code with the paper's module.
BY_ORACLE = ("general-both-rubber-both-rough-0", "general-layered-0", "extreme-light-1", "elastic-elastic-0")


@pytest.mark.parametrize("name", BY_ORACLE)
def test_the_paper_has_the_values_of_brute_force(name):
    case = reference("forward_cases")[name]
    found = jax.jit(paper.solve)(*arguments(case))
    for quantity in QUANTITIES:
        value, exact = float(getattr(found, quantity)), case[quantity]
        assert value == pytest.approx(exact, rel=1e-9, abs=1e-20 if exact == 0 else 0), quantity


@pytest.mark.slow
def test_nodes_of_the_paper_are_enough():
    for at, rtol in (
        (SCENES["two rubbers"], [1e-13, 1e-13, 1e-9]),
        (SCENES["light load"], [1e-12, 1e-11, 1e-9]),
    ):
        usual = paper.solve(*at)
        fine = paper.solve(*at, nodes=paper.gauss_nodes(order=16, panels=12, graded=18, step=0.15))
        for one, two, error in zip(usual, fine, rtol, strict=False):
            assert float(one) == pytest.approx(float(two), rel=error)


def test_trapezoids_converge_to_the_second_order():
    """Full contact at first, every angle resolved: the trapezoids' own order."""
    road = rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 5e-4)
    slow = scene((RIGID, road), (rf.Prony(3e6, [4e8, 5e7], [1e-7, 1e-3]),))
    exact = paper.solve(slow, 1e-7, 4e6)
    errors = []
    for n in (51, 101, 201):
        found = paper.solve(slow, 1e-7, 4e6, nodes=paper.trapezoid_nodes(n, 2 * n))
        errors.append([abs(float(a / b) - 1) for a, b in zip(found[:3], exact[:3], strict=True)])
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all((ratios > 3.4) & (ratios < 4.6)), ratios


@pytest.mark.parametrize(
    "part",
    [
        {"heating": rf.Heating(1200.0, 1600.0, 0.23, 2e-3)},
        {"softening": rf.Softening(np.array([1e-3, 1.0]), np.array([1.0, 0.3]), np.array([1.0, 0.5]))},
        {"adhesion": rf.Adhesion(0.05)},
        {"lower": rf.Body(RIGID, rf.Anisotropic(ROAD, 2.0))},
        {"upper": rf.Body(TREAD, None, rf.Coating(1e-3, rf.Elastic(1e9, 0.3)))},
    ],
    ids=lambda part: next(iter(part)),
)
def test_scenes_beyond_the_paper_are_refused(part):
    plain = scene((RIGID, ROAD), (TREAD,))
    assert paper.covers(plain) and not paper.covers(plain.replace(**part))
    with pytest.raises(ValueError, match="scene has a part that the paper's general case lacks"):
        paper.solve(plain.replace(**part), 1.0, 1e5)
