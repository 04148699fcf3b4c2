"""Angular means of tabulated moduli against quadrature of their law, written down here once more."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases.stored import slow_if
from support.oracles.tables import by_quadrature, law, random_table

import rubberfric as rf
from rubberfric.theory import paper
from rubberfric.theory.stiffness.by_node import at_points
from rubberfric.theory.stiffness.complex_stiffness import F_j, quick
from rubberfric.theory.stiffness.kinds import kinds_of
from rubberfric.theory.stiffness.table import means_table
from rubberfric.theory.structure import RequiredMeans, rough_surfaces_of

WANTED = RequiredMeans(mean_abs2=True, mean_cos_loss=True, mean_storage=True)


def velocities(table):
    """ln(q v) within the table, at an entry, and far beyond its ends."""
    x = table[0]
    inside = np.random.default_rng(1).uniform(x[0] - 3, x[-1] + 3, 10)
    return np.concatenate([inside, [x[0], x[1], x[0] - 12, x[0] - 30, x[-1] + 12, x[-1] + 30]])


def stiffness(table, outside, spring):
    """A scene whose solid has E' and E'' as in by_quadrature, in series with a spring or on a rigid road."""
    exp = np.exp if isinstance(table[0], np.ndarray) else jnp.exp
    material = rf.TabulatedModulus(*map(exp, table), poisson=0.0, outside=outside)
    road = rf.SelfAffine(100.0, 1000.0, 3.1e4, 0.8, 5e-4)
    rough = rf.Rigid() if spring is None else rf.Elastic(spring, 0.0)
    return rf.Scene(rf.Body(rough, road), rf.Body(material))


def table_of(F):
    return means_table(rough_surfaces_of(F)[0], jnp.ones(()), WANTED)


@jax.jit
def means(F, x):
    found = table_of(F).means(jnp.exp(x), jnp.ones(1), None, WANTED)
    return jnp.stack([found[kind][0] for kind in WANTED.kinds])


@jax.jit
def means_by_node(F, x):
    surface = rough_surfaces_of(F)[0]
    solids, material = quick(surface), surface.strained.material
    kinds = kinds_of(WANTED, False, material.loss_beyond)
    found = at_points(
        lambda q, omega: F_j(solids, q, omega), jnp.ones((1, 1)), x, (), kinds, None, material.detail
    )
    return jnp.stack([found[kind][0][0, :, 0] for kind in WANTED.kinds])


def close(found, exact, outside, tolerance):
    # E'' that is cut off has the dissipation below the table underflow.
    floor = np.zeros((3, 1))
    if outside == "none":
        floor[1] = 1e-3 * exact[1].max()
    return (np.abs(found - exact) <= tolerance * np.maximum(exact, floor)).all()


OUTSIDE = ("fall", "hold", "none")


