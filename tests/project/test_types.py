"""Types: a checker finds no error in the snippets of pages, and finds wrong keywords.

The packages themselves are its own run's: `basedpyright`.
"""

import ast
import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest
from support.folders import RECIPE, ROOT, SNIPPETS

PACKAGES = ("rubberfric", "fitting")
# Every line that says so is wrong, no other one is.
WRONG = """\
import fitting
import rubberfric as rf

rf.Prony(E_inf=3e6, E=[1e7], tau=[1e-3])
rf.Prony(E_infty=3e6, E=[1e7], tau=[1e-3])  # wrong
rf.Slab(thickness=1e-3, base="bonded")
rf.Slab(depth=1e-3)  # wrong
road = rf.SelfAffine(q0=1e2, qr=1e3, q1=1e5, hurst=0.8, h_rms=1e-4)
road.height  # wrong
scene = rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(rf.Elastic(1e7, 0.5)))
rf.friction(scene, velocity=1.0, pressure=1e5)
rf.friction(scene, speed=1.0, pressure=1e5)  # wrong
rf.fraction(scene, velocity=1.0, pressure=1e5)  # wrong
fitting.FrictionData(velocity=[1.0], friction=[0.5], pressure=1e5)
fitting.FrictionData(velocity=[1.0], mu=[0.5], pressure=1e5)  # wrong
"""


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """Return the output of basedpyright for the snippets of pages and for wrong.py."""
    checker = shutil.which("basedpyright", path=Path(sys.executable).parent) or shutil.which("basedpyright")
    if checker is None:
        pytest.skip("needs basedpyright, which is in the test extra")
    folder = tmp_path_factory.mktemp("types")
    (folder / "README.py").write_text("\n".join(SNIPPETS))
    (folder / "CONTRIBUTING.py").write_text(RECIPE)
    (folder / "wrong.py").write_text(WRONG)
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["basedpyright"]
    settings["include"] = [str(folder)]
    (folder / "pyrightconfig.json").write_text(json.dumps(settings | {"extraPaths": [str(ROOT)]}))
    command = [checker, "--outputjson", "--pythonpath", sys.executable, "-p", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr  # 1: there are errors
    report = json.loads(done.stdout)
    assert report["summary"]["filesAnalyzed"] == 3
    return report["generalDiagnostics"]


def messages(errors, start):
    """Errors in files of a name or below a folder."""
    return [
        f"{error['file']}:{error['range']['start']['line'] + 1}: {error['message'].splitlines()[0]}"
        for error in errors
        if error["severity"] == "error"
        if Path(error["file"]).name == start
    ]


@pytest.mark.parametrize("start", ["README.py", "CONTRIBUTING.py"])
def test_no_errors(errors, start):
    found = messages(errors, start)
    assert not found, "\n" + "\n".join(found)


def test_wrong_keywords_are_errors(errors):
    lines = {int(message.split("wrong.py:")[1].split(":")[0]) for message in messages(errors, "wrong.py")}
    assert lines == {i for i, line in enumerate(WRONG.splitlines(), 1) if line.endswith("# wrong")}


class Missing(NamedTuple):
    """Return place, number of types and missing types of a public function."""

    place: str
    needed: int
    lacking: list[str]


def public_functions(path):
    """Public functions and methods of public classes of a module."""
    for node in ast.parse(path.read_text()).body:
        inside = node.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_") else []
        for function in (node, *inside):
            if isinstance(function, ast.FunctionDef) and (
                not function.name.startswith("_") or function.name in ("__init__", "__call__")
            ):
                yield function, function is not node


def lacking(path, function, is_method):
    static = any(ast.unparse(x) == "staticmethod" for x in function.decorator_list)
    a = function.args
    given = [*a.posonlyargs, *a.args][1 if is_method and not static else 0 :]
    given += [*a.kwonlyargs, *filter(None, (a.vararg, a.kwarg))]
    found = [x.arg for x in given if x.annotation is None]
    found += ["return"] * (function.returns is None and function.name != "__init__")
    place = f"{path.relative_to(ROOT)}:{function.lineno} {function.name}"
    return Missing(place, len(given) + (function.name != "__init__"), found)


@pytest.mark.parametrize("package", PACKAGES)
def test_public_functions_are_annotated(package):
    found = [
        lacking(path, function, is_method)
        for path in sorted((ROOT / package).rglob("*.py"))
        if not path.name.startswith("_") or path.name == "__init__.py"
        for function, is_method in public_functions(path)
    ]
    needed, absent = sum(x.needed for x in found), sum(len(x.lacking) for x in found)
    assert needed > 100
    text = "\n".join(f"{x.place}: {', '.join(x.lacking)}" for x in found if x.lacking)
    assert not absent, f"{package}: {absent} of {needed} types are missing\n{text}"
