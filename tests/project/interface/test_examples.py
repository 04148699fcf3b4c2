"""The examples of docstrings run, and every public name of the reference has one."""

import doctest
import inspect
import pydoc
import re
import typing

import numpy as np
import pytest
from support.cases.stored import slow_if
from support.folders import DATA, REFERENCE_NAMES

import fitting
import rubberfric as rf
from rubberfric.base.objects.physical import Kind

OBJECTS = {name: inspect.unwrap(pydoc.locate(name)) for name in REFERENCE_NAMES}


def methods(cls):
    """Return the documented public methods of a class by name."""
    own = {name: inspect.unwrap(getattr(found, "__func__", found)) for name, found in vars(cls).items()}
    return {n: m for n, m in own.items() if inspect.isfunction(m) and m.__doc__ and not n.startswith("_")}


METHODS = {
    f"{place}.{name}": method
    for place, found in OBJECTS.items()
    if inspect.isclass(found)
    for name, method in methods(found).items()
}
DOCSTRINGS = {name: inspect.getdoc(found) or "" for name, found in (OBJECTS | METHODS).items()}
EXAMPLES = {name: text for name, text in DOCSTRINGS.items() if ">>>" in text}
CODE = {
    name: "".join(one.source for one in doctest.DocTestParser().get_examples(text))
    for name, text in EXAMPLES.items()
}
ALL_CODE = "".join(CODE.values())

# Why a name has no example.
WITHOUT = {
    **dict.fromkeys(
        (
            *("rubberfric.materials.Material", "rubberfric.materials.Shift", "rubberfric.materials.Layer"),
            *("rubberfric.materials.VerticalShift", "rubberfric.scene.PressureShape"),
        ),
        "base class: CONTRIBUTING has a subclass, and its classes have examples",
    ),
    "rubberfric.UnitWarning": "a warning",
    "rubberfric.compilation_cache": "changes the whole process",
    "rubberfric.progress": "draws in a terminal only",
    "rubberfric.roughness.check_normalisation": "returns nothing",
    "rubberfric.plot.plot_accuracy": "a sweep takes long: the example of `accuracy` draws it",
    "rubberfric.plot.save_accuracy_plot": "a sweep takes long: the example of `accuracy` draws it",
    **dict.fromkeys(
        ("rubberfric.roughness.InstrumentLimits", "rubberfric.roughness.ResolvedRange"),
        "part of a MeasuredSpectrum",
    ),
    "rubberfric.roughness.Joint": "part of JoinedSpectra, whose example shows it",
}


# Methods that no example calls.
METHODS_WITHOUT = {
    "draws as the functions `plot_...` do": {
        *("fitting.MasterCurve.plot", "fitting.PronyFit.plot", "fitting.KramersKronig.plot"),
        *("fitting.FitResult.plot", "fitting.Budget.plot", "fitting.Design.plot", "fitting.Calibration.plot"),
    },
    "a detail that other methods use, or a diagnostic": {
        *(
            "rubberfric.analysis.SlidingContact.distribution",
            "rubberfric.analysis.SlidingContact.heat_beyond",
        ),
        *("rubberfric.roughness.MeasuredSpectrum.knots", "rubberfric.roughness.MeasuredSpectrum.areal"),
        *(
            "rubberfric.roughness.MeasuredSpectrum.resolved",
            "rubberfric.roughness.ArealSpectrum.moment_error",
        ),
        *("rubberfric.Quadrature.resolving", "rubberfric.Solution.labelled", "fitting.Members.fingerprint"),
        "rubberfric.Body.check_single",
        *("fitting.PronyFit.model", "fitting.Budget.write_group", "fitting.Calibration.on_normal"),
        *("fitting.Calibration.ranks", "fitting.Calibration.distribution", "fitting.Calibration.envelope"),
        "fitting.Calibration.doubts",
    },
    "fits many times": {"fitting.FitResult.profile_cutoff", "fitting.Samples.band"},
}


def returned(function):
    """Return the classes that a function is annotated to return."""
    try:
        result = typing.get_type_hints(function).get("return")
    except (NameError, TypeError):
        return set()
    return {result, *typing.get_args(result)}


# Classes whose objects an example returns or constructs.
SHOWN = set().union(*(returned(found) for name, found in (OBJECTS | METHODS).items() if name in EXAMPLES))
SHOWN |= {
    found
    for name, found in OBJECTS.items()
    if inspect.isclass(found) and re.search(rf"\b{name.rsplit('.', 1)[1]}[.(]", ALL_CODE)
}


def test_every_name_has_an_example():
    assert len(REFERENCE_NAMES) > 230
    missing = [name for name, found in OBJECTS.items() if name not in EXAMPLES and found not in SHOWN]
    assert sorted(missing) == sorted(WITHOUT)


def test_every_method_is_called_in_an_example():
    """Kinds of parts of a scene are left out, because the theory calls their methods."""
    missing = {
        place
        for place, method in METHODS.items()
        if f".{method.__name__}(" not in ALL_CODE and not issubclass(OBJECTS[place.rsplit(".", 1)[0]], Kind)
    }
    assert missing == set().union(*METHODS_WITHOUT.values())


# Beginnings of names whose examples are ordinary tests, because they take 0.1 s at most.
FAST = (
    *("rubberfric.io.", "rubberfric.base.units.", "rubberfric.roughness.", "rubberfric.materials."),
    *("rubberfric.Arrhenius", "rubberfric.Elastic", "rubberfric.Entropic", "rubberfric.Parabolic"),
    *("rubberfric.Patch", "rubberfric.Prony", "rubberfric.Rigid", "rubberfric.ThermalProperties"),
    *("rubberfric.Uniform", "rubberfric.WLF", "rubberfric.complex_modulus", "rubberfric.load_scene"),
    *("rubberfric.quantities_of", "rubberfric.rms_slope", "rubberfric.same", "rubberfric.save_scene"),
    *("fitting.average", "fitting.fit_prony", "fitting.read", "fitting.write"),
)
# Calls for which JAX compiles for longer.
SLOW_CALLS = (
    *("friction_map", "solve", "TabulatedModulus", "PronyShear", "Anisotropic", "TabulatedSpectrum"),
    *("areal_spectrum", "join_spectra", "resample", "spectrum_from", "from_grid"),
    *("heights_by_normalisation", "line_spectrum", "log_power_spectrum"),
)
SLOW = re.compile(rf"\b(?:{'|'.join(SLOW_CALLS)})\(")


def is_slow(name):
    """Return True if the example of a name is a slow test, as all new ones are first."""
    return not (name.startswith(FAST) or name.endswith("Data")) or SLOW.search(CODE[name]) is not None


def test_beginnings_of_names_are_used():
    assert all(any(name.startswith(start) for name in EXAMPLES) for start in FAST)
    assert sum(map(is_slow, EXAMPLES)) < 0.8 * len(EXAMPLES)


@pytest.mark.parametrize("name", slow_if(is_slow, EXAMPLES.keys()))
def test_example(name, tmp_path, monkeypatch):
    (tmp_path / "data").symlink_to(DATA)
    monkeypatch.chdir(tmp_path)
    names = {"np": np, "rf": rf, "fitting": fitting}
    example = doctest.DocTestParser().get_doctest(EXAMPLES[name], names, name, name, 0)
    messages = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    result = runner.run(example, out=messages.append)
    assert result.attempted and not result.failed, "".join(messages)
    assert "+SKIP" not in EXAMPLES[name]
