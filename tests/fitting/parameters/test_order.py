"""Fits keep the orders of a scene: q0 <= qr <= q1, increasing tables, and orders of user classes."""

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from support.scenes.fits import FAST, PLAIN, Q1, ROAD, friction_data

import fitting
import rubberfric as rf
from fitting import Bounded, Free, Positive, Tied
from fitting.parameters.variables import free_parameters, to_scene
from fitting.solvers.ordered import put_on_bounds, slopes_of_x, x_of, z_of
from rubberfric.base import POSITIVE, Number, forget, leaf, physical
from rubberfric.materials.shifts import Shift

Q = "lower.spectrum."
S = "upper.material.shift."
Q0 = f"{Q}q0"
QR = f"{Q}qr"
TABLE = rf.TabulatedShift([280.0, 290.0, 300.0, 310.0], [10.0, 3.0, 1.0, 0.3], 295.0)
SCENE = rf.Scene(ROAD, rf.Body(dataclasses.replace(PLAIN, shift=TABLE)))
SPECTRUM = rf.TabulatedSpectrum([1e2, 1e3, 1e4, 1e5], [1e-10, 1e-11, 1e-15, 1e-19], 2e2, 5e4)
CASES = {
    "cut-off": {Q1: Positive()},
    "roll-off between two that stay": {QR: Positive()},
    "both": {Q1: Positive(), QR: Positive()},
    "one that stays between": {Q0: Positive(), Q1: Positive()},
    "all": {Q1: Positive(), Q0: Positive(), QR: Positive()},
    "bounds that overlap": {Q1: Bounded(5e2, 1e6), QR: Bounded(2e2, 4e3)},
    "one tied to the next": {Q1: Positive(), QR: Tied(Q1)},
    "a table's temperatures": {f"{S}T[1:]": Free(), f"{S}T_ref": Free()},
    "some of a table": {f"{S}T[1:3]": Positive()},
}


def parts(scene):
    return scene.lower.spectrum, scene.upper.material.shift


@pytest.mark.parametrize("held", [pytest.param(False, marks=pytest.mark.slow), True])
@pytest.mark.parametrize("name", CASES)
def test_whatever_a_solver_does_the_scene_is_one_that_its_constructors_take(name, held):
    variables, constants, x = free_parameters(SCENE, CASES[name])
    moving = np.ones(variables.size)
    moving[0] = not (held and variables.size > 1)
    z = z_of(variables, constants, x, moving)
    np.testing.assert_allclose(x_of(variables, constants, z, moving), x, rtol=1e-13)
    rng = np.random.default_rng(0)
    for far in (0.3, 3.0, 30.0):
        for _ in range(50):
            there = x_of(variables, constants, z + far * moving * rng.standard_normal(z.size), moving)
            for part in parts(to_scene(variables, constants, jnp.asarray(there))):
                dataclasses.replace(part)


# Both scenes share q1, which both roll-offs bound from below. The solver moves one or the other above q1.
TWO_SCENES = {"A": SCENE, "B": SCENE}
ABOVE_BOTH = {f"*.{Q1}": Positive(), f"A.{QR}": Positive(), f"B.{QR}": Positive()}


@pytest.mark.parametrize(
    ("scenes", "free", "away"),
    [
        *((SCENE, free, 0.3) for free in CASES.values()),
        (TWO_SCENES, ABOVE_BOTH, [-3.0, 2.0, 1.0]),
        (TWO_SCENES, ABOVE_BOTH, [-3.0, 1.0, 2.0]),
    ],
    ids=[*CASES, "below A", "below B"],
)
def test_slopes_are_those_of_finite_differences(scenes, free, away):
    variables, constants, x = free_parameters(scenes, free)
    moving = np.ones(variables.size)
    z = z_of(variables, constants, x, moving) + away
    shift = 1e-6 * np.eye(z.size)
    ends = [[x_of(variables, constants, z + sign * s, moving) for s in shift] for sign in (1, -1)]
    expected = (np.array(ends[0]) - np.array(ends[1])).T / 2e-6
    np.testing.assert_allclose(slopes_of_x(variables, constants, z, moving), expected, atol=1e-7)
    traced = jax.jit(jax.jacfwd(lambda z: x_of(variables, constants, z, jnp.asarray(moving))))(jnp.asarray(z))
    np.testing.assert_allclose(traced, expected, atol=1e-7)


@pytest.mark.parametrize("name", CASES)
def test_several_fits_are_each_fit_alone_to_the_last_bit(name):
    variables, constants, x = free_parameters(SCENE, CASES[name])
    rng = np.random.default_rng(1)
    x = x + 0.3 * rng.standard_normal((7, x.size))
    moving = (rng.random(x.shape) < 0.7).astype(float)

    def computed(x, moving):
        at = variables, constants
        z = z_of(*at, x, moving) + 2.0 * moving
        bounds = put_on_bounds(*at, z + 3.0 * moving, z, moving)
        return z, x_of(*at, z, moving), slopes_of_x(*at, z, moving), bounds

    together = computed(x, moving)
    for i in range(len(x)):
        for several, single in zip(together, computed(x[i], moving[i]), strict=True):
            np.testing.assert_array_equal(several[i], single)


