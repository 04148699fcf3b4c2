"""The command rubberfric-fit and its job files: input, output, files, and exit status."""

import os
import sys

import jax
import numpy as np
import pytest
from support.scenes.fits import JOB, JOB_FILES

import fitting
import rubberfric as rf
from fitting.commands import work
from fitting.commands.job import read_job


def test_report_file_and_picture(call, job, tmp_path):
    status, printed, complaint = call(job, "--out", "fit.h5", "--plot", "fit.png")
    assert (status, complaint) == (0, "")
    assert sorted(os.listdir()) == sorted([*JOB_FILES, "fit.h5", "fit.png"])
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG\r\n")
    result = fitting.FitResult.load("fit.h5")
    assert printed == "Small fit\n" + result.report()
    assert result.success
    assert result.names == (
        *("upper.material.E[0]", "upper.material.E[1]", "upper.material.tau[1]", "upper.material.E_inf"),
    )
    np.testing.assert_allclose(result.values, [1e8, 1e7, 1e-4, 1e6], rtol=0.1)
    np.testing.assert_allclose(result.start_values, [5e7, 2e7, 1e-4, 1e6])
    assert sum(minimum.count for minimum in result.minima) == 2

    # the same in Python
    read = read_job(job)
    again = fitting.fit(read.scene, read.data, read.free, prior=read.prior, **read.options)
    np.testing.assert_array_equal(again.values, result.values)


def test_everything_a_job_can_say(job):
    job.write_text("""
    scene = "scene.h5"
    [[data]]
    file = "friction.csv"
    pressure = 2e5
    relative = 0.05
    name = "Läufer 2"
    [[data]]
    file = "friction.h5"
    [[data]]
    file = "modulus.csv"
    body = "upper"
    [free]
    "upper.material.E" = "positive"
    "upper.material.E_inf" = { rule = "tied", to = "lower.spectrum.h_rms", ratio = 1e10 }
    "lower.spectrum.h_rms" = { rule = "positive", start = 2e-4 }
    "lower.spectrum.hurst" = { rule = "bounded", low = 0.3, high = 1, start = 0.75 }
    gamma = { rule = "free", start = 0.4, scale = 0.1 }
    [prior]
    "lower.spectrum.hurst" = { mean = 0.8, sigma = 0.05 }
    "upper.material.E" = { smooth = 2 }
    [fit]
    method = "lbfgs"
    starts = 4
    seed = 7
    loss = "huber"
    loss_width = 2
    decades = 0.5
    max_steps = 10
    tolerance = 1e-6
    """)
    rf.save_scene("scene.h5", rf.load_scene("scene.toml"))
    read = read_job(job)
    assert isinstance(read.scene, rf.Scene)
    friction, stored, modulus = read.data
    assert friction.pressure.tolist() == [2e5, 2e5]
    assert friction.relative.tolist() == [0.05, 0.05]
    assert [friction.name, stored.name, modulus.body] == ["Läufer 2", "own", "upper"]
    assert read.free == {
        "upper.material.E": fitting.Positive(),
        "upper.material.E_inf": fitting.Tied("lower.spectrum.h_rms", 1e10),
        "lower.spectrum.h_rms": fitting.Positive(2e-4),
        "lower.spectrum.hurst": fitting.Bounded(0.3, 1.0, 0.75),
        "gamma": fitting.Free(0.4, 0.1),
    }
    assert read.prior == {
        "lower.spectrum.hurst": fitting.Gaussian(0.8, 0.05),
        "upper.material.E": fitting.Smooth(2.0),
    }
    key = read.options.pop("key")
    assert jax.random.key_data(key).tolist() == jax.random.key_data(jax.random.key(7)).tolist()
    assert read.options == {
        **{"method": "lbfgs", "starts": 4, "loss": "huber", "loss_width": 2.0, "decades": 0.5},
        **{"max_steps": 10, "tolerance": 1e-6},
    }
    assert read.title == ""


