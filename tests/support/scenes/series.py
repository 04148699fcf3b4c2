"""Prony series of nine terms, as cards of other programs hold them."""

import numpy as np
from support.scenes.shifts import WLF

import rubberfric as rf

TAU = 10.0 ** np.arange(-7, 2)
E = 1e9 * np.array([0.7, 0.31, 0.2, 0.11, 0.05, 0.02, 0.01, 0.004, 0.0013])
RUBBER = rf.Prony(4.2e6, E, TAU, 0.45, WLF)
SOFT = rf.Prony(4.2e6, E, TAU, 0.5)
SHEAR = rf.PronyShear(1.4e6, E / 3, TAU, 2.1e9, WLF)
OMEGA = 10.0 ** np.linspace(-3, 9, 25)


def same(found, expected, rtol):
    """Assert that two series are of one class, with equal numbers and shift."""
    assert type(found) is type(expected)
    for name in expected.__dataclass_fields__:
        a, b = getattr(found, name), getattr(expected, name)
        if name != "shift":
            np.testing.assert_allclose(a, b, rtol=rtol)
        elif b is None:
            assert a is None
        else:
            np.testing.assert_allclose([a.C1, a.C2, a.T_ref], [b.C1, b.C2, b.T_ref], rtol=1e-12)
