"""Anisotropic roughness: harmonics against quadrature, scenes against the oracle, symmetries, signs.

Grooves at an angle alpha have the ratio r > 1 and their wavevectors across, at alpha +- 90 degrees.
"""

import dataclasses

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
    found = table.means(jnp.ones(()), qv, None, NEEDS, harmonics=shares)
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


# Harmonics of the roughness.


def shape(ratio, angle, hurst, phi):
    """D / <D>, with the mean of 20000 directions."""

    def D(phi):
        return (ratio * np.cos(phi - angle) ** 2 + np.sin(phi - angle) ** 2 / ratio) ** -(1 + hurst)

    return D(phi) / np.mean(D(np.pi * np.arange(20000) / 20000))


of_stretched = jax.jit(lambda spectrum: spectrum.harmonics_at(spectrum.base.q0))


@pytest.mark.parametrize("ratio", [1.0, 1 / 3, 2.0, 4.0, 30.0])
def test_harmonics_of_a_stretched_surface(ratio):
    phi = np.pi * np.arange(20000) / 20000
    exact = np.fft.rfft(shape(ratio, 0.4, 0.8, phi)) * 2 / phi.size
    cosine, sine = of_stretched(as_arrays(rf.Anisotropic(ROAD, ratio, 0.4, 64)))
    np.testing.assert_allclose(cosine, exact.real[1:65], atol=1e-13)
    np.testing.assert_allclose(sine, -exact.imag[1:65], atol=1e-13)


def test_harmonics_left_out():
    """The sum of the other harmonics, and the figures of the docstring for 16 and 32."""
    phi = np.pi * np.arange(20000) / 20000
    left_out = jax.jit(rf.roughness.harmonics_left_out)
    for ratio in (0.5, 2.0, 4.0, 10.0):
        size = np.abs(np.fft.rfft(shape(ratio, 0.0, 0.8, phi)))[1:] * 2 / phi.size
        for count in (4, 16):
            found = left_out(as_arrays(rf.Anisotropic(ROAD, ratio, 0.4, count)))
            np.testing.assert_allclose(found, size[count:512].sum(), rtol=1e-6, atol=1e-12)
    assert left_out(as_arrays(rf.Anisotropic(ROAD, 2.0))) < 3e-7
    assert left_out(as_arrays(rf.Anisotropic(ROAD, 4.0, harmonics=32))) < 4e-6
    assert rf.roughness.harmonics_left_out(ROAD) == 0
    table = rf.TabulatedAnisotropic([1e2, 1e4], np.tile(shape(2.0, 0.3, 0.8, phi[::4000]), (2, 1)) * 1e-9)
    assert 0.1 < left_out(table) < 0.8


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


# Symmetries, all of the one compiled structure.

PLAIN = CASES["grooved-plain"]


def solved(ratio=2.0, angle=0.4, **changes):
    psd = PLAIN["psd2"] | {"ratio": ratio, "angle": angle}
    return np.asarray(value(arguments(PLAIN | {"psd2": psd} | changes)))


@pytest.mark.slow
def test_no_stretch_is_isotropic():
    isotropic = {k: v for k, v in PLAIN["psd2"].items() if k not in ("ratio", "angle", "harmonics")}
    exact = np.asarray(value(arguments(PLAIN | {"psd2": isotropic})))
    assert exact[3] == 0
    found = solved(1.0)
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=1e-14 * exact[1])


def test_mirrored_grooves():
    np.testing.assert_allclose(solved(angle=0.4 - np.pi), solved(), rtol=1e-12)
    np.testing.assert_allclose(solved(angle=-0.4), solved() * [1, 1, 1, -1], rtol=1e-13)


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


def test_velocities():
    at_rest, slow, slower = solved(v=0.0), solved(v=1e-28), solved(v=1e-30)
    assert at_rest[1] == 0 and at_rest[3] == 0
    np.testing.assert_allclose(slow, slower * [1, 100, 1, 100], rtol=1e-12)
    np.testing.assert_allclose(slower[[0, 2]], at_rest[[0, 2]], rtol=1e-12)
    fast = solved(v=1e18)
    assert np.isfinite(fast).all() and 0 < fast[1] < 1e-6


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


