"""A small job of rubberfric-fit."""

import numpy as np
import pytest
from support.scenes.job import JOB, SCENE

import fitting
import rubberfric as rf


@pytest.fixture
def job(tmp_path, monkeypatch):
    """A job file with its scene and data in the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "job.toml").write_text(JOB)
    omega = np.logspace(0, 7, 10)
    E = np.asarray(rf.complex_modulus(rf.Prony(1e6, [1e8, 1e7], [1e-6, 1e-4]), omega))
    noise = np.exp(0.03 * np.random.default_rng(0).standard_normal((2, 10)))
    fitting.write("modulus.csv", fitting.ModulusData(omega, E.real * noise[0], E.imag * noise[1]))
    v = np.logspace(-3, 1, 5)
    fitting.write("friction.h5", fitting.FrictionData(v, 0.1 + 0.01 * v, pressure=1e5, name="own"))
    (tmp_path / "friction.csv").write_text("v,mu\nm/s,-\n1e-2,0.1\n1e-1,0.2\n")
    return tmp_path / "job.toml"
