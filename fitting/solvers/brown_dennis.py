r"""Least squares with few evaluations: quadratic models of the residuals with secant Hessians.

.. math:: r(x + d) \approx r + J d + \tfrac12 d^T H d,\qquad H_+ d = J_+ - J

The Hessian H of each residual changes by the smallest symmetric matrix that agrees with the new Jacobian
[Brown & Dennis, New computational algorithms for minimizing a sum of squares of nonlinear functions, Yale
University report 71-6 (1971); Powell's symmetric Broyden update], also after a rejected step. The next move
minimises the sum of squares of these functions within a trust radius. This saves time if an evaluation of the
model takes longer than the linear algebra, and converges superlinearly even if residuals stay large at the
minimum. The functions use NumPy and treat one fit at a time.
"""

from typing import NamedTuple

import numpy as np

from fitting.solvers.levenberg_marquardt import LONGEST_STEP
from fitting.solvers.objective import (
    CONVERGED,
    NEGLIGIBLE,
    NOT_FINITE,
    PERFECT,
    PRECISE,
    RUNNING,
    STALLED,
    Iterate,
)

# Trust radius in x at the start, where a Positive parameter changes by a factor e, and where a fit stalls.
_FIRST, _LAST = 1.0, 1e-9
# Parts of the predicted gain above which the trust radius grows, and below which it shrinks.
_MUCH, _LITTLE = 0.75, 0.25
# Smallest damping of the inner problem, divided by the largest singular value squared. Factor by which the
# damping falls until the move is too long. Number of bisections, in the logarithm, between the last two
# dampings.
_SOFTEST, _SOFTER, _HALVINGS = 1e-16, 4.0, 2
_INNER_STEPS, _INNER_TRIALS = 30, 12
# Ratio of eigenvalues below which one counts as 0, for example of the fixed parameter of a profile.
_FLAT = 1e-13
# A kink at the minimum, as in tabulated shift factors, or noise may prevent further progress. A fit therefore
# ends if `_EVALUATIONS` evaluations gained less than `_GAINED` times a negligible gain, and the linear model
# predicts at most `_PROMISED` times a negligible gain.
_EVALUATIONS, _GAINED, _PROMISED = 3, 0.1, 10.0


class QuadraticModel(NamedTuple):
    """Quadratic models of the residuals of one fit, or of several fits with a leading axis."""

    rows: np.ndarray  # residuals at x, (rows,)
    jacobian: np.ndarray  # (rows, size)
    hessians: np.ndarray  # H, (rows, size, size)
    radius: np.ndarray  # trust radius
    costs: np.ndarray  # costs before each of the last evaluations, in order


def begin_quadratic(x: np.ndarray, rows: np.ndarray, jacobian: np.ndarray) -> Iterate:
    """Return the first iterate of a fit, given the residuals and the Jacobian at x."""
    finite = np.isfinite(rows).all() and np.isfinite(jacobian).all()
    hessians, costs = np.zeros((*jacobian.shape, x.size)), np.full(_EVALUATIONS, np.inf)
    model = QuadraticModel(rows, jacobian, hessians, np.asarray(_FIRST), costs)
    cost = 0.5 * np.sum(rows**2) if finite else np.asarray(np.nan)
    one = np.asarray(1)
    return Iterate(x, cost, np.asarray(RUNNING if finite else NOT_FINITE), one, one, model)


def propose_move(iterate: Iterate, longest: float = LONGEST_STEP) -> np.ndarray:
    """Return the next move, within the trust radius and with no element longer than `longest`."""
    model = iterate.own
    largest = np.linalg.norm(model.jacobian, 2) ** 2

    def within(move):
        return np.linalg.norm(move) <= model.radius and np.max(np.abs(move)) <= longest

    move = nothing = np.zeros(model.jacobian.shape[1])
    if not largest > 0:  # nothing to gain, and no step
        return nothing
    free = _least(model, _SOFTEST * largest, nothing)
    if within(free):
        return free
    # Damping with which the move of the linear model has half the allowed length.
    stiff = 2 * np.linalg.norm(model.jacobian.T @ model.rows) / min(float(model.radius), longest)
    further = _least(model, stiff, nothing)
    while not within(further):
        stiff *= _SOFTER**2
        further = _least(model, stiff, nothing)
    soft, move = stiff / _SOFTER, further
    while within(further := _least(model, soft, move)) and soft > _SOFTEST * largest:
        stiff, move, soft = soft, further, soft / _SOFTER
    for _ in range(_HALVINGS):
        between = np.sqrt(stiff * soft)
        if within(further := _least(model, between, move)):
            stiff, move = between, further
        else:
            soft = between
    return move


