"""Several scenes fitted together: two compounds on one road, with one law of contact shear."""

import functools
import re
from dataclasses import replace

import numpy as np
import pytest
from support.counting.compilations import compilations
from support.scenes.fits import FAST, PLAIN, ROAD

import fitting
import rubberfric as rf
from fitting import Bounded, FrictionData, Gaussian, Positive, RmsSlope, Tied
from fitting.commands import main as command
from fitting.commands.job import read_job
from fitting.parameters.scenes import as_scenes
from fitting.solvers.problem import make_problem
from rubberfric.roughness import cutoff

SHEAR = rf.ContactShear(5e6, 0.1, 1e-3)
R20 = rf.Scene(ROAD, rf.Body(PLAIN), shear=SHEAR)
R40 = replace(R20, upper=rf.Body(rf.Prony(2e6, [3e7, 5e6], [1e-5, 1e-3])))
TRUTH = {"R20": R20, "R40": R40}
OFF = {name: replace(one, shear=rf.ContactShear(3e6, 0.2, 2e-3)) for name, one in TRUTH.items()}
V = {"R20": np.logspace(-4, 1, 6), "R40": np.logspace(-3, 1, 6)}
FREE = {
    "*.shear.tau_f0": Positive(),
    "*.shear.v0": Positive(),
    "R20.upper.material.E_inf": Positive(2e6),
    "R40.upper.material.E_inf": Positive(4e6),
    "R40.shear.c": Bounded(0.01, 1.0),
    "R20.shear.c": Tied("R40.shear.c", 1.0),
}
VALUES = [5e6, 1e-3, 3e6, 2e6, 0.1]


@functools.cache
def curves():
    return {name: np.asarray(rf.friction(TRUTH[name], V[name], 3e5, quadrature=FAST)) for name in TRUTH}


def data(factor=1.0):
    """Friction without noise; of R40 the last value times a factor."""
    mu = {name: values.copy() for name, values in curves().items()}
    mu["R40"][-1] *= factor
    return {name: FrictionData(V[name], mu[name], pressure=3e5, relative=0.03) for name in TRUTH}


@pytest.fixture(scope="module")
def result():
    return fitting.fit(OFF, data(), FREE, quadrature=FAST)


def test_shared_and_own_numbers_are_found_again(result):
    assert result.success and result.names == tuple(FREE)[:-1]
    np.testing.assert_allclose(result.values, VALUES, rtol=1e-6)
    fitted = result.scene
    for name in TRUTH:
        assert float(fitted[name].shear.tau_f0) == result["*.shear.tau_f0"].value
        assert float(fitted[name].shear.c) == result["R40.shear.c"].value
        again = rf.friction(fitted[name], V[name], 3e5, quadrature=FAST)
        np.testing.assert_allclose(again, data()[name].friction, rtol=1e-7)
        assert result[f"{name}.shear.v0"] == result["*.shear.v0"]
    assert fitted["R20"].upper.material.E_inf != fitted["R40"].upper.material.E_inf


@pytest.mark.slow
def test_report_file_and_predictions(result, tmp_path):
    text = result.report()
    for line in ("R20: explains the data", "1: R20: friction, 6 points", "R20.shear.c: 0.1, 1 times R40"):
        assert line in text
    page = result._repr_html_()
    assert "scene R20" in page and "scene R40" in page
    axes = result.plot()
    legend = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert legend[:2] == ["R20, 0.3 MPa", "R40, 0.3 MPa"]
    result.save(tmp_path / "joint.h5")
    again = fitting.FitResult.load(tmp_path / "joint.h5")
    assert again.report() == result.report()
    assert again.data_scenes == ("R20", "R40") and set(again.scene) == {"R20", "R40"}
    band = result.band(V["R40"], 3e5, scene="R40")
    np.testing.assert_allclose(band.value, result.predict(V["R40"], 3e5, scene="R40"), rtol=1e-9)
    with pytest.raises(ValueError, match="scene = None: must be one of R20, R40"):
        result.predict(1e-3, 3e5)
    with pytest.raises(KeyError, match=r"did you mean '\*.shear.tau_f0'"):
        result["R20.shear.tau_f1"]


@pytest.mark.slow
def test_the_verdict_says_which_scene_does_not_explain_its_data(result):
    """And another fit of the same kind, and a profile, compile nothing."""
    better = {name: one.replaced(one.friction * 1.01) for name, one in data().items()}
    with compilations() as compiled:
        bad = fitting.fit(OFF, data(factor=1.5), FREE, quadrature=FAST)
        assert compiled
        compiled.clear()
        assert fitting.fit(OFF, better, FREE, quadrature=FAST).success
        profile = result.profile("*.shear.v0", points=2)
    assert bad.verdict.explains is False and bad.verdicts["R40"].explains is False
    assert any("data 'R40: friction" in reason for reason in bad.verdict.reasons)
    assert profile.low < 1e-3 < profile.high
    assert not [name for name in compiled if "residuals" in name]


