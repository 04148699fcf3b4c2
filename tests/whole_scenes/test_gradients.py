"""Gradients of area, friction and separation with respect to every real leaf of every scene.

Errors are measured against |Q| + |dQ/d ln theta|, the change that matters in a fit: a
parameter off by a part moves the quantity by that part of it. A separation counts from
1e-6 of the rms height upwards.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases.stored import (
    QUANTITIES,
    arguments,
    h_rms,
    leaf_value,
    paths,
    quantities,
    reference,
    reverse,
)

import rubberfric as rf

SCENES = reference("forward_cases") | reference("edge_cases")
OPTIONS = reference("option_cases")
DERIVATIVES = {f"{name}-by-oracle": case for name, case in reference("derivative_cases").items()}

# Kinds of scene apart from those of test_extremes; all others are marked slow.
ORDINARY = (
    "case3-rough-rubber-smooth-elastic-1",
    "elastic-elastic-1",
    "smooth-rubber-rough-rigid-1",
    "extreme-light-1",
    "extreme-heavy-1",
)
BOTH_MODES = ("smooth-rubber-rough-rigid-1", "extreme-light-1", "extreme-heavy-1")

BATCH = 32
forward = jax.jit(jax.jacfwd(quantities))
batch_of_values = jax.jit(jax.vmap(quantities))


def columns(tree):
    """Jacobian as (leaf element, quantity)."""
    return np.concatenate([np.asarray(x).reshape(len(QUANTITIES), -1).T for x in jax.tree.leaves(tree)])


def flat(tree):
    return np.concatenate([np.ravel(x) for x in jax.tree.leaves(tree)])


def unflatten(tree, rows):
    """Rows of leaf elements as a batch of trees."""
    leaves, structure = jax.tree.flatten(tree)
    parts = np.split(rows, np.cumsum([leaf.size for leaf in leaves])[:-1], axis=1)
    parts = [jnp.asarray(part.reshape(-1, *leaf.shape)) for part, leaf in zip(parts, leaves, strict=True)]
    return structure.unflatten(parts)


def values(tree, rows):
    """Quantities at rows of leaf elements, in batches of one size, so that little memory is needed."""
    count = len(rows)
    rows = np.concatenate([rows, np.repeat(rows[-1:], -count % BATCH, axis=0)])
    parts = [batch_of_values(unflatten(tree, part)) for part in np.split(rows, len(rows) // BATCH)]
    return np.concatenate(parts)[:count]


def names_of(tree):
    """Name of every leaf element."""
    leaves = jax.tree.leaves(tree)
    return [name for name, leaf in zip(paths(tree), leaves, strict=True) for _ in range(leaf.size)]


@functools.cache
def result(name):
    case = (SCENES | OPTIONS | DERIVATIVES)[name]
    at = arguments(case)
    Q, slopes = reverse(at)
    return at, np.asarray(Q), columns(slopes)


def scale(name, Q, slope, theta):
    """|Q| + |dQ/d ln theta|, shape (leaf element, quantity)."""
    floor = np.array([0.0, 0.0, 1e-6 * h_rms((SCENES | OPTIONS | DERIVATIVES)[name])])
    total = np.abs(Q) + floor + np.abs(slope * theta[:, None])
    return np.where(total > 0, total, 1.0)  # friction that is zero, and exactly so


ALL = [*SCENES, *(name for name in OPTIONS if "table-modulus" not in name)]


def every_scene(ordinary):
    return pytest.mark.parametrize(
        "name", [n if n in ordinary else pytest.param(n, marks=pytest.mark.slow) for n in ALL]
    )


@every_scene(ORDINARY)
def test_finite(name):
    at, Q, slopes = result(name)
    assert np.isfinite(Q).all()
    bad = [n for n, s in zip(names_of(at), slopes, strict=True) if not np.isfinite(s).all()]
    assert not bad


@every_scene(BOTH_MODES)
@pytest.mark.slow
def test_forward_equals_reverse(name):
    at, Q, slopes = result(name)
    theta = flat(at)
    unit = np.where(theta != 0, np.abs(theta), 1.0)
    error = np.abs(columns(forward(at)) - slopes) * unit[:, None]
    assert (error <= 1e-12 * scale(name, Q, slopes, unit)).all()


ONE_SIDED = np.arange(1.0, 7.0)
TWO_SIDED = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])


def derivative_weights(offsets):
    """Weights of f(offsets) - f(0) for f'(0), exact for polynomials of degree 6."""
    unit = np.abs(offsets).max()
    return np.linalg.solve(np.vander(offsets / unit, 7, increasing=True)[:, 1:].T, np.eye(6)[0]) / unit


