"""`rubberfric-fit job`: files that it writes or keeps, and scenes that it refuses."""

import os
import tomllib
from pathlib import Path

import numpy as np
import pytest

import rubberfric as rf
from fitting.commands.job import read_job
from rubberfric.commands.main import main as scene_main

RUBBER = """{ kind = "prony", E_inf = 1e6, E = [1e8, 1e7], tau = [1e-6, 1e-4], shift = { kind = "wlf",\
 C1 = 12.0, C2 = 150.0, T_ref = 293.15 } }""".replace("\\\n", "")
SCENE = f"""# Rubber of the second batch
title = "Tread"

[lower]
material = {{ kind = "rigid" }}
spectrum = {{ kind = "self_affine", q0 = 100, qr = 1000, q1 = 1e4, hurst = 0.8, h_rms = 1e-4 }}  # stylus

[upper]
material = {RUBBER}

[run]
velocity = [1e-3, 1e-2]  # the tester
pressure = 2e5
temperature = 293.15

[map]
velocity = [1e-4, 1.0]
pressure = [1e5, 3e5]
temperature = 293.15
"""
FRICTION = "v,mu,p,T\nm/s,-,Pa,K\n" + "".join(f"1e-{k},0.{9 - k},2e5,300\n" for k in range(1, 7))
SMOOTH = SCENE.replace("spectrum =", "# spectrum =")
ELASTIC = SCENE.replace(RUBBER, '{ kind = "elastic", young = 1e7, poisson = 0.5 }').replace(
    "temperature", "# temperature"
)


@pytest.fixture
def run(run):
    """Run a command in a folder with a scene and friction: status, stdout, stderr."""
    Path("a_scene.toml").write_text(SCENE)
    Path("friction.csv").write_text(FRICTION)
    return run


def contents():
    return {name: Path(name).read_bytes() for name in os.listdir()}


def test_the_scene_of_a_job_keeps_title_comments_and_conditions(run):
    assert run("job", "a_scene.toml", "friction.csv", "--shear", "--out", "job.toml")[0] == 0
    new, old = Path("job_scene.toml").read_text(), tomllib.loads(SCENE)
    for line in SCENE.splitlines():
        assert line in new
    read = tomllib.loads(new)
    assert {name: read[name] for name in old} == old
    assert read["shear"]["tau_f0"] == 5e6
    assert Path("a_scene.toml").read_text() == SCENE


@pytest.mark.parametrize("existing", ["file", "link", "folder"])
def test_a_file_that_the_user_has_not_named_is_not_overwritten(run, existing):
    """The name of the new scene follows from --out; here the input has this name."""
    other = Path("a_scene.toml") if existing == "file" else Path("b_scene.toml")
    if existing == "link":
        other.symlink_to("a_scene.toml")
    if existing == "folder":
        other.mkdir()
    before = Path("a_scene.toml").read_bytes()
    out = f"{other.name[0]}.toml"
    status, printed, _ = run("job", "a_scene.toml", "friction.csv", "--shear", "--out", out)
    assert status == 0 and f'scene = "{other.stem}_2.toml"' in printed
    assert Path("a_scene.toml").read_bytes() == before
    assert rf.load_scene(f"{other.stem}_2.toml").shear is not None
    # A second job leaves the scene of the first one.
    scenes = {path: path.read_bytes() for path in Path().glob("*scene*") if path.is_file()}
    assert run("job", "a_scene.toml", "friction.csv", "--shear", "--out", out)[0] == 0
    assert f'scene = "{other.stem}_3.toml"' in Path(out).read_text()
    assert {path: path.read_bytes() for path in scenes} == scenes


