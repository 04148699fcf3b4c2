"""Heated scenes: references, extremes, energy, and values that did not converge.

The kernel of the temperatures is in test_heating.py. Calls of one structure share a compiled function,
at `POINTS` points.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases.stored import as_arrays, reference, scene
from support.oracles import oracle_heating

import fitting
import rubberfric as rf
from fitting.solvers.evaluation import residual_rows
from fitting.solvers.problem import make_problem
from fitting.stages import why_not_finite
from rubberfric.analysis import jacobian
from rubberfric.analysis.jacobian import value_and_jacobian

NAMES = ("area", "viscoelastic_friction", "shear_friction", "friction", "separation", "flash_temperature")
POINTS = 8
CASES = reference("heated_cases")
BASE = CASES["one"]
HEATING = BASE["heating"]
MACRO = CASES["macro"]["heating"]
SHEARED = CASES["sheared"]  # the cheapest with a fixed point
ORDINARY = ("one", "slow", "backwards", "light")  # of one structure


def some(names, ordinary=ORDINARY):
    return [name if name in ordinary else pytest.param(name, marks=pytest.mark.slow) for name in names]


def solved(scene, velocity, pressure, temperature, quadrature=None):
    found = rf.solve(
        scene,
        velocity,
        pressure,
        temperature,
        quantities=(*NAMES, "converged"),
        quadrature=quadrature or rf.Quadrature(),
    )
    return {name: getattr(found, name) for name in (*NAMES, "converged")}


compiled = jax.jit(solved, static_argnames="quadrature")


def conditions(case, **changes):
    """Scene and conditions at POINTS points, `changes` made to the case; lists spread over the points."""
    case = case | changes
    spread = [np.resize(np.array(case[name], float), POINTS) for name in ("v", "pressure", "temperature")]
    return as_arrays((scene(case), *spread))


def found(case, dtype=float, quadrature=None, **changes):
    at = as_arrays(conditions(case, **changes), dtype)
    return {name: np.asarray(x) for name, x in compiled(*at, quadrature=quadrature).items()}


def assert_is(values, wanted, rtol, temperature):
    """The flash temperature by its rise."""
    for name in NAMES:
        base = temperature if name == "flash_temperature" else 0.0
        np.testing.assert_allclose(
            values[name] - base, wanted[name] - base, rtol=rtol, atol=1e-300, err_msg=name
        )


@pytest.mark.parametrize("name", some(CASES, ("macro", "background-shear")))
def test_references_are_fixed_points_of_coarser_panels_too(name):
    known = CASES[name]
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
VELOCITIES = [0.0, 1e-30, 1e-6, 1e-2, 10.0, 1e3, 1e6, 1e12]
PRESSURES = [1e-3, 1.0, 1e3, 1e4, 1e5, 1e6, 1e7, 1e9]
SCENES = {"one": BASE, "sheared": SHEARED} | {n: CASES[n] for n in ("macro", "flash-shear", "two-rubbers")}


@pytest.mark.parametrize("change", EXTREMES)
@pytest.mark.parametrize("name", some(SCENES))
def test_extremes_are_finite(name, change):
    case = SCENES[name]
    law = case["heating"] | EXTREMES[change]
    for where in ({"v": VELOCITIES}, {"pressure": PRESSURES}):
        values = found(case, heating=law, **where)
        assert all(np.isfinite(values[quantity]).all() for quantity in NAMES)
        assert (values["flash_temperature"] >= case["temperature"]).all()
        assert ((values["area"] > 0) & (values["area"] <= 1)).all()
        assert (values["friction"] >= 0).all() and (values["separation"] >= 0).all()
        if change not in ("large-contacts", "light-matter") and name != "flash-shear":
            assert values["converged"].all()


def test_at_rest():
    values = found(BASE, v=0.0)
    assert (values["flash_temperature"] == BASE["temperature"]).all() and (values["friction"] == 0).all()
    # The rise goes like |v|^1.5 or more.
    slow = found(BASE, v=[1e-8, 1e-7])["flash_temperature"] - BASE["temperature"]
    assert (slow >= 0).all() and (slow < 1e-4).all()


def scalar_arguments(case):
    return as_arrays((scene(case), case["v"], case["pressure"], case["temperature"]))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "quantity"), [("macro", "area"), ("flash-shear", "friction")])
def test_pointwise_jacobian(name, quantity):
    at, *_ = scalar_arguments(CASES[name])
    leaves, tree = jax.tree.flatten(at)

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
    truth = scene(BASE)
    v = np.logspace(-2, 2, 12)
    measured = np.asarray(rf.friction(truth, v, 3e5, 290.0))
    start = scene(BASE | {"heating": HEATING | {"conductivity": 0.5, "radius": 1e-3}})
    data = fitting.FrictionData(v, measured, pressure=3e5, temperature=290.0)
    free = {"heating.conductivity": fitting.Positive(), "heating.radius": fitting.Positive()}
    result = fitting.fit(start, data, free)
    assert result.success and tuple(result.names) == tuple(free)
    np.testing.assert_allclose(result.values, [HEATING["conductivity"], HEATING["radius"]], rtol=1e-6)


def test_no_last_iterate_reaches_a_fit(monkeypatch):
    heated, v = scene(BASE), np.array([1e-2, 1.0, 10.0])
    data = fitting.FrictionData(v, np.ones(3), pressure=3e5, temperature=290.0)
    problem = make_problem(
        heated, [data], {"heating.conductivity": fitting.Positive()}, None, "linear", None, None
    )

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
        return rf.Scene(*both, heating=rf.Heating(1.2e3, 1.6e3, x[0], 2e-3))

    both = scene(SHEARED).lower, scene(SHEARED).upper
    values = jax.jit(
        lambda x: value_and_jacobian(scene_of, x, points, "friction", rf.Quadrature(panels=2, graded=0))[0]
    )(jnp.ones(1))
    assert np.isnan(values).all()


@pytest.mark.slow
def test_macroasperities_beyond_the_roughness():
    for radius, fraction in ((1.0, lambda _: 1.0), (1e-5, lambda area: area)):
        law = MACRO | {"radius": radius}  # q_m = 3 and 3e5
        own = found(BASE, heating=law, v=0.3)
        given = found(BASE, heating=law | {"area_fraction": float(fraction(own["area"][0]))}, v=0.3)
        assert_is(own, given, 1e-9, BASE["temperature"])


@pytest.mark.slow
def test_without_roughness_nothing_is_hot():
    smooth = rf.Scene(scene(BASE).upper, rf.Body(rf.Rigid()), heating=rf.Heating(**HEATING))
    values = solved(smooth, 1.0, 1e6, 290.0)
    wanted = dict.fromkeys(NAMES, 0.0) | {"area": 1.0, "flash_temperature": 290.0}
    assert {name: float(values[name]) for name in NAMES} == wanted and values["converged"]


def test_what_a_heated_scene_must_have():
    heated = scene(BASE)
    with pytest.raises(ValueError, match=r"^temperature is missing: a scene with heating requires it, far"):
        rf.friction(heated, 1.0, 1e6)
    cold = dataclasses.replace(heated, heating=None)
    for name in ("flash_temperature", "converged"):
        with pytest.raises(
            ValueError, match=r"^quantities has 'flash_temperature' or 'converged': the scene"
        ):
            rf.solve(cold, 1.0, 1e6, 290.0, quantities=(name,))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["macro", "flash-shear"])
def test_energy_near_the_surface_is_what_friction_set_free(name):
    """q -> 0 sees T_q / 2q = int T dz = R (mu + share mu_con) sigma_0 / (P_m rho c_p)."""
    case = CASES[name] | {"heating": HEATING | {"conductivity": 1e-6}}
    base = found(case)
    law, q = case["heating"], np.array([1e-4, 1.0])
    warm = rf.analysis.profile(*scalar_arguments(case), q=q).temperature
    heat = law["density"] * law["heat_capacity"] * law["area_fraction"]
    power = (base["viscoelastic_friction"] + 0.5 * base["shear_friction"])[0] * case["pressure"]
    rise = warm[1] - case["temperature"]
    # 1 / q is 1 m, the heat within 1e-3 m.
    assert float(rise / (2 * q[1])) == pytest.approx(law["radius"] * power / heat, rel=5e-3)


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
