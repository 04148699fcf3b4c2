"""The option --budget of rubberfric-fit, and the table [budget] of a job."""

import functools

import numpy as np
import pytest

import fitting
import rubberfric as rf
from fitting.commands.main import main

JOB = """
scene = "scene.toml"
[[data]]
file = "friction.csv"
[free]
"upper.material.E_inf" = "positive"
"lower.spectrum.h_rms" = "positive"
[prior]
gamma = { mean = 0.5, sigma = 0.05 }
[budget]
pressure = 0.01
"""
SCENE = """
[lower]
material = { kind = "rigid" }
spectrum = { kind = "self_affine", q0 = 100, qr = 1000, q1 = 1e4, hurst = 0.8, h_rms = 1e-4 }
[upper]
material = { kind = "prony", E_inf = 1e6, E = [1e8, 1e7], tau = [1e-6, 1e-4] }
"""


@pytest.fixture
def call(call_main):
    return functools.partial(call_main, main)


@pytest.fixture
def job(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "job.toml").write_text(JOB)
    v, scene = np.geomspace(1e-4, 1, 8), rf.load_scene("scene.toml")
    mu = np.asarray(rf.friction(scene, v, 1e5)) * np.exp(0.02 * np.random.default_rng(2).standard_normal(8))
    fitting.write("friction.csv", fitting.FrictionData(v, mu, pressure=1e5, relative=0.02))
    return tmp_path / "job.toml"


def test_budget_of_a_job(job, call):
    status, out, err = call("job.toml", "--budget", "budget.png", "--out", "fit.h5")
    assert status == 0 and err == ""
    table = out[out.index("[[Budget]]") :]
    assert (
        "pressure: all pressures x 1.01\n" in table and "velocity: all velocities x 1.02 (default)" in table
    )
    assert "gamma: gamma + 0.05" in table
    assert (job.parent / "budget.png").read_bytes().startswith(b"\x89PNG")
    found = fitting.Budget.load("fit.h5")
    assert "or add a table [discrepancy] to the job" in table
    assert table.split("largest")[0] == found.report().split("largest")[0] and found.sizes.pressure == 0.01
    assert "[[Budget]]" not in call("job.toml")[1]


@pytest.mark.parametrize(
    ("old", "new", "options", "text"),
    [
        ("pressure = 0.01", "pressure = -1", (), "job.toml: budget.pressure = -1: must be a finite number"),
        ("pressure = 0.01", "presure = 1", (), "budget.presure: unknown key; did you mean 'pressure'?"),
        ("sigma = 0.05", "sigma = 0.05", ("--budget", "budget.txt"), "must be .png or .pdf or .svg"),
        ("sigma = 0.05", "sigma = 0.05", ("--budget", "a.png", "--plot", "a.png"), "is the file of --plot"),
        ("mean = 0.5", "mean = 0.4", (), "but the number is fixed at 0.5"),
    ],
)
def test_refusals(job, call, old, new, options, text):
    job.write_text(JOB.replace(old, new))
    status, out, err = call("job.toml", *options)
    assert status == 2 and out == "" and text in err
