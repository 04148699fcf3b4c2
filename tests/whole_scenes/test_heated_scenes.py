"""Heated scenes: references, extremes, energy, and values that did not converge.

The kernel of the temperatures is in test_heating.py.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import solved, stored
from support.cases.stored import slow_if
from support.oracles import oracle_heating

import fitting
import rubberfric as rf
from fitting.solvers.evaluation import residual_rows
from fitting.solvers.problem import make_problem
from fitting.stages import why_not_finite
from rubberfric.analysis import jacobian
from rubberfric.analysis.jacobian import value_and_jacobian

NAMES = ("area", "viscoelastic_friction", "shear_friction", "friction", "separation", "flash_temperature")
CASES = {problem.name: problem for problem in stored("heated_cases")}
BASE = CASES["one"]


def heated_otherwise(problem, **changes):
    """Return the scene of a problem with changes of its heating."""
    return problem.scene.replace({f"heating.{name}": value for name, value in changes.items()})


def assert_is(values, wanted, rtol, temperature):
    """The flash temperature by its rise."""
    for name in [name for name in NAMES if name in values]:
        base = temperature if name == "flash_temperature" else 0.0
        np.testing.assert_allclose(
            values[name] - base, wanted[name] - base, rtol=rtol, atol=1e-300, err_msg=name
        )


@pytest.mark.parametrize("name", slow_if(lambda name: name not in ("macro", "background-shear"), list(CASES)))
def test_references_are_fixed_points_of_coarser_panels_too(name):
    known = CASES[name].case
    again = oracle_heating.solve(known, 20, 6, start=np.array(known["rises"]))
    assert_is(again, known, 1e-8, known["temperature"])


EXTREMES = {
    "mild": {},
    "insulating": {"conductivity": 1e-12},
    "conducting": {"conductivity": 1e12},
    "small-contacts": {"radius": 1e-9},
    "large-contacts": {"radius": 1e3},
    "light-matter": {"density": 1e-6},
}
KINDS = ("one", "sheared", "macro", "flash-shear", "two-rubbers")
CONDITIONS = [
    {name: np.array(values)}
    for name, values in (
        ("velocity", [0.0, 1e-30, 1e-6, 1e-2]),
        ("velocity", [10.0, 1e3, 1e6, 1e12]),
        ("pressure", [1e-3, 1.0, 1e3, 1e4]),
        ("pressure", [1e5, 1e6, 1e7, 1e9]),
    )
]


@pytest.mark.parametrize("change", EXTREMES)
@pytest.mark.parametrize("name", slow_if(lambda name: name != "one", KINDS))
def test_extremes_are_finite(name, change):
    problem = CASES[name]
    scene = heated_otherwise(problem, **EXTREMES[change])
    for conditions in CONDITIONS:
        values = problem.solved(scene=scene, **conditions)
        assert all(np.isfinite(x).all() for x in values.values())
        assert (values["flash_temperature"] >= problem.temperature).all()
        assert ((values["area"] > 0) & (values["area"] <= 1)).all()
        assert (values["friction"] >= 0).all() and (values["separation"] >= 0).all()
        if change not in ("large-contacts", "light-matter") and name != "flash-shear":
            assert values["converged"].all()


def test_at_rest():
    """The rise goes like |v|^1.5 or more."""
    values = BASE.solved(velocity=np.array([0.0, 1e-8, 1e-7]))
    rise = values["flash_temperature"] - BASE.temperature
    assert rise[0] == values["friction"][0] == 0
    assert (rise >= 0).all() and (rise < 1e-4).all()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "quantity"), [("macro", "area"), ("flash-shear", "friction")])
def test_pointwise_jacobian(name, quantity):
    leaves, tree = jax.tree.flatten(CASES[name].arguments[0])

    def scene_of(x):
        return tree.unflatten([leaf * jnp.exp(x[i]) for i, leaf in enumerate(leaves)])

    points = (np.array([1e-3, 0.3, 5.0]), np.array([1e5, 1e6, 3e5]), np.array([280.0, 290.0, 300.0]))
    x = jnp.zeros(len(leaves))
    _, jacobian = jax.jit(lambda x: value_and_jacobian(scene_of, x, points, quantity, rf.Quadrature()))(x)
    plain = jax.jit(
        jax.jacfwd(lambda x: getattr(rf.solve(scene_of(x), *points, quantities=quantity), quantity))
    )(x)
    np.testing.assert_allclose(jacobian, plain, rtol=1e-9, atol=1e-10 * float(np.abs(plain).max()))


@pytest.mark.slow
def test_fit_finds_conductivity_and_radius():
    v, heating = np.logspace(-2, 2, 12), BASE.scene.heating
    measured = np.asarray(rf.friction(BASE.scene, v, 3e5, 290.0))
    start = heated_otherwise(BASE, conductivity=0.5, radius=1e-3)
    data = fitting.FrictionData(v, measured, pressure=3e5, temperature=290.0)
    free = {"heating.conductivity": fitting.Positive(), "heating.radius": fitting.Positive()}
    result = fitting.fit(start, data, free)
    assert result.success and tuple(result.names) == tuple(free)
    np.testing.assert_allclose(result.values, [heating.conductivity, heating.radius], rtol=1e-6)


def test_no_last_iterate_reaches_a_fit(monkeypatch):
    v = np.array([1e-2, 1.0, 10.0])
    data = fitting.FrictionData(v, np.ones(3), pressure=3e5, temperature=290.0)
    problem = make_problem(BASE.scene, [data], {"heating.conductivity": fitting.Positive()})

    def left(_, velocity, *__, **___):
        return rf.Solution(friction=jnp.ones_like(velocity), converged=jnp.asarray(velocity) != v[1])

    monkeypatch.setattr(rf, "solve", left)
    assert np.isnan(residual_rows(problem, problem.start)).tolist() == [False, True, False]
    assert "not finite at the start at 1 of 3 values, first at velocity = 1 m/s" in why_not_finite(
        problem, [data]
    )


def test_no_last_iterate_has_a_jacobian(monkeypatch):
    left = {"friction": jnp.ones(1), "converged": jnp.zeros(1, bool)}
    monkeypatch.setattr(jacobian, "evaluate", lambda *_: left)
    points = np.array([1.0, 2.0]), np.array([1e5, 1e5]), np.array([290.0, 290.0])

    def scene_of(x):
        return BASE.scene.replace("heating.conductivity", x[0])

    values = jax.jit(
        lambda x: value_and_jacobian(scene_of, x, points, "friction", rf.Quadrature(panels=2, graded=0))[0]
    )(jnp.ones(1))
    assert np.isnan(values).all()


@pytest.mark.slow
def test_macroasperities_beyond_the_roughness():
    for radius, fraction in ((1.0, lambda _: 1.0), (1e-5, lambda area: area)):  # q_m = 3 and 3e5
        scene = heated_otherwise(BASE, radius=radius, area_fraction=None)
        own = BASE.solved(scene=scene, velocity=0.3)
        scene = heated_otherwise(BASE, radius=radius, area_fraction=float(fraction(own["area"][0])))
        assert_is(own, BASE.solved(scene=scene, velocity=0.3), 1e-9, BASE.temperature)


@pytest.mark.slow
def test_without_roughness_nothing_is_hot():
    smooth = rf.Scene(BASE.scene.upper, rf.Body(rf.Rigid()), heating=BASE.scene.heating)
    values = solved(smooth, 1.0, 1e6, 290.0)
    wanted = {"area": 1.0, "friction": 0.0, "separation": 0.0, "flash_temperature": 290.0, "converged": True}
    assert values == wanted


def test_what_a_heated_scene_must_have():
    with pytest.raises(ValueError, match=r"^temperature is missing: a scene with heating requires it, far"):
        rf.friction(BASE.scene, 1.0, 1e6)
    cold = BASE.scene.replace(heating=None)
    for name in ("flash_temperature", "converged"):
        with pytest.raises(
            ValueError, match=r"^quantities has 'flash_temperature' or 'converged': the scene"
        ):
            rf.solve(cold, 1.0, 1e6, 290.0, quantities=(name,))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["macro", "flash-shear"])
def test_energy_near_the_surface_is_what_friction_set_free(name):
    """q -> 0 sees T_q / 2q = int T dz = R (mu + share mu_con) sigma_0 / (P_m rho c_p)."""
    problem = CASES[name]._replace(scene=heated_otherwise(CASES[name], conductivity=1e-6))
    law = problem.scene.heating
    values, q = problem.solved(), np.array([1e-4, 1.0, np.pi / law.radius])
    along = rf.analysis.profile(*problem.arguments, q=q)
    warm = along.temperature
    fraction = along.area[2] if law.area_fraction is None else law.area_fraction
    heat = float(law.density * law.heat_capacity * fraction)
    shear = values.get("shear_friction", np.zeros(1))  # half of whose heat enters the rubber
    power = (values["friction"] - 0.5 * shear)[0] * problem.pressure
    rise = warm[1] - problem.temperature
    # 1 / q is 1 m, the heat within 1e-3 m.
    assert float(rise / (2 * q[1])) == pytest.approx(law.radius * power / heat, rel=5e-3)


@pytest.mark.slow
def test_temperatures_that_cross_an_entry_of_a_shift_table():
    """Default nodes against many more: a kink of ln a_T at 290 K, between T_0 and the flash, leaves 3e-5."""
    T = np.array([270.0, 280.0, 290.0, 300.0, 310.0, 320.0, 340.0])
    shift = rf.TabulatedShift(T, 10 ** (-8.86 * (T - 293.15) / (101.6 + T - 293.15)), 293.15)
    rubber = rf.Prony(4e6, [8e8, 7e8, 9e7, 1.5e7], [1e-9, 1e-7, 1e-5, 1e-3], shift=shift)
    road = rf.SelfAffine(300.0, 2000.0, 5e4, 0.7, 4e-5)
    hot = rf.Scene(
        rf.Body(rf.Rigid(), road),
        rf.Body(rubber),
        shear=rf.ContactShear(6.5e6, 0.1, 6e-3),
        heating=rf.Heating(1200.0, 1600.0, 0.23, 5e-3),
    )
    names = ("area", "friction", "flash_temperature")
    fine = rf.Quadrature(order=24, panels=16, graded=6, angular_order=24)
    found, exact = (
        rf.solve(hot, np.array([0.1, 0.3, 0.7]), 2e5, 285.0, quantities=names, quadrature=nodes)
        for nodes in (None, fine)
    )
    assert (exact.flash_temperature > 290.5).all()
    for name in names:
        np.testing.assert_allclose(getattr(found, name), getattr(exact, name), rtol=1e-8)
