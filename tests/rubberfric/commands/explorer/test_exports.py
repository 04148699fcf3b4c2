"""Downloads of the page: scenes that load again, and jobs that rubberfric-fit reads and computes."""

import io
import zipfile

import numpy as np
import pytest
from support.folders import DATA
from support.scenes.examples import same

import fitting
import rubberfric as rf
from fitting.commands.job import read_job
from rubberfric.commands.explorer.command import COMMAND, fit_download, scene_download
from rubberfric.commands.explorer.sliders import slider_values
from rubberfric.io.files import read_computable


def named(download, name):
    return download.headers == {"Content-Disposition": f'attachment; filename="{name}"'}


def unpacked(download, folder):
    assert named(download, "explored.zip") and download.kind == "application/zip"
    with zipfile.ZipFile(io.BytesIO(download.content)) as archive:
        names = archive.namelist()
        archive.extractall(folder)
    return names


def test_scene_without_tables(explorer_of, tmp_path):
    explorer = explorer_of("twin_truth")
    moved = {
        "lower.spectrum.h_rms": 7e-4,
        "pressure": 3e5,
        "temperature": 310.0,
        "upper.material.moduli": 2.0,
    }
    values = slider_values(explorer.sliders, moved)
    found = scene_download(explorer, values)
    assert named(found, "scene.toml") and found.kind == "application/toml"
    (tmp_path / "scene.toml").write_bytes(found.content)
    scene, conditions, title = read_computable(tmp_path / "scene.toml")
    same(scene, explorer.moved(values))
    assert scene.lower.spectrum.h_rms == 7e-4 and scene.upper.material.E_inf == 7.2e6
    assert (conditions.pressure, conditions.temperature, title) == (3e5, 310.0, explorer.title)


def test_scene_with_tables(explorer_of, tmp_path):
    explorer = explorer_of("tabulated_tread")
    values = slider_values(explorer.sliders, {"upper.material.moduli": 2.0})
    names = unpacked(scene_download(explorer, values), tmp_path)
    assert names[0] == "explored/scene.toml" and len(names) == 4
    assert all(name.startswith("explored/") and ".." not in name for name in names)
    same(rf.load_scene(tmp_path / "explored" / "scene.toml"), explorer.moved(values))


def test_a_job_begins_where_the_sliders_are(explorer_of, tmp_path):
    explorer = explorer_of("twin_guess", DATA / "twin_friction.csv")
    moved = {
        "lower.spectrum.hurst": 1.0,  # at its bound
        "lower.spectrum.q1": 3e4,
        "upper.material.E[3]": 1.5,
        "upper.material.frequencies": 2.0,
        "shear.tau_f0": 5e6,
        "pressure": 2e5,
    }
    values = slider_values(explorer.sliders, moved)
    names = unpacked(fit_download(explorer, values), tmp_path)
    assert names == [f"explored/{name}" for name in ("job.toml", "scene.toml", "data.csv")]
    assert COMMAND == "rubberfric-fit explored/job.toml"
    text = (tmp_path / "explored" / "job.toml").read_text()
    assert str(DATA) not in text and "# upper.material.frequencies: was moved" in text
    job = read_job(tmp_path / "explored" / "job.toml")
    same(job.scene, explorer.moved(values))
    assert job.free == {
        "lower.spectrum.hurst": fitting.Bounded(0.0, 1.0, 0.99),
        "lower.spectrum.q1": fitting.Positive(),
        "upper.material.E[3]": fitting.Positive(),
        "shear.tau_f0": fitting.Positive(),
    }
    (data,) = job.data
    measured = explorer.measured
    np.testing.assert_array_equal(data.friction, measured.friction)
    np.testing.assert_array_equal(data.pressure, measured.pressure)
    np.testing.assert_array_equal(data.temperature, measured.temperature)
    np.testing.assert_allclose(data.error * data.friction, measured.error, rtol=1e-14)


def test_a_whole_series_is_free_as_a_whole(explorer_of, tmp_path):
    explorer = explorer_of("twin_guess", DATA / "twin_friction.csv")
    moved = {"upper.material.moduli": 2.0, "upper.material.E[3]": 1.5, "upper.material.E_inf": 4e6}
    unpacked(fit_download(explorer, slider_values(explorer.sliders, moved)), tmp_path)
    job = read_job(tmp_path / "explored" / "job.toml")
    assert job.free == dict.fromkeys(["upper.material.E_inf", "upper.material.E"], fitting.Positive())


def test_what_the_points_lack_is_where_the_sliders_are(explorer_of, tmp_path):
    table = tmp_path / "points.txt"
    table.write_text("v,mu\nm/s,-\n1e-3,0.5\n1e-2,0.6\n1e-1,0.7\n")
    explorer = explorer_of("twin_guess", table)
    values = slider_values(explorer.sliders, {"pressure": 2e5, "temperature": 300.0, "gamma": 0.4})
    table.unlink()  # which was read once, when the command began
    unpacked(fit_download(explorer, values), tmp_path)
    job = read_job(tmp_path / "explored" / "job.toml")
    assert set(job.data[0].pressure) == {2e5} and set(job.data[0].temperature) == {300.0}
    assert job.free == {"gamma": fitting.Bounded(0.0, 1.0)}
    # It fits.
    found = fitting.fit(job.scene, job.data, job.free, max_steps=2, **job.options)
    assert np.isfinite(found.cost)


def test_no_job_without_points_or_moved_numbers(explorer_of):
    explorer = explorer_of("twin_guess")
    values = slider_values(explorer.sliders, {"gamma": 0.4})
    with pytest.raises(ValueError, match="no measured points; start the command with --data FILE"):
        fit_download(explorer, values)
    explorer = explorer_of("twin_guess", DATA / "twin_friction.csv")
    for moved in ({}, {"pressure": 2e5}, {"upper.material.frequencies": 2.0}):
        with pytest.raises(ValueError, match="no number that a fit can vary was moved"):
            fit_download(explorer, slider_values(explorer.sliders, moved))
