"""Solvers of least squares without friction: standard problems, robust losses against SciPy, how they end.

The solvers are Levenberg-Marquardt and the quadratic models of Brown and Dennis. The problems are in
`support.oracles.least_squares`.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares
from support.oracles.least_squares import (
    PROBLEMS,
    STALLING,
    bard,
    beale,
    brown_dennis,
    freudenstein_roth,
    helical_valley,
    jennrich_sampson,
    kowalik_osborne,
    meyer,
    powell_singular,
    rosenbrock,
    wood,
)

from fitting.solvers.brown_dennis import after_move, begin_quadratic, propose_move
from fitting.solvers.levenberg_marquardt import STIFFEST, step
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
    Loss,
    first_iterate,
)

# Most Jacobians: by Levenberg-Marquardt, with two to four evaluations of the residuals each, and by Brown and
# Dennis, with one.
JACOBIANS = {
    rosenbrock: (15, 12),
    powell_singular: (40, 12),
    helical_valley: (15, 14),
    wood: (80, 40),
    beale: (12, 10),
    brown_dennis: (80, 24),
    freudenstein_roth: (40, 24),
    jennrich_sampson: (35, 16),  # the last steps, at the rounding of its cost, depend on compiler options
    bard: (12, 8),
    kowalik_osborne: (20, 30),
    meyer: (60, 38),
}


def both(residuals):
    return lambda x: (residuals(x), jax.jacfwd(residuals)(x))


def on_host(residuals):
    """Residuals and Jacobian, NumPy."""
    compiled = jax.jit(both(residuals))
    return lambda x: [np.asarray(part) for part in compiled(jnp.asarray(x))]


def started(residuals, x, loss=SQUARES):
    def begin(x):
        return first_iterate(loss.cost(residuals(x)), x, jnp.asarray(1e-3))

    return jax.jit(begin)(np.asarray(x, float))


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


def quadratic_minimum(evaluate, x, most=300, longest=3.0, **options):
    """The iterate at which moves of Brown and Dennis from x end."""
    x = np.asarray(x, float)
    iterate = begin_quadratic(x, *evaluate(x))
    while iterate.status == RUNNING and iterate.nfev < most:
        move = propose_move(iterate, longest)
        assert np.max(np.abs(move)) <= longest * (1 + 1e-12)
        iterate = after_move(iterate, move, *evaluate(iterate.x + move), longest=longest, **options)
    assert iterate.nfev == iterate.njev
    return iterate


def by_brown_dennis(residuals, x, exact=None, **options):
    """Return the result in the form of `minimum`."""
    evaluate = on_host(residuals)
    slopes = evaluate if exact is None else on_host(exact)
    return quadratic_minimum(lambda x: (evaluate(x)[0], slopes(x)[1]), x, **options)


methods = pytest.mark.parametrize(
    "solve", [minimum, by_brown_dennis], ids=["levenberg_marquardt", "brown_dennis"]
)


# --- both


@methods
@pytest.mark.parametrize("residuals", PROBLEMS, ids=lambda residuals: residuals.__name__)
def test_standard_problems(residuals, solve):
    x, squares = PROBLEMS[residuals]
    end = solve(residuals, x, tolerance=1e-10, rounding=1e-26, longest=100.0)
    print(f"\n{residuals.__name__}: {MESSAGES[int(end.status)]}, {end.njev} Jacobians, {2 * end.cost:.12g}")
    assert end.njev <= JACOBIANS[residuals][solve is by_brown_dennis]
    assert end.status == (PRECISE if residuals in STALLING else CONVERGED if squares else PERFECT)
    assert 2 * float(end.cost) == pytest.approx(squares, rel=1e-9, abs=1e-25)
    assert solve is by_brown_dennis or 1 + 2 * end.njev <= end.nfev <= 1 + 4 * end.njev


@methods
def test_directions_that_the_residuals_do_not_see_are_left(solve):
    for x in (2.0, 5.0):
        end = solve(lambda x: jnp.stack([x[0] - 1.0, 2 * x[0] - 1.0]), [x, 7.0])
        assert end.status == CONVERGED and end.x[1] == 7.0
        assert float(end.x[0]) == pytest.approx(0.6)
    end = solve(lambda x: jnp.ones(3) + 0 * x[0], [5.0])
    assert end.status == CONVERGED and end.x[0] == 5.0


@methods
def test_a_model_that_is_known_to_some_digits_only(solve):
    """Like temperatures that are iterated to a tolerance: steps end where the noise hides the minimum."""

    def exact(x):
        return jnp.stack([x[0] - 3.0, 2.0 * x[0] - 5.0, jnp.exp(x[1]) - 2.0, jnp.exp(x[1]) - 1.5])

    def known(x):
        return exact(x) + 1e-5 * jnp.sin(1e9 * x[jnp.array([0, 0, 1, 1])])

    tolerance = {"tolerance": 1e-15} if solve is by_brown_dennis else {}
    end = solve(known, [0.0, 3.0], exact=exact, **tolerance)
    assert end.status == PRECISE
    np.testing.assert_allclose(end.x, [2.6, np.log(1.75)], atol=3e-3)


# --- Levenberg-Marquardt


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
    assert started(lambda x: jnp.log(x), [-1.0]).status == NOT_FINITE
    unknown = one_step(lambda x: x, lambda x: (x, jnp.array([[jnp.nan]])))
    infinite = unknown(started(lambda x: x, [1.0]))
    assert infinite.status == NOT_FINITE and infinite.x[0] == 1.0


def test_vmap_is_a_loop():
    starts = jnp.asarray([[-1.2, 1.0], [2.0, -3.0], [0.0, 5.0]])

    def two(x):
        one = functools.partial(step, rosenbrock, both(rosenbrock))
        return one(one(first_iterate(SQUARES.cost(rosenbrock(x)), x, jnp.asarray(1e-3))))

    together = jax.jit(jax.vmap(two))(starts)
    for i, x in enumerate(starts):
        for a, b in zip(jax.tree.leaves(jax.jit(two)(x)), jax.tree.leaves(together), strict=True):
            # A cost of 1e-5 is the rounding error of numbers of size 1 to 100.
            np.testing.assert_allclose(a, b[i], rtol=1e-10, atol=1e-14)


# --- Brown and Dennis


def test_large_residuals_end_as_those_of_newton():
    """Gauss-Newton steps would shrink by a constant factor, and here grow: S outweighs J^T J."""
    y = np.array([1.0, -4.0, 3.0])

    def residuals(x):
        return jnp.stack([x[0] - y[0], 0.6 * x[0] ** 2 - y[1], x[0] ** 3 / 6 - y[2]])

    tried = []
    evaluate = on_host(residuals)
    end = quadratic_minimum(lambda x: tried.append(float(x[0])) or evaluate(x), [2.0], tolerance=1e-16)
    assert end.status == CONVERGED
    slope = jax.grad(lambda x: 0.5 * jnp.sum(residuals(x) ** 2))
    assert abs(float(slope(jnp.asarray(end.x))[0])) < 1e-7
    away = np.abs(np.array(tried[-4:]) - end.x[0])
    assert away[-2] < 0.01 * away[-3] or away[-2] < 1e-9


def test_no_move_is_longer_than_allowed_nor_than_trusted():
    evaluate = on_host(lambda x: x - 1e3)
    x = np.zeros(2)
    iterate = begin_quadratic(x, *evaluate(x))
    assert np.linalg.norm(propose_move(iterate)) == pytest.approx(0.85, rel=0.18)
    wide = iterate._replace(own=iterate.own._replace(radius=np.asarray(1e9)))
    assert np.max(np.abs(propose_move(wide, longest=0.5))) == pytest.approx(0.42, rel=0.2)


def test_where_the_model_is_no_number_the_way_is_shorter():
    evaluate = on_host(lambda x: jnp.stack([jnp.log(x[0]), jnp.sqrt(x[0]) - 0.2]))
    end = quadratic_minimum(evaluate, [3.0], tolerance=1e-12)
    assert end.status == CONVERGED and np.isfinite(end.x).all()
    x = np.array([-1.0])
    assert begin_quadratic(x, *evaluate(x)).status == NOT_FINITE


def test_a_fit_that_stalls():
    def root(x):  # no move lowers it, but the derivative promises one
        return np.sqrt(np.abs(x)) + 1.0, np.array([[-1.0]])

    end = quadratic_minimum(root, [0.0])
    assert end.status == STALLED and end.x[0] == 0


def test_a_kink_at_the_minimum():
    """Like a shift that is linear between the entries of a table."""

    def residuals(x):
        return jnp.stack([1.0 + jnp.abs(x[0] - 0.3), 0.1 * (x[0] - 5.0), x[1] - x[0]])

    end = quadratic_minimum(on_host(residuals), [2.0, 0.0])
    assert float(end.cost) == pytest.approx(0.5 * (1 + 0.47**2), rel=1e-2) and end.nfev < 80