def stencil(name, theta, case):
    """(side, step) of a leaf element: side 0 is two-sided; steps in ln theta, or theta if it is 0."""
    solid, psd = ("solid1", "psd1") if ".lower" in name else ("solid2", "psd2")
    if theta == 0:  # E_i = 0 and E_inf = 0, moved up in units of the smallest modulus of the solid
        return 1, 1e-3
    if name.endswith((".q0", ".qr", ".q1")):
        q0, qr, q1 = (case[psd][key] for key in ("q0", "qr", "q1"))
        below = {"q0": np.inf, "qr": np.log(qr / q0), "q1": np.log(q1 / qr)}[name[-2:]]
        above = {"q0": np.log(qr / q0), "qr": np.log(q1 / qr), "q1": np.inf}[name[-2:]]
        if below == 0 or above == 0:
            return (1 if below == 0 else -1), 4e-3
        return 0, min(4e-3, 0.02 * min(below, above))
    if name.endswith(".poisson") and case[solid].get("thickness"):
        # A slab differs from an incompressible one once 1 - 2 nu exceeds (q d)^2.
        q0 = min(case[key]["q0"] for key in ("psd1", "psd2") if case[key])
        step = min(1e-3, 0.003 * (1 - 2 * theta + (q0 * case[solid]["thickness"]) ** 2))
        return (-1 if theta == 0.5 else 0), step
    return 0, 4e-3


def differences(name, case):
    """d quantity / d theta of every leaf element, from values alone; and the unit of theta."""
    at, Q, _ = result(name)
    theta, names = flat(at), names_of(at)
    positive = [t for n, t in zip(names, theta, strict=True) if ".material.E" in n and t > 0]
    unit = np.where(theta != 0, np.abs(theta), min(positive, default=1.0))
    rows, weights = [], []
    for i, (n, t) in enumerate(zip(names, theta, strict=True)):
        side, step = stencil(n, t, case)
        offsets = step * (side * ONE_SIDED if side else TWO_SIDED)
        points = np.tile(theta, (6, 1))
        points[:, i] = t * np.exp(offsets) if t != 0 else unit[i] * offsets
        # The offsets after rounding: steps of 1e-11 in Poisson's ratio have five digits.
        offsets = np.log1p((points[:, i] - t) / t) if t != 0 else points[:, i] / unit[i]
        weights.append(derivative_weights(offsets) * (np.sign(t) or 1))
        rows.append(points)
    moved = values(at, np.concatenate(rows)).reshape(len(theta), 6, -1)
    return np.einsum("ij,ijk->ik", np.array(weights), moved - Q) / unit[:, None], unit


@every_scene(ORDINARY)
def test_equal_to_differences(name):
    case = (SCENES | OPTIONS)[name]
    if "shift" in case["solid1"] or "shift" in case["solid2"]:
        pytest.skip("temperatures and shift laws: see test_equal_to_the_oracle")
    _, Q, slopes = result(name)
    expected, unit = differences(name, case)
    error = np.abs(slopes - expected) * unit[:, None] / scale(name, Q, expected, unit)
    worst = np.unravel_index(np.argmax(error), error.shape)
    assert error[worst] <= 1e-6, (
        f"{names_of(result(name)[0])[worst[0]]}, {QUANTITIES[worst[1]]}: {error[worst]:.1e}"
    )


# Kinds of scene that test_extremes holds against references of more digits.
IN_EXTREMES = (
    "one-rubber",
    "two-rubbers",
    "slab",
    "two-slabs",
    "frictionless-slab",
    "rubber-on-elastic",
    "light",
    "corrected",
    "table-spectrum",
)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=pytest.mark.slow) if n.removesuffix("-by-oracle") in IN_EXTREMES else n
        for n in DERIVATIVES
    ],
)
def test_equal_to_the_oracle(name):
    """Derivatives of the brute-force values, not of the library's own."""
    case = DERIVATIVES[name]
    at, Q, _ = result(name)
    _, slopes = reverse(at)
    floor = np.array([0.0, 0.0, 1e-6 * h_rms(case)])
    for parameter, expected in case["derivatives"].items():
        path = parameter.split(".")
        kind = case[path[0]]["kind"] if path[0].startswith("solid") else None
        slope = leaf_value(slopes, path, kind) * leaf_value(at, path, kind)
        expected = np.array([expected[quantity] for quantity in QUANTITIES])
        error = np.abs(slope - expected)
        assert (error <= 1e-6 * (np.abs(Q) + floor + np.abs(expected))).all(), (parameter, error)


def test_a_roughness_that_begins_at_a_border_of_the_others():
    """An ulp from the middle of the range; the contact is lost within A^2 = 1e-12 of it: by differences."""
    road = rf.SelfAffine(1e6, 1e6, 3e6, 0.8, 1e-7)
    tread = rf.Prony(1.0, [1.0, 1.0, 1e3], [1.0, 1.0, 1.0])

    @jax.jit
    def friction(q0):
        rough = rf.SelfAffine(q0, 2828427.1247461904, 4e6, 0.8, 1.0)
        return rf.friction(rf.Scene(rf.Body(tread, road), rf.Body(rf.Elastic(1e3, 0.5), rough)), 1.0, 1e3)

    slope = 2e6 * float(jax.jit(jax.grad(friction))(2e6))
    difference = (friction(2e6 * (1 + 1e-5)) - friction(2e6 * (1 - 1e-5))) / 2e-5
    assert slope == pytest.approx(float(difference), rel=1e-7)
