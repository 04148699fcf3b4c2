"""`rubberfric-fit design`, `calibration` and --bootstrap: output, files, and messages for invalid input."""

import numpy as np
import pytest

import fitting
import rubberfric as rf
from fitting.commands import work
from fitting.commands.job import read_job

DESIGN = """
[design]
velocity = { from = 1e-3, to = 1.0, points = 4 }
pressure = 2e5
n = 2
"""


@pytest.mark.slow
def test_design(call, job, tmp_path):
    text = job.read_text()
    job.write_text(text + DESIGN + "criterion = { velocity = 0.1, pressure = 3e5 }\nseed = 1\n")
    status, printed, complaint = call("design", job, "--out", "next.csv", "--plot", "next.png")
    assert (status, complaint) == (0, "")
    assert "Design of 2 measurements (prediction), most useful first" in printed
    assert "error of the prediction" in printed and printed.startswith("Small fit\n")
    assert rf.io.read_columns(tmp_path / "next.csv")["v"].size == 2
    assert (tmp_path / "next.png").read_bytes().startswith(b"\x89PNG\r\n")
    job.write_text(text.replace("relative = 0.03", "relative = 0.003") + DESIGN)
    status, printed, complaint = call("design", job)
    why = "the scene does not explain the data: run rubberfric-fit for details"
    assert (status, complaint) == (3, f"rubberfric-fit design: {why}\n")
    assert "Design of 2 measurements (D), most useful first" in printed


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("", "design: is missing; add a table [design] with the candidates"),
        (DESIGN.replace("n = 2", ""), "design.n: is missing"),
        (DESIGN + "crit = 1\n", "design.crit: unknown key; did you mean 'criterion'?"),
        (DESIGN.replace("2e5", "-2e5"), "design.pressure[0] = -200000.0: must be > 0 and finite"),
        (DESIGN.replace("n = 2", "n = 1e9"), "design.n = 1000000000.0: must be at most 10000"),
        (DESIGN + "draws = 1000000000\n", "design.draws = 1000000000: must be at most 100000"),
        (
            DESIGN.replace("points = 4", "points = 90000").replace("2e5", "[1e5, 2e5]"),
            "design: has 180000 candidates: must have at most 100000",
        ),
        (DESIGN + "[discrepancy]\namplitude = 0.1\n", "discrepancy: must be left out of a design"),
        (DESIGN + "seed = 1.5\n", "design.seed = 1.5: must be an integer"),
    ],
)
def test_bad_designs(call, job, table, message):
    job.write_text(job.read_text() + table)
    refused(call, "design", job, message)


def refused(call, command, job, message):
    status, printed, complaint = call(command, job)
    assert (status, printed, complaint.count("\n")) == (2, "", 1)
    assert complaint.startswith(f"rubberfric-fit {command}: {job}: ") and message in complaint


def test_calibration(call, planned, tmp_path):
    status, printed, complaint = call(
        *("calibration", planned, "--members", 40, "--on", "samples", "--plot", "places.png")
    )
    assert (status, complaint) == (0, "")
    assert printed.startswith("Small fit\n40 fits, 0 did not converge; 100 draws, ")
    assert "upper.material.E[0]: " in printed and printed.endswith(": calibrated\n")
    assert (tmp_path / "places.png").read_bytes().startswith(b"\x89PNG\r\n")


def test_bad_calibrations(call, planned):
    text = planned.read_text()
    planned.write_text(text.split("[prior]")[0])
    refused(call, "calibration", planned, "has no Gaussian prior")
    planned.write_text(text + '[fit]\nloss = "huber"\n')
    refused(call, "calibration", planned, "fit.loss: must be 'linear' for a calibration")
    status, _, complaint = call("calibration", planned, "--members", 0)
    assert status == 2 and "must be an integer >= 1" in complaint


def test_bootstrap_is_interrupted_and_goes_on(call, job, monkeypatch):
    arguments = (job, "--bootstrap", 9, "--checkpoint", "run.h5")
    run, calls = work.run_ensemble, []

    def interrupted(*members, callback, **options):
        def stopping(*at):
            calls.append(at)
            if len(calls) == 3:
                raise KeyboardInterrupt
            callback(*at)

        return run(*members, batch=2, callback=stopping, **options)

    monkeypatch.setattr(work, "run_ensemble", interrupted)
    _, printed, _ = call(*arguments)
    assert "interrupted: these are the best values so far" in printed
    monkeypatch.setattr(work, "run_ensemble", run)
    status, _, complaint = call(*arguments)
    assert status == 2 and "run.h5: the file exists" in complaint
    status, printed, complaint = call(*arguments, "--resume")
    assert (status, complaint) == (0, "")
    read = read_job(job)
    result = fitting.fit(read.scene, read.data, read.free, prior=read.prior, **read.options)
    ends = fitting.run_ensemble(fitting.bootstrap_members(result, 9))
    assert "[[Correlations]]" in printed.split("[[Ensemble]]")[0] and "9 converged" in printed
    low, high = ends.interval()
    for i, name in enumerate(result.names):
        row = next(line for line in printed.split("[[Values")[1].splitlines() if name in line)
        found = [float(row.split()[k]) for k in (1, 2, 4)]
        expected = [np.median(ends.values[:, i]), low[i], high[i]]
        np.testing.assert_allclose(found, expected, rtol=1e-5)
