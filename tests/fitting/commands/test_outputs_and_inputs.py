"""No command overwrites a file that it reads, or a file that this file names."""

import os
import shutil
from pathlib import Path

import pytest
from support.folders import ROOT
from support.scenes.fits import JOB, JOB_SCENE

import rubberfric as rf
from fitting.commands.main import main as fit_main
from rubberfric.commands.main import main as scene_main

AFFINE = 'kind = "self_affine", q0 = 100, qr = 1000, q1 = 1e4, hurst = 0.8, h_rms = 1e-4'
TABLE = 'kind = "tabulated", file = "spectrum.csv", normalisation = "C"'
AT = ("--velocity", "1e-3", "0.1", "--pressure", "1e5")


@pytest.fixture
def folder(job, tmp_path):
    """A job with a scene that has a table and a prior from another fit, a result, exports, and links."""
    scene = JOB_SCENE.replace(AFFINE, TABLE) + "[run]\nvelocity = [0.01, 0.1]\npressure = 1e5\n"
    Path("spectrum.csv").write_text("q,C\n1/m,m^4\n100,1e-13\n1000,1e-13\n10000,2.5e-17\n")
    Path("scene.toml").write_text(scene)
    job.write_text(JOB.replace("[prior]", '[prior]\nfit = { file = "prior.h5" }'))
    Path("prior.h5").write_text("a fit")
    rf.save_scene("scene.h5", rf.load_scene("scene.toml"))
    for name in ("stylus.csv", "dma_isothermen.csv", "strain_sweep.txt", "linear_tester.csv"):
        shutil.copy(ROOT / "data" / "laboratory" / name, tmp_path)
    Path("link.toml").symlink_to("scene.toml")
    os.link("spectrum.csv", "hard.csv")
    return tmp_path


def contents():
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


SWEEP = ("mastercurve", "dma_isothermen.csv")


@pytest.mark.parametrize(
    ("main", "arguments", "output"),
    [
        (scene_main, ("run", "scene.h5"), ("--out", "scene.h5")),
        (scene_main, ("map", "scene.h5"), ("--out", "./scene.h5")),
        (scene_main, ("accuracy", "scene.toml"), ("--out", "spectrum.csv")),
        (scene_main, ("accuracy", "scene.toml"), ("--out", "hard.csv")),
        (scene_main, ("accuracy", "link.toml"), ("--out", "spectrum.csv")),
        (fit_main, ("job.toml",), ("--out", "prior.h5")),
        (fit_main, ("job.toml", "--bootstrap", "2", "--resume"), ("--checkpoint", "prior.h5")),
        (fit_main, ("design", "job.toml"), ("--out", "modulus.csv")),
        (fit_main, ("design", "job.toml"), ("--out", "spectrum.csv")),
        (fit_main, ("job", "scene.toml", "linear_tester.csv"), ("--out", "scene.toml")),
        (fit_main, ("job", "scene.toml", "linear_tester.csv"), ("--out", "link.toml")),
        (fit_main, ("job", "link.toml", "linear_tester.csv", "--shear"), ("--out", "scene.toml")),
        (fit_main, ("table", "scene.toml", *AT), ("--out", "spectrum.csv")),
        (fit_main, ("spectrum", "stylus.csv", "--scene", "scene.toml"), ("--out", "scene.toml")),
        (fit_main, ("spectrum", "stylus.csv", "--scene", "scene.toml"), ("--out", "link.toml")),
        (fit_main, ("spectrum", "stylus.csv", "--scene", "scene.toml"), ("--out", "spectrum.csv")),
        (fit_main, ("spectrum", "stylus.csv"), ("--out", "stylus.csv")),
        (fit_main, SWEEP, ("--out", "dma_isothermen.csv")),
        (fit_main, (*SWEEP, "--scene", "scene.h5"), ("--out", "scene.h5")),
        (fit_main, (*SWEEP, "--scene", "scene.toml"), ("--out", "hard.csv")),
    ],
)
@pytest.mark.usefixtures("folder")
def test_an_input_is_not_overwritten(call_main, main, arguments, output):
    before = contents()
    status, printed, complaint = call_main(main, *arguments, *output, "--no-cache")
    assert (status, printed, complaint.count("\n")) == (2, "", 1)
    assert f"{' '.join(output)}: is a file that this command reads; choose another file" in complaint
    assert contents() == before
