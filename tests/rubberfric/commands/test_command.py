"""The command: output, files and plots; one line and status 2 for bad input."""

import importlib.metadata
import importlib.util
import os
import re

import jax
import numpy as np
import pytest
from support.cases.stored import slow_if, three
from support.folders import DATA, SCENE_FILES
from support.scenes.maps import FILE, MATERIAL

import rubberfric as rf
from fitting.commands.main import main as fit_main
from rubberfric.commands import main as command
from rubberfric.commands import run as run_command
from rubberfric.commands.run import convergence_line
from rubberfric.io.files import load_result
from rubberfric.io.results import Conditions, Result

# To compile.
LONG = {"tabulated_tread", "softened_tread_on_asphalt", "heated_tread_on_asphalt", "coated_base"}
LONG |= {"two_rubbers", "sheared_tread_on_asphalt", "rubber_seal", "rough_tread_on_asphalt"}


def test_table_result_and_plot_agree_with_solve(call, scene_file, tmp_path, numbers):
    out, picture = tmp_path / "r.h5", tmp_path / "r.png"
    status, printed, complaint = call("run", scene_file, "--out", out, "--plot", picture)
    assert (status, complaint) == (0, "")
    assert sorted(os.listdir(tmp_path)) == ["r.h5", "r.png", "scene.toml"]
    assert picture.read_bytes().startswith(b"\x89PNG\r\n")

    result = load_result(out)
    scene, v = rf.load_scene(scene_file), np.logspace(-3, 1, 5)[None, None]
    T, p = np.array([283.15, 293.15, 303.15])[:, None, None], np.array([1e5, 3e5])[None, :, None]
    expected = jax.jit(rf.solve)(scene, v, p, T)
    for got, want in zip(three(result.solution), three(expected), strict=True):
        assert got.shape == (3, 2, 5)
        np.testing.assert_allclose(got, want, rtol=1e-12)
    assert result.solution.viscoelastic_friction is None
    assert result.solution.shear_friction is None
    assert result.title == "Small scene"
    assert result.quadrature == rf.analysis.default_quadrature(scene, p)

    lines = printed.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0] == "Small scene"
    assert lines[2] == "pressure 0.1 MPa, temperature 283.15 K (10 °C)"
    assert lines[3].split() == ["v", "[m/s]", "A/A0", "[-]", "mu", "[-]", "u_bar", "[um]"]
    table = numbers(printed).reshape(3, 2, 5, 4)
    np.testing.assert_allclose(table[..., 0], np.broadcast_to(v, (3, 2, 5)), rtol=1e-4)
    for column, scale, values in zip((1, 2, 3), (1, 1, 1e6), three(expected), strict=True):
        np.testing.assert_allclose(table[..., column], scale * values, rtol=1e-5)

    # the result file is a scene file that gives the same result to the last bit
    status, printed_again, _ = call("run", out, "--out", tmp_path / "again.h5")
    assert (status, printed_again) == (0, printed)
    for x, y in zip(result.solution, load_result(tmp_path / "again.h5").solution, strict=True):
        np.testing.assert_array_equal(x, y)


SHEAR = (
    "[shear]\ntau_f0 = 6.5e6\nc = 0.1\nv0 = 6e-3\nshift = { kind = 'arrhenius', energy = 1, T_ref = 293 }\n"
)


def test_contact_shear_shows_in_table_result_and_plot(call, scene_file, tmp_path, numbers):
    out, picture = tmp_path / "r.h5", tmp_path / "r.png"
    scene_file.write_text(FILE.replace("[run]", SHEAR + "[run]"))
    status, printed, complaint = call("run", scene_file, "--out", out, "--plot", picture)
    assert (status, complaint) == (0, "")
    solution = load_result(out).solution
    solution = type(solution)(*(values for values in solution if values is not None))
    assert all(values.shape == (3, 2, 5) for values in solution[:5])
    total = solution.viscoelastic_friction + solution.shear_friction
    np.testing.assert_allclose(solution.friction, total, rtol=1e-15)
    assert np.all(solution.shear_friction > 0.1)

    lines = printed.splitlines()
    assert max(map(len, lines)) <= 80
    heading = "     v [m/s]     A/A0 [-]       mu [-]   u_bar [um]  mu_visc [-] mu_shear [-]"
    assert lines[3] == heading
    table = numbers(printed).reshape(3, 2, 5, 6)
    for column, (scale, values) in enumerate(zip((1, 1, 1e6, 1, 1), solution[:5], strict=True), start=1):
        np.testing.assert_allclose(table[..., column], scale * values, rtol=1e-5)

    # run again from the result and without shear; the rest is unchanged
    assert call("run", out) == (0, printed, "")
    scene_file.write_text(FILE)
    plain = numbers(call("run", scene_file)[1]).reshape(3, 2, 5, 4)
    np.testing.assert_allclose(plain[..., [0, 1, 3]], table[..., [0, 1, 3]], rtol=2e-5)
    np.testing.assert_allclose(plain[..., 2], table[..., 4], rtol=2e-5)


