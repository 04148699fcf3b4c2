r"""Least squares with unknowns >= 0, by the active sets of Lawson and Hanson (1974, ch. 23).

.. math:: \min_{x \ge 0} |A x - b|^2 \quad\text{or}\quad
          \min_{x \ge 0} \sum_k \left(\frac{\ln (A x + c)_k / b_k}{e_k}\right)^2

NumPy on the host, for a few dozen unknowns: which of them are exactly 0 is found, not
approached, and that is what a Prony series wants to know.
"""

import numpy as np

_ROUNDS = 50


def nonnegative(A, b):
    """The x >= 0 that brings A x closest to b.

    Parameters
    ----------
    A : shape (rows, unknowns)
    b : shape (rows,)

    Returns
    -------
    array, shape (unknowns,); zeros are exact
    """
    # Columns of one length: the tolerance below, and the steps, then mean the same for all.
    length = np.linalg.norm(A, axis=0)
    length = np.where(length > 0, length, 1.0)
    A = A / length
    count = A.shape[1]
    x, free = np.zeros(count), np.zeros(count, bool)
    tolerance = 10 * np.finfo(float).eps * max(A.shape) * np.linalg.norm(b)
    # Every round frees one unknown; a set is never met twice but for rounding.
    for _ in range(3 * count):
        gain = np.where(free, 0.0, A.T @ (b - A @ x))
        if gain.max(initial=0.0) <= tolerance:
            break
        free[np.argmax(gain)] = True
        while True:
            best = np.zeros(count)
            best[free] = np.linalg.lstsq(A[:, free], b, rcond=None)[0]
            low = free & (best <= 0)
            if not low.any():
                x = best
                break
            # As far as the first of them to reach zero, which is held there.
            part = x[low] / np.maximum(x[low] - best[low], np.finfo(float).tiny)
            x = x + part.min() * (best - x)
            free &= x > 0
            free[np.flatnonzero(low)[np.argmin(part)]] = False
            x[~free] = 0.0
    return x / length


def nonnegative_logarithmic(A, b, known, error):
    """The x >= 0 that brings ln(A x + known) closest to ln b, in units of `error`.

    Parameters
    ----------
    A : shape (rows, unknowns), >= 0
    b, error : shape (rows,), > 0
    known : shape (rows,), >= 0

    Returns
    -------
    array, shape (unknowns,); zeros are exact
    """

    def cost(x):
        model = A @ x + known
        return np.sum((np.log(model / b) / error) ** 2) if (model > 0).all() else np.inf

    # Gauss-Newton: the logarithm is linear in a small relative change of the model, so that
    # every step is a bounded problem of its own. The first is about the data themselves.
    model, x, lowest = b, np.zeros(A.shape[1]), np.inf
    for _ in range(_ROUNDS):
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
