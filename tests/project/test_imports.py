"""Imports of all modules keep the rules of `support.import_rules`, which find their violations."""

import ast

import pytest
from support.folders import ROOT
from support.import_rules import (
    RULES,
    House,
    across,
    circles,
    crowded,
    private,
    rooms_without_a_floor,
    through_the_door,
    upward,
)


@pytest.fixture(scope="module")
def house():
    return House(ROOT)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_imports(house, rule):
    assert len(house.imports) > 300
    found = rule(house)
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize("folder", ["rubberfric", "fitting", "tests"])
def test_rooms(folder):
    found = crowded(ROOT / folder)
    assert not found, "\n" + "\n".join(found)


def test_tests_import_from_support_only():
    """A test module that imports another one runs with it, and moves with it."""
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno} imports {node.module}"
        for path in sorted((ROOT / "tests").rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module and "test_" in node.module
    ]
    assert not found, "\n" + "\n".join(found)


# Violations for each rule: files of a small project, and words of the message.
FAULTS = {
    "a room without a floor": (
        rooms_without_a_floor,
        {"rubberfric/cellar/a.py": ""},
        "rubberfric.cellar: has no place",
    ),
    "an import upward, hidden in a function": (
        upward,
        {"rubberfric/base/a.py": "def f():\n    from rubberfric.theory.model import solve\n"},
        "base/a.py:2 imports solve from rubberfric.theory.model: rubberfric.theory does not stand below",
    ),
    "rooms of one floor": (
        upward,
        {"rubberfric/materials/a.py": "from rubberfric.roughness import b", "rubberfric/roughness/b.py": ""},
        "rubberfric.roughness does not stand below rubberfric.materials",
    ),
    "a relative import upward": (
        upward,
        {"rubberfric/base/a.py": "from ..theory import model"},
        "imports rubberfric.theory.model",
    ),
    "an import of the top": (
        upward,
        {"rubberfric/base/a.py": "import rubberfric"},
        "rubberfric does not stand below rubberfric.base",
    ),
    "rubberfric knows fitting": (
        upward,
        {"rubberfric/theory/a.py": "import fitting"},
        "rubberfric does not know fitting",
    ),
    "a circle by three modules": (
        circles,
        {
            "rubberfric/io/a.py": "from rubberfric.io.b import x",
            "rubberfric/io/b.py": "x = 1\ndef f():\n    import rubberfric.io.c",
            "rubberfric/io/c.py": "from rubberfric.io import a",
        },
        "circle of 3: rubberfric.io.a, rubberfric.io.b, rubberfric.io.c",
    ),
    "a name by its folder": (
        through_the_door,
        {"rubberfric/io/a.py": "from rubberfric.theory import solve"},
        "from the module that defines it",
    ),
    "a private name of another room": (
        private,
        {"rubberfric/io/a.py": "from rubberfric.theory.model import _points"},
        "imports _points from rubberfric.theory.model: is private",
    ),
    "a private name as an attribute": (
        private,
        {"rubberfric/io/a.py": "from rubberfric.theory import model\nmodel._points()"},
        "uses rubberfric.theory.model._points: is private",
    ),
    "fitting in a module": (
        across,
        {"fitting/data/a.py": "from rubberfric.theory.model import solve"},
        "imports solve from rubberfric.theory.model: fitting uses names in __all__",
    ),
    "fitting with a name that is not public": (
        across,
        {"fitting/data/a.py": "from rubberfric.theory import points"},
        "imports points from rubberfric.theory",
    ),
    "fitting by an attribute": (
        across,
        {"fitting/data/a.py": "import rubberfric as rf\nrf.theory.points"},
        "uses rubberfric.theory.points: not in __all__ of rubberfric.theory",
    ),
    "fifteen rooms": (
        lambda house: crowded(house.root / "rubberfric"),
        {f"rubberfric/io/{i}.py": "" for i in range(15)},
        "15 rooms, more than 14: 0.py, 1.py",
    ),
}
SOUND = {
    "rubberfric/__init__.py": "from rubberfric import theory\n__all__ = ['theory']",
    "rubberfric/base/__init__.py": "",
    "rubberfric/theory/__init__.py": "from rubberfric.theory.model import solve\n__all__ = ['solve']",
    "rubberfric/theory/model.py": "import numpy as np\ndef solve(): ...",
    "fitting/__init__.py": "",
    "fitting/fit.py": "import rubberfric as rf\nfrom rubberfric.theory import solve\nrf.theory.solve",
}


def built(folder, files):
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return House(folder)


def test_a_sound_house_passes(tmp_path):
    house = built(tmp_path, SOUND)
    assert {rule.__name__: rule(house) for rule in RULES if rule(house)} == {}


@pytest.mark.parametrize(("rule", "files", "words"), FAULTS.values(), ids=FAULTS)
def test_faults_are_found(tmp_path, rule, files, words):
    assert words in "\n".join(rule(built(tmp_path, SOUND | files)))
