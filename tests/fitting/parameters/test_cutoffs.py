"""Cut-offs of measured spectra in fits: free, and following an rms slope."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.scenes.fits import FAST, JOB, Q1, SHIFTED, E, friction_data, write_job
from support.scenes.fits import WARM as AFFINE

import fitting
import rubberfric as rf
from fitting import Bounded, Positive, RmsSlope
from fitting.commands.job import read_job
from fitting.parameters.constraints import last_wavevector
from fitting.parameters.variables import element_names, free_parameters, to_scene
from fitting.solvers.problem import make_problem

Q = np.geomspace(1e2, 1e6, 15)
TABLE = rf.TabulatedSpectrum(Q, 1e-14 * np.minimum(1, (Q / 1e3) ** -3.6))
SCENE = rf.Scene(rf.Body(rf.Rigid(), TABLE), rf.Body(SHIFTED))
C = "lower.spectrum.C"
CUT = SCENE.replace(Q1, 1e5)
V = np.logspace(-4, 0, 7)  # [m/s]


def friction_of(scene):
    return friction_data(scene, V, 2e5, error=0.0, temperature=293.15, relative=0.01)


def test_the_largest_cutoff_of_a_profile_is_the_end_of_the_table():
    assert last_wavevector(CUT, Q1) == 1e6
    assert last_wavevector(SCENE.replace("lower.spectrum", AFFINE.lower.spectrum), Q1) == np.inf


@pytest.mark.slow
def test_a_free_cutoff_is_found_again():
    """From twice the true one, together with a modulus."""
    truth = CUT.replace(Q1, 1.234e5)
    start = CUT.replace({Q1: 2.5e5, E + "[0]": 4e7})
    free = {Q1: Bounded(1e3, 1e6), E + "[0]": Positive()}
    result = fitting.fit(start, friction_of(truth), free, quadrature=FAST)
    assert result.success and result.names == (Q1, E + "[0]")
    np.testing.assert_allclose(result.values, [1.234e5, 5e7], rtol=1e-6)
    assert result.scene.lower.spectrum.q1 == pytest.approx(1.234e5, rel=1e-6)
    assert f"{Q1}:" in result.report()
    values = np.array([0.8e5, 1.1e5, 1.4e5, 2e5])
    profile = result.profile_cutoff(values=values)
    np.testing.assert_allclose(profile.values, np.sort([*values, 1.234e5]), rtol=1e-6)
    assert profile.names == result.names and 1.1e5 < profile.low < 1.234e5 < profile.high < 2e5
    # The cost at a value equals the cost of a scene whose other parameters were fitted again.
    modulus, rise = profile.parameters[0, 1], profile.rise[0]
    there = friction_of(CUT.replace({Q1: 0.8e5, E + "[0]": modulus})).friction
    off = np.log(there / friction_of(truth).friction) / 0.01
    assert rise == pytest.approx(np.sum(off**2), rel=1e-4)
    upper, lower = rf.plot.auto(profile)
    assert repr(profile).startswith("LikelihoodProfile(lower.spectrum.q1: ") and len(repr(profile)) < 90
    assert upper.get_ylabel() == "rise of chi-square [-]" and lower.get_xlabel() == Q1
    with pytest.raises(ValueError, match=r"must be the q1 of a spectrum: lower\.spectrum\.q1"):
        result.profile_cutoff("lower.spectrum.C")


@pytest.mark.parametrize(
    ("scene", "free"),
    [
        (CUT, {C + "[3:6]": Positive()}),
        pytest.param(
            AFFINE,
            {"lower.spectrum.hurst": Positive(), "lower.spectrum.h_rms": Positive()},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["table", "self-affine"],
)
def test_a_cutoff_that_follows_a_slope(scene, free):
    """The scene has the slope wherever the other numbers are; derivatives in both modes."""
    variables, constants, x = free_parameters(scene, {Q1: RmsSlope(0.4), **free})
    assert element_names(variables) == element_names(free_parameters(scene, free)[0])

    def spectrum(x):
        return to_scene(variables, constants, x).lower.spectrum

    @jax.jit
    def results(x):
        def cut(x):
            return jnp.log(spectrum(x).q1)

        def slope(x):
            return rf.rms_slope(spectrum(x))

        return cut(x), slope(x), jax.jacfwd(cut)(x), jax.jacrev(cut)(x), jax.grad(slope)(x)

    for move in (0.0, 0.1):
        here = x + move
        _, slope, forward, reverse, none = results(here)
        assert slope == pytest.approx(0.4, rel=1e-12)
        np.testing.assert_allclose(none, 0.0, atol=1e-12)
        np.testing.assert_allclose(forward, reverse, rtol=1e-10)
        h = 1e-4
        for i, step in enumerate(h * np.eye(x.size)):
            five = [results(here + k * step)[0] for k in (-2, -1, 1, 2)]
            assert forward[i] == pytest.approx(np.dot([1, -8, 8, -1], five) / (12 * h), rel=1e-8, abs=1e-10)
    names = element_names(free_parameters(scene, free)[0])
    start = [float(getattr(scene.lower.spectrum, n.split(".")[-1], 0.0)) for n in names if "[" not in n]
    found = [float(getattr(spectrum(x), n.split(".")[-1], 0.0)) for n in names if "[" not in n]
    np.testing.assert_allclose(found, start, rtol=1e-14)  # the height stays


@pytest.mark.slow
def test_a_fit_with_a_slope(tmp_path):
    """Moduli found with the cut-off where the slope is, and said so in the report."""
    truth = rf.Scene(rf.Body(rf.Rigid(), rf.with_cutoff(TABLE, 0.5)), rf.Body(SHIFTED))
    free = {E: Positive(start=[8e7, 5e6]), Q1: RmsSlope(0.5)}
    result = fitting.fit(SCENE, friction_of(truth), free, quadrature=FAST)
    np.testing.assert_allclose(result.values, SHIFTED.E, rtol=1e-6)
    q1 = truth.lower.spectrum.q1
    assert result.scene.lower.spectrum.q1 == pytest.approx(float(q1), rel=1e-12)
    assert f"{Q1}: {float(q1):.6g} 1/m, where the rms slope is 0.5" in result.report()
    result.save(tmp_path / "fit.h5")
    loaded = fitting.FitResult.load(tmp_path / "fit.h5")
    assert loaded.free == free and loaded.report() == result.report()


def test_a_rule_gives_what_the_scene_leaves_out():
    """The q1 of a table without one: by start, or by the slope; else the table's end."""
    data = friction_of(CUT)
    problem = make_problem(SCENE, [data], {Q1: Bounded(1e4, 1e6, start=1e5)})
    assert problem.scene(problem.start).lower.spectrum.q1 == pytest.approx(1e5, rel=1e-14)
    problem = make_problem(SCENE, [data], {Q1: Positive()})
    end = float(SCENE.lower.spectrum.q[-1])
    assert problem.scene(problem.start).lower.spectrum.q1 == pytest.approx(end, rel=1e-14)
    with pytest.raises(ValueError, match=r"starts at 1e\+06: must start inside the bounds .* give start="):
        make_problem(SCENE, [data], {Q1: Bounded(1e4, end)})
    with pytest.raises(ValueError, match=r"q1 = 20000000\.0: must lie within the table, 100\.0 \.\.\. "):
        make_problem(SCENE, [data], {Q1: Bounded(1e4, 1e8, start=2e7)})
    with pytest.raises(ValueError, match=rf"free\['{Q1}'\]: rms_slope = 99\.0: must be at most"):
        make_problem(SCENE, [data], {E: Positive(), Q1: RmsSlope(99.0)})


def test_in_a_job(tmp_path):
    path = write_job(tmp_path)
    path.write_text(
        JOB.replace("[prior]", '"lower.spectrum.q1" = { rule = "rms_slope", slope = 1.1 }\n[prior]')
    )
    assert read_job(path).free[Q1] == RmsSlope(1.1)
