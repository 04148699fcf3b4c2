"""Output of `rubberfric doctor`."""

import argparse
import importlib.metadata
import re
import subprocess
import sys

import jax
from support.folders import ROOT
from support.processes.signals import PROGRAM

from rubberfric.commands import doctor


def test_versions_devices_and_programs(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format("rubberfric", ""), "doctor"],
        env={"PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    for name in ("jax", "jaxlib", "numpy", "scipy", "h5py"):
        assert re.search(rf"^{name} +{re.escape(importlib.metadata.version(name))}$", done.stdout, re.M)
    assert re.search(r"^float64 +yes$", done.stdout, re.M)
    assert re.search(rf"^cache +\S+ MB in {tmp_path}/rubberfric/jaxlib-", done.stdout, re.M)
    assert "first compilation: miss; second: hit" in done.stdout
    assert "FAULT" not in done.stdout and "jax#38445" not in done.stdout


def test_known_faults(monkeypatch, tmp_path):
    said = "\n".join(doctor._lines(argparse.Namespace(no_cache=True)))
    assert "not used: --no-cache" in said and "FAULT" not in said
    monkeypatch.setattr(jax, "__version__", "0.10.2")
    said = "\n".join(doctor._lines(argparse.Namespace(no_cache=True)))
    assert "FAULT        jax 0.10.2: it computes wrong numbers on processors (jax-ml/jax#39103)" in said
    monkeypatch.setattr(doctor, "compilation_cache", lambda: tmp_path)
    monkeypatch.setattr(doctor, "_is_found", lambda: False)
    said = "\n".join(doctor._lines(argparse.Namespace(no_cache=False)))
    assert "miss; second: miss" in said and "jax-ml/jax#38445" in said
    monkeypatch.setattr(doctor, "compilation_cache", lambda: None)
    said = "\n".join(doctor._lines(argparse.Namespace(no_cache=False)))
    assert "not used: its folder cannot be written to" in said

    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    assert doctor._version("jax") == "is importable, but not installed"
    assert doctor._version("no_such_package") == "is not installed"
