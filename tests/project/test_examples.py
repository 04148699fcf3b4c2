"""Examples in the docstrings of public functions give the values that they show."""

import doctest
import inspect
import pydoc
import re
import shutil

import numpy as np
import pytest
from support.folders import REFERENCE_PAGES, ROOT

import fitting
import rubberfric as rf

NAMES = [
    name
    for page in REFERENCE_PAGES
    for name in re.findall(r"^\.\. auto\w+:: ([\w.]+)$", page.read_text(), re.M)
]


def example_of(name):
    """Return the examples in a docstring as a test of doctest, with the names that users import."""
    text = inspect.getdoc(pydoc.locate(name)) or ""
    return doctest.DocTestParser().get_doctest(text, {"np": np, "rf": rf, "fitting": fitting}, name, name, 0)


def runs(name):
    """Return True if a docstring has an example that needs no file of the user."""
    text = inspect.getdoc(pydoc.locate(name)) or ""
    return ">>>" in text and "+SKIP" not in text


WITH_EXAMPLES = [name for name in NAMES if runs(name)]
# They compile for a fraction of a second at most.
FAST = ("rubberfric.base.units.", "rubberfric.roughness.", "rubberfric.io.", "rubberfric.materials.")
FAST += ("rubberfric.complex_modulus", "rubberfric.rms_slope", "rubberfric.power_spectrum", "rubberfric.same")
FAST += ("rubberfric.quantities_of", "rubberfric.load_scene", "rubberfric.friction", "fitting.fit_prony")


def test_there_are_examples():
    assert len(WITH_EXAMPLES) >= 30
    assert all(any(name.startswith(start) for name in WITH_EXAMPLES) for start in FAST)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (not name.startswith(FAST) or "_map" in name))
        for name in WITH_EXAMPLES
    ],
)
def test_example(name, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "data", tmp_path / "data")
    monkeypatch.chdir(tmp_path)
    messages = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    found = runner.run(example_of(name), out=messages.append)
    assert found.attempted and not found.failed, "".join(messages)
