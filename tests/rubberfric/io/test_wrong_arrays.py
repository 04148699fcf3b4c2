"""Arguments and columns that are no arrays of numbers."""

import numpy as np
import pytest
from support.scenes.fits import SCENE

import rubberfric as rf


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: rf.friction(SCENE, np.ma.array([1.0, 2.0], mask=[0, 1]), 1e5),
            "velocity has masked entries",
        ),
        (
            lambda: rf.Prony(1e6, np.ma.array([1e6, 1e7], mask=[0, 1]), [1.0, 2.0]),
            "Prony.E has masked entries",
        ),
        (lambda: rf.friction(SCENE, [[1.0], [1.0, 2.0]], 1e5), "velocity = [[1.0], [1.0, 2.0]]"),
        (lambda: rf.friction(SCENE, True, 1e5), "velocity = True: must be a number"),
        (
            lambda: rf.io.write_table("t.csv", {"v": ["a"], "mu": ["b"]}),
            "t.csv: column 'v' = ['a']: must be numbers",
        ),
        (
            lambda: rf.io.read_table("t.csv", "omega"),
            "needed, optional = ('omega', ()): must be lists of names",
        ),
    ],
)
def test_values_that_are_no_numbers(call, message):
    with pytest.raises(ValueError, match="must") as caught:
        call()
    assert message in str(caught.value) and "\n" not in str(caught.value)
