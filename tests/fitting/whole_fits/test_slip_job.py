"""A job with a table of a wheel tester and a scene with a patch."""

from pathlib import Path

import numpy as np
from support.scenes.fits import JOB_SCENE

import fitting
import rubberfric as rf
from fitting.commands.job import read_job
from fitting.commands.main import main

SCENE = f"""{JOB_SCENE}
[shear]
tau_f0 = 6e5
c = 0.1
v0 = 1e-2

[patch]
length = 0.1
width = 0.1
stiffness = 3e7
pressure = "uniform"
"""
JOB = """
scene = "tyre.toml"

[[data]]
file = "drum.csv"
relative = 0.03

[free]
"patch.stiffness" = { rule = "positive", start = 1e7 }
"shear.tau_f0" = { rule = "positive", start = 2e5 }
"""


def test_a_wheel_tester(call_main, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("tyre.toml").write_text(SCENE)
    Path("job.toml").write_text(JOB)
    scene, angle = rf.load_scene("tyre.toml"), np.linspace(0.5, 12.0, 10)
    force = rf.grip(scene, scene.patch, np.radians(angle), 5.0, 2e3).force
    rows = [
        f"{a!r},18,2,{-f / 1e3!r}" for a, f in zip(angle.tolist(), np.asarray(force).tolist(), strict=True)
    ]
    titles = "slip angle [deg],speed [km/h],load [kN],side force [kN]"
    Path("drum.csv").write_text("\n".join([titles, *rows]))
    status, printed, complaint = call_main(
        main, "job.toml", "--out", "fit.h5", "--plot", "fit.png", "--no-cache"
    )
    assert (status, complaint) == (0, "")
    assert "1: force, 10 points: 10 values" in printed
    # A job for the same data frees the stiffness of the patch.
    assert call_main(main, "job", "tyre.toml", "drum.csv", "--out", "again.toml")[0] == 0
    assert '"patch.stiffness" = "positive"' in Path("again.toml").read_text()
    fitted = fitting.FitResult.load("fit.h5").scene
    assert abs(fitted.patch.stiffness / 3e7 - 1) < 1e-5
    assert abs(fitted.shear.tau_f0 / 6e5 - 1) < 1e-5


def test_forces_and_moments_of_one_table(call_main, tmp_path, monkeypatch):
    """The forces get the error of the option. The moments have their own."""
    monkeypatch.chdir(tmp_path)
    Path("tyre.toml").write_text(SCENE)
    titles = "slip angle [deg],speed [km/h],load [N],side force [N],Mz [N mm],sigma_moment [N mm]"
    Path("lat100.csv").write_text(f"{titles}\n2,3.6,75,-40,90,3\n4,3.6,75,-60,80,3\n")
    options = ("--kind", "force", "moment", "--relative", "0.03", "--out", "job.toml")
    status, printed, complaint = call_main(main, "job", "tyre.toml", "lat100.csv", *options)
    assert (status, complaint) == (0, "")
    forces, moments = read_job("job.toml").data
    np.testing.assert_allclose([forces.force, forces.relative], [[40, 60], [0.03, 0.03]])
    np.testing.assert_allclose([np.abs(moments.moment), moments.sigma], [[0.09, 0.08], [3e-3, 3e-3]])
    for name in ("patch.stiffness", "patch.length"):
        assert printed.count(f'"{name}" = "positive"') == 1
    Path("drum.csv").write_text("slip angle [deg],speed [km/h],load [N],side force [N]\n2,3.6,75,-40\n")
    status, _, complaint = call_main(
        main, "job", "tyre.toml", "drum.csv", "--kind", "force", "moment", "--out", "other.toml"
    )
    assert status == 2 and "no column moment: the table" in complaint and not Path("other.toml").exists()