E_LINE = '"upper.material.E" = { rule = "positive", start = [5e7, 2e7] }'
PRIOR = '"upper.material.E_inf" = { mean = 1e6, sigma = 1e5 }'


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[free]", "[free", "is not TOML"),
        ("[free]", "[fre]", "fre: unknown key; did you mean 'free'? must be one of title, scene, data"),
        ('scene = "scene.toml"', "", "scene: is missing; must be given"),
        ("modulus.csv", "modulus.ods", "save a sheet as .csv"),
        ('scene = "scene.toml"', "scene = 3", "scene = 3: must be one line of text"),
        ("scene.toml", "no.toml", "scene: no.toml: cannot be read: No such file"),
        ("scene.toml", "scene.yaml", "suffix '.yaml': must be .toml or .h5"),
        ("Small fit", "Small\\nfit", "title = 'Small\\nfit': must be one line of text"),
        ("[[data]]", "[data]", "data = {'file': 'modulus.csv', 'body': 'upper', 'relative': 0.03}: must be"),
        ('file = "modulus.csv"', "", "data[0].file: is missing; must be given"),
        ('body = "upper"', 'bdy = "upper"', "data[0].bdy: unknown key; did you mean 'body'?"),
        ('body = "upper"', 'body = "up"', "data[0].file: modulus.csv: ModulusData.body = 'up': must be 'low"),
        ("modulus.csv", "no.csv", "data[0].file: no.csv: cannot be read: No such file"),
        ("modulus.csv", "friction.h5", "body = 'upper': must not be given; friction data have none"),
        ("relative = 0.03", "relative = -0.03", "ModulusData.relative = -0.03: must be > 0"),
        ("relative = 0.03", "relative = [1, 2]", "data[0].relative = [1, 2]: must be one number"),
        ("relative = 0.03", "pressure = 1e5", "pressure = 100000.0: must not be given; modulus data have"),
        (JOB[JOB.index("[free]") :], "[free]", "free: is empty; must contain the key paths of free"),
        (E_LINE, 'upper.material.E = "positive"', "free.upper.material.E: put the key path in quotes:"),
        (f"[free]\n{E_LINE}", '[free.lower.spectrum]\nq1 = "free"\n[free]', '"lower.spectrum.q1" = ...'),
        (
            '"upper.material.tau[1]" = "positive"',
            "gamma = { rul = 1 }",
            "free.'gamma'.rul: unknown key; did you mean 'r",
        ),
        ("upper.material.tau[1]", "upper.material.tua", "'upper.material.tua': unknown key path; did you"),
        ("upper.material.tau[1]", "upper.material.tau[2]", "has the elements [0] ... [1]; must name one of"),
        ('tau[1]" = "positive"', 'tau[1]" = "postive"', "rule = 'postive': did you mean 'positive'? must"),
        ('tau[1]" = "positive"', 'tau[1]" = "bounded"', "free.'upper.material.tau[1]'.low: is missing"),
        ('tau[1]" = "positive"', 'tau[1]" = 3', 'tau[1]\' = 3: must be "positive" or a table with the key'),
        (E_LINE, '"upper.material.E" = {}', "free.'upper.material.E'.rule: is missing; must be given"),
        ("[5e7, 2e7]", "-1", "free['upper.material.E']: starts at -1: must start at a value > 0, because"),
        ("low = 1e5", "low = 1e8", "free.'upper.material.E_inf': Bounded(100000000.0, 10000000.0): must be"),
        (
            PRIOR,
            '"gamma" = { mean = 1, sigma = 1 }',
            "prior['gamma']: mean = 1, but the number is fixed at 0.5: must be this number",
        ),
        ("sigma = 1e5", "sgma = 1e5", "prior.'upper.material.E_inf'.sgma: unknown key; did you mean"),
        ("sigma = 1e5", "sigma = 0", "prior.'upper.material.E_inf': Gaussian: sigma = 0.0: must be"),
        (PRIOR, '"upper.material.E" = 3', "prior.'upper.material.E' = 3: must be a table"),
        ("starts = 2", "starts = 0", "fit.starts = 0: must be an integer, 1 to 10000"),
    ],
)
def test_bad_jobs(call, job, monkeypatch, old, new, message):
    assert JOB.count(old) >= 1
    job.write_text(JOB.replace(old, new, 1))
    monkeypatch.setattr(sys.modules["fitting.stages"], "run_fits", None)  # nothing may be computed
    status, printed, complaint = call("job.toml", "--out", "fit.h5", "--plot", "fit.png")
    assert (status, printed, complaint.count("\n")) == (2, "", 1)
    assert message in complaint
    assert complaint.startswith("rubberfric-fit: job.toml: ")
    assert sorted(os.listdir()) == JOB_FILES


