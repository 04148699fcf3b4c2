"""Which of several temperatures a heated scene has: branches, folds and jumps, against damped brute force.

Values, derivatives and extremes of heated scenes are in test_heated_scenes.py.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import rubberfric as rf
from rubberfric.theory import model
from rubberfric.theory.heat import temperatures
from rubberfric.theory.heat.balance import heat_balance
from rubberfric.theory.integrals import prepare

# --- A scene with folds

PRESSURE = 3e5  # [Pa]
COLD = 258.0  # [K], so cold that the scene has folds
QUANTITIES = ("friction", "flash_temperature", "converged")


def folded(branch="rising"):
    rubber = rf.Prony(
        4e6, [8e8, 7e8, 9e7, 1.5e7], [1e-9, 1e-7, 1e-5, 1e-3], shift=rf.WLF(14.0, 100.0, 293.15)
    )
    road = rf.SelfAffine(200.0, 1500.0, 5e4, 0.8, 4e-4)
    heating = rf.Heating(1.2e3, 1.6e3, 0.2, 2e-3, 0.05, branch=branch)
    return rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(rubber), heating=heating)


POINTS = 16


@jax.jit
def compiled(scene, v, pressure, temperature):
    found = rf.solve(scene, v, pressure, temperature, quantities=QUANTITIES)
    return found.friction, found.flash_temperature - temperature, found.converged


def solved(scene, v, pressure=PRESSURE, temperature=COLD):
    """Friction, flash rise and whether it converged, at up to POINTS velocities."""
    arrays = [np.resize(x, POINTS).astype(float) for x in (v, pressure, temperature)]
    return [np.asarray(x)[: np.size(v)] for x in compiled(scene, *arrays)]


# By `oracle_heating`, which shares nothing with the library, damped by 0.2 and each begun at the one before:
# velocity, friction, flash rise.
BRUTE = {
    "rising": [
        (0.001, 0.65561674359, 8.28177980101),
        (0.002, 0.60548982499, 9.96374427539),
        (0.01, 0.43601225017, 12.8235717741),
        (0.03, 0.314140302883, 14.5939895594),
        (0.1, 0.269949320698, 17.2102311885),
        (0.2, 0.258214960004, 18.5318642991),
        (0.4, 0.166602799016, 12.4506150728),
        (1.0, 0.110479796215, 13.3064705302),
        (1.5, 0.00425732224497, 0.114280334332),
    ],
    "falling": [
        (1.5, 0.00425732224497, 0.11428033433),
        (0.2, 0.039229554437, 1.1330847469),
        (0.14, 0.212181071191, 10.7661186696),
        (0.1, 0.212512908898, 10.073617805),
        (0.03, 0.186891944747, 7.38153273586),
        (0.01, 0.178127991915, 5.25079199208),
        (0.004, 0.214550467864, 4.1941908235),
        (0.002, 0.60548982499, 9.96374427544),
    ],
}


@pytest.mark.slow
@pytest.mark.parametrize("branch", ["rising", "falling"])
def test_brute_force_on_both_branches(branch):
    v, friction, rise = np.transpose(BRUTE[branch])
    found = solved(folded(branch), v)
    assert found[2].all()
    np.testing.assert_allclose(found[0], friction, rtol=1e-8)
    np.testing.assert_allclose(found[1], rise, rtol=1e-8)


@pytest.mark.slow  # brute force confirms both branches
def test_hysteresis():
    """The branches part within the loops that the folds bound, and nowhere else."""
    v = np.array([1e-5, 1e-3, 3e-3, 3.6e-3, 0.1, 0.279, 0.284, 1.35, 1.38, 10.0])
    rising, falling = solved(folded("rising"), v), solved(folded("falling"), v)
    assert rising[2].all() and falling[2].all()
    apart = np.abs(rising[1] - falling[1]) > 0.1
    assert apart.tolist() == [False, False, False, True, True, True, True, True, False, False]
    assert (rising[1] - falling[1] >= -1e-9).all()
    # The folds of the rising branch at 0.2815 and 1.367 m/s.
    assert rising[1][5] > 18.4 and rising[1][6] < 12.1 and rising[1][7] > 12.8 and rising[1][8] < 0.13


# --- Random scenes


def random_case(rng):
    """Scene and conditions: velocity, pressure, temperature."""
    tau = 10.0 ** np.sort(rng.uniform(-10, -2, 4))
    E = np.sort(10.0 ** rng.uniform(6.7, 9.0, 4))[::-1]
    shift = rf.WLF(rng.uniform(10, 18), rng.uniform(80, 130), 293.15)
    rubber = rf.Prony(10.0 ** rng.uniform(6, 7), E, tau, shift=shift)
    q = rng.uniform(50, 500), rng.uniform(600, 3000), 10.0 ** rng.uniform(4, 5.3)
    road = rf.SelfAffine(*q, rng.uniform(0.7, 0.95), 10.0 ** rng.uniform(-4, -3.2))
    area = 10.0 ** rng.uniform(np.log10(0.02), 0)
    heating = rf.Heating(1.2e3, 1.6e3, rng.uniform(0.15, 0.3), 10.0 ** rng.uniform(-3, -2.3), area)
    scene = rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(rubber), heating=heating)
    return scene, 10.0 ** rng.uniform(-6, 2), 10.0 ** rng.uniform(5, 6), rng.uniform(250, 300)


def stacked(cases):
    return jax.tree.map(lambda *x: jnp.stack([jnp.asarray(y, float) for y in x]), *cases)


@jax.jit
def vmapped(scenes, v, pressure, temperature):
    one = compiled.__wrapped__
    return jax.vmap(one)(scenes, v, pressure, temperature)


def test_random_scenes():
    """64 points of them: in a curve, and each among others."""
    rng = np.random.default_rng(7)
    for _ in range(8):
        scene, _, pressure, temperature = random_case(rng)
        v = 10.0 ** rng.uniform(-6, 2, 8)
        curve = solved(scene, v, pressure, temperature)
        assert curve[2].all()
        where = np.arange(8) == rng.integers(8)
        mixed = solved(scene, v, np.where(where, pressure, 2e5), np.where(where, temperature, 270.0))
        assert mixed[2].all()
        for whole, other in zip(curve, mixed, strict=True):
            np.testing.assert_allclose(other[where], whole[where], rtol=1e-9)


@pytest.mark.slow
def test_ten_thousand_random_scenes():
    rng = np.random.default_rng(11)
    for k in range(100):
        cases = [random_case(rng) for _ in range(100)]
        at_once = vmapped(*stacked(cases))
        assert at_once[2].all()
        for i in range(0, 100, 1 if k < 5 else 10):
            scene, *where = cases[i]
            others = [np.append(x, y) for x, y in zip(where, ([1e-3, 1.0], 3e5, 265.0), strict=True)]
            others = [np.resize(x, 3) for x in others]
            for together, one in zip(at_once, solved(scene, *others), strict=True):
                np.testing.assert_allclose(one[0], together[i], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("branch", "begin"), [("rising", 1e-8), ("falling", 1e8)])
def test_random_scenes_by_damped_brute_force(branch, begin):
    """Followed in small steps of v by damped iteration, which shares no code of the solver."""
    rng = np.random.default_rng(3)
    cases = [random_case(rng) for _ in range(50)]
    cases = [(scene.replace({"heating.branch": branch}), *at) for scene, *at in cases]
    scenes, v, pressure, temperature = stacked(cases)
    quadrature = rf.Quadrature()

    @jax.jit
    def caused(log_v, rises):
        def one(scene, log_v, pressure, temperature, rises):
            ready = prepare(scene, ("flash_temperature",), quadrature)
            points = jnp.exp(log_v)[None], pressure[None], temperature[None]
            thermal = ready.thermal
            return heat_balance(thermal, ready.roughness, thermal.diffusion, points)(rises[None])[0]

        return jax.vmap(one)(scenes, log_v, pressure, temperature, rises)

    @jax.jit
    def damped(log_v, rises, steps):
        return jax.lax.fori_loop(
            0, steps, lambda _, y: y + jnp.clip(0.1 * (caused(log_v, y) - y), -0.2, 0.2), rises
        )

    rises = jnp.zeros(
        (50, prepare(cases[0][0], ("flash_temperature",), quadrature).thermal.diffusion.wavevector.size)
    )
    for share in np.linspace(0, 1, 150):
        rises = damped(np.log(begin) + share * (jnp.log(v) - np.log(begin)), rises, 40)
    rises = damped(jnp.log(v), rises, 4000)
    error = np.abs(caused(jnp.log(v), rises) - rises).max(1)
    assert (error <= 1e-10 * rises.max(1)).all()
    found = vmapped(scenes, v, pressure, temperature)
    # T minus the background has the digits of T.
    np.testing.assert_allclose(found[1], rises[:, -1], rtol=1e-8, atol=3e-13)


# --- Failed convergence


def test_what_did_not_converge_is_named(monkeypatch, recwarn):
    """For concrete values, unless the caller requests `converged`."""
    values = rf.Solution(friction=jnp.ones(5), converged=jnp.array([True, False, False, False, False]))
    monkeypatch.setattr(model, "_solve", lambda *_, **__: values)
    scene, v = folded(), np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    with pytest.warns(
        RuntimeWarning,
        match=r"^the temperatures did not converge at 4 of 5 points, at v = 2 m/s, "
        r"p = 300000 Pa, T = 258 K; .*v = 4 .* and others: their values are the last",
    ):
        rf.friction(scene, v, PRESSURE, COLD)
    recwarn.clear()
    assert rf.solve(scene, v, PRESSURE, COLD, quantities=("friction", "converged")) is values

    def traced(converged):
        monkeypatch.setattr(model, "_solve", lambda *_, **__: values._replace(converged=converged))
        return rf.friction(scene, v, PRESSURE, COLD)

    jax.eval_shape(traced, values.converged)
    monkeypatch.setattr(model, "_solve", lambda *_, **__: values._replace(converged=jnp.ones(5, bool)))
    rf.friction(dataclasses.replace(scene), v, PRESSURE, COLD)
    assert not recwarn.list


@pytest.mark.slow
@pytest.mark.parametrize("name", ["profile", "dissipated_power", "contact_stiffness", "stress_distribution"])
def test_what_did_not_converge_is_named_by_the_analysis(name, monkeypatch, recwarn):
    """With the second of three points marked as not converged."""
    scene, v = folded(), np.array([1e-9, 0.1, 1e-9])
    further = {"profile": {"q": [1e3]}, "stress_distribution": {"stress": 3e5}}.get(name, {})
    small = rf.Quadrature(order=4, panels=2, graded=1, angular_order=4, heat=48)
    at = {"velocity": v, "pressure": PRESSURE, "temperature": COLD, "quadrature": small}
    monkeypatch.setattr(temperatures, "solve_rises", _second_is_left(temperatures.solve_rises))
    message = r"^the temperatures did not converge at 1 of 3 points, at v = 0.1 m/s"
    with pytest.warns(RuntimeWarning, match=message):
        getattr(rf.analysis, name)(scene, **further, **at)
    recwarn.clear()
    jax.eval_shape(lambda v: getattr(rf.analysis, name)(scene, **further, **(at | {"velocity": v})), v)
    assert not recwarn.list


def _second_is_left(solve):
    def left(*arguments):
        found = solve(*arguments)
        return found._replace(converged=found.converged & (np.arange(3) != 1))

    return left
