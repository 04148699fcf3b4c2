r"""What weighted draws are worth.

As much as so many equal ones,

.. math:: n_\mathrm{eff} = \Big(\sum_s w_s\Big)^2 \Big/ \sum_s w_s^2

of which single large weights, not met yet, may leave less. Their tail says how likely that is: the index k of
a generalised Pareto distribution of the largest ones, above 0.7 too likely [Vehtari, Simpson, Gelman, Yao &
Gabry, J. Mach. Learn. Res. 25 (2024) 72, arXiv:1507.02646; Zhang & Stephens, Technometrics 51 (2009) 316]. Of
a hundred draws k itself is known to 0.4 only: what chance can do to it is allowed for.

Weights are given as their logarithms but for a constant of each fit, shape (fits, draws).
"""

import numpy as np
import scipy

# Weights that differ by less than this part of the largest have no tail.
_EVEN = 1e-6
# Effective draws with which they say something of a posterior, and index of their tail above which not.
_ENOUGH, _HEAVY = 10, 0.7


def relative(log_weight: np.ndarray) -> np.ndarray:
    """Weights, the largest of each fit 1."""
    largest = np.max(log_weight, 1, keepdims=True)
    # Where the model is finite nowhere all are 0.
    return np.exp(log_weight - np.where(np.isfinite(largest), largest, 0.0))


def effective(log_weight: np.ndarray) -> np.ndarray:
    """Number of equal draws that are worth as much, of every fit, shape (fits,)."""
    weight = relative(log_weight)
    squares = np.sum(weight**2, 1)
    return np.sum(weight, 1) ** 2 / np.where(squares > 0, squares, 1.0)


def tail_index(log_weight: np.ndarray) -> np.ndarray:
    """k of the largest weights of every fit, shape (fits,); -inf where weights are all the same."""
    rows = log_weight.shape[1]
    count = _tail(rows)
    ordered = np.sort(relative(log_weight), 1)
    return np.array([_pareto_shape(one[-count:] - one[-count - 1]) for one in ordered])


def doubtful(worth: np.ndarray, index: np.ndarray, draws: int) -> np.ndarray:
    """Which of the fits, with these `effective` numbers and tail indices of so many draws, are known badly.

    Fewer than 10 effective, or an index that is above 0.7 by more than two of its standard errors.
    """
    tail = np.maximum(index, -1.0)
    return (worth < _ENOUGH) | (tail - 2 * (1 + tail) / np.sqrt(_tail(draws)) > _HEAVY)


def _tail(draws):
    """Number of the largest weights."""
    return int(min(0.2 * draws, 3 * np.sqrt(draws)))


def _pareto_shape(excess):
    """Shape of the generalised Pareto distribution of values > 0 in increasing order (Zhang & Stephens).

    With so many values as ten at a shape of 1/2 beside them (Vehtari et al.): a few alone say little.
    """
    if not excess[-1] > _EVEN:
        return -np.inf
    count = excess.size
    tried = 30 + int(np.sqrt(count))
    quartile = excess[int(count / 4 + 0.5) - 1]
    steps = 1 - np.sqrt(tried / (np.arange(1, tried + 1) - 0.5))
    # Equal weights stand on the border of the tail.
    theta = 1 / excess[-1] + steps / (3 * max(quartile, _EVEN * excess[-1]))
    shape = np.mean(np.log1p(-theta[:, None] * excess), 1)
    likelihood = count * (np.log(-theta / shape) - shape - 1)
    best = np.sum(theta * scipy.special.softmax(likelihood))
    found = np.mean(np.log1p(-best * excess))
    return (count * found + 10 * 0.5) / (count + 10)