@pytest.mark.slow
def test_priors_know_shared_numbers():
    prior = {"*.shear.v0": Gaussian(2e-3, 2e-5)}
    pulled = fitting.fit(OFF, data(), FREE, prior=prior, quadrature=FAST)
    assert pulled["*.shear.v0"].value == pytest.approx(2e-3, rel=0.05)


def test_members_of_ensembles_have_the_problem(result):
    members = fitting.multi_start(OFF, data(), FREE, 3, quadrature=FAST)
    assert members.names == result.names and len(members) == 3


@pytest.mark.slow
def test_a_cutoff_by_rms_slope_in_every_scene():
    smoother = replace(ROAD, spectrum=ROAD.spectrum.replace(h_rms=4e-4))
    scenes = as_scenes({"R20": R20, "R40": replace(R40, lower=smoother)})
    free = {"*.gamma": Positive(), "*.lower.spectrum.q1": RmsSlope(1.0)}
    problem = make_problem(scenes, list(data().values()), free, of=["R20", "R40"])
    found = problem.scene(problem.start)
    for name, one in found.items():
        expected = cutoff(scenes[name].lower.spectrum, 1.0, keep="h_rms")
        assert float(one.lower.spectrum.q1) == pytest.approx(float(expected), rel=1e-9)
    assert problem.names == ("*.gamma",)


WRONG = {
    "a dict of name -> data": (OFF, lambda d: d["R20"], {"*.gamma": Positive()}),
    "scene 'R40' has no data": (OFF, lambda d: {"R20": d["R20"]}, {"*.gamma": Positive()}),
    "scene 'R20': data is empty": (OFF, lambda d: d | {"R20": []}, {"*.gamma": Positive()}),
    "which no scene has: did you mean 'R40'": (OFF, lambda d: d | {"R4": d["R40"]}, {"*.gamma": Positive()}),
    "'gamma': must begin with the name of a scene, R20, R40": (OFF, dict, {"gamma": Positive()}),
    "did you mean 'R20.gamma'": (OFF, dict, {"*.gama": Positive()}),
    "at 0.1 in R20, at 0.2 in R40; a shared parameter needs one start value: give start=": (
        OFF | {"R20": R20},
        dict,
        {"*.shear.c": Positive()},
    ),
    "already free as '*.gamma'": (OFF, dict, {"*.gamma": Positive(), "R20.gamma": Positive()}),
    "'R40.shear.c': the scene has no shear": (
        OFF | {"R40": replace(R40, shear=None)},
        dict,
        {"*.shear.c": Positive()},
    ),
    "has 2 elements, R40.upper.material.E has 1; shared parameters must have equal elements": (
        OFF | {"R40": replace(R40, upper=rf.Body(rf.Prony(2e6, [5e7], [1e-5])))},
        dict,
        {"*.upper.material.E": Positive(1e7)},
    ),
    "name 'R 20': must be a letter": ({"R 20": R20}, dict, {"*.gamma": Positive()}),
    "scene['R20'] is a Body: must be a Scene": ({"R20": ROAD}, dict, {"*.gamma": Positive()}),
    "must be a key path like": (R20, lambda d: d["R20"], {"*.gamma": Positive()}),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_wrong_is_named(message):
    scenes, given, free = WRONG[message]
    with pytest.raises(ValueError, match=re.escape(message)):
        fitting.fit(scenes, given(data()), free)


JOB = """
title = "Two compounds"
[scenes.R20]
file = "R20.h5"
[[scenes.R20.data]]
file = "R20.csv"
[scenes.R40]
file = "R40.h5"
[[scenes.R40.data]]
file = "R40.csv"
[free]
"*.shear.tau_f0" = { rule = "positive", start = 3e6 }
"R40.gamma" = "positive"
"""


def test_a_job_of_several_scenes(call_main, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, one in data().items():
        fitting.write(f"{name}.csv", one)
        rf.save_scene(f"{name}.h5", OFF[name])
    (tmp_path / "job.toml").write_text(JOB)
    read = read_job("job.toml")
    assert set(read.scene) == set(read.data) == {"R20", "R40"}
    np.testing.assert_allclose(read.data["R40"][0].friction, data()["R40"].friction, rtol=1e-9)
    assert set(read.free) == {"*.shear.tau_f0", "R40.gamma"}
    for old, new, message in (
        ('file = "R40.h5"', 'file = "R41.h5"', "scenes.R40.file: R41.h5: "),
        ("[[scenes.R40.data]]", "[[scenes.R40.sets]]", "scenes.R40.sets: unknown key"),
        ("[scenes.R20]\n", 'scene = "R20.h5"\n[scenes.R20]\n', "scene: unknown key; did you mean 'scenes'?"),
        ('"R40.gamma"', '"gamma"', "'gamma': must begin with the name of a scene, R20, R40"),
    ):
        (tmp_path / "job.toml").write_text(JOB.replace(old, new))
        status, printed, complaint = call_main(command.main, "job.toml")
        assert (status, printed) == (2, "") and message in complaint