@pytest.mark.slow
def test_derivatives_at_rest_and_backwards():
    for v in (0.0, 1e-30, -0.1):
        slopes = reverse(arguments(PLAIN | {"v": v}))
        assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))
        # The slope over v at rest is the limit of mu / v.
        if abs(v) < 1e-20:
            found, exact = np.asarray(slopes[1]), solved(v=1e-30) * 1e30
            np.testing.assert_allclose(found[[1, 3]], exact[[1, 3]], rtol=1e-10)


# Tables from grids.


def test_grid_between_whose_entries_nothing_is_lost():
    """A bilinear ln C is kept; half a plane is enough, the other half is its mirror image."""
    q, x = np.array([10.0, 30.0, 100.0]), np.linspace(-100.0, 100.0, 21)
    y = np.linspace(0.0, 100.0, 6)
    half = np.exp(-20 + 0.01 * x[:, None] + 0.003 * y + 1e-4 * x[:, None] * y)
    phi = np.pi * np.arange(12) / 12
    u, w = q[:, None] * np.cos(phi), q[:, None] * np.sin(phi)
    exact = np.exp(-20 + 0.01 * u + 0.003 * w + 1e-4 * u * w)
    found = rf.roughness.from_grid(x, y, half, q, 12)
    np.testing.assert_allclose(found.C, exact, rtol=1e-13)
    np.testing.assert_array_equal(found.q, q)
    # x >= 0 only, both signs of y: of x < 0 the mirror image.
    other = np.exp(-20 + 0.01 * y[:, None] + 0.003 * x + 1e-4 * y[:, None] * x)
    mirrored = np.where(u < 0, np.exp(-20 - 0.01 * u - 0.003 * w + 1e-4 * u * w), exact)
    np.testing.assert_allclose(rf.roughness.from_grid(y, x, other, q, 12).C, mirrored, rtol=1e-13)


@pytest.mark.parametrize(("ratio", "angle"), [(1.0, 0.0), (2.0, 0.5)])
def test_grid_of_a_known_spectrum(ratio, angle):
    """Second order in the spacing; without directions if the spectrum has none."""
    q, phi = np.array([200.0, 400.0, 900.0]), np.pi * np.arange(33) / 33
    exact = q[:, None] ** -3.6 * shape(ratio, angle, 0.8, phi)

    def error(points):
        x = np.linspace(-1000.0, 1000.0, points)
        size, direction = np.hypot(x[:, None], x), np.arctan2(x, x[:, None])
        C = np.maximum(size, 1.0) ** -3.6 * shape(ratio, angle, 0.8, direction)
        return np.sqrt(np.mean((rf.roughness.from_grid(x, x, C, q, 33).C / exact - 1) ** 2))

    errors = [error(points) for points in (201, 401, 801)]
    assert errors[2] < 5e-4
    assert 10 < errors[0] / errors[2] < 25


GRID = np.array([-2.0, 0.0, 2.0])


