r"""Which measurements to choose among candidates: linear optimal design by exchange.

A measurement i adds a_i a_i^T to the information M, a_i being its row of the Jacobian in units of its error,
and M^-1 is the covariance of what is fitted. With M_0 for what is known, n measurements of

.. math:: \max_i \; \frac1K \sum_k \phi\Big(M_0 + \sum_i a_{ik} a_{ik}^T\Big),\qquad
          \phi_D = \ln\det M,\quad \phi_L = -\ln\mathrm{tr}(L\, M^{-1})

are found by adding the best one by one, then exchanging each for a better one until none is
[Fedorov, Theory of Optimal Experiments, Academic Press 1972; Atkinson, Donev & Tobias, Optimum Experimental
Designs, Oxford 2007, chapter 12]. K sets of rows, of draws from what is known, make the design robust; as
logarithms are averaged [Chaloner & Larntz, J. Stat. Plan. Inference 21, 191 (1989)], no draw counts more than
another because its variance is large. One more row changes both criteria by

.. math:: \Delta\phi_D = \ln(1 + a^T M^{-1} a),\qquad
          \Delta\phi_L = -\ln\Big(1 - \frac{1}{\mathrm{tr}(L\, M^{-1})}
          \frac{a^T M^{-1} L M^{-1} a}{1 + a^T M^{-1} a}\Big)

Limits: a local optimum, which a single exchange does not improve; on the examples with a closed form it is
the global one.
"""

import numpy as np

# Passes through all chosen points; a few are enough.
_PASSES = 50
# An exchange must gain more than this: of rounding it would go in circles.
_LEAST = 1e-10
# Of the variance one row takes less than all; rounding must not say otherwise.
_MOST = 1 - 1e-15


def exchange(
    rows: np.ndarray,
    base: np.ndarray,
    budget: float,
    cost: np.ndarray | None = None,
    target: np.ndarray | None = None,
) -> np.ndarray:
    """Indices of the candidates to measure, one as often as it is to be repeated, most useful first.

    Parameters
    ----------
    rows : of every candidate, in units of its error, shape (draws, candidates, size)
    base : information already there, positive definite, shape (size, size)
    budget : number of measurements, or what they may cost together
    cost : of every candidate, > 0, shape (candidates,); None: 1 each
    target : L, shape (draws, size, size); None: D-optimal

    Returns
    -------
    integers, shape (number of measurements,); none where the budget allows none
    """
    cost = np.ones(rows.shape[1]) if cost is None else cost
    chosen = _filled(rows, base, budget, cost, target, [])
    for _ in range(_PASSES):
        before = list(chosen)
        for i in range(len(chosen)):
            others = chosen[:i] + chosen[i + 1 :]
            gains = gain(rows, information(rows, base, others), target)
            allowed = cost <= budget - cost[others].sum() + 1e-9 * budget
            best = int(np.argmax(np.where(allowed, gains, -np.inf)))
            if gains[best] > gains[chosen[i]] + _LEAST * (1 + abs(gains[chosen[i]])):
                chosen[i] = best
        chosen = _filled(rows, base, budget, cost, target, chosen)
        if chosen == before:
            break
    return _ordered(rows, base, cost, target, chosen)


def information(rows: np.ndarray, base: np.ndarray, chosen: list[int] | np.ndarray) -> np.ndarray:
    """M of every draw, shape (draws, size, size)."""
    some = rows[:, np.asarray(chosen, int)]
    return base + np.swapaxes(some, 1, 2) @ some


def criterion(information: np.ndarray, target: np.ndarray | None) -> float:
    """phi, the mean over the draws."""
    if target is None:
        return float(np.mean(np.linalg.slogdet(information)[1]))
    return -float(np.mean(np.log(variance(information, target))))


def variance(information: np.ndarray, target: np.ndarray) -> np.ndarray:
    """tr(L M^-1) of every draw, shape (draws,)."""
    return np.trace(target @ np.linalg.inv(information), axis1=1, axis2=2)


def gain(rows: np.ndarray, information: np.ndarray, target: np.ndarray | None) -> np.ndarray:
    """What each candidate would add to phi, shape (candidates,)."""
    covariance = np.linalg.inv(information)
    moved = rows @ covariance
    seen = np.sum(moved * rows, -1)
    if target is None:
        return np.mean(np.log1p(seen), 0)
    less = np.sum((moved @ target) * moved, -1) / (1 + seen)
    part = less / np.trace(target @ covariance, axis1=1, axis2=2)[:, None]
    return np.mean(-np.log1p(-np.minimum(part, _MOST)), 0)


def _filled(rows, base, budget, cost, target, chosen):
    """Chosen candidates and, as far as the budget goes, those that add most for what they cost."""
    chosen = list(chosen)
    while True:
        allowed = cost <= budget - cost[chosen].sum() + 1e-9 * budget
        if not allowed.any():
            return chosen
        gains = gain(rows, information(rows, base, chosen), target) / cost
        chosen.append(int(np.argmax(np.where(allowed, gains, -np.inf))))


def _ordered(rows, base, cost, target, chosen):
    """The chosen, each the best of those left for what it costs."""
    left, order = list(chosen), []
    while left:
        gains = gain(rows[:, left], information(rows, base, order), target) / cost[left]
        order.append(left.pop(int(np.argmax(gains))))
    return np.array(order, int)
