"""Scenes with anisotropic roughness: angular means against quadrature, extremes by the oracle, slow sliding.

Grooves at an angle alpha have the ratio r > 1 and their wavevectors across, at alpha +- 90 degrees.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD
from support.cases.parts import CASES, expected, reverse, value
from support.cases.stored import arguments, as_arrays, scene
from support.oracles import oracle
from support.oracles.angular import angular_means, prony

import rubberfric as rf
from rubberfric.theory.stiffness.table import means_table
from rubberfric.theory.structure import RequiredMeans, rough_surfaces_of

# Harmonics of the angular means.

REST = 0.25


def by_quadrature(a, m):
    """Harmonics m of the means of |F|^2, cos phi Im F, Re F and sin phi Im F; one term."""
    one = np.eye(6)[m - 1]
    # The harmonics of the rest are zero, so that those of Re F do not need it.
    solids = [prony(rest, np.ones(1), np.ones(1)) for rest in (REST, 0.0)]
    stiff, soft = (angular_means(solid, a, one, one) - angular_means(solid, a) for solid in solids)
    return np.array([stiff[0] + stiff[1], *soft[2:]])


NEEDS = RequiredMeans(mean_abs2=True, mean_cos_loss=True, mean_storage=True, mean_sin_loss=True)
SOLID = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(rf.Prony(REST, np.ones(1), np.ones(1), 0.0)))


def means_of(rest, weight, tau, qv, shares):
    """The four means of a Prony series with shares of their harmonics, (4, nodes)."""
    given = {"E_inf": rest, "E": weight, "tau": tau}
    surface = rough_surfaces_of(SOLID.replace({f"upper.material.{k}": v for k, v in given.items()}))[0]
    table = means_table(surface, jnp.ones(()), NEEDS, False, shares)
    found = table.means(jnp.ones(()), qv, None, NEEDS, grooved=True)
    return jnp.stack([found[kind][0] for kind in NEEDS.kinds])


@jax.jit
def mixed(shares, qv):
    """The four means of one term with shares of their harmonics, (4, nodes)."""
    return means_of(jnp.asarray(REST), jnp.ones(1), jnp.ones(1), qv, shares)


@jax.jit
def harmonic_means(qv):
    """The harmonics one by one, (4, count, nodes): derivatives of the sum, which is linear in the shares."""
    by_cosine, by_sine = jax.jacfwd(mixed)((jnp.zeros(6), jnp.zeros(6)), qv)
    return jnp.moveaxis(jnp.concatenate([by_cosine[:3], by_sine[3:]]), -1, 1)


@pytest.mark.slow
def test_harmonics_of_the_means():
    """m = 1 ... 6 at a = q v tau = 1e-8 ... 1e8, relative to the mean over all directions."""
    a = np.logspace(-8, 8, 33)
    found = np.asarray(harmonic_means(jnp.asarray(a)))
    for j, x in enumerate(a):
        r = np.hypot(1, x)
        one, sine = x / r * (x / (1 + r)), x / r / (1 + r)
        scale = np.array([REST**2 + (2 * REST + 1) * one, sine, REST + one, sine])
        for m in range(1, 7):
            error = np.abs(found[:, m - 1, j] - by_quadrature(x, m)) / scale
            assert (error < 1e-12).all(), (x, m, error)
    np.testing.assert_allclose(harmonic_means(-jnp.asarray(a)), found * SIGN, rtol=1e-15)
    assert np.abs(harmonic_means(jnp.zeros(1))).max() < 1e-18


SIGN = np.reshape([1, -1, 1, -1], (4, 1, 1))


def of_terms(rest, weight, tau, qv, cosine, sine):
    """The four means with their harmonics by Gauss panels, analytic in every number."""
    storage2, loss2, *others = angular_means(prony(rest, weight, tau), qv, cosine, sine)
    return np.array([storage2 + loss2, *others])


@pytest.mark.slow
def test_means_with_harmonics_have_the_derivatives_of_the_quadrature():
    """By every term, share and q v; forward = reverse = the integrals' own, taken by complex steps."""
    shares = np.array([[0.5, -0.2, 0.1], [0.3, 0.2, -0.4]])
    at = (0.5, np.array([1.0, 5.0, 20.0]), np.array([1.0, 1e-1, 1e-2]), 7.0, *shares)

    def means(numbers):
        rest, weight, tau, qv, cosine, sine = numbers
        return means_of(rest, weight, tau, qv, (cosine, sine))

    numbers, exact = as_arrays(at), of_terms(*at)
    np.testing.assert_allclose(means(numbers), exact, rtol=1e-12)
    forward, reverse = (jax.jit(d(means))(numbers) for d in (jax.jacfwd, jax.jacrev))
    for k, (one, other) in enumerate(zip(forward, reverse, strict=True)):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-13)
        for i in np.ndindex(np.shape(at[k])):
            moved = [np.array(x, complex) for x in at]
            moved[k][i] += 1e-100j
            slope = of_terms(*moved).imag / 1e-100
            np.testing.assert_allclose(one[(slice(None), *i)], slope, rtol=1e-10, atol=1e-12)