HEATING = "[heating]\ndensity = 1200.0\nheat_capacity = 1600.0\nconductivity = 0.23\nradius = 2e-3\n"


@pytest.mark.slow
def test_heat_shows_in_table_result_and_plot(call, refused, scene_file, tmp_path, numbers):
    out, picture = tmp_path / "r.h5", tmp_path / "r.png"
    text = FILE.replace("[run]", HEATING + "[run]")
    scene_file.write_text(text)
    status, printed, complaint = call("run", scene_file, "--out", out, "--plot", picture)
    assert (status, complaint) == (0, "")
    result = load_result(out)
    assert result.solution.converged.dtype == bool and result.solution.converged.all()
    rise = result.solution.flash_temperature - result.conditions.temperature[:, None, None]
    assert (rise >= 0).all() and rise.max() > 1e-3
    table = numbers(printed).reshape(3, 2, 5, 5)
    np.testing.assert_allclose(table[..., 4], result.solution.flash_temperature, rtol=1e-5)
    assert "did not converge" not in printed

    left = result.solution.converged.copy()
    left[0, 1, 2] = False
    note = convergence_line(result._replace(solution=result.solution._replace(converged=left)))
    assert note.startswith("the temperatures did not converge at 1 of 30 points, first at v = ")

    scene_file.write_text(text.replace("temperature", "# temperature"))
    assert "run.temperature is missing: a scene with heating requires" in refused("run", scene_file)


def test_no_viscoelastic_solid_no_friction(call, scene_file, numbers):
    elastic = 'material = { kind = "elastic", young = 1e7, poisson = 0.5 }'
    text = FILE.replace(MATERIAL, elastic).replace("temperature", "# temperature")
    scene_file.write_text(text.replace("[1e5, 3e5]", "1e5").replace('title = "Small scene"', ""))
    status, printed, _ = call("run", scene_file)
    assert status == 0
    assert printed.startswith("\npressure 0.1 MPa\n")
    assert np.all(numbers(printed)[:, 2] == 0)
    assert np.ptp(numbers(printed)[:, 1]) == 0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("h_rms = 1e-4", "h_rms = -1e-4", "lower.spectrum: SelfAffine.h_rms = -0.0001: must be >= 0"),
        ("[1e5, 3e5]", "[1e5, 0]", "scene.toml: run.pressure[1] = 0.0: must be > 0"),
        ("[upper]", "[upper", "scene.toml: is not TOML"),
    ],
)
def test_bad_scene(refused, scene_file, tmp_path, old, new, message):
    """One message of each reader; `tests/rubberfric/io/test_scene_files.py` has all."""
    assert old in FILE
    scene_file.write_text(FILE.replace(old, new))
    complaint = refused("run", scene_file, "--out", tmp_path / "r.h5", "--plot", tmp_path / "r.png")
    assert message in complaint
    assert complaint.startswith(f"rubberfric: {scene_file}: ")


def test_a_scene_without_conditions_has_default_ones(call, scene_file, tmp_path):
    rf.save_scene(tmp_path / "bare.toml", rf.load_scene(scene_file))
    status, printed, _ = call("run", tmp_path / "bare.toml", "--out", tmp_path / "bare.h5")
    assert status == 0
    stated = "default conditions: velocity 1e-06 ... 10 m/s, pressure 200000 Pa, temperature 293.15 K"
    assert printed.startswith(stated)
    result = rf.io.load_result(tmp_path / "bare.h5")
    v, p, T = result.conditions
    assert (v.size, float(p[0]), float(T[0])) == (29, 2e5, 293.15)
    expected = rf.solve(result.scene, v, p[0], T[0]).friction
    np.testing.assert_allclose(result.solution.friction[0, 0], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "COMMAND"),
        (("walk",), "invalid choice: 'walk'"),
        (("fit", "job.toml"), "'doctor'); fits and measured data have their own command: rubberfric-fit"),
        (("run",), "SCENE"),
        (("run", "scene.csv"), "scene.csv: suffix '.csv': must be .toml or .h5"),
        (("run", "scene.toml", "--out", "r.csv"), "r.csv: suffix '.csv': must be .h5"),
        (("run", "scene.toml", "--out", "no/r.h5"), "folder 'no' does not exist; create it first"),
        (("run", "scene.toml", "--plot", "r.jpeg2000"), "must be .png or .pdf or .svg"),
        (("run", "scene.toml", "--fast"), "unrecognized arguments: --fast"),
    ],
)
@pytest.mark.usefixtures("scene_file")
def test_bad_arguments(refused, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run_command, "solve", None)  # nothing may be computed
    assert message in refused(*arguments)


