"""README's snippets and commands run, the API reference builds, and the wheel holds what it must."""

import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from support.folders import ROOT

import fitting
import rubberfric
from fitting.commands.main import main as fit_main
from rubberfric.commands.main import main as scene_main

README = (ROOT / "README.md").read_text()
SNIPPETS = re.findall(r"^```python\n(.*?)^```", README, re.M | re.S)
COMMANDS = re.findall(r"^    .*?\b((?:rubberfric|rubberfric-fit) .*)$", README, re.M)
LONG = ("rubberfric accuracy",)  # half a minute and more


@pytest.fixture
def in_a_copy(tmp_path, monkeypatch):
    """A working folder with the data beside it, where commands may write."""
    shutil.copytree(ROOT / "data", tmp_path / "data")
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("in_a_copy")
def test_snippets(capsys):
    assert len(SNIPPETS) >= 2
    names = {}
    for snippet in SNIPPETS:
        exec(compile(snippet, "README.md", "exec"), names)
    assert capsys.readouterr().out


@pytest.mark.usefixtures("in_a_copy")
@pytest.mark.parametrize(
    "command",
    [pytest.param(c, marks=[pytest.mark.slow] * c.startswith(LONG)) for c in dict.fromkeys(COMMANDS)],
)
def test_commands(command, call_main):
    program, *arguments = shlex.split(command)
    main = {"rubberfric": scene_main, "rubberfric-fit": fit_main}[program]
    status, printed, complaint = call_main(main, *arguments)
    assert status == 0, complaint
    assert printed
    for name in arguments:
        if name.endswith((".png", ".h5")):
            assert Path(name).stat().st_size > 1000


def test_files_that_are_named_exist():
    for name in re.findall(r"\]\(([\w./]+)\)", README):
        assert (ROOT / name).exists(), name


def test_api_reference(tmp_path):
    """Every public name has its page's entry, and its formulas are set as formulas."""
    pdoc = pytest.importorskip("pdoc", reason="needs pdoc, which is in the test extra")
    pdoc.render.configure(docformat="numpy", math=True, show_source=False)
    pdoc.pdoc(
        "rubberfric", "rubberfric.base.units", "fitting", "fitting.results.plot", output_directory=tmp_path
    )
    for package in (rubberfric, fitting):
        page = (tmp_path / f"{package.__name__}.html").read_text()
        for name in package.__all__:
            module = getattr(getattr(package, name), "__name__", "")  # has a page of its own
            own_page = tmp_path / f"{module.replace('.', '/')}.html"
            assert f'id="{name}"' in page or own_page.exists(), name
        assert ".. math::" not in page


def test_wheel(tmp_path):
    """Both packages with their py.typed, and nothing else."""
    source = tmp_path / "source"
    shutil.copytree(ROOT, source, ignore=shutil.ignore_patterns(".git", "*.egg-info", "build", "dist"))
    build = "from setuptools.build_meta import build_wheel; print(build_wheel('dist'))"
    done = subprocess.run([sys.executable, "-c", build], cwd=source, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (wheel,) = (source / "dist").glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    modules = {
        str(path.relative_to(ROOT))
        for name in ("rubberfric", "fitting")
        for path in (ROOT / name).rglob("*.py")
    }
    assert modules | {"rubberfric/py.typed", "fitting/py.typed"} <= set(names)
    others = set(names) - modules
    assert all(n.endswith("py.typed") or ".dist-info/" in n for n in others), others