def test_the_ends_of_a_tabulated_spectrum_stay_in_the_table():
    scene = rf.Scene(rf.Body(rf.Rigid(), SPECTRUM), rf.Body(PLAIN))
    variables, constants, x = free_parameters(scene, {Q0: Positive(), Q1: Positive()})
    for z in ([-50.0, 50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, -50.0]):
        at = x_of(variables, constants, np.array(z), np.ones(2))
        dataclasses.replace(to_scene(variables, constants, jnp.asarray(at)).lower.spectrum)
    np.testing.assert_allclose(
        x_of(variables, constants, z_of(variables, constants, x, np.ones(2)), np.ones(2)), x
    )


def test_an_own_class_says_its_order():
    @physical
    class TwoSlopes(Shift):
        """ln a_T falls by 0.1 per K below T_knee, and half as steeply above, 0 at T_ref <= T_knee."""

        rising: ClassVar = (("T_ref", "T_knee"),)
        T_ref: Number = leaf(POSITIVE, unit="K")
        T_knee: Number = leaf(POSITIVE, unit="K")

        def log_factor(self, temperature):
            return -0.1 * (jnp.minimum(temperature, self.T_knee) - self.T_ref)

    try:
        with pytest.raises(ValueError, match=r"TwoSlopes.T_knee = 290.0: must be >= T_ref = 300.0"):
            TwoSlopes(300.0, 290.0)
        scene = rf.Scene(ROAD, rf.Body(dataclasses.replace(PLAIN, shift=TwoSlopes(300.0, 310.0))))
        variables, constants, x = free_parameters(scene, {f"{S}T_knee": Positive()})
        low = x_of(variables, constants, x - 50, np.ones(1))
        assert 300 < np.exp(low[0]) < 300 * (1 + 1e-10)
    finally:
        forget(TwoSlopes)


# A scene that has hardly a fall between its roll-off and its cut-off: noise wants q1 < qr.
V = np.logspace(-3, 1, 8)
NARROW = rf.Scene(rf.Body(rf.Rigid(), rf.SelfAffine(1e2, 3e3, 3.3e3, 0.8, 3e-5)), rf.Body(PLAIN))
FREE = {Q1: Positive(), QR: Positive()}


def friction(scene, seed):
    return friction_data(scene, V, 3e5, 0.03, seed)


@pytest.fixture(scope="module")
def at_the_edge():
    start = NARROW.replace({Q1: 1e4, QR: 1e3})
    return fitting.fit(start, friction(NARROW, 0), FREE, quadrature=FAST, further_time=0.0)


def test_a_fit_that_would_leave_the_order_ends_at_its_edge(at_the_edge, tmp_path):
    spectrum = at_the_edge.scene.lower.spectrum
    assert at_the_edge.success and at_the_edge.njev < 40
    assert 0 <= spectrum.q1 - spectrum.qr < 1e-4 * spectrum.q1
    assert at_the_edge.withheld[Q1] == f"at its lower bound {QR}"
    assert at_the_edge.withheld[QR] == f"at its upper bound {Q1}"
    rf.save_scene(tmp_path / "scene.h5", at_the_edge.scene)
    # The lowest along the edge, found by a search that shares no code with the fit.
    data = friction(NARROW, 0)

    def cost(log_q):
        model = rf.friction(NARROW.replace({QR: np.exp(log_q), Q1: np.exp(log_q)}), V, 3e5, quadrature=FAST)
        return 0.5 * float(np.sum((np.log(np.asarray(model) / data.friction) / 0.03) ** 2))

    lowest = minimize_scalar(cost, bracket=(7.5, 8.5)).fun
    assert at_the_edge.cost == pytest.approx(lowest, rel=1e-6)


def test_a_profile_holds_the_number_itself_and_moves_the_other_within(at_the_edge):
    profile = at_the_edge.profile(Q1, values=[2e3, 6e3])
    held, others = profile.values, dict(zip(profile.names, profile.parameters.T, strict=True))
    np.testing.assert_allclose(others[Q1], held, rtol=1e-12)
    assert np.all(others[QR] <= held) and np.isfinite(profile.rise).all()


@pytest.mark.slow
def test_other_methods_and_ensembles_keep_the_order(at_the_edge):
    start = NARROW.replace({Q1: 1e4, QR: 1e3})
    found = fitting.fit(start, friction(NARROW, 0), FREE, "lbfgs", quadrature=FAST, max_steps=60)
    assert found.scene.lower.spectrum.qr <= found.scene.lower.spectrum.q1
    assert found.cost == pytest.approx(at_the_edge.cost, rel=1e-2)
    members = fitting.multi_start(start, friction(NARROW, 0), FREE, 3, quadrature=FAST)
    ends = dict(zip(members.names, fitting.run_ensemble(members).values.T, strict=True))
    assert np.all(ends[QR] <= ends[Q1])


@pytest.mark.parametrize("edge", [{Q1: 1e3}, pytest.param({QR: 1e2}, marks=pytest.mark.slow)])
def test_a_start_at_an_edge_moves(edge):
    truth = rf.Scene(ROAD, rf.Body(PLAIN))
    data = friction(truth, 1)
    free = FREE if Q1 in edge else {QR: Positive(), f"{Q}h_rms": Positive()}
    found = fitting.fit(truth.replace(edge), data, free, quadrature=FAST)
    known = fitting.fit(truth, data, free, quadrature=FAST)
    assert found.success and found.cost == pytest.approx(known.cost, rel=1e-6)


def test_a_start_at_an_edge_is_in_order():
    assert free_parameters(SCENE, {Q1: Positive(1e3)})[0].order
