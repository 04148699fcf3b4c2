"""Packages with lazy names: all names exist, and JAX is not imported early."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest
from support.folders import PYTHONPATH, ROOT

ROOMS = ("base", "materials", "roughness", "scene", "io", "analysis", "plot", "commands")
PACKAGES = ("rubberfric", *(f"rubberfric.{room}" for room in ROOMS), "fitting")


def for_checkers(package):
    """Return name -> module of the imports for type checkers, which mark public names."""
    path = ROOT / package.replace(".", "/") / "__init__.py"
    (block,) = (node for node in ast.parse(path.read_text()).body if isinstance(node, ast.If))
    imports = [(one.module, alias.name) for one in block.body for alias in one.names]
    assert all(alias.asname == alias.name for one in block.body for alias in one.names)
    assert len({name for _, name in imports}) == len(imports)
    return {name: place for place, name in imports}


@pytest.mark.parametrize("package", PACKAGES)
def test_names_are_those_that_checkers_see(package):
    module, seen = importlib.import_module(package), for_checkers(package)
    assert sorted(seen) == sorted(module.__all__) == dir(module)
    for name, place in seen.items():
        exec(f"from {place} import {name} as found", here := {})
        assert getattr(module, name) is here["found"], name


def test_a_function_is_not_hidden_by_the_module_of_its_name():
    program = "import fitting.fit, fitting.data; import fitting as f; assert callable(vars(f)['fit'])\n"
    program += "from fitting.fit import fit\n"
    program += "from fitting import fit as again\nassert f.fit is fit is again and callable(fit)\n"
    program += "import rubberfric as rf; assert rf.scene.Scene is rf.Scene and rf.theory.solve is rf.solve"
    subprocess.run([sys.executable, "-c", program], check=True, cwd=ROOT)


SECOND_NAME = """
import sys
import rubberfric as rf
from rubberfric import fitting as again
assert "fitting" not in sys.modules and "jax" not in sys.modules
from rubberfric.fitting import FrictionData
import fitting, rubberfric.fitting
assert rf.fitting is again is rubberfric.fitting and FrictionData is fitting.FrictionData
assert all(getattr(again, name) is getattr(fitting, name) for name in fitting.__all__)
assert dir(again) == dir(fitting) == again.__all__ and not hasattr(again, "__path__")
"""


def test_second_name_of_fitting():
    subprocess.run([sys.executable, "-c", SECOND_NAME], check=True, cwd=ROOT)


def test_a_folder_of_the_user_that_hides_fitting(tmp_path):
    (tmp_path / "fitting").mkdir()
    (tmp_path / "fitting" / "__init__.py").write_text("")
    program = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]\nimport rubberfric as rf\n"
    program += "rf.fitting.fit"
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert "ImportError" in done.stderr and "hides the package fitting of rubberfric: rename" in done.stderr


@pytest.mark.parametrize("name", ["nothing", "_nothing", "__wrapped__"])
def test_what_is_not_there(name):
    with pytest.raises(AttributeError, match=f"module 'fitting' has no attribute '{name}'"):
        getattr(importlib.import_module("fitting"), name)


LIGHT = """
import sys
{imports}
heavy = {{"jax", "numpy", "scipy", "h5py", "matplotlib"}} & set(sys.modules)
assert not heavy, heavy
"""


@pytest.mark.parametrize(
    "imports",
    [
        "import rubberfric, fitting, rubberfric.base",
        "from rubberfric.commands.main import main; main(['--version'])",
        "from rubberfric.commands.main import main; assert main(['run', 'no.toml']) == 2",
        "from fitting.commands.main import main; assert main(['--help']) == 0",
    ],
)
def test_without_jax(imports):
    done = subprocess.run(
        [sys.executable, "-c", LIGHT.format(imports=imports)], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_a_reader_of_objects_knows_all_classes():
    program = "from rubberfric.io import read_object; from rubberfric.base.objects.physical import _CLASSES\n"
    program += "assert {'Prony', 'Coating', 'TabulatedAnisotropic', 'Softening', 'Scene'} <= set(_CLASSES)"
    subprocess.run([sys.executable, "-c", program], check=True, cwd=ROOT)


EVERY = """
import importlib, sys
for name in sys.argv[1:]:
    for old in [old for old in sys.modules if old.split(".")[0] in ("rubberfric", "fitting")]:
        del sys.modules[old]
    importlib.import_module(name)
"""


@pytest.mark.slow
def test_every_module_can_be_the_first():
    modules = [
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for package in ("rubberfric", "fitting")
        for path in sorted(Path(ROOT / package).rglob("*.py"))
    ]
    done = subprocess.run(
        [sys.executable, "-c", EVERY, *modules],
        env={"PYTHONPATH": PYTHONPATH},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
