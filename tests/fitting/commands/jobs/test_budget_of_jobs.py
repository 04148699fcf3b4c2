"""The option --budget of rubberfric-fit, and the table [budget] of a job."""

import numpy as np
import pytest
from support.scenes.fits import friction_data

import fitting
import rubberfric as rf

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


@pytest.fixture
def job(job):
    """A fit of friction, with a table [budget]."""
    job.write_text(JOB)
    data = friction_data(rf.load_scene("scene.toml"), np.geomspace(1e-4, 1, 8), seed=2)
    fitting.write("friction.csv", data)
    return job


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
        ("", "", ("--budget", "budget.txt"), "must be .png or .pdf or .svg"),
        ("", "", ("--budget", "a.png", "--plot", "a.png"), "is the file of --plot"),
    ],
)
def test_refusals(job, call, old, new, options, text):
    job.write_text(JOB.replace(old, new))
    status, out, err = call("job.toml", *options)
    assert status == 2 and out == "" and text in err
