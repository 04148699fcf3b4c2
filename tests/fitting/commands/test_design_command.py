"""`rubberfric-fit design`: output, files, and messages for invalid input."""

import functools

import pytest

import rubberfric as rf
from fitting.commands import main as command

TABLE = """
[design]
velocity = { from = 1e-3, to = 1.0, points = 4 }
pressure = 2e5
n = 2
"""


@pytest.fixture
def call(call_main):
    return functools.partial(call_main, command.main)


def test_report_file_and_picture(call, job, tmp_path):
    text = job.read_text()
    job.write_text(text + TABLE + "criterion = { velocity = 0.1, pressure = 3e5 }\nseed = 1\n")
    status, printed, complaint = call("design", job, "--out", "next.csv", "--plot", "next.png")
    assert (status, complaint) == (0, "")
    assert "Design of 2 measurements (prediction), most useful first" in printed
    assert "error of the prediction" in printed and printed.startswith("Small fit\n")
    assert rf.io.read_columns(tmp_path / "next.csv")["v"].size == 2
    assert (tmp_path / "next.png").read_bytes().startswith(b"\x89PNG\r\n")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("", "design: is missing. Add a table [design] with the candidate measurements"),
        (TABLE.replace("n = 2", ""), "design.n: is missing"),
        (TABLE + "crit = 1\n", "design.crit: unknown key; did you mean 'criterion'?"),
        (TABLE.replace("2e5", "-2e5"), "design.pressure[0] = -200000.0: must be > 0 and finite"),
        (TABLE.replace("n = 2", "n = 1e9"), "design.n = 1000000000.0: must be at most 10000"),
        (TABLE + "draws = 1000000000\n", "design.draws = 1000000000: must be at most 100000"),
        (
            TABLE.replace("points = 4", "points = 90000").replace("2e5", "[1e5, 2e5]"),
            "design: has 180000 candidates: must have at most 100000",
        ),
        (TABLE + "seed = 1.5\n", "design.seed = 1.5: must be an integer"),
    ],
)
def test_bad_input(call, job, table, message):
    job.write_text(job.read_text() + table)
    status, printed, complaint = call("design", job)
    assert (status, printed) == (2, "")
    assert complaint.startswith(f"rubberfric-fit design: {job}: ") and message in complaint
    assert complaint.count("\n") == 1
