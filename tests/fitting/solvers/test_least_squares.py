"""Levenberg-Marquardt without friction: standard problems, robust losses against SciPy, how fits end.

The problems are in `support.oracles.least_squares`.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares
from support.cases.stored import slow_if
from support.oracles.least_squares import PROBLEMS, STALLING, rosenbrock

from fitting.solvers.levenberg_marquardt import (
    CORRECTIONS,
    LONGEST_STEP,
    STIFFEST,
    accept,
    after_evaluation,
    first_trial,
    plan_step,
)
from fitting.solvers.objective import (
    CONVERGED,
    LOSS_WIDTHS,
    MESSAGES,
    NOT_FINITE,
    PERFECT,
    PRECISE,
    RUNNING,
    SQUARES,
    STALLED,
    Iterate,
    Loss,
)


def both(residuals):
    return lambda x: (residuals(x), jax.jacfwd(residuals)(x))


def started(residuals, x, loss=SQUARES):
    begin = jax.jit(functools.partial(first_iterate, residuals, loss=loss, damping=1e-3))
    return begin(np.asarray(x, float))


def first_iterate(residuals, x, loss, damping):
    zero = jnp.asarray(0)
    return Iterate(x, loss.cost(residuals(x)), zero + RUNNING, zero + 1, zero, jnp.asarray(damping))


def step(
    residuals, with_jacobian, iterate, loss=SQUARES, *, tolerance=1e-9, rounding=0.0, longest=LONGEST_STEP
):
    """Take one step, as `fitting.solvers.steps` does for several fits."""
    plan = plan_step(*with_jacobian(iterate.x), iterate, loss, longest)

    def evaluated(trial):
        return after_evaluation(plan, trial, residuals(iterate.x + trial.move), iterate, loss)

    trial = jax.lax.while_loop(lambda trial: ~trial.done, evaluated, first_trial(plan))
    return accept(plan, trial, iterate, tolerance=tolerance, rounding=rounding, longest=longest)


def one_step(residuals, with_jacobian=None):
    """Return the compiled step of Levenberg-Marquardt."""
    return jax.jit(functools.partial(step, residuals, with_jacobian or both(residuals)))


def minimum(residuals, x, loss=SQUARES, max_steps=200, exact=None, **options):
    """The iterate at which Levenberg-Marquardt steps from x end, with the Jacobian of `exact`."""

    def with_jacobian(x):
        return residuals(x), jax.jacfwd(exact or residuals)(x)

    one = jax.jit(functools.partial(step, residuals, with_jacobian, loss=loss, **options))
    iterate = started(residuals, x, loss)
    for _ in range(max_steps):
        if iterate.status != RUNNING:
            break
        iterate = one(iterate)
    return iterate


# Problems of the ordinary run: curved valleys, a singular Jacobian, large residuals, bad scaling.
QUICK_PROBLEMS = ("rosenbrock", "powell_singular", "brown_dennis", "meyer")


@pytest.mark.parametrize(
    "residuals", slow_if(lambda name: name not in QUICK_PROBLEMS, {f.__name__: f for f in PROBLEMS})
)
def test_standard_problems(residuals):
    x, squares, most = PROBLEMS[residuals]
    end = minimum(residuals, x, tolerance=1e-10, rounding=1e-26, longest=100.0)
    print(f"\n{residuals.__name__}: {MESSAGES[int(end.status)]}, {end.njev} Jacobians, {2 * end.cost:.12g}")
    assert end.njev <= most
    assert end.status == (PRECISE if residuals in STALLING else CONVERGED if squares else PERFECT)
    assert 2 * float(end.cost) == pytest.approx(squares, rel=1e-9, abs=1e-25)
    assert 1 + end.njev <= end.nfev <= 1 + 12 * end.njev


def test_directions_that_the_residuals_do_not_see_are_left():
    for x in (2.0, 5.0):
        end = minimum(lambda x: jnp.stack([x[0] - 1.0, 2 * x[0] - 1.0]), [x, 7.0])
        assert end.status == CONVERGED and end.x[1] == 7.0
        assert float(end.x[0]) == pytest.approx(0.6)
    end = minimum(lambda x: jnp.ones(3) + 0 * x[0], [5.0])
    assert end.status == CONVERGED and end.x[0] == 5.0


def test_a_model_that_is_known_to_some_digits_only():
    """Like temperatures that are iterated to a tolerance: steps end where the noise hides the minimum."""

    def exact(x):
        return jnp.stack([x[0] - 3.0, 2.0 * x[0] - 5.0, jnp.exp(x[1]) - 2.0, jnp.exp(x[1]) - 1.5])

    def known(x):
        return exact(x) + 1e-5 * jnp.sin(1e9 * x[jnp.array([0, 0, 1, 1])])

    end = minimum(known, [0.0, 3.0], exact=exact, tolerance=1e-15)
    assert end.status == PRECISE
    np.testing.assert_allclose(end.x, [2.6, np.log(1.75)], atol=3e-3)


@pytest.mark.parametrize("loss", LOSS_WIDTHS)
def test_robust_losses_of_a_straight_line_against_scipy(loss):
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 1.0, 30)
    y = 2.0 + 3.0 * t + 0.1 * rng.standard_normal(30)
    y[[3, 17, 25]] += [4.0, -6.0, 5.0]
    width = 0.1 * LOSS_WIDTHS[loss]

    def residuals(x):
        return x[0] + x[1] * t - y

    exact = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-13}
    theirs = least_squares(residuals, [0.0, 0.0], loss=loss, f_scale=width, **exact)
    found = minimum(residuals, [0.0, 0.0], Loss(loss, width, 30), tolerance=1e-13, max_steps=500)
    assert found.status == CONVERGED
    np.testing.assert_allclose(found.x, theirs.x, rtol=1e-6)
    assert float(found.cost) == pytest.approx(theirs.cost, rel=1e-12)
    away = np.abs(np.asarray(found.x) - [2.0, 3.0])
    assert (away.max() > 0.1) == (loss == "linear")


def test_linear_problems():
    """A prior beside an outlier: the minimum of ln(1 + (x - 10)^2) / 2 + x^2 / 2, by its derivative."""
    end = minimum(lambda x: jnp.stack([x[0] - 10, x[0]]), [9.0], Loss("cauchy", 1.0, 1), tolerance=1e-14)
    x = float(end.x[0])
    assert (x - 10) / (1 + (x - 10) ** 2) + x == pytest.approx(0, abs=1e-6)
    A = np.random.default_rng(1).standard_normal((6, 3))
    b = np.arange(6.0)
    iterate = started(lambda x: A @ x - b, np.zeros(3))._replace(own=jnp.asarray(1e-29))
    after = one_step(lambda x: A @ x - b)(iterate, longest=1e3)
    np.testing.assert_allclose(after.x, np.linalg.lstsq(A, b, rcond=None)[0], rtol=1e-10)

    def residuals(x):
        return x - 1e3

    iterate = started(residuals, [0.0, 0.0])
    step_from = one_step(residuals)
    for longest in (0.5, 3.0):
        after = step_from(iterate, longest=longest)
        assert np.max(np.abs(after.x)) == pytest.approx(longest)


def test_ends():
    def root(x):  # no step lowers it, but the derivative promises one
        return jnp.stack([jnp.sqrt(jnp.abs(x[0])) + 1.0])

    def wrong(x):
        return root(x), jnp.array([[-1.0]])

    iterate = started(root, [0.0])
    step_from = one_step(root, wrong)
    for _ in range(20):
        iterate = step_from(iterate)
    assert iterate.status == STALLED and iterate.x[0] == 0 and iterate.own == STIFFEST
    after = step_from(iterate)
    assert all(np.all(a == b) for a, b in zip(after, iterate, strict=True))  # it is unchanged
    unknown = one_step(lambda x: x, lambda x: (x, jnp.array([[jnp.nan]])))
    infinite = unknown(started(lambda x: x, [1.0]))
    assert infinite.status == NOT_FINITE and infinite.x[0] == 1.0


def test_vmap_is_a_loop():
    starts = jnp.asarray([[-1.2, 1.0], [2.0, -3.0], [0.0, 5.0]])

    def two(x):
        one = functools.partial(step, rosenbrock, both(rosenbrock))
        return one(one(first_iterate(rosenbrock, x, SQUARES, 1e-3)))

    together = jax.jit(jax.vmap(two))(starts)
    for i, x in enumerate(starts):
        for a, b in zip(jax.tree.leaves(jax.jit(two)(x)), jax.tree.leaves(together), strict=True):
            # A cost of 1e-5 is the rounding error of numbers of size 1 to 100.
            np.testing.assert_allclose(a, b[i], rtol=1e-10, atol=1e-14)


def test_large_residuals_at_the_minimum():
    """Undamped Gauss-Newton steps would grow here, because the curvature of the residuals outweighs J^T J."""
    y = np.array([1.0, -4.0, 3.0])

    def residuals(x):
        return jnp.stack([x[0] - y[0], 0.6 * x[0] ** 2 - y[1], x[0] ** 3 / 6 - y[2]])

    end = minimum(residuals, [2.0], tolerance=1e-16)
    assert end.status == CONVERGED
    slope = jax.grad(lambda x: 0.5 * jnp.sum(residuals(x) ** 2))
    assert abs(float(slope(end.x)[0])) < 1e-7


def test_where_the_model_is_no_number_the_way_is_shorter():
    end = minimum(lambda x: jnp.stack([jnp.log(x[0]), jnp.sqrt(x[0]) - 0.2]), [3.0], tolerance=1e-12)
    assert end.status == CONVERGED and np.isfinite(end.x).all()


def test_a_kink_at_the_minimum():
    """Like a shift that is linear between the entries of a table."""

    def residuals(x):
        return jnp.stack([1.0 + jnp.abs(x[0] - 0.3), 0.1 * (x[0] - 5.0), x[1] - x[0]])

    end = minimum(residuals, [2.0, 0.0])
    assert float(end.cost) == pytest.approx(0.5 * (1 + 0.47**2), rel=1e-2) and end.njev < 80


@pytest.mark.slow
@pytest.mark.parametrize("loss", [SQUARES, Loss("cauchy", 5.0, 3)], ids=["squares", "cauchy"])
def test_corrections_are_steps_of_broyden(loss):
    """They solve F(m) = J^T (r(x + m) - r(x) - J dx) + lambda (m - dx) = 0, here with the whole matrix.

    With a robust loss, the rows of r(x + m) - r(x) and J have the factors of the loss.
    """

    def residuals(x):
        bend = x[1] - x[0] ** 2 + 0.3 * jnp.sin(x[0])
        return jnp.stack([3 * bend, 1 - x[0], 2 * (x[2] - jnp.exp(x[0] * x[1])), 0.3 * x[2]])

    x = jnp.asarray([-0.5, 0.4, 1.0])
    r, J = both(residuals)(x)
    iterate = first_iterate(residuals, x, loss, 1.0)
    plan = plan_step(r, J, iterate, loss)
    of_rows, factor = loss.factors(r)
    J = factor[:, None] * J
    dx, damping = plan.moves[0], plan.dampings[0] * np.linalg.norm(J, 2) ** 2
    matrix = J.T @ J + damping * np.eye(3)
    np.testing.assert_allclose(dx, -np.linalg.solve(matrix, J.T @ (of_rows * r)), rtol=1e-12)

    def F(m):
        return J.T @ (factor * (residuals(x + m) - r) - J @ dx) + damping * (m - dx)

    trial, m, left = first_trial(plan), np.zeros(3), [F(np.zeros(3))]
    for count in range(CORRECTIONS + 1):
        s = -np.linalg.solve(matrix, left[-1])
        m = m + s
        assert trial.index == 0 and trial.count == count and not trial.done
        np.testing.assert_allclose(trial.move, m, rtol=1e-9)
        left.append(F(m))
        matrix = matrix + np.outer(left[-1] - left[-2] - matrix @ s, s) / (s @ s)
        # No decrease of the cost is enough, so that no correction is omitted.
        trial = after_evaluation(plan, trial, residuals(x + trial.move), iterate._replace(cost=-1e9), loss)
    assert np.linalg.norm(left[-1]) < 1e-2 * np.linalg.norm(left[1])
    assert trial.index == 1 and trial.count == 0 and trial.nfev == CORRECTIONS + 1