def test_a_job_keeps_the_options_for_reading_its_data(run):
    Path("odd.txt").write_text("1 0.1 2 300\n10 n/a 2 300\n100 0.2 2 300\n1000 0.2 2 300\n10000 0.3 2 300\n")
    columns = ["v [um/s]", "mu", "p [bar]", "T [K]"]
    given = ("--columns", *columns, "--bad-rows", "drop", "--kind", "friction", "--relative", "0.05")
    with pytest.warns(UserWarning, match="odd.txt"):
        status, printed, complaint = run("job", "a_scene.toml", "odd.txt", *given, "--out", "job.toml")
    assert (status, complaint) == (0, "")
    (data,) = tomllib.loads(printed)["data"]
    assert data == {
        "file": "odd.txt",
        "columns": columns,
        "bad_rows": "drop",
        "kind": "friction",
        "relative": 0.05,
    }
    with pytest.warns(UserWarning, match="odd.txt"):
        (read,) = read_job("job.toml").data
    np.testing.assert_allclose(read.velocity, [1e-6, 1e-4, 1e-3, 1e-2], rtol=1e-12)
    np.testing.assert_allclose(read.pressure, 2e5)


@pytest.mark.parametrize(
    ("scene", "options", "message"),
    [
        (SMOOTH, (), "a_scene.toml: has no roughness, so that the contact is complete: add a spectrum"),
        (SMOOTH, ("--shear",), "has no roughness"),
        (SMOOTH, ("--free", "upper.material.E_inf"), "has no roughness"),
        (ELASTIC, (), "the scene has no friction; a rough solid must face a viscoelastic one, or"),
    ],
)
def test_a_scene_without_roughness_or_friction_is_refused(run, scene, options, message):
    Path("a_scene.toml").write_text(scene)
    before = contents()
    status, printed, complaint = run("job", "a_scene.toml", "friction.csv", *options, "--out", "job.toml")
    assert (status, printed, complaint.count("\n")) == (2, "", 1) and message in complaint
    assert contents() == before


@pytest.mark.parametrize(
    ("scene", "text"),
    [
        (SMOOTH, "the scene has no roughness: the contact is complete, and the friction is 0"),
        (ELASTIC, "friction is 0: no rough solid faces a viscoelastic one, and there is no contact shear"),
        (SCENE, None),
    ],
)
@pytest.mark.parametrize("command", ["run", "map"])
def test_the_computed_scene_says_so(call_main, tmp_path, command, scene, text):
    (tmp_path / "scene.toml").write_text(scene)
    status, printed, _ = call_main(scene_main, command, tmp_path / "scene.toml")
    assert status == 0
    assert text in printed if text else "roughness" not in printed


@pytest.mark.usefixtures("run")
def test_keys_of_data_in_a_job():
    """`area`, `frequency` and `block` give the numbers that the tables lack."""
    Path("forces.csv").write_text("v [mm/s],Fn [N],Ft [N]\n1,100,70\n10,200,160\n")
    Path("ramp.csv").write_text("T [C],E' [MPa],E'' [MPa]\n-20,300,60\n0,40,12\n20,8,1\n")
    Path("beside.csv").write_text(
        "sample A,,,sample B,,\nf,E',E'',f,E',E''\nHz,MPa,MPa,Hz,MPa,MPa\n1,5,1,1,7,2\n10,6,2,10,9,3\n"
    )
    Path("job.toml").write_text(
        """scene = "a_scene.toml"
[[data]]
file = "forces.csv"
area = 1e-3
temperature = 293.15
relative = 0.05
[[data]]
file = "ramp.csv"
frequency = 10
relative = 0.05
[[data]]
file = "beside.csv"
block = 2
temperature = 293.15
relative = 0.05
[free]
"upper.material.E_inf" = "positive"
"""
    )
    forces, ramp, beside = read_job("job.toml").data
    np.testing.assert_allclose(forces.pressure, [1e5, 2e5], rtol=1e-12)  # F_n / area
    np.testing.assert_allclose(forces.friction, [0.7, 0.8], rtol=1e-12)
    np.testing.assert_allclose(ramp.omega, 20 * np.pi, rtol=1e-12)
    np.testing.assert_allclose(ramp.temperature, [253.15, 273.15, 293.15], rtol=1e-12)
    np.testing.assert_allclose(ramp.storage, [3e8, 4e7, 8e6], rtol=1e-12)
    np.testing.assert_allclose(beside.storage, [7e6, 9e6], rtol=1e-12)
    np.testing.assert_allclose(beside.loss, [2e6, 3e6], rtol=1e-12)