@pytest.mark.usefixtures("job")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "JOB"),
        (("no.toml",), "no.toml: cannot be read: No such file"),
        (("job.json",), "job.json: suffix '.json': must be .toml"),
        (("job.toml", "--fast"), "unrecognized arguments: --fast"),
        (("job.toml", "--out", "fit.csv"), "fit.csv: suffix '.csv': must be .h5"),
        (("job.toml", "--out", "no/fit.h5"), "folder 'no' does not exist; create it first"),
        (("job.toml", "--plot", "fit.gif"), "must be .png or .pdf or .svg"),
        (("job.toml", "--bootstrap", "0"), "'0': must be an integer >= 1"),
        (("job.toml", "--checkpoint", "run.h5"), "must come with --bootstrap N"),
        (("job.toml", "--resume", "--bootstrap", "3"), "must come with --checkpoint FILE.h5"),
        (("job.toml", "--bootstrap", "3", "--checkpoint", "run.txt"), "suffix '.txt': must be .h5"),
    ],
)
def test_bad_arguments(call, monkeypatch, arguments, message):
    monkeypatch.setattr(work, "fit", None)  # nothing may be computed
    status, printed, complaint = call(*arguments)
    assert (status, printed, complaint.count("\n")) == (2, "", 1)
    assert message in complaint
    assert complaint.startswith("rubberfric-fit: ")
    assert sorted(os.listdir()) == JOB_FILES


def test_a_fit_that_does_not_converge_is_written_and_reported_all_the_same(call, job):
    job.write_text(JOB + "max_steps = 1\n")
    status, printed, complaint = call(job, "--out", "fit.h5")
    assert (status, complaint) == (1, "rubberfric-fit: not converged: out of steps; raise max_steps\n")
    assert printed.startswith("Small fit\nTHE FIT DID NOT SUCCEED: not converged: out of steps")
    assert not fitting.FitResult.load("fit.h5").success


def test_a_scene_that_does_not_explain_the_data_has_a_status_of_its_own(call, job):
    job.write_text(JOB.replace("relative = 0.03", "relative = 0.003"))
    status, printed, complaint = call(job, "--out", "fit.h5")
    message = "rubberfric-fit: the scene does not explain the data: see the verdict above\n"
    assert (status, complaint) == (3, message)
    assert printed.startswith("Small fit\nTHE SCENE DOES NOT EXPLAIN THE DATA: chi-square")
    plain = fitting.FitResult.load("fit.h5")
    assert plain.success
    # Their scatter instead of the errors given: the same verdict, other bars.
    job.write_text(job.read_text() + "scale_errors = true\n")
    assert call(job, "--out", "fit.h5")[0] == 3
    scaled = fitting.FitResult.load("fit.h5")
    assert scaled.error_scale == pytest.approx(np.sqrt(plain.redchi), rel=1e-2)  # the prior counts more now
    np.testing.assert_allclose(scaled.stderr[:3], plain.stderr[:3] * scaled.error_scale, rtol=0.05)


def test_a_full_disk_does_not_cost_the_report(call, job, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fitting.results.hdf5.write_object", full)
    status, printed, complaint = call(job, "--out", "fit.h5", "--plot", "fit.png")
    assert (status, complaint) == (1, "rubberfric-fit: [Errno 28] No space left on device: 'fit.h5'\n")
    assert "[[Variables]]" in printed
    assert sorted(os.listdir()) == sorted([*JOB_FILES, "fit.png"])


@pytest.mark.parametrize("error", [FloatingPointError("not finite"), np.linalg.LinAlgError("no SVD")])
def test_failed_work(call, job, monkeypatch, error):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(work, "fit", fail)
    assert call(job, "--out", "fit.h5") == (1, "", f"rubberfric-fit: {error}\n")
    assert sorted(os.listdir()) == JOB_FILES


def test_profiles(call, job):
    status, printed, complaint = call(job, "--profile", "upper.material.E_inf")
    assert (status, complaint) == (0, "")
    below = printed.split("[[Profile of upper.material.E_inf]]\n")[1].splitlines()
    low, high = (float(end) for end in below[0].split(",")[0].split("..."))
    assert low < 1e6 < high and len(below) == 2 + 17
    assert "upper.material.E[0] = " in below[2]
    status, printed, complaint = call(job, "--profile", "gamma")
    assert status == 2 and "[[Variables]]" in printed
    assert "--profile: name = 'gamma': must be one of upper.material.E[0]," in complaint