@pytest.mark.usefixtures("job")
@pytest.mark.parametrize(
    ("main", "program", "arguments"),
    [(command.main, "rubberfric", ("run", "scene.toml")), (fit_main, "rubberfric-fit", ("job.toml",))],
)
def test_plot_without_matplotlib_version_and_help(call_main, monkeypatch, main, program, arguments):
    assert call_main(main, "--version") == (0, f"{program} {importlib.metadata.version('rubberfric')}\n", "")
    status, printed, _ = call_main(main, *arguments[:-1], "--help")
    assert status == 0 and "--plot" in printed
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    status, printed, complaint = call_main(main, *arguments, "--plot", "r.png")
    assert (status, printed) == (2, "")
    expected = f"{program}: --plot needs matplotlib; install it with: pip install 'rubberfric[plot]'\n"
    assert complaint == expected


def test_values_that_are_not_finite(call, scene_file, tmp_path, monkeypatch):
    """Status 1, and no file."""

    def solve(_, velocity, pressure, temperature, **__):
        good = jax.numpy.asarray(velocity + pressure + temperature)
        return rf.Solution(good, good / (velocity - 1e-3), good)

    monkeypatch.setattr(run_command, "solve", solve)
    status, printed, complaint = call("run", scene_file, "--out", tmp_path / "r.h5")
    assert (status, printed, complaint.count("\n")) == (1, "", 1)
    assert "friction = inf at v = 0.001 m/s, p = 100000 Pa: not finite" in complaint
    assert os.listdir(tmp_path) == ["scene.toml"]


@pytest.mark.parametrize("path", slow_if(LONG.__contains__, {path.stem: path for path in SCENE_FILES}))
def test_scenes_of_the_data_folder(call, path, tmp_path):
    scene = rf.load_scene(path)
    text = re.sub(r"points = \d+", "points = 3", path.read_text(encoding="utf-8"))
    short = tmp_path / "short.toml"
    short.write_text(re.sub(r'file = "', f'file = "{path.parent.as_posix()}/', text), encoding="utf-8")
    status, _, complaint = call("run", short, "--out", tmp_path / "r.h5")
    assert (status, complaint) == (0, "")
    result = load_result(tmp_path / "r.h5")
    if scene.adhesion is not None:  # at rest, and of no separation; it may close the contact
        assert np.all((result.solution.area > 0) & (result.solution.area <= 1) & result.solution.converged)
        return
    assert np.all((result.solution.area > 0) & (result.solution.area < 1))
    assert np.all(result.solution.friction > 0)
    assert np.all(result.solution.separation > 0)
    assert type(result.scene.upper.material) is type(scene.upper.material)


@pytest.mark.slow
def test_a_tabulated_scene_says_how_much_lies_outside_its_table(call):
    status, printed, _ = call("run", DATA / "tabulated_tread.toml")
    (line,) = [line for line in printed.splitlines() if line.endswith("outside the tabulated moduli")]
    assert status == 0
    assert line.startswith("at most ")
    assert "% of mu comes" in line
    assert "outside" not in call("run", DATA / "thin_layer.toml")[1]
    scene = rf.load_scene(DATA / "tabulated_tread.toml")
    sheared = rf.Scene(scene.lower, scene.upper, shear=rf.ContactShear(6.5e6, 0.1, 6e-3))
    conditions = Conditions(np.array([1e-3]), np.array([1e5]), None)
    notes = [
        run_command.extrapolation_line(Result(s, conditions, rf.Solution(), rf.Quadrature()))
        for s in (scene, sheared)
    ]
    assert notes[1] == notes[0].replace("of mu", "of the viscoelastic mu")
