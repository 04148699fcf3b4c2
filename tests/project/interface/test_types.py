"""Types: checkers find no error in the snippets of pages, and find mistakes of users.

The packages themselves are its own run's: `basedpyright`.
"""

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple, get_args, get_overloads, get_type_hints

import pytest
from support.folders import PAGE_SNIPPETS, RECIPE, ROOT, SNIPPETS

from fitting.data.files import read
from fitting.data.kinds import KINDS

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
# Forty lines of a user with ten mistakes.
USER = """\
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from rubberfric import fitting

folder = Path("laboratory")
sweeps = fitting.read(folder / "sweeps.csv", kind="modulus", poisson=0.5)
curve = fitting.fit_master_curve(sweeps, reference=293.15)
fitting.read(folder / "sweeps.csv", kind="modulos")  # wrong: unknown kind
heights = rf.fitting.read(folder / "road.csv", kind="spectrum", normalisation="C")
fit = rf.fitting.fit_spectrum(heights)
fitting.fit_master_curve(heights)  # wrong: a spectrum has no isotherms
fitting.fit_prony(fitting.read("relaxation.h5", kind="relaxation"), tau=(1e-6, 1e-3))
tread = rf.Prony(3e6, E=[1e8, 1e7], tau=np.array([1e-6, 1e-3]), shift=rf.WLF(12.0, 150.0, 293.15))
rf.Prony(E_inf=3e6, E=[1e8], taus=[1e-6])  # wrong: the argument is tau
rf.SelfAffine(q0=1e2, qr=1e3, q1=1e6, hurst=0.8)  # wrong: h_rms is missing
rf.SelfAffine(q0=1e2, qr=1e3, q1=1e6, hurst="0.8", h_rms=1e-4)  # wrong: a text
road = rf.SelfAffine(q0=1e2, qr=1e3, q1=1e6, hurst=jnp.asarray(0.8), h_rms=1e-4)
scene = rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(tread))
rf.Body(road, rf.Rigid())  # wrong: the material comes first
velocity, pressure = [0.01, 0.1, 1], (2e5,)
mu = rf.friction(scene, velocity, pressure, temperature=303.15)
rf.friction(scene, velocity, "2 bar")  # wrong: a text
rf.friction(velocity, scene, pressure)  # wrong: the scene comes first
solution = rf.solve(scene, np.logspace(-3, 0, 4), [[1e5], [2e5]])
area, friction = rf.solve(scene, 1.0, 2e5)  # wrong: there are more than two results
slope = eqx.filter_grad(lambda one: rf.friction(one, 0.1, 2e5))(scene)
slopes = jax.jit(jax.grad(lambda one: rf.friction(one, 0.1, 2e5)))(scene)
data = fitting.read("friction.csv")
result = fitting.fit(scene, data, {"lower.spectrum.hurst": fitting.Bounded(0.5, 1.0)}, starts=4)
fitting.fit(scene, data, {"gamma": (0.3, 0.7)})  # wrong: a tuple is no constraint
points = fitting.FrictionData([0.01, 0.1], (0.8, 0.9), pressure=2e5, relative=0.05)
print(result.report(), float(mu[0]), solution.area.shape, rf.rms_slope(road) + 0.1, curve.shift)
print(rf.power_spectrum(road, [1e3, 1e4]), rf.complex_modulus(tread, [1.0], 300), slope, slopes)
points.write(folder / "points.csv")
"""


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """Return the output of basedpyright for the snippets of pages and for wrong.py."""
    checker = shutil.which("basedpyright", path=Path(sys.executable).parent) or shutil.which("basedpyright")
    if checker is None:
        pytest.skip("needs basedpyright, which is in the test extra")
    folder = tmp_path_factory.mktemp("types")
    (folder / "README.py").write_text(
        "\n".join(SNIPPETS + PAGE_SNIPPETS["how_true"] + PAGE_SNIPPETS["troubleshooting"])
    )
    (folder / "CONTRIBUTING.py").write_text(RECIPE)
    (folder / "wrong.py").write_text(WRONG)
    (folder / "user.py").write_text(USER)
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["basedpyright"]
    settings["include"] = [str(folder)]
    (folder / "pyrightconfig.json").write_text(json.dumps(settings | {"extraPaths": [str(ROOT)]}))
    command = [checker, "--outputjson", "--pythonpath", sys.executable, "-p", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr  # 1: there are errors
    report = json.loads(done.stdout)
    assert report["summary"]["filesAnalyzed"] == 4
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


def wrong_lines(text):
    return {i for i, line in enumerate(text.splitlines(), 1) if "# wrong" in line}


@pytest.mark.parametrize(("name", "text"), [("wrong.py", WRONG), ("user.py", USER)])
def test_mistakes_are_errors(errors, name, text):
    lines = {int(message.split(f"{name}:")[1].split(":")[0]) for message in messages(errors, name)}
    assert lines == wrong_lines(text)


@pytest.mark.slow
def test_mypy_finds_the_same_mistakes(tmp_path):
    """Mypy is in no extra: `uv pip install mypy` before this test."""
    mypy = shutil.which("mypy")
    if mypy is None:
        pytest.skip("needs mypy")
    (tmp_path / "user.py").write_text(USER)
    command = [mypy, "--follow-imports=silent", f"--python-executable={sys.executable}", "user.py"]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    lines = {int(line) for line in re.findall(r"^user\.py:(\d+): error", done.stdout, re.M)}
    assert lines == wrong_lines(USER), done.stdout + done.stderr


def test_forty_lines_have_ten_mistakes():
    assert len(USER.splitlines()) == 40 and len(wrong_lines(USER)) == 10


def test_overloads_of_read_have_all_kinds():
    found = {}
    for overload in get_overloads(read):
        hints = get_type_hints(overload)
        found |= dict.fromkeys(get_args(hints["kind"]), hints["return"])
    assert found == KINDS


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
