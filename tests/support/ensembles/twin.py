"""The twin measurements of data/, and the fit of its job file."""

import importlib.util

import jax
import numpy as np
from support.folders import DATA

import fitting
import rubberfric as rf

TRUTH = rf.load_scene(DATA / "twin_truth.toml")
GUESS = rf.load_scene(DATA / "twin_guess.toml")
POSITIVE = fitting.Positive()
FREE = {
    "upper.material.E": POSITIVE,
    "upper.material.shift.C1": POSITIVE,
    "upper.material.shift.C2": POSITIVE,
    "lower.spectrum.hurst": fitting.Bounded(0.3, 1.0),
    "lower.spectrum.h_rms": POSITIVE,
    "lower.spectrum.q1": POSITIVE,
    "shear.tau_f0": POSITIVE,
    "shear.c": POSITIVE,
    "shear.v0": POSITIVE,
    "shear.shift.energy": POSITIVE,
}


def _script():
    spec = importlib.util.spec_from_file_location("make_twin", DATA / "make_twin.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


make_twin = _script()
twin, conditions = make_twin.twin, make_twin.conditions


def true_values(names):
    """Values of the truth, by key path."""
    leaves = {
        jax.tree_util.keystr(path, simple=True, separator="."): np.asarray(leaf)
        for path, leaf in jax.tree_util.tree_flatten_with_path(TRUTH)[0]
    }
    values = []
    for name in names:
        path, _, index = name.partition("[")
        values.append(leaves[path][int(index[:-1])] if index else float(leaves[path]))
    return np.array(values)
