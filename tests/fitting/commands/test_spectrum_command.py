"""`rubberfric-fit spectrum` on synthetic surfaces with known parameters, with every option."""

import functools
import warnings
from pathlib import Path

import jax
import numpy as np
import pytest
from support.folders import DATA

import fitting
import rubberfric as rf
from fitting.commands.arguments import COMMANDS
from fitting.commands.laboratory import measured_spectrum

LENGTH = 1e-3
Q0 = 2 * np.pi / LENGTH
TRUTH = rf.SelfAffine(Q0, 4 * Q0, 40 * Q0, 0.8, 1e-5)


@pytest.fixture(scope="module")
def surface():
    """Heights [m] of 2 x 2 periods, and their spacing."""
    found = rf.analysis.random_surface(TRUTH, jax.random.key(3), grid=320, periods=2.0)
    return found.heights, found.length / 320


@pytest.fixture
def run(run):
    """Run `rubberfric-fit spectrum` in an empty folder: exit status, stdout, stderr."""
    return functools.partial(run, "spectrum")


def grid(heights, separator=","):
    return "".join(separator.join(f"{1e6 * z:.5f}" for z in row) + "\n" for row in heights)


def xyz(heights, dx, dy):
    rows = [f"{1e6 * i * dx:.5f},{1e6 * k * dy:.5f},{1e6 * z:.5f}" for (i, k), z in np.ndenumerate(heights)]
    return "x [um],y [um],z [um]\n" + "\n".join(rows) + "\n"


@pytest.mark.parametrize("kind", ["csv", "txt", "dat", "xyz", "holes"])
@pytest.mark.parametrize(
    ("nx", "ny", "every"), [pytest.param(320, 320, 1, marks=pytest.mark.slow), (320, 140, 1), (320, 160, 2)]
)
def test_height_maps(run, surface, kind, nx, ny, every):
    """Files of 5e4 points and more; `every` makes dy twice dx."""
    if kind not in ("csv", "xyz") and (nx, ny, every) != (320, 140, 1):
        pytest.skip("one size of the rarer formats")
    whole, d = surface
    heights = whole[:nx, : ny * every : every].copy()
    if kind == "holes":
        heights[100:104, 50:60] = -9999e-6
    spacing = [d] if every == 1 else [d, every * d]
    name = "map.csv" if kind == "holes" else f"map.{kind}"
    separator = {"txt": "\t", "dat": " "}.get(kind, ",")
    Path(name).write_text(xyz(heights, d, every * d) if kind == "xyz" else grid(heights, separator))
    how = () if kind == "xyz" else ("--spacing", *spacing, "--unit", "um")
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always", UserWarning)
        status, printed, complaint = run(name, "--map", *how, "--out", "scene.toml")
    assert status == 0 and f"{nx} x {ny} heights" in printed, complaint
    texts = [str(each.message) for each in warned]
    assert texts == ["map.csv: 40 heights -9999 are taken as holes"] * (kind == "holes")
    found = rf.load_scene("scene.toml").lower.spectrum
    assert float(found.h_rms) == pytest.approx(float(TRUTH.h_rms), rel=0.25)
    assert float(found.hurst) == pytest.approx(0.8, abs=0.1)
    assert float(found.qr) == pytest.approx(float(TRUTH.qr), rel=0.5)


@pytest.mark.slow
def test_options_of_a_map(run, surface):
    heights, d = surface
    Path("map.csv").write_text(grid(heights[:, :192]))
    how = ("map.csv", "--map", "--spacing", d, "--unit", "um")
    assert run(*how, "--out", "measured.csv", "--plot", "spectrum.png")[0] == 0
    data = fitting.read("measured.csv", normalisation="C")
    assert Path("spectrum.png").stat().st_size > 10_000 and data.relative.max() > 1
    status, printed, _ = run(*how, "--slope", "0.2", "--tops", "--out", "cut.toml", "--body", "upper")
    assert status == 0 and "of the area above the mean" in printed and "rms slope 0.2.\n" in printed
    assert float(rf.rms_slope(rf.load_scene("cut.toml").upper.spectrum)) == pytest.approx(0.2, rel=1e-9)
    assert run(*how, "--table", "--out", "table.toml")[0] == 0
    table = rf.load_scene("table.toml").lower.spectrum
    np.testing.assert_allclose(table.C, data.C, rtol=1e-12)
    np.save("map.npy", np.round(1e6 * heights[:, :192], 5))
    assert run("map.npy", *how[1:], "--table", "--out", "array.toml")[0] == 0
    np.testing.assert_allclose(rf.load_scene("array.toml").lower.spectrum.C, data.C, rtol=1e-9)
    assert run(*how, "--q1", 20 * Q0, "--out", "short.h5")[0] == 0
    assert float(rf.load_scene("short.h5").lower.spectrum.q1) == pytest.approx(20 * Q0)


