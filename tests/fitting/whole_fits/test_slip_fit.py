"""Fits to forces and moments of a patch: predictions, derivatives, twins, reports and the budget."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD, SHEAR, SHIFTED_TREAD

import fitting
import rubberfric as rf
from fitting import MomentData, Positive, SlipData
from fitting.budget.contact_model import rows_by_law
from fitting.results.plot import plot_fit
from fitting.solvers.evaluation import model_rows
from fitting.solvers.problem import make_problem
from fitting.solvers.residuals import forward, rows_and_slopes, rows_of

TABLE = rf.TabulatedModulus([1e-2, 1e3, 1e8], [3e6, 1e7, 4e8], [1e5, 4e6, 1e8], 0.5, SHIFTED_TREAD.shift)
PATCH = rf.Patch(0.12, 0.15, 2e7)
TRUTH = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(SHIFTED_TREAD), shear=SHEAR, patch=PATCH)
ANGLE = np.radians(np.linspace(0.5, 15.0, 12))
AT = {"speed": 10.0, "load": 3e3, "temperature": 300.0}
FREE = {"patch.stiffness": Positive(), "shear.tau_f0": Positive(), "upper.material.E[1]": Positive()}


def force(scene=TRUTH, slip=ANGLE, kind="angle", **at):
    speed, load, temperature = (AT | at).values()
    return np.asarray(rf.grip(scene, scene.patch, slip, speed, load, temperature, kind).force)


def moment(scene=TRUTH, slip=ANGLE):
    return np.asarray(rf.grip(scene, scene.patch, slip, *AT.values()).moment)


def all_kinds(scene=TRUTH):
    braked = -np.array([0.02, 0.05, 0.2])
    return [
        SlipData(angle=ANGLE, force=force(scene), **AT, relative=0.03),
        SlipData(ratio=braked, force=force(scene, braked, "ratio"), **AT, sigma=30.0),
        MomentData(angle=ANGLE[:8], moment=moment(scene, ANGLE[:8]), **AT, relative=0.03),
    ]


def test_rows_are_the_grip_at_angles_and_ratios():
    data = all_kinds()
    problem = make_problem(TRUTH, data, FREE)
    rows = model_rows(problem, problem.start)
    angles, ratios, moments = (rows[where] for where in problem.order)
    np.testing.assert_allclose(angles, np.log(data[0].force), rtol=1e-8)
    np.testing.assert_allclose(ratios, data[1].force, rtol=1e-8)
    np.testing.assert_allclose(np.exp(moments), data[2].moment, rtol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("scene", [TRUTH, TRUTH.replace("upper.material", TABLE)], ids=["series", "table"])
def test_derivatives(scene):
    """By parameters of scene and patch, whose size moves the pressures, against differences."""
    free = {"patch.stiffness": Positive(), "patch.length": Positive(), "shear.tau_f0": Positive()}
    free["lower.spectrum.hurst"] = fitting.Bounded(0.3, 1.0)
    problem = make_problem(scene, all_kinds(scene), free)
    structure, numbers, x = problem.structure, problem.numbers, jnp.asarray(problem.start)
    values, slopes = jax.jit(lambda x: rows_and_slopes(structure, numbers, x))(x)
    rows = jax.jit(lambda x: rows_of(structure, numbers, x))
    np.testing.assert_allclose(values, rows(x), rtol=1e-12)
    np.testing.assert_allclose(slopes, forward(rows, x)[1], rtol=1e-9, atol=1e-9 * np.abs(slopes).max())
    step = 1e-4
    for k, unit in enumerate(np.eye(4)):
        around = [rows(x + s * step * unit) for s in (-2, -1, 1, 2)]
        difference = (around[0] - 8 * around[1] + 8 * around[2] - around[3]) / (12 * step)
        scale = np.abs(difference).max()
        np.testing.assert_allclose(slopes[:, k], difference, rtol=1e-6, atol=1e-7 * scale)


@pytest.mark.slow
def test_the_truth_is_found():
    start = TRUTH.replace({"patch.stiffness": 4e7, "patch.length": 0.09, "shear.tau_f0": 3e6})
    free = {"patch.length": Positive(), **FREE}
    result = fitting.fit(start, all_kinds(), free, quadrature=rf.Quadrature())
    np.testing.assert_allclose(result.values, [0.12, 2e7, 6.5e6, float(SHIFTED_TREAD.E[1])], rtol=1e-4)
    assert len(plot_fit(result)) == 4
    np.testing.assert_allclose(
        rows_by_law(result.problem, result.x).rows[:3],
        np.log(force(TRUTH.replace(contact_model="boundary_elements"))[:3]),
        rtol=1e-6,
    )


@pytest.mark.slow
def test_stiffness_and_length_trade():
    """At small slip only k L^2 counts, and the report says so."""
    data = SlipData(angle=ANGLE[:3] / 4, force=force(slip=ANGLE[:3] / 4), **AT, relative=0.03)
    free = {"patch.stiffness": Positive(), "patch.length": Positive()}
    result = fitting.fit(TRUTH, data, free, further_time=0.0)
    assert len(result.unidentified) == 1
    assert "patch.stiffness * λ, patch.length * λ^-0.5" in result.report()


@pytest.mark.slow
def test_budget():
    """The shifts by speed, load and temperature of the data are those of fits to changed data."""
    free = {name: FREE[name] for name in ("patch.stiffness", "shear.tau_f0")}
    data = SlipData(angle=ANGLE, force=force(), **AT, relative=0.03)
    result = fitting.fit(TRUTH, data, free)
    budget = result.budget(temperature=1.0, velocity=0.02, pressure=0.05)
    changes = {"temperature": {"temperature": 301.0}, "velocity": {"speed": 10.2}, "pressure": {"load": 3150}}
    for source, change in changes.items():
        moved = SlipData(angle=ANGLE, force=force(), **(AT | change), relative=0.03)
        shift = np.abs(np.asarray(fitting.fit(TRUTH, moved, free).values) - result.values)
        assert np.all(np.abs(np.abs(budget[source].shift) - shift) < 0.1 * shift + 0.05 * result.stderr)
    assert "contact model" in budget.sources


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (TRUTH.replace(patch=None), "the scene has no patch; add the table [patch] to its file,"),
        (TRUTH.replace({"upper.material": rf.Elastic(1e7, 0.5)}, shear=None), "the scene has no friction"),
    ],
)
def test_scenes_that_cannot_predict(scene, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        fitting.fit(scene, SlipData(angle=ANGLE, force=force(), **AT), {"gamma": fitting.Bounded(0.0, 1.0)})


@pytest.mark.slow
def test_coverage():
    """Bars of 95 % hold the truth of twins with noise of 3 %."""
    at = [(speed, T) for speed in (1.0, 5.0, 20.0) for T in (280.0, 320.0)]
    exact = [force(speed=speed, temperature=T) for speed, T in at]
    free = FREE | {"upper.material.E[2]": Positive()}
    truth, rng, inside = np.array([2e7, 6.5e6, *SHIFTED_TREAD.E[1:]]), np.random.default_rng(5), []
    for _ in range(20):
        data = [
            SlipData(
                angle=ANGLE,
                force=curve * np.exp(0.03 * rng.normal(size=ANGLE.size)),
                **{"speed": speed, "load": 3e3, "temperature": T, "relative": 0.03},
            )
            for (speed, T), curve in zip(at, exact, strict=True)
        ]
        low, high = fitting.fit(TRUTH, data, free).interval()
        inside.append([(low < truth) & (truth < high), np.isfinite(low)])
    held, bars = np.array(inside).sum(0)
    print("held", held, "of", bars)
    assert 0.9 <= held.sum() / bars.sum() <= 0.99