def after_move(
    iterate: Iterate,
    move: np.ndarray,
    rows: np.ndarray,
    jacobian: np.ndarray,
    *,
    tolerance: float = 1e-9,
    rounding: float = 0.0,
    longest: float = LONGEST_STEP,
) -> Iterate:
    """Return the iterate after a move, given the residuals and the Jacobian there.

    The fit ends when the linear model predicts a relative gain in cost below `tolerance`, or when the cost is
    below `rounding`. `longest` is as in `propose_move`.
    """
    model, before = iterate.own, float(iterate.cost)
    finite = bool(np.isfinite(rows).all() and np.isfinite(jacobian).all())
    cost = 0.5 * float(np.sum(rows**2)) if finite else np.inf
    length, accepted = float(np.linalg.norm(move)), cost < before
    share = (before - cost) / max(_promise(model, move), np.finfo(float).tiny)
    radius = float(model.radius)
    if share > _MUCH:
        radius = max(radius, 2 * length)
    elif share < _LITTLE:
        radius = 0.5 * min(length, radius)
    hessians = _updated_hessians(model, move, jacobian) if finite and length > 0 else model.hessians
    new = model._replace(
        hessians=hessians, radius=np.asarray(radius), costs=np.append(model.costs[1:], before)
    )
    if accepted:
        new = new._replace(rows=rows, jacobian=jacobian)
    lowest = min(cost, before)
    promised = _linear_promise(new, longest)
    negligible = NEGLIGIBLE * max(lowest, 1.0)
    near = promised <= _PROMISED * negligible
    # Fits of exact data continue until the cost is at rounding level.
    hidden = near and lowest > 20 * NEGLIGIBLE and new.costs[0] - lowest <= _GAINED * negligible
    if lowest <= rounding:
        status = PERFECT
    elif promised <= tolerance * lowest + 0.02 * np.sqrt(rounding * lowest):
        status = CONVERGED
    elif hidden or radius < _LAST:
        status = PRECISE if near else STALLED
    else:
        status = RUNNING
    x = iterate.x + move.astype(iterate.x.dtype) if accepted else iterate.x
    return Iterate(x, np.asarray(lowest), np.asarray(status), iterate.nfev + 1, iterate.njev + 1, new)


def _predicted(model, move):
    """Return the residuals and Jacobian of the quadratic models after a move."""
    bend = model.hessians @ move
    return model.rows + model.jacobian @ move + 0.5 * bend @ move, model.jacobian + bend


def _promise(model, move):
    """Return the gain in cost that the quadratic models predict for a move."""
    return 0.5 * float(np.sum(model.rows**2) - np.sum(_predicted(model, move)[0] ** 2))


def _linear_promise(model, longest):
    """Return the gain that linear models predict for steps up to `longest` along each singular vector."""
    U, s, _ = np.linalg.svd(model.jacobian, full_matrices=False)
    along = np.abs(U.T @ model.rows)
    return float(np.sum(np.minimum(0.5 * along**2, along * s * longest)))


def _least(model, damping, move):
    """Minimise the sum of squares of the models plus damping * |d|^2 by Newton steps from the move d."""
    one = np.eye(move.size)
    (rows, jacobian), extra = _predicted(model, move), 0.0
    cost = rows @ rows + damping * move @ move
    for _ in range(_INNER_STEPS):
        gradient, plain = jacobian.T @ rows + damping * move, jacobian.T @ jacobian + damping * one
        hessian = plain + np.tensordot(rows, model.hessians, 1)
        values = np.linalg.eigvalsh(hessian)
        if values[0] < -_FLAT * np.abs(values).max():  # not a minimum
            hessian = plain
        largest = np.trace(plain)
        for _ in range(_INNER_TRIALS):
            there = move - np.linalg.solve(hessian + max(extra, 2 * _FLAT * largest) * one, gradient)
            found = _predicted(model, there)
            lower = found[0] @ found[0] + damping * there @ there
            if lower < cost:
                break
            extra = max(10 * extra, 1e-6 * largest)
        else:
            return move
        gain = cost - lower
        move, (rows, jacobian), cost, extra = there, found, lower, 0.1 * extra
        if gain <= 1e-14 * cost:
            return move
    return move


def _updated_hessians(model, move, jacobian):
    """Return H after the symmetric Broyden update with the Jacobian after a move."""
    unit, length = move / np.linalg.norm(move), np.linalg.norm(move)
    left = (jacobian - model.jacobian) / length - model.hessians @ unit
    both = left[:, :, None] * unit
    along = (left @ unit)[:, None, None] * np.outer(unit, unit)
    return model.hessians + both + np.swapaxes(both, 1, 2) - along
