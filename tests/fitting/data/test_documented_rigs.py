"""The snippets about rigs and data frames on the page of formats, with files of known friction."""

import math
import re
from pathlib import Path

import numpy as np
import pandas
import pytest
from support.folders import ROOT

import fitting
import rubberfric as rf
from fitting.commands.job import read_job

PAGE = (ROOT / "notebooks" / "formats_introduction.md").read_text(encoding="utf-8")
TITLES = ("Friction rigs", "Data frames")
RIGS, FRAMES = (PAGE.split(f"## {title}\n")[1].split("\n## ")[0] for title in TITLES)
SCENE = """[lower]
material = { kind = 'rigid' }
[upper]
material = { kind = 'elastic', young = 1e6, poisson = 0.5 }
"""


def snippets(text, language):
    return re.findall(rf"```{language}\n(.*?)```", text, re.S)


def names_of(snippet):
    """Return the names that a snippet defines."""
    names = {"fitting": fitting, "pandas": pandas}
    exec(snippet, names)
    return names


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Files of a reciprocating run with 100 N, 2 deg of misalignment and drift, and of three runs."""
    monkeypatch.chdir(tmp_path)
    rows, angle = [(0.0, 0.0, 0.0)] * 20, math.radians(2.0)
    for cycle in range(3):
        for sign in (1, -1):
            for k in range(60):
                force = sign * (0.8 + 0.01 * (cycle - 1)) * 100 * (1 + 0.3 * math.exp(-k / 3))
                normal = 100 * math.cos(angle) - force * math.sin(angle)
                rows.append((sign * 10.0, normal, force * math.cos(angle) + 100 * math.sin(angle)))
    rows += [(0.0, 0.0, 0.0)] * 20
    lines = [f"{0.05 * i},{v},{n + 1 + 0.005 * i},{f - 2 + 0.01 * i}" for i, (v, n, f) in enumerate(rows)]
    Path("reciprocating.csv").write_text("\n".join(["t [s],v [mm/s],Fn [N],Ft [N]", *lines]) + "\n")
    for i, force in enumerate((80.0, 82.0, 87.0), 1):
        Path(f"run{i}.csv").write_text(f"v [mm/s],Fn [N],Ft [N]\n5,100,{force}\n")


def test_a_reciprocating_run(capsys):
    first, *_ = snippets(RIGS, "python")
    run = names_of(first)["run"]
    # 3 s of a stroke are 30 mm. The first 10 mm are 20 rows, after which the start-up part is below 4e-4.
    np.testing.assert_allclose(run.friction, [0.8], rtol=1e-4)
    np.testing.assert_allclose(run.pressure, [100 * math.cos(math.radians(2.0)) / 4e-4], rtol=1e-4)
    np.testing.assert_allclose(run.relative, [1.3213 * 0.0125 / math.sqrt(3)], rtol=1e-3)
    lines = capsys.readouterr().out.splitlines()
    assert any("misalignment of +2 deg" in line for line in lines)
    assert any("120 of 360 rows" in line for line in lines)


def test_sinusoidal_strokes():
    """Three cycles of 10 Hz and 1 mm with mu = 0.8, whose largest velocity is 0.01 pi m/s."""
    lines = [
        f"{0.0005 * k!r},100,{80 * math.copysign(1, math.cos(0.01 * math.pi * (k + 0.5)))}"
        for k in range(600)
    ]
    Path("srv.csv").write_text("\n".join(["t [s],Fn [N],Ft [N]", *lines]) + "\n")
    _, sinusoidal, _ = snippets(RIGS, "python")
    names = names_of(sinusoidal)
    for data, count in ((names["speeds"], 5), (names["middle"], 1)):
        np.testing.assert_allclose(data.friction, [0.8] * count, rtol=1e-12)
    np.testing.assert_allclose(names["middle"].velocity, 0.01 * math.pi * 0.2 / math.asin(0.2), rtol=1e-3)


def test_three_runs():
    *_, second = snippets(RIGS, "python")
    mean = names_of(second)["mean"]
    expected = 1.3213 * math.sqrt(13e-4 / 3) / 0.83
    np.testing.assert_allclose([mean.friction, mean.relative], [[0.83], [expected]], rtol=1e-4)
    (toml,) = snippets(RIGS, "toml")
    Path("scene.toml").write_text(SCENE)
    Path("job.toml").write_text(f"scene = 'scene.toml'\n{toml}[free]\n'upper.material.young' = 'positive'\n")
    (data,) = read_job("job.toml").data
    np.testing.assert_allclose([data.friction, data.relative], [[0.83], [expected]], rtol=1e-4)


def test_a_wheel():
    (call,) = re.findall(r"`(rf\.io\.read_table\(\"wheel.*?)`", RIGS, re.S)
    Path("wheel.csv").write_text("slip angle [deg],speed [km/h],load [N],side force [N]\n30,3.6,75,-60\n")
    table = eval(call, {"rf": rf})
    found = [table[name][0] for name in ("slip_angle", "v_travel", "F_n", "F_t")]
    np.testing.assert_allclose(found, [math.pi / 6, 1, 75, -60])


def test_a_frame():
    (snippet,) = snippets(FRAMES, "python")
    data = names_of(snippet)["data"]
    np.testing.assert_allclose([data.velocity, data.friction], [[1e-3, 1e-2], [0.5, 0.7]])
