"""`rubberfric-fit calibration`: output, plot, and messages for invalid input."""

import functools

import pytest

from fitting.commands import main as command

FREE = """[free]
"upper.material.E[0]" = "positive"
[prior]
"upper.material.E[0]" = { mean = 1e8, sigma = 1e7 }
"""


@pytest.fixture
def call(call_main):
    return functools.partial(call_main, command.main)


@pytest.fixture
def planned(job):
    """The small job with one free parameter that has a Gaussian prior."""
    before, _ = job.read_text().split("[free]")
    job.write_text(before + FREE)
    return job


def test_report_and_picture(call, planned, tmp_path):
    status, printed, complaint = call(
        *("calibration", planned, "--members", 40, "--on", "samples", "--plot", "places.png")
    )
    assert (status, complaint) == (0, "")
    assert printed.startswith("Small fit\n40 fits, 0 did not converge; 100 draws, ")
    assert "upper.material.E[0]: " in printed and printed.endswith(": calibrated\n")
    assert (tmp_path / "places.png").read_bytes().startswith(b"\x89PNG\r\n")


def test_bad_input(call, planned):
    text = planned.read_text()
    for changed, message in (
        (text.split("[prior]")[0], "upper.material.E[0] has no Gaussian prior; every"),
        (text + '[fit]\nloss = "huber"\n', "fit.loss: must be 'linear' for a calibration"),
    ):
        planned.write_text(changed)
        status, printed, complaint = call("calibration", planned)
        assert (status, printed) == (2, "")
        assert complaint.startswith(f"rubberfric-fit calibration: {planned}: ") and message in complaint
    status, _, complaint = call("calibration", planned, "--members", 0)
    assert status == 2 and "must be an integer >= 1" in complaint
