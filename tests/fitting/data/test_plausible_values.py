"""Limits beyond which a number of the data is refused because its unit seems to be wrong."""

import numpy as np
import pytest

from fitting.data import quantities

# Name of the field: smallest and largest number that are accepted, in SI. None: no limit other than the sign.
LIMITS = {
    "COMPLIANCE": (1e-13, 1.0),
    "SPECTRUM": (None, 1e3),
    "SPECTRUM_ERROR": (None, 2.5),
    "SPEED": (None, 200.0),
    "LOAD": (1e-3, 1e6),
    "RATIO": (-1.0, 5.0),
    "ANGLE": (-np.pi / 2, np.pi / 2),
}


@pytest.mark.parametrize("name", LIMITS)
def test_limits(name):
    field = getattr(quantities, name)

    def accepted(value):
        return all(np.all(rule(np.array([value]))) for _, rule in (field.rule, *field.plausible))

    for limit, outward in zip(LIMITS[name], (-1, 1), strict=True):
        if limit is not None:
            step = 1e-6 * abs(limit) * outward
            assert accepted(limit - step) and not accepted(limit + step)
