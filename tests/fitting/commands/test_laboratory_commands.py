"""From the exports in data/laboratory to a table for a simulation, by commands only."""

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from support.folders import DATA, ROOT

import fitting
import rubberfric as rf


@pytest.fixture(autouse=True)
def exports(tmp_path):
    shutil.copytree(DATA / "laboratory", tmp_path, dirs_exist_ok=True)


def test_a_material_from_sweeps(run):
    status, printed, _ = run(
        "mastercurve", "dma_isothermen.csv", "--strain", "strain_sweep.txt", "--out", "scene.toml"
    )
    assert status == 0 and "WLF" in printed and "Prony series" in printed and "At a strain of 1" in printed
    found = rf.load_scene("scene.toml").upper
    curve = fitting.fit_master_curve(fitting.read("dma_isothermen.csv"))
    expected = fitting.fit_prony(curve.data, 2.0, shift=curve.shift).material
    np.testing.assert_allclose(found.material.E, expected.E, rtol=1e-12)
    np.testing.assert_allclose(found.material.shift.C1, expected.shift.C1, rtol=1e-12)
    assert found.softening.strain[-1] == pytest.approx(1.0)


def test_a_master_curve_as_a_table(run):
    assert run("mastercurve", "dma_isothermen.csv", "--out", "curve.csv", "--plot", "curve.png")[0] == 0
    assert fitting.read("curve.csv").omega.size == 195 and Path("curve.png").stat().st_size > 10_000


@pytest.mark.slow
def test_roughness_from_traces_goes_into_a_scene(run):
    new = run("spectrum", "stylus.csv", "--slope", "1.3", "--out", "road.toml", "--plot", "road.png")
    assert new[0] == 0 and "6 traces of 2048 heights" in new[1] and "where" not in new[1]
    assert "because its rms slope is 1.3 there (--slope)" in new[1] and new[1].count("q1 = ") == 1
    road = rf.load_scene("road.toml")
    assert isinstance(road.upper.material, rf.Elastic) and not road.lower.material.deforms
    assert float(rf.rms_slope(road.lower.spectrum)) == pytest.approx(1.3, rel=1e-9)
    assert (
        run("spectrum", "stylus.csv", "--scene", "road.toml", "--body", "lower", "--out", "two.toml")[0] == 0
    )
    assert float(rf.load_scene("two.toml").lower.spectrum.h_rms) == pytest.approx(1.5e-4, rel=0.1)
    status, printed, _ = run("spectrum", "stylus.csv", "--table", "--out", "table.toml")
    assert status == 0 and "The scene ends at q1 = 3.104e+05 1/m, where the data end." in printed
    assert isinstance(rf.load_scene("table.toml").lower.spectrum, rf.TabulatedSpectrum)


@pytest.mark.slow
def test_a_job_a_fit_and_a_table(run):
    assert run("mastercurve", "dma_isothermen.csv", "--out", "material.toml", "--per-decade", "1")[0] == 0
    assert (
        run("spectrum", "stylus.csv", "--scene", "material.toml", "--slope", "1.3", "--out", "scene.toml")[0]
        == 0
    )
    status, printed, _ = run(
        "job", "scene.toml", "linear_tester.csv", "--relative", "0.05", "--shear", "--out", "job.toml"
    )
    assert status == 0 and printed == Path("job.toml").read_text()
    assert '"lower.spectrum.q1" = "positive"' in printed and rf.load_scene("job_scene.toml").shear is not None
    assert run("job.toml", "--out", "fit.h5")[0] == 0
    at = ("--velocity", "1e-3", "0.1", "--pressure", "1e5", "4e5", "--temperature", "293.15")
    status, printed, _ = run("table", "fit.h5", *at, "--out", "mu.inp", "--units", "mm/s", "MPa", "C")
    assert status == 0 and "interpolation error 0.00" in printed
    table = rf.io.read_friction("mu.inp", "abaqus")
    expected = fitting.FitResult.load("fit.h5").predict(0.01, 2e5, 293.15)
    np.testing.assert_allclose(table.at(0.01, 2e5, 293.15), expected, rtol=0.01)
    assert run("table", "scene.toml", *at, "--out", "mu.csv", "--error", "0.1")[0] == 0


@pytest.mark.slow  # softening takes half a minute; the steps are tested above
def test_the_commands_of_the_page(run):
    page = (ROOT / "notebooks" / "commands.md").read_text(encoding="utf-8")
    block = re.search(r"```sh\n(.*?)```", page, re.S)
    assert block is not None
    for line in block[1].splitlines():
        program, *arguments = shlex.split(line)
        status, printed, complaint = run(*arguments)
        assert program == "rubberfric-fit" and status == 0 and printed, complaint
    result = fitting.FitResult.load("fit.h5")
    assert result.verdict.explains
    truth = {"shear.tau_f0": 2e6, "shear.c": 0.1, "shear.v0": 6e-3, "lower.spectrum.q1": 4e5}
    for name, value in truth.items():
        assert abs(result[name].value - value) < 3 * result[name].stderr
    assert {"moduli.png", "road.png", "fit.png", "mu.inp"} <= {path.name for path in Path().iterdir()}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mastercurve", "no.csv"), "no.csv: cannot be read"),
        (("mastercurve", "dma_isothermen.csv", "--temperature", "290"), "--temperature 290.0: must not be"),
        (("mastercurve", "stylus.csv", "stylus.csv", "--temperature", "290"), "has 1 values for 2 files"),
        (("mastercurve", "dma_isothermen.csv", "--out", "x.png"), "must be .toml or .h5 or .csv"),
        (("spectrum", "stylus.csv", "--map"), "must have x, y and z, or be a grid"),
        (("spectrum", "stylus.csv", "--map", "--spacing", "1e-5", "--unit", "inch"), "unit 'inch'"),
        (("spectrum", "stylus.csv", "--slope", "-1"), "--slope -1.0: must be > 0"),
        (("job", "dma_isothermen.csv", "linear_tester.csv", "--out", "job.toml"), "must be .toml or .h5"),
        (
            ("table", "scene.toml", "--velocity", "1", "2", "3", "--pressure", "1e5", "--out", "a.k"),
            "scene.toml",
        ),
    ],
)
def test_wrong_arguments_write_nothing(run, arguments, message):
    before = sorted(Path().iterdir())
    status, printed, complaint = run(*arguments)
    assert status == 2 and printed == "" and complaint.count("\n") == 1
    assert message in complaint and sorted(Path().iterdir()) == before


def test_a_wrong_job_is_not_written(run):
    assert run("spectrum", "stylus.csv", "--out", "road.toml")[0] == 0
    Path("job.toml").write_text("kept")
    before = sorted(Path().iterdir())
    status, _, complaint = run(
        "job",
        "road.toml",
        "linear_tester.csv",
        "--shear",
        "--free",
        "lower.spectrum.nonsense",
        "--out",
        "job.toml",
    )
    assert status == 2 and "nonsense" in complaint
    assert Path("job.toml").read_text() == "kept" and sorted(Path().iterdir()) == before
