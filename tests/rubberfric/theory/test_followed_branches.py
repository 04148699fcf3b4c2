"""Branches of a cubic with known folds: where they end, and where they jump."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rubberfric.theory.heat.branch import arrive, begin_at, path

# y^3 - 3 y = 3 s: from s -> -inf the solution below -1 until s = 2/3, from s -> inf that above 1 until -2/3.
LENGTH = np.array([1.0, -0.5, 0.25])


def cubic(log_v, rises):
    """A steep first direction, and two others that follow it and decay."""
    y = rises[:, 0]
    first = -(y**3 - 3 * y - 3 * log_v)
    others = LENGTH[1:] * y[:, None] - rises[:, 1:]
    return jnp.concatenate([0.5 * first[:, None], others], 1)


def roots(s):
    found = np.roots([1.0, 0.0, -3.0, -3.0 * s])
    return np.sort(found[np.abs(found.imag) < 1e-9].real)


@functools.partial(jax.jit, static_argnums=1)
def branch(targets, direction):
    begin = begin_at(jnp.array([-direction * 10.0]), jnp.array([[-direction * 3.0, 0.0, 0.0]]))
    places = path(cubic, begin, targets, direction)
    return arrive(cubic, places, targets, 1e-9)


def followed(targets, direction):
    """At up to 10 targets."""
    return [x[: len(targets)] for x in branch(jnp.asarray(np.resize(targets, 10)), direction)]


@pytest.mark.parametrize("direction", [1, -1])
def test_branches_end_at_their_folds_and_jump(direction):
    targets = direction * np.array([-10.0, -4.0, -0.9, -0.6, 0.0, 0.6, 0.66, 0.67, 0.8, 5.0])
    rises, arrived = followed(targets, direction)
    assert arrived.all()
    # The root on the side from where the branch comes, until there is the other one alone.
    wanted = [roots(s)[0 if direction > 0 else -1] for s in targets]
    np.testing.assert_allclose(rises, np.outer(wanted, LENGTH), rtol=1e-8)
    assert np.sign(wanted[-4]) == -direction and np.sign(wanted[-3]) == direction


def test_places_on_a_branch():
    targets = np.array([-7.3, -0.2, 0.5, 2.2, 9.0])
    together = followed(targets, 1)[0]
    for i, target in enumerate(targets):
        np.testing.assert_array_equal(followed([target, -12.0, target], 1)[0][0], together[i])
    np.testing.assert_array_equal(followed(targets[::-1], 1)[0], together[::-1])
    rises, arrived = followed([-12.0], 1)
    assert arrived.all()
    np.testing.assert_allclose(rises[0, 0], roots(-12.0)[0], rtol=1e-8)