@pytest.mark.parametrize("seed", slow_if(lambda seed: seed, range(20)))
def test_means_of_random_tables(seed):
    table, outside = random_table(seed), OUTSIDE[seed // 4 % 3]
    x = velocities(table)
    material = rf.TabulatedModulus(*map(np.exp, table), outside=outside)
    found = np.asarray(jax.jit(lambda material, x: material.modulus(jnp.exp(x)))(material, x))
    np.testing.assert_allclose([found.real, found.imag], law(table, outside, x), rtol=1e-12, atol=1e-200)
    assert close(
        means(stiffness(table, outside, None), x), by_quadrature(table, outside, x)[:3], outside, 1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_means_in_series_with_a_spring(seed):
    """One value for all nodes, or one for every node."""
    table, outside = random_table(seed), OUTSIDE[seed % 3]
    x, F = velocities(table), stiffness(table, outside, 2.0)
    exact = by_quadrature(table, outside, x, 2.0)[:3]
    assert close(means(F, x), exact, outside, 1e-9)
    assert close(means_by_node(F, x), exact, outside, 1e-9)


@pytest.mark.parametrize("seed", slow_if(lambda seed: seed, range(20)))
def test_derivatives_of_random_tables(seed):
    """With respect to every entry, ln omega, ln E' and ln E'', and to ln(q v)."""
    table, outside = random_table(seed), OUTSIDE[seed // 4 % 3]
    x, rng = velocities(table), np.random.default_rng(2)
    # Along a direction of all entries, with a difference in omega smaller than its spacing.
    gap = np.diff(table[0]).min()
    along = np.array([0.1 * gap, 1, 1])[:, None] * rng.uniform(-1, 1, (3, table[0].size))
    h = 1e-3
    moved = [
        by_quadrature(np.array(table) + k * h * along, outside, x + k * h)[:3] for k in (-3, -2, -1, 1, 2, 3)
    ]
    difference = np.tensordot([-1 / 60, 3 / 20, -3 / 4, 3 / 4, -3 / 20, 1 / 60], moved, 1) / h
    slope = slope_along(np.array(table), x, along, outside)
    scale = np.abs(means(stiffness(table, outside, None), x))
    scale = np.maximum(scale, 1e-3 * scale.max(1, keepdims=True)) if outside == "none" else scale
    assert (np.abs(slope - difference) <= 1e-7 * scale).all()


def slope_along(table, x, along, outside):
    return jax.jit(
        lambda *at: jax.jvp(
            lambda t, x: means(stiffness(t, outside, None), x), at, (along, jnp.ones(x.shape))
        )[1]
    )(table, x)


@pytest.mark.slow
def test_forward_and_reverse_mode_are_alike():
    table = np.array(random_table(0))
    x = velocities(table)

    def values(table, x):
        return means(stiffness(table, "fall", 2.0), x)

    forward, reverse = (jax.jit(d(values, (0, 1)))(table, x) for d in (jax.jacfwd, jax.jacrev))
    for one, other in zip(forward, reverse, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * np.abs(one).max())


@pytest.mark.slow
def test_at_rest_a_loss_is_nothing_however_large():
    """E'' is 3e13 of E' where the table begins: 1e-9 of that is not nothing beside E'."""
    table = np.log(
        [[1e-20, 2e-20, 2.00002e-15, 4e-15], [3.2, 13.0, 1.0e5, 6.0e5], [9.2e13, 5.5e13, 1.8e14, 3.6e14]]
    )
    q = jnp.array([1.0, 3.0, 9.0])
    found = table_of(stiffness(table, "fall", None)).means(q, jnp.zeros(1), None, WANTED)
    np.testing.assert_allclose(jnp.ravel(found["mean_abs2"][0]), 3.2**2, rtol=1e-7)
    np.testing.assert_allclose(jnp.ravel(found["mean_storage"][0]), 3.2, rtol=1e-7)
    assert not found["mean_cos_loss"][0].any()


def test_the_dissipation_of_a_loss_that_ends_is_not_negative():
    """Far below the table a spline through underflowed values oscillates."""
    table = np.log(
        [
            [1.0955e-6, 1.1171e-6, 4.4342e-6, 4.4785e-6],
            [2.532e6, 4.771e6, 7.774e6, 5.818e6],
            [4.259e3, 3.053e3, 2.829e3, 1.468e3],
        ]
    )
    x = table[0, 0] - np.linspace(0, 9, 2000)
    _, dissipation, _ = means(stiffness(table, "none", None), x)
    assert (dissipation >= 0).all()


def test_a_mean_depends_on_its_own_velocity_alone():
    table = random_table(3)
    x, F = velocities(table), stiffness(table, "fall", None)
    together = means(F, x)
    alone = jnp.concatenate([means(F, x[k : k + 1]) for k in (0, 5, 12)], 1)
    np.testing.assert_allclose(alone, together[:, np.array([0, 5, 12])], rtol=1e-14)


def test_a_shift_at_every_node_is_a_velocity():
    """From far below the table to far above, and at rest, where the slope is finite."""
    table = random_table(2)
    q = jnp.geomspace(10.0, 1e5, 6).reshape(3, 1, 2)
    v = jnp.array([-1e-3, 0.0, 1e-20, 1e-8, 1e-3, 10.0])[:, None]
    log_shift = jnp.asarray(np.random.default_rng(0).uniform(-30, 30, (3, 6, 2)))

    @jax.jit
    def both(F, v):
        one = table_of(F)
        shifted, moved = (
            one.means(q, v, log_shift, WANTED),
            one.means(q, v * jnp.exp(log_shift), None, WANTED),
        )
        slope = jax.grad(lambda v: jnp.sum(one.means(q, v, log_shift, WANTED)["mean_cos_loss"][0]))(v)
        return shifted, moved, slope

    shifted, moved, slope = both(stiffness(table, "fall", None), v)
    for kind in WANTED.kinds:
        np.testing.assert_allclose(shifted[kind][0], moved[kind][0], rtol=1e-12)
    assert jnp.isfinite(slope).all()


def test_no_seams():
    """Third differences over some cells of the grid do not see where one begins."""
    table = random_table(0)
    x = table[0][3] + np.linspace(-0.05, 0.05, 101)
    found = np.log(means(stiffness(table, "fall", None), x))
    curvature = np.diff(found, 3, axis=1) / np.diff(x)[0] ** 3
    assert np.abs(np.diff(curvature)).max() < 0.2 * np.abs(curvature).max()


@pytest.mark.parametrize("of", [means, means_by_node])
def test_where_a_table_begins_on_the_grid_does_not_matter(of):
    """Also beyond the ends: an end that rounding placed in the cell before the first was one step off."""
    # Where a product and a sum are rounded once, as XLA does by default.
    of = jax.jit(of.__wrapped__, compiler_options={"xla_backend_optimization_level": 3})
    x, *logarithms = random_table(0)
    at, step = velocities((x, *logarithms)), 0.1 / 6
    moved = np.concatenate([np.arange(40), np.arange(40) + 0.5]) * step
    moved = np.concatenate([moved, np.nextafter(moved, 1e3), [0.123]])
    rows = [of(stiffness((x + by, *logarithms), "fall", 2.0), at + by) for by in moved]
    np.testing.assert_allclose(rows, np.broadcast_to(rows[-1], np.shape(rows)), rtol=1e-10)


@pytest.mark.parametrize("width", [pytest.param(0.05, marks=pytest.mark.slow), 0.4])
def test_another_width(width):
    table = random_table(0)
    x, F = velocities(table), stiffness(table, "fall", None)
    F = F.replace("upper.material", dataclasses.replace(F.upper.material, smoothing=width))
    assert close(means(F, x), by_quadrature(table, "fall", x, width=width)[:3], "fall", 1e-9)


def test_refusals():
    with pytest.raises(ValueError, match=r"TabulatedModulus\.smoothing = .*: must be"):
        rf.TabulatedModulus([1.0, 2.0], [1.0, 2.0], [1.0, 2.0], smoothing=2.0)
    with pytest.raises(ValueError, match="omega spans 30 decades: must be at most 26"):
        rf.TabulatedModulus([1e-15, 1e15], [1.0, 2.0], [1.0, 2.0])


ROAD = rf.SelfAffine(200.0, 1500.0, 5e4, 0.8, 4e-4)


def on_the_road(seed):
    """A random table of a rubber and the velocities that have ROAD excite it at its middle."""
    table = np.array(random_table(seed))
    table[1:] += np.log(1e7)
    return table, np.exp(np.quantile(table[0], [0.2, 0.7]) - 8)


def slopes_by(solve):
    """Area and friction of a rubber with a table on ROAD, and their derivatives along a direction."""

    def area_and_friction(table, v):
        rubber = rf.TabulatedModulus(*map(jnp.exp, table))
        found = solve(rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(rubber)), v, 2e5)
        return jnp.stack([found.area, found.friction])

    slopes = jax.jit(lambda table, v, along: jax.jvp(lambda t: area_and_friction(t, v), (table,), (along,)))
    return jax.jit(area_and_friction), slopes


OF_LIBRARY = slopes_by(rf.solve)
OF_PAPER = slopes_by(functools.partial(paper.solve, nodes=paper.gauss_nodes(step=0.04, panels=24)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_values_and_derivatives_are_those_of_the_paper(seed):
    """Along a direction of all entries, ln omega, ln E' and ln E''."""
    table, v = on_the_road(seed)
    rng = np.random.default_rng(2)
    along = np.array([0.1 * np.diff(table[0]).min(), 1, 1])[:, None] * rng.uniform(-1, 1, table.shape)
    (values, slopes), (exact, known) = (of(table, v, along) for _, of in (OF_LIBRARY, OF_PAPER))
    np.testing.assert_allclose(values, exact, rtol=1e-9)
    assert (np.abs(slopes - known) <= 1e-7 * np.maximum(values, np.abs(known))).all()
