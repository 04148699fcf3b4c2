"""Least squares with terms >= 0, linear and in logarithms, against SciPy and the conditions of a minimum."""

import numpy as np
import pytest
import scipy.optimize
from support.scenes.fits import maxwell_columns

from fitting.characterise.prony_series import nonnegative, nonnegative_logarithmic

OMEGA = np.geomspace(1.0, 1e6, 40)


@pytest.mark.parametrize("seed", range(8))
def test_nonnegative_equal_to_scipy(seed):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((30, 12)) * 10.0 ** rng.uniform(-6, 6, 12)
    b = rng.standard_normal(30)
    x, rest = scipy.optimize.nnls(A, b)
    found = nonnegative(A, b)
    assert 0 < np.count_nonzero(x == 0) < 12
    np.testing.assert_array_equal(found == 0, x == 0)
    np.testing.assert_allclose(found, x, rtol=1e-10)
    assert np.linalg.norm(A @ found - b) <= rest * (1 + 1e-12)


def test_nonnegative_survives_what_is_degenerate():
    A = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0]])
    found = nonnegative(A, np.array([1.0, 2.0]))
    assert (found >= 0).all() and found[2] == 0
    np.testing.assert_allclose(A @ found, [1.0, 2.0], rtol=1e-12)
    assert (nonnegative(A, np.array([-1.0, -2.0])) == 0).all()
    # Four terms a decade are nearly the same column.
    a = OMEGA[:, None] * np.geomspace(1e-6, 1.0, 25)
    A = a / (1 + a**2)
    b = A @ np.linspace(1.0, 2.0, 25)
    assert np.linalg.norm(A @ nonnegative(A, b) - b) <= 1e-12 * np.linalg.norm(b)


@pytest.mark.parametrize("directions", [0, 2])
@pytest.mark.parametrize("seed", range(4))
def test_minimum_of_the_logarithms(seed, directions):
    """No direction that is allowed goes down: the conditions of Karush, Kuhn and Tucker.

    `lstsq` removes the part of the differences that lies along the ignored columns.
    """
    rng = np.random.default_rng(seed)
    *A, plateau = maxwell_columns(OMEGA, np.geomspace(1e-6, 1.0, 13)).T
    A, known = np.stack(A, 1), 2e6 * plateau
    error = rng.uniform(0.5, 2.0, known.size)
    b = (A @ 10 ** rng.uniform(6, 9, 13) + known) * np.exp(0.2 * rng.standard_normal(known.size))
    ignored = rng.standard_normal((known.size, directions))
    x = nonnegative_logarithmic(A, b, known, error, ignored if directions else None)
    model = A @ x + known
    rows, along = A / (model * error)[:, None], ignored / error[:, None]
    differences = np.log(model / b) / error
    differences -= along @ np.linalg.lstsq(along, differences)[0]
    gradient = rows.T @ differences / np.linalg.norm(rows, axis=0)
    assert 0 < np.count_nonzero(x == 0) < 8
    assert (gradient[x == 0] > 0).all()
    np.testing.assert_allclose(gradient[x > 0], 0, atol=1e-6)