from_grid = rf.roughness.from_grid
Table = rf.TabulatedAnisotropic


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: from_grid(GRID, GRID, np.ones((3, 2)), [1.0, 2.0]), r"C has shape \(3, 2\): must be"),
        (lambda: from_grid(GRID, GRID, np.zeros((3, 3)), [1.0, 2.0]), r"must be \(3, 3\), all > 0"),
        (lambda: from_grid(GRID, GRID, np.full((3, 3), np.nan), [1.0, 2.0]), r"all > 0"),
        (lambda: from_grid(GRID, GRID, np.ones((3, 3)), [1.0, 2.1]), r"q up to 2\.1 1/m: the grid must"),
        (lambda: from_grid(GRID[1:], GRID[1:], np.ones((2, 2)), [1.0, 2.0]), r"the grid must reach"),
        (lambda: from_grid(-GRID, GRID, np.ones((3, 3)), [1.0, 2.0]), r"qx\[1\].*must increase strictly"),
        (lambda: from_grid(GRID, GRID, np.ones((3, 3)), [1.0, 2.0], 3), r"directions >= 4"),
        (lambda: from_grid(GRID, GRID, np.ones((3, 3)), [2.0, 1.0]), r"must increase strictly"),
        (lambda: rf.Anisotropic(ROAD, 0.0), r"Anisotropic\.ratio = 0\.0: must be > 0"),
        (lambda: rf.Anisotropic(ROAD, 2.0, np.inf), r"Anisotropic\.angle = inf: must be finite"),
        (lambda: rf.Anisotropic(ROAD, 2.0, 0.0, 12), r"Anisotropic\.harmonics = 12: must be one of 4, 8"),
        (
            lambda: rf.Anisotropic(rf.TabulatedSpectrum([1.0, 2.0], [1.0, 1.0]), 2.0),
            r"Anisotropic\.base = .*must be SelfAffine",
        ),
        (lambda: Table([1.0, 2.0], np.ones((2, 3))), r"directions >= 4"),
        (lambda: Table([1.0], np.ones((1, 5))), r"n >= 2"),
        (lambda: Table([2.0, 1.0], np.ones((2, 5))), r"q\[1\] = 1\.0 after 2\.0"),
        (lambda: Table([1.0, 2.0], np.zeros((2, 5))), r"C\[0\]\[0\] = 0\.0: must be > 0"),
        (lambda: Table([1.0, 2.0], np.ones(2)), r"C has shape \(2,\): must be two-dim"),
        (lambda: Table([1.0, 2.0], np.ones((2, 5)), q1=3.0), r"q1 = 3\.0: must lie within the table, 1\.0"),
    ],
)
def test_refused(make, message):
    with pytest.raises(ValueError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


# Moments.


@jax.jit
def moments(spectrum, q):
    found = [rf.roughness.moment(spectrum, order) for order in (0, 2, 4)]
    return (
        *found,
        rf.rms_slope(spectrum, q),
        rf.roughness.rms_height(spectrum, q),
        rf.roughness.cutoff(spectrum, 0.3),
    )


def test_moments_are_those_of_the_mean_over_all_directions():
    q = jnp.array([50.0, 300.0, 1e4, 1e6])
    stretched = rf.Anisotropic(ROAD, 3.0, 0.4)
    for x, y in zip(moments(stretched, q), moments(ROAD, q), strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.slow
def test_moments_of_a_table_of_directions():
    q = jnp.array([50.0, 300.0, 1e4, 1e6])
    table_q, C = np.array([1e2, 1e3, 1e4]), np.outer([1e-9, 1e-10, 1e-14], [1.0, 3.0, 2.0, 1.0, 0.5])
    tables = rf.TabulatedAnisotropic(table_q, C), rf.TabulatedSpectrum(table_q, C.mean(1))
    for x, y in zip(*(moments(table, q) for table in tables), strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-13)


@pytest.mark.slow
def test_cutoff_of_a_stretched_surface():
    """Like its base: also beyond its last wavevector, and with a derivative if smooth."""
    stretched = rf.Anisotropic(ROAD, 3.0, 0.4)
    assert rf.roughness.cutoff(stretched, 2.0) == rf.roughness.cutoff(ROAD, 2.0) > ROAD.q1
    cut = rf.with_cutoff(stretched, 0.7)
    assert isinstance(cut, rf.Anisotropic) and (cut.ratio, cut.angle) == (3.0, 0.4)
    assert float(rf.rms_slope(cut)) == pytest.approx(0.7, rel=1e-12)
    np.testing.assert_allclose(rf.power_spectrum(cut, 500.0), rf.power_spectrum(ROAD, 500.0), rtol=1e-12)
    smooth = rf.Anisotropic(dataclasses.replace(ROAD, h_rms=0.0), 3.0)
    slope = jax.jit(jax.grad(rf.rms_slope))(as_arrays(smooth))
    assert np.isfinite(slope.base.h_rms) and slope.base.h_rms > 0
    with pytest.raises(ValueError, match="must be at most"):
        rf.roughness.cutoff(rf.TabulatedAnisotropic([1.0, 2.0], 1e-9 * np.ones((2, 5))))