def test_options_of_heights(surface, tmp_path, monkeypatch):
    """Each against the same steps in NumPy and the library, and its line in the report."""
    monkeypatch.chdir(tmp_path)
    heights, d = np.round(surface[0][:, :150], 11), surface[1]  # as the file has them
    spoiled = heights.copy()
    spoiled[50, 60] = 1e-4
    Path("map.csv").write_text(grid(spoiled))
    how = ("map.csv", "--map", "--spacing", d, "--unit", "um")

    def C_of(*more):
        options = COMMANDS["spectrum"].parser().parse_args([*map(str, how), *map(str, more)])
        found, text = measured_spectrum(options)
        return found.C, text

    def bins(z, **options):
        return rf.roughness.spectrum_of_topography(z, d, per_decade=10, **options).C

    with pytest.warns(UserWarning, match="0.00% of the heights are outliers and are interpolated"):
        C, printed = C_of("--outliers", 10, "--detrend", 2)
    assert "320 x 150 heights, 0.0% of them filled" in printed
    spoiled[50, 60] = np.mean([heights[place] for place in ((49, 60), (51, 60), (50, 59), (50, 61))])
    np.testing.assert_allclose(C, bins(spoiled, detrend=2), rtol=1e-6)
    Path("map.csv").write_text(grid(heights))
    flat = heights - heights.mean()
    level = 0.3 * heights.std()
    C, printed = C_of("--detrend", 0, "--fill-level", level, "--noise", 1.5 * heights.std())
    np.testing.assert_allclose(C, bins(np.maximum(flat, level), detrend=0), rtol=1e-6)
    assert "the stated noise is more than a fifth of C above q1" in printed and " +/- " in printed
    volume = np.mean(np.maximum(level - flat, 0))
    again, printed = C_of("--detrend", 0, "--fill-volume", volume, "--tip-radius", 1e-3)
    np.testing.assert_allclose(again, C, rtol=1e-6)
    assert f"filled up to {level:.4g} m above" in printed
    assert "the tip does not follow sharper peaks above q1" in printed
    C, printed = C_of("--detrend", 0, "--tops")
    tops = np.maximum(flat, 0) / np.sqrt(np.mean(flat > 0))
    np.testing.assert_allclose(C, bins(tops, detrend=0), rtol=1e-6)
    assert f"top spectrum, of the {np.mean(flat > 0):.1%}" in printed


def test_options_of_heights_that_are_refused(run, surface):
    heights, d = surface
    Path("map.csv").write_text(grid(heights[:40, :40]))
    Path("s.csv").write_text("q,C\n1/m,m^4\n1e3,1e-12\n1e4,1e-15\n")
    how = ("map.csv", "--map", "--spacing", d, "--unit", "um")
    for arguments, text in (
        ((*how, "--fill-level", 0, "--fill-volume", 1e-6), "--fill-level 0.0: must not be given with"),
        ((*how, "--tip-radius", -1), "--tip-radius -1.0: must be > 0"),
        ((*how, "--outliers", 0), "--outliers 0.0: must be > 0"),
        (("s.csv", "--normalisation", "C", "--tops"), "--tops True: must not be given; s.csv holds a"),
    ):
        status, printed, complaint = run(*arguments)
        assert status == 2 and printed == "" and complaint.count("\n") == 1 and text in complaint, complaint


@pytest.mark.slow
def test_spectra_of_other_programs(run):
    q = np.geomspace(Q0, 39 * Q0, 60)
    W1 = 2 * np.asarray(rf.roughness.line_spectrum(TRUTH, q))
    rows = "".join(f"{a:.8g},{b:.8g}\n" for a, b in zip(q, W1, strict=True))
    Path("gwyddion.csv").write_text("k [1/m],W1 [m^3]\n" + rows)
    Path("plain.csv").write_text("q [rad/m],C_1D [m^3]\n" + rows)
    for arguments in (("gwyddion.csv",), ("plain.csv", "--normalisation", "C_1D_one_sided")):
        status, _, complaint = run(*arguments, "--out", "scene.toml")
        assert status == 0, complaint
        assert float(rf.load_scene("scene.toml").lower.spectrum.h_rms) == pytest.approx(1e-5, rel=0.03)
    status, _, complaint = run("plain.csv")
    assert status == 2 and "normalisation is missing" in complaint
    how = ("--normalisation", "C_1D_one_sided", "--hurst", "0.8", "--out", "s.toml")
    with pytest.warns(UserWarning, match="because of a roll-off"):
        assert run("plain.csv", *how)[0] == 0


@pytest.fixture
def run_table(run):
    """Run the command on a table of the true spectrum."""
    q = np.geomspace(Q0, 40 * Q0, 60)
    C = np.asarray(rf.power_spectrum(TRUTH, np.clip(q, Q0 * (1 + 1e-12), 40 * Q0 * (1 - 1e-12))))
    Path("s.csv").write_text("q,C\n1/m,m^4\n" + "".join(f"{a},{b}\n" for a, b in zip(q, C, strict=True)))
    return functools.partial(run, "s.csv", "--normalisation", "C")


@pytest.mark.parametrize(
    ("cutoff", "text"),
    [(("--slope", "1e9"), "--slope 1000000000.0: is reached"), (("--q1", "1e30"), "the distance of atoms")],
)
def test_absurd_cutoffs_are_refused(run_table, cutoff, text):
    status, printed, complaint = run_table(*cutoff, "--out", "no.toml")
    assert status == 2 and printed == "" and complaint.count("\n") == 1 and text in complaint
    assert not Path("no.toml").exists()


def test_a_scene_keeps_its_lines(run_table):
    own = (DATA / "tread_on_asphalt.toml").read_text(encoding="utf-8")
    Path("scene.toml").write_text("# of 2019\n" + own)
    status, _, complaint = run_table("--slope", 0.5, "--scene", "scene.toml", "--out", "new.toml")
    assert status == 0, complaint
    new = Path("new.toml").read_text(encoding="utf-8")
    for line in ("# of 2019", *own.splitlines()):
        assert line in new.splitlines() or line.split(" = ")[0] in ("q0", "qr", "q1", "hurst", "h_rms")
    assert float(rf.rms_slope(rf.load_scene("new.toml").lower.spectrum)) == pytest.approx(0.5)