@pytest.mark.slow
def test_bound_of_the_harmonics_left_out():
    """G, the separation and the friction of full contact are off by less than the harmonics left out."""
    given = CASES["grooved-plain"]
    few = given | {"psd2": given["psd2"] | {"harmonics": 4}}
    bound = float(rf.roughness.harmonics_left_out(scene(few).upper.spectrum))
    assert 1e-3 < bound < 1e-1
    # Far below full contact the area goes like G^(-1/2); at a large load all is in contact.
    exact, found = (np.asarray(value(arguments(case))) for case in (given, few))
    assert 0 < abs((found[0] / exact[0]) ** -2 - 1) < 1.1 * bound
    assert 0 < abs(found[2] / exact[2] - 1) < bound
    exact, found = (np.asarray(value(arguments(case | {"pressure": 1e12}))) for case in (given, few))
    assert exact[0] == 1
    assert 0 < abs(found[1] / exact[1] - 1) < bound


# Scenes of one compiled structure.

PLAIN = CASES["grooved-plain"]


def solved(ratio=2.0, angle=0.4, **changes):
    psd = PLAIN["psd2"] | {"ratio": ratio, "angle": angle}
    return np.asarray(value(arguments(PLAIN | {"psd2": psd} | changes)))


def test_grooves_along_the_sliding_lower_friction():
    """At rest relative to a groove nothing is excited; across it all is."""
    along, across = solved(angle=0.0), solved(angle=np.pi / 2)
    isotropic = solved(1.0)
    assert along[1] < isotropic[1] < across[1]
    np.testing.assert_allclose([along[3], across[3]], 0.0, atol=1e-13 * across[1])


@pytest.mark.parametrize("angle", [0.4, -1.1, 2.0])
def test_slow_friction_is_a_tensor(angle):
    """Slow friction is linear in the velocity, a symmetric tensor with its axes along and across the grooves.

    So grooves at 0 < alpha < 90 degrees, easier to slide along, give mu_y = (mu_along - mu_across)
    sin(alpha) cos(alpha) < 0, as mu_x > 0 is a force against the sliding: they lead the slider to the left.
    """
    slow = {"v": 1e-12}
    along, across = solved(angle=0.0, **slow)[1], solved(angle=np.pi / 2, **slow)[1]
    found, c, s = solved(angle=angle, **slow), np.cos(angle), np.sin(angle)
    assert 0 < along < across
    np.testing.assert_allclose(found[1], along * c * c + across * s * s, rtol=1e-7)
    np.testing.assert_allclose(found[3], (along - across) * s * c, rtol=1e-7)


def test_no_dissipation_no_transverse_friction():
    """Elastic solids, and roughness of the rubber itself: zero, not computed."""
    stretched, names = rf.Anisotropic(ROAD, 2.0, 0.4), ("transverse_friction", "friction")
    rubber, rigid = rf.Prony(1e6, [1e8], [1e-6]), rf.Rigid()
    for lower, upper in (((rf.Elastic(1e7, 0.3),), (rigid, stretched)), ((rubber, stretched), (rigid,))):
        found = rf.solve(rf.Scene(rf.Body(*lower), rf.Body(*upper)), [0.1, 1.0], 1e5, quantities=names)
        assert found.transverse_friction.shape == (2,) and not found.transverse_friction.any()


EXTREMES = {
    "nearly lines": {"psd2": PLAIN["psd2"] | {"ratio": 10.0}},
    "liquid": {"solid1": PLAIN["solid1"] | {"E_inf": 0.0}},
    "equal times": {"solid1": PLAIN["solid1"] | {"tau": [1e-6] * 4}},
    "light": {"pressure": 1e-2},
    "fast": {"v": 1e12, "pressure": 2e7},
    "stiff": {"solid1": PLAIN["solid1"] | {"E_inf": 1e30}, "pressure": 1e28},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes(name):
    given = PLAIN | EXTREMES[name]
    given = given | {"psd2": given["psd2"] | {"harmonics": 64}}
    found, exact = np.asarray(value(arguments(given))), expected(oracle.solve(given, halvings=60, order=20))
    np.testing.assert_allclose(found, exact, rtol=1e-4 if name == "nearly lines" else 1e-9, atol=1e-300)
    slopes = reverse(arguments(given))
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))
