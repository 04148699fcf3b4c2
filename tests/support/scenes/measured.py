"""Good data of every kind."""

import dataclasses

import numpy as np

from fitting.data.kinds import AreaData, FrictionData, ModulusData, SpectrumData

GOOD = {
    FrictionData: {"velocity": [1e-3, 1.0], "friction": [0.5, 0.9], "pressure": 1e5, "temperature": 293.15},
    AreaData: {"velocity": [1e-3, 1.0], "area": [0.1, 0.05], "pressure": 1e5, "temperature": 293.15},
    ModulusData: {"omega": [2.0, 1.0], "storage": [1e6, 2e6], "loss": [1e5, 2e5], "temperature": 293.15},
    SpectrumData: {"q": [1e3, 1e2], "C": [1e-12, 1e-9]},
}


KINDS = list(GOOD)


def good(cls, **changes):
    return cls(**GOOD[cls] | changes)


def absolute(cls, **changes):
    """Data with absolute errors."""
    return good(cls, **dict(zip(cls.sigmas, ([0.1, 0.2], [0.3, 0.4]), strict=False)) | changes)


def equal(one, other):
    """Return True if two data sets are equal to the last bit."""
    assert type(one) is type(other)
    for field in dataclasses.fields(one):
        x, y = getattr(one, field.name), getattr(other, field.name)
        if isinstance(x, np.ndarray):
            assert (x.dtype, y.dtype) == (np.float64, np.float64)
            np.testing.assert_array_equal(x, y)
        else:
            assert x == y, field.name
