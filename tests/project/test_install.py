"""Installed files: both packages and nothing else; in a checkout, the checkout."""

import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile

import pytest
from support.folders import ROOT

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
    names = set(zipfile.ZipFile(built(source, "wheel")).namelist())
    assert needed() <= names
    assert all(".dist-info/" in name for name in names - needed()), names - needed()
    with tarfile.open(built(source, "sdist")) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert needed() | {"pyproject.toml", "README.md", "LICENSE"} <= names
    # Type checkers follow a path, an import hook they do not.
    wheel = zipfile.ZipFile(built(source, "editable"))
    names = [name for name in wheel.namelist() if ".dist-info/" not in name]
    assert len(names) == 1 and names[0].endswith(".pth"), names
    assert wheel.read(names[0]).decode().strip() == str(source)


def test_citation_is_of_this_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {rf.__version__}\n" in citation and f"\nlicense: {project['license']}\n" in citation
    assert all(f"  - {word}\n" in citation for word in project["keywords"])
    assert "arXiv:1506.06955" in citation
