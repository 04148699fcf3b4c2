"""Installed files: both packages, and the data of README's commands; in a checkout, the checkout."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile

import pytest
from support.folders import DATA, ROOT

import rubberfric as rf

PACKAGES = ("rubberfric", "fitting")
PAGE = "rubberfric/commands/explorer/page"
BUILD = """
import sys
from setuptools import build_meta
print(getattr(build_meta, f"build_{sys.argv[1]}")("dist"))
"""


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A copy of the project, which building does not change."""
    folder = tmp_path_factory.mktemp("source") / "project"
    left = shutil.ignore_patterns(".git", "*.egg-info", "build", "dist", "__pycache__", ".*_cache")
    shutil.copytree(ROOT, folder, ignore=left)
    return folder


def built(source, kind):
    """Return the path of the wheel of the build back end."""
    shutil.rmtree(source / "dist", ignore_errors=True)
    command = [sys.executable, "-c", BUILD, kind]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (path,) = (source / "dist").iterdir()
    return path


def needed():
    """All modules of the packages, what tells type checkers that they are typed, and the explorer's page."""
    page = {f"{PAGE}/{name}" for name in ("page.html", "style.css", "plots.js", "page.js")}
    modules = {str(path.relative_to(ROOT)) for name in PACKAGES for path in (ROOT / name).rglob("*.py")}
    assert any(name.count("/") > 2 for name in modules)
    return modules | page | {f"{name}/py.typed" for name in PACKAGES}


def test_built_packages(source):
    version = f"rubberfric-{rf.__version__}"
    files = (path for path in DATA.rglob("*") if path.suffix in (".toml", ".csv", ".txt"))
    data = {str(path.relative_to(ROOT)) for path in files}
    assert {"data/tread_on_asphalt_fit.toml", "data/laboratory/strain_sweep.txt"} <= data
    shared = f"{version}.data/data/share/rubberfric/"
    wheel = zipfile.ZipFile(built(source, "wheel"))
    names = set(wheel.namelist())
    assert needed() | {shared + name for name in data} <= names
    assert all(name.startswith((f"{version}.dist-info/", shared)) for name in names - needed())
    metadata = wheel.read(f"{version}.dist-info/METADATA").decode()
    assert all(f"\nClassifier: Programming Language :: Python :: 3.{n}\n" in metadata for n in (11, 12, 13))
    with tarfile.open(built(source, "sdist")) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert needed() | data | {"pyproject.toml", "README.md", "LICENSE", "tests/conftest.py"} <= names
    # Type checkers follow a path, an import hook they do not.
    wheel = zipfile.ZipFile(built(source, "editable"))
    names = [name for name in wheel.namelist() if ".dist-info/" not in name]
    assert len(names) == 1 and names[0].endswith(".pth"), names
    assert wheel.read(names[0]).decode().strip() == str(source)


def test_hosted_checks_run_what_runs_by_hand():
    text = (ROOT / ".github/workflows/ci.yml").read_text()
    assert re.findall(r"\brun: *(\S.*)$", text, re.M) == [".ci/run"]
    assert os.access(ROOT / ".ci/run", os.X_OK)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    versions = [re.search(r":: (3\.\d+)$", line) for line in project["classifiers"]]
    assert re.findall(r"3\.\d+", text) == [found[1] for found in versions if found]
    site = (ROOT / ".readthedocs.yaml").read_text()
    (extra,) = re.findall(r"extra_requirements: \[(\w+)\]", site)
    (path,) = re.findall(r"configuration: (\S+)", site)
    assert extra in project["optional-dependencies"] and (ROOT / path).exists()
