"""The content of a result file."""

import numpy as np
from support.scenes.examples import EXAMPLES

import rubberfric as rf
from rubberfric.io.results import Conditions, Result


def result(temperature=(283.0, 293.15)):
    """Return a result at three velocities and two pressures, with numbers that all differ."""
    T = None if temperature is None else np.array(temperature)
    conditions = Conditions(np.array([1e-3, 0.1, 1.0]), np.array([1e5, 2e5]), T)
    values = np.random.default_rng(0).uniform(size=(5, 1 if T is None else T.size, 2, 3))
    return Result(EXAMPLES["Scene"], conditions, rf.Solution(*values), rf.Quadrature(order=20), "Title µ")
