"""Levenberg-Marquardt without friction: standard problems, robust losses against SciPy, and how it ends.

The problems are those of Moré, Garbow and Hillstrom, "Testing unconstrained optimization software", ACM
Transactions on Mathematical Software 7 (1981) 17, whose minima and starts they give.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from fitting.solvers.iterate import (
    CONVERGED,
    MESSAGES,
    NOT_FINITE,
    PERFECT,
    PRECISE,
    RUNNING,
    STALLED,
    begin,
)
from fitting.solvers.losses import SQUARES, WIDTHS, Loss
from fitting.solvers.methods.levenberg_marquardt import STIFFEST, step

BARD = jnp.array([0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39])
KOWALIK = jnp.array([0.1957, 0.1947, 0.1735, 0.16, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246])
AT = jnp.array([4, 2, 1, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625])
MEYER = jnp.array(
    [34780, 28610, 23650, 19630, 16370, 13720, 11540, 9744, 8261, 7030, 6005, 5147, 4427, 3820, 3307, 2872]
)


def rosenbrock(x):
    return jnp.stack([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def powell_singular(x):
    a, b, c, d = x
    return jnp.stack([a + 10 * b, jnp.sqrt(5) * (c - d), (b - 2 * c) ** 2, jnp.sqrt(10) * (a - d) ** 2])


def helical_valley(x):
    a, b, c = x
    angle = jnp.arctan2(b, a) / (2 * jnp.pi)
    return jnp.stack([10 * (c - 10 * angle), 10 * (jnp.hypot(a, b) - 1), c])


def wood(x):
    a, b, c, d = x
    root = jnp.sqrt(10.0)
    rows = [10 * (b - a**2), 1 - a, 3 * root * (d - c**2), 1 - c, root * (b + d - 2), (b - d) / root]
    return jnp.stack(rows)


def beale(x):
    power = jnp.arange(1, 4)
    return jnp.array([1.5, 2.25, 2.625]) - x[0] * (1 - x[1] ** power)


def brown_dennis(x):
    t = jnp.arange(1, 21) / 5
    return (x[0] + t * x[1] - jnp.exp(t)) ** 2 + (x[2] + x[3] * jnp.sin(t) - jnp.cos(t)) ** 2


def freudenstein_roth(x):
    a, b = x
    return jnp.stack([-13 + a + ((5 - b) * b - 2) * b, -29 + a + ((b + 1) * b - 14) * b])


def jennrich_sampson(x):
    i = jnp.arange(1, 11)
    return 2 + 2 * i - (jnp.exp(i * x[0]) + jnp.exp(i * x[1]))


def bard(x):
    u = jnp.arange(1.0, 16)
    return BARD - (x[0] + u / ((16 - u) * x[1] + jnp.minimum(u, 16 - u) * x[2]))


def kowalik_osborne(x):
    return KOWALIK - x[0] * (AT**2 + AT * x[1]) / (AT**2 + AT * x[2] + x[3])


def meyer(x):
    """In units of the start, as a fit has its parameters."""
    x = x * jnp.array([0.02, 4000.0, 250.0])
    return x[0] * jnp.exp(x[1] / (45 + 5 * jnp.arange(1, 17) + x[2])) - MEYER


# Start, sum of squares at the minimum, steps at most. At the minima of `STALLING` the Jacobian is singular,
# so that the linear model goes on promising a little.
STALLING = (freudenstein_roth, jennrich_sampson)
PROBLEMS = {
    rosenbrock: ([-1.2, 1.0], 0.0, 15),
    powell_singular: ([3.0, -1.0, 0.0, 1.0], 0.0, 40),
    helical_valley: ([-1.0, 0.0, 0.0], 0.0, 15),
    wood: ([-3.0, -1.0, -3.0, -1.0], 0.0, 80),
    beale: ([1.0, 1.0], 0.0, 12),
    brown_dennis: ([25.0, 5.0, -5.0, -1.0], 85822.2016263, 80),
    freudenstein_roth: ([0.5, -2.0], 48.9842536792, 40),
    jennrich_sampson: ([0.3, 0.4], 124.362182355, 30),
    bard: ([1.0, 1.0, 1.0], 8.21487730658e-3, 12),
    kowalik_osborne: ([0.25, 0.39, 0.415, 0.39], 3.07505603849e-4, 20),
    meyer: ([1.0, 1.0, 1.0], 87.9458551708, 60),
}


def both(residuals):
    return lambda x: (residuals(x), jax.jacfwd(residuals)(x))


def started(residuals, x, loss=SQUARES):
    x = jnp.asarray(x, float)
    return begin(loss.cost(residuals(x)), x, jnp.asarray(1e-3))


def minimum(residuals, x, loss=SQUARES, max_steps=200, **options):
    """The iterate at which steps from x end."""
    one = jax.jit(functools.partial(step, residuals, both(residuals), loss=loss, **options))
    iterate = started(residuals, x, loss)
    for _ in range(max_steps):
        if iterate.status != RUNNING:
            break
        iterate = one(iterate)
    return iterate


@pytest.mark.parametrize("residuals", PROBLEMS, ids=lambda residuals: residuals.__name__)
def test_standard_problems(residuals):
    x, squares, steps = PROBLEMS[residuals]
    end = minimum(residuals, x, tolerance=1e-10, rounding=1e-26, longest=100.0)
    print(f"\n{residuals.__name__}: {MESSAGES[int(end.status)]}, {end.njev} steps, {2 * end.cost:.12g}")
    assert end.njev <= steps
    assert end.status == (PRECISE if residuals in STALLING else CONVERGED if squares else PERFECT)
    assert 2 * float(end.cost) == pytest.approx(squares, rel=1e-9, abs=1e-25)
    assert end.nfev == 1 + 4 * end.njev


@pytest.mark.parametrize("loss", WIDTHS)
def test_robust_losses_of_a_straight_line_against_scipy(loss):
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 1.0, 30)
    y = 2.0 + 3.0 * t + 0.1 * rng.standard_normal(30)
    y[[3, 17, 25]] += [4.0, -6.0, 5.0]
    width = 0.1 * WIDTHS[loss]

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


def test_rows_beyond_those_of_the_loss_count_by_their_squares():
    """A prior beside an outlier: the minimum of ln(1 + (x - 10)^2) / 2 + x^2 / 2, by its derivative."""
    end = minimum(lambda x: jnp.stack([x[0] - 10, x[0]]), [9.0], Loss("cauchy", 1.0, 1), tolerance=1e-14)
    x = float(end.x[0])
    assert (x - 10) / (1 + (x - 10) ** 2) + x == pytest.approx(0, abs=1e-6)


def test_one_step_of_a_linear_problem_without_damping_is_its_solution():
    A = np.random.default_rng(1).standard_normal((6, 3))
    b = np.arange(6.0)
    iterate = started(lambda x: A @ x - b, np.zeros(3))._replace(own=jnp.asarray(1e-29))
    after = step(lambda x: A @ x - b, both(lambda x: A @ x - b), iterate, longest=1e3)
    np.testing.assert_allclose(after.x, np.linalg.lstsq(A, b, rcond=None)[0], rtol=1e-10)


def test_no_step_is_longer_than_allowed():
    def residuals(x):
        return x - 1e3

    iterate = started(residuals, [0.0, 0.0])
    for longest in (0.5, 3.0):
        after = step(residuals, both(residuals), iterate, longest=longest)
        assert np.max(np.abs(after.x)) == pytest.approx(longest)


def test_directions_that_the_residuals_do_not_see_are_left():
    end = minimum(lambda x: jnp.stack([x[0] - 1.0, 2 * x[0] - 1.0]), [5.0, 7.0])
    assert end.status == CONVERGED and end.x[1] == 7.0
    assert float(end.x[0]) == pytest.approx(0.6)
    end = minimum(lambda x: jnp.ones(3) + 0 * x[0], [5.0])
    assert end.status == CONVERGED and end.x[0] == 5.0


def test_ends():
    def root(x):  # no step lowers it, but the derivative promises one
        return jnp.stack([jnp.sqrt(jnp.abs(x[0])) + 1.0])

    def wrong(x):
        return root(x), jnp.array([[-1.0]])

    iterate = started(root, [0.0])
    for _ in range(20):
        iterate = step(root, wrong, iterate)
    assert iterate.status == STALLED and iterate.x[0] == 0 and iterate.own == STIFFEST
    after = step(root, wrong, iterate)
    assert all(np.all(a == b) for a, b in zip(after, iterate, strict=True))  # it stays as it is
    assert started(lambda x: jnp.log(x), [-1.0]).status == NOT_FINITE
    infinite = step(lambda x: x, lambda x: (x, jnp.array([[jnp.nan]])), started(lambda x: x, [1.0]))
    assert infinite.status == NOT_FINITE and infinite.x[0] == 1.0


def test_a_model_that_is_known_to_some_digits_only():
    """As temperatures that are iterated to a tolerance: steps end where its noise hides the minimum."""

    def exact(x):
        return jnp.stack([x[0] - 3.0, 2.0 * x[0] - 5.0, jnp.exp(x[1]) - 2.0, jnp.exp(x[1]) - 1.5])

    def known(x):
        return exact(x) + 1e-5 * jnp.sin(1e9 * x[jnp.array([0, 0, 1, 1])])

    iterate = started(known, [0.0, 3.0])
    one = jax.jit(functools.partial(step, known, lambda x: (known(x), jax.jacfwd(exact)(x))))
    for _ in range(100):
        iterate = one(iterate)
    assert iterate.status == PRECISE
    np.testing.assert_allclose(iterate.x, [2.6, np.log(1.75)], atol=3e-3)


def test_vmap_is_a_loop():
    starts = jnp.asarray([[-1.2, 1.0], [2.0, -3.0], [0.0, 5.0]])

    def two(x):
        one = functools.partial(step, rosenbrock, both(rosenbrock))
        return one(one(begin(SQUARES.cost(rosenbrock(x)), x, jnp.asarray(1e-3))))

    together = jax.jit(jax.vmap(two))(starts)
    for i, x in enumerate(starts):
        for a, b in zip(jax.tree.leaves(jax.jit(two)(x)), jax.tree.leaves(together), strict=True):
            np.testing.assert_allclose(a, b[i], rtol=1e-10)
