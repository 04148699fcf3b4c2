"""Least squares with unknowns >= 0, of values and of their logarithms.

Which unknowns are exactly 0 is found, not approached, and that is what a Prony series wants to know.
"""

import numpy as np
import scipy

_STEPS = 50


def nonnegative(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    r"""The x >= 0 that brings A x closest to b; zeros are exact.

    .. math:: \min_{x \ge 0} |A x - b|^2

    by the active sets of Lawson and Hanson (Solving least squares problems, 1974, ch. 23).
    """
    # Columns of one length: the tolerance of the search then means the same for all.
    length = np.linalg.norm(A, axis=0)
    length = np.where(length > 0, length, 1.0)
    return scipy.optimize.nnls(A / length, b)[0] / length


def nonnegative_logarithmic(A: np.ndarray, b: np.ndarray, known: np.ndarray, error: np.ndarray) -> np.ndarray:
    r"""The x >= 0 that brings ln(A x + known) closest to ln b, in units of `error`; zeros are exact.

    .. math:: \min_{x \ge 0} \sum_k \left(\frac{\ln (A x + known)_k / b_k}{error_k}\right)^2

    Parameters
    ----------
    A : shape (rows, unknowns), >= 0
    b, error : shape (rows,), > 0
    known : shape (rows,), >= 0

    Returns
    -------
    array, shape (unknowns,)
    """

    def cost(x):
        model = A @ x + known
        return np.sum((np.log(model / b) / error) ** 2) if (model > 0).all() else np.inf

    # Gauss-Newton: the logarithm is linear in a small relative change of the model, so that
    # every step is a bounded problem of its own. The first is about the data themselves.
    model, x, found, lowest = b, np.zeros(A.shape[1]), np.zeros(A.shape[1]), np.inf
    for _ in range(_STEPS):
        scale = 1 / (model * error)
        found = nonnegative(A * scale[:, None], (model - known) * scale - np.log(model / b) / error)
        # From nothing only the full step makes sense; later ones are shortened as needed.
        parts = 0.5 ** np.arange(20 if np.isfinite(lowest) else 1)
        tried = [x + part * (found - x) for part in parts]
        costs = [cost(one) for one in tried]
        best = int(np.argmin(costs))
        gained = lowest - costs[best]
        if not gained > 0:
            break
        x, lowest = tried[best], costs[best]
        model = A @ x + known
        if gained <= 1e-14 * lowest:
            break
    return np.where(found > 0, x, 0.0)
