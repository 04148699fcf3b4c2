"""Records of rigs in job files and as options of `rubberfric-fit job`, with the friction that made them."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.scenes.fits import JOB_SCENE

from fitting.commands.job import read_job

JOB = """scene = "scene.toml"
[[data]]
file = {file}
{options}
[free]
"upper.material.E_inf" = "positive"
"""
# Factors of three runs, whose mean is 1.
FACTORS = (0.98, 1.0, 1.02)


def record(factor=1.0, angle=0.03):
    """Return the text of a reciprocating run at 5 and 50 mm/s, mu = 0.7 and 0.9, with drift and start-up."""
    rows = []
    for v, mu in ((5, 0.7), (50, 0.9)):
        for sign in (1, -1):
            for k in range(40):
                force = sign * factor * mu * 100 * (1 - 0.9 * math.exp(-k))
                normal = 100 * math.cos(angle) - force * math.sin(angle)
                rows.append((sign * v, normal, force * math.cos(angle) + 100 * math.sin(angle)))
    rest = [(0, 0.0, 0.0)] * 10
    rows = [*rest, *rows, *rest]
    lines = [f"{0.1 * i!r},{v},{n + 2 + 0.01 * i!r},{f - 1 + 0.02 * i!r}" for i, (v, n, f) in enumerate(rows)]
    return "\n".join(["Zeit [s],Geschwindigkeit [mm/s],Normalkraft [N],Reibkraft [N]", *lines]) + "\n"


@pytest.fixture(autouse=True)
def run(run):
    """Run a command in a folder with a scene and records: exit status, stdout, stderr."""
    Path("scene.toml").write_text(JOB_SCENE)
    Path("run.csv").write_text(record())
    for i, factor in enumerate(FACTORS):
        Path(f"run{i}.csv").write_text(record(factor))
    return run


def job(options, file='"run.csv"'):
    Path("job.toml").write_text(JOB.format(file=file, options=options))
    return read_job("job.toml")


STEPS = 'area = 4e-4\nzero = true\ndiscard = "2 s"\nfold = true\n'


def test_a_record_in_a_job():
    (data,) = job(STEPS).data
    np.testing.assert_allclose(data.friction, [0.7, 0.9], rtol=1e-7)
    np.testing.assert_allclose(data.velocity, [5e-3, 50e-3], rtol=1e-12)
    np.testing.assert_allclose(data.pressure, 100 * math.cos(0.03) / 4e-4, rtol=1e-7)
    assert "misalignment of +1.72 deg" in "; ".join(data.history)


def test_files_of_several_runs_in_a_job():
    """The scatter of the runs is 2 %, and its factor for four degrees of freedom is 1.1416."""
    (data,) = job(STEPS + "average = true", '["run0.csv", "run1.csv", "run2.csv"]').data
    np.testing.assert_allclose(data.friction, [0.7, 0.9], rtol=1e-7)
    np.testing.assert_allclose(data.relative, 1.1416 * 0.02 / math.sqrt(3), rtol=1e-4)


@pytest.mark.parametrize(
    ("options", "file", "message"),
    [
        (STEPS, '["run0.csv", "run1.csv"]', r"data\[0\].file = .*: must be one file, or average = true$"),
        ("area = 4e-4\nfold = 1", '"run.csv"', "fold = 1: must be True or False"),
        ("area = 4e-4\ndiscard = 3", '"run.csv"', r"data\[0\].discard = 3: must be one line of text"),
        ("average = true", "[]", r"data\[0\].file: runs = \[\]: must be FrictionData"),
    ],
)
def test_wrong_records_in_a_job(options, file, message):
    with pytest.raises(ValueError, match=message):
        job(options, file)


@pytest.mark.parametrize("files", [["run.csv"], ["run0.csv", "run1.csv", "run2.csv"]])
def test_options_of_the_command(run, files):
    options = ("--area", "4e-4", "--zero", "--discard", "2 s", "--fold", "--average")
    status, printed, complaint = run("job", "scene.toml", *files, *options, "--out", "job.toml")
    assert (status, complaint) == (0, "")
    (table,) = tomllib.loads(printed)["data"]
    own = {"area": 4e-4, "zero": True, "discard": "2 s", "fold": True, "average": True}
    assert table == {"file": files if len(files) > 1 else files[0]} | own
    (data,) = read_job("job.toml").data
    np.testing.assert_allclose(data.friction, [0.7, 0.9], rtol=1e-7)


def test_sinusoidal_strokes_by_the_command(run):
    """mu = 0.8 at 10 Hz and 1 mm, whose largest velocity is 0.01 pi m/s."""
    lines = [
        f"{0.0005 * k!r},100,{80 if math.cos(0.01 * math.pi * (k + 0.5)) > 0 else -80}" for k in range(600)
    ]
    Path("srv.csv").write_text("\n".join(["t [s],Fn [N],Ft [N]", *lines]) + "\n")
    options = ("--area", "4e-4", "--frequency", "10", "--stroke", "1e-3", "--fold", "middle", "--average")
    status, printed, complaint = run("job", "scene.toml", "srv.csv", *options, "--out", "job.toml")
    assert (status, complaint) == (0, "") and 'fold = "middle"' in printed
    (data,) = read_job("job.toml").data
    np.testing.assert_allclose(data.friction, [0.8], rtol=1e-12)
    np.testing.assert_allclose(data.velocity, 0.01 * math.pi * 0.2 / math.asin(0.2), rtol=1e-3)
    status, _, complaint = run("job", "scene.toml", "srv.csv", "--area", "4e-4", "--out", "j.toml")
    advice = "--fold middle or --fold speeds, --frequency ... [Hz] and --stroke ..."
    assert status == 2 and advice in complaint


def test_messages_of_the_command(run):
    Path("mu.csv").write_text("v [mm/s],mu,p [bar]\n5,0.7,2\n6,0.7,2\n")
    status, _, complaint = run("job", "scene.toml", "mu.csv", "--fold", "--out", "job.toml")
    assert status == 2 and "mu.csv: --fold: no sections in opposite directions at equal speeds" in complaint
