"""Least squares by quadratic models of the residuals: standard problems, noise, and how it ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
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
from fitting.solvers.iterate import CONVERGED, MESSAGES, NOT_FINITE, PERFECT, PRECISE, RUNNING, STALLED

# Evaluations at most; of Levenberg-Marquardt they are five times its steps.
EVALUATIONS = {
    rosenbrock: 12,
    powell_singular: 12,
    helical_valley: 14,
    wood: 40,
    beale: 10,
    brown_dennis: 24,
    freudenstein_roth: 24,
    jennrich_sampson: 16,
    bard: 8,
    kowalik_osborne: 30,
    meyer: 38,
}


def both(residuals):
    """Residuals and Jacobian, NumPy."""
    compiled = jax.jit(lambda x: (residuals(x), jax.jacfwd(residuals)(x)))
    return lambda x: [np.asarray(part) for part in compiled(jnp.asarray(x))]


def minimum(evaluate, x, most=300, longest=3.0, **options):
    """The iterate at which moves from x end."""
    x = np.asarray(x, float)
    iterate = begin_quadratic(x, *evaluate(x))
    while iterate.status == RUNNING and iterate.nfev < most:
        move = propose_move(iterate, longest)
        assert np.max(np.abs(move)) <= longest * (1 + 1e-12)
        iterate = after_move(iterate, move, *evaluate(iterate.x + move), longest=longest, **options)
    return iterate


@pytest.mark.parametrize("residuals", PROBLEMS, ids=lambda residuals: residuals.__name__)
def test_standard_problems(residuals):
    x, squares = PROBLEMS[residuals]
    end = minimum(both(residuals), x, tolerance=1e-10, rounding=1e-26, longest=100.0)
    print(f"\n{residuals.__name__}: {MESSAGES[int(end.status)]}, {end.nfev} evaluations, {2 * end.cost:.12g}")
    assert end.nfev <= EVALUATIONS[residuals] and end.nfev == end.njev
    assert end.status == (PRECISE if residuals in STALLING else CONVERGED if squares else PERFECT)
    assert 2 * float(end.cost) == pytest.approx(squares, rel=1e-9, abs=1e-25)


def test_large_residuals_end_as_those_of_newton():
    """Gauss-Newton steps would shrink by a constant factor, and here grow: S outweighs J^T J."""
    y = np.array([1.0, -4.0, 3.0])

    def residuals(x):
        return jnp.stack([x[0] - y[0], 0.6 * x[0] ** 2 - y[1], x[0] ** 3 / 6 - y[2]])

    tried = []
    evaluate = both(residuals)
    end = minimum(lambda x: tried.append(float(x[0])) or evaluate(x), [2.0], tolerance=1e-16)
    assert end.status == CONVERGED
    slope = jax.grad(lambda x: 0.5 * jnp.sum(residuals(x) ** 2))
    assert abs(float(slope(jnp.asarray(end.x))[0])) < 1e-7
    away = np.abs(np.array(tried[-4:]) - end.x[0])
    assert away[-2] < 0.01 * away[-3] or away[-2] < 1e-9


def test_directions_that_the_residuals_do_not_see_are_left():
    end = minimum(both(lambda x: jnp.stack([x[0] - 1.0, 2 * x[0] - 1.0])), [2.0, 7.0])
    assert end.status == CONVERGED and end.x[1] == 7.0 and end.x[0] == pytest.approx(0.6)
    end = minimum(both(lambda x: jnp.ones(3) + 0 * x[0]), [5.0])
    assert end.status == CONVERGED and end.x[0] == 5.0


def test_no_move_is_longer_than_allowed_nor_than_trusted():
    evaluate = both(lambda x: x - 1e3)
    x = np.zeros(2)
    iterate = begin_quadratic(x, *evaluate(x))
    assert np.linalg.norm(propose_move(iterate)) == pytest.approx(0.85, rel=0.18)
    wide = iterate._replace(own=iterate.own._replace(radius=np.asarray(1e9)))
    assert np.max(np.abs(propose_move(wide, longest=0.5))) == pytest.approx(0.42, rel=0.2)


def test_where_the_model_is_no_number_the_way_is_shorter():
    evaluate = both(lambda x: jnp.stack([jnp.log(x[0]), jnp.sqrt(x[0]) - 0.2]))
    end = minimum(evaluate, [3.0], tolerance=1e-12)
    assert end.status == CONVERGED and np.isfinite(end.x).all()
    x = np.array([-1.0])
    assert begin_quadratic(x, *evaluate(x)).status == NOT_FINITE


def test_ends():
    def root(x):  # no move lowers it, but the derivative promises one
        return np.sqrt(np.abs(x)) + 1.0, np.array([[-1.0]])

    end = minimum(root, [0.0])
    assert end.status == STALLED and end.x[0] == 0


def test_a_model_that_is_known_to_some_digits_only():
    """As temperatures that are iterated to a tolerance: moves end where its noise hides the minimum."""

    def exact(x):
        return jnp.stack([x[0] - 3.0, 2.0 * x[0] - 5.0, jnp.exp(x[1]) - 2.0, jnp.exp(x[1]) - 1.5])

    evaluate = both(exact)

    def known(x):
        rows, jacobian = evaluate(x)
        return rows + 1e-5 * np.sin(1e9 * x[[0, 0, 1, 1]]), jacobian

    end = minimum(known, [0.0, 3.0], tolerance=1e-15)
    assert end.status == PRECISE
    np.testing.assert_allclose(end.x, [2.6, np.log(1.75)], atol=3e-3)


def test_a_kink_at_the_minimum():
    """As of a shift that is linear between the entries of a table."""

    def residuals(x):
        return jnp.stack([1.0 + jnp.abs(x[0] - 0.3), 0.1 * (x[0] - 5.0), x[1] - x[0]])

    end = minimum(both(residuals), [2.0, 0.0])
    assert float(end.cost) == pytest.approx(0.5 * (1 + 0.47**2), rel=1e-2) and end.nfev < 80
