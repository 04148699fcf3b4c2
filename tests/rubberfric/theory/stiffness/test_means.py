"""Means over the direction of sliding by every method, against quadrature of a modulus written down here."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD
from support.cases.stored import slow_if
from support.oracles.angular import angular_means, prony, with_spring

import rubberfric as rf
from rubberfric.theory.stiffness.kinds import passing
from rubberfric.theory.stiffness.means import factors_at, stiffness_means
from rubberfric.theory.structure import AT_REFERENCE, MeansMethod, RequiredMeans, rough_surfaces_of

ALL = RequiredMeans(mean_abs2=True, mean_cos_loss=True, mean_storage=True, mean_sin_loss=True)
EVEN = RequiredMeans(mean_abs2=True, mean_cos_loss=True, mean_storage=True)
GROOVES = rf.Anisotropic(ROAD, 2.0, 0.4, 4)
SOFTENING = rf.Softening([1e-3, 0.1, 0.5, 1.5], [1.0, 0.7, 0.4, 0.3], [1.0, 0.9, 0.6, 0.5], 0.3)
SCALE = 1e6
# Poisson's ratio 0, so that E_r is E. Times that are equal, and a term without weight.
SERIES = {
    "four terms": (1e6, [5e5, 3e7, 1e9, 2e10], [1e2, 1.0, 1e-3, 1e-8]),
    "equal times": (2e6, [1e6, 3e6, 0.0, 5e6], [1.0, 1.0, 1.0, 1.0]),
    "liquid": (0.0, [1e6, 1.0, 1e12, 1e6], [1e-3, 1e3, 1.0, 2.0]),
    "one term": (1e6, [1e9], [1e-2]),
    "thirty decades": (1e6, np.geomspace(1e10, 1e5, 31), np.logspace(-18, 12, 31)),
}
FEW_SERIES = [
    pytest.param(name, marks=[pytest.mark.slow] * (name in ("four terms", "equal times"))) for name in SERIES
]
QV = np.concatenate([np.logspace(-10, 10, 21), [-3.0]])


def rubber(name):
    rest, weight, tau = SERIES[name]
    return rf.Prony(rest, np.array(weight), np.array(tau), 0.0)


def modulus_of(name, storage=1.0, loss=1.0, spring=None):
    """E' and E'' over the scale as functions of omega."""
    rest, weight, tau = SERIES[name]
    plain = prony(rest / SCALE, np.array(weight) / SCALE, np.array(tau))

    def modulus(omega):
        real, imaginary = plain(omega)
        real, imaginary = storage * real, loss * imaginary
        return (real, imaginary) if spring is None else with_spring(real, imaginary, spring)

    return modulus


def means_at(scene, method, q, v, needs=EVEN, T=AT_REFERENCE):
    """Means times their factors at one q and many v, shape (needed means, points)."""
    surface = rough_surfaces_of(scene)[0]
    assert surface.method is method

    @jax.jit
    def found(surface, v):
        at = jnp.full((1, 1), q)
        means = stiffness_means(surface, jnp.asarray(SCALE), at, needs).means(at, v, T)
        factors = factors_at(surface, jnp.asarray(SCALE), at)
        rows = []
        for kind in needs.kinds:
            weights = factors.of(kind, jnp.ones((1, 1)))
            rows.append(sum(w[:, None] * x for w, x in zip(weights, means[kind], strict=True))[0, :, 0])
        return jnp.stack(rows)

    return np.asarray(jax.jit(lambda v: found.__wrapped__(surface, v))(jnp.asarray(v)))


def exact_means(modulus, v, q=1.0, harmonics=((), ())):
    rows = np.array([angular_means(modulus, abs(x) * q, *harmonics) for x in v]).T
    sign = np.sign(v)
    return np.stack([rows[0] + rows[1], sign * rows[2], rows[3], sign * rows[4]])


def facing(material, other=None, spectrum=ROAD, layer=None, **parts):
    """Roughness on a rigid solid, or on `other`, that strains a smooth body."""
    rough = rf.Body(rf.Rigid() if other is None else other, spectrum)
    return rf.Scene(rough, rf.Body(material, None, layer), **parts)


@pytest.mark.parametrize("name", SERIES)
def test_closed_form(name):
    found = means_at(facing(rubber(name)), MeansMethod.CLOSED_FORM, 1.0, QV)
    np.testing.assert_allclose(found, exact_means(modulus_of(name), QV)[:3], rtol=1e-12)


@pytest.mark.parametrize("name", slow_if(lambda name: name not in ("liquid", "one term"), SERIES.keys()))
def test_table_in_series_with_a_spring(name):
    """Springs that are softer than E(0), as stiff as the glass, and between."""
    for spring in (1e-3, 40.0, 1e4):
        scene = facing(rubber(name), rf.Elastic(spring * SCALE, 0.0))
        found = means_at(scene, MeansMethod.TABLE, 1.0, QV)
        exact = exact_means(modulus_of(name, spring=spring), QV)[:3]
        np.testing.assert_allclose(found, exact, rtol=2e-10, err_msg=str(spring))


@pytest.mark.parametrize("name", FEW_SERIES)
def test_table_of_a_softened_solid(name):
    """<F'^2> and <F''^2> have separate factors."""
    q = 2e4
    scene = facing(rubber(name), softening=SOFTENING)
    surface = rough_surfaces_of(scene)[0]
    factors = factors_at(surface, jnp.asarray(SCALE), jnp.asarray(q))
    f, g = float(factors.storage), float(factors.loss)
    assert f < 0.9 and g < 0.95 and f != g
    found = means_at(scene, MeansMethod.TABLE, q, QV / q)
    np.testing.assert_allclose(found, exact_means(modulus_of(name, f, g), QV)[:3], rtol=2e-10)


# The directions of its waves differ between the entries.
TURNING = rf.TabulatedAnisotropic(
    [100.0, 2e3, 2e4],
    np.array([[4e-11], [1e-12], [1e-15]])
    * (1 + np.array([0.0, 0.2, 0.5, 0.1, 0.3]) * np.array([[1.0], [-0.8], [2.0]])),
    0.3,
)


@pytest.mark.parametrize(
    ("name", "spectrum", "q"),
    [
        *((name, GROOVES, 1e3) for name in ("four terms", "one term", "thirty decades")),
        # Within the table, at an entry, at the ends and beyond them.
        *(("one term", TURNING, q) for q in (50.0, 100.0, 300.0, 2e3, 1e4, 2e4, 3e4)),
    ],
)
def test_table_with_grooves(name, spectrum, q):
    scene = facing(rubber(name), spectrum=spectrum)
    shares = [np.asarray(x) for x in spectrum.harmonics_at(jnp.asarray(q))]
    found = means_at(scene, MeansMethod.TABLE, q, QV / q, ALL)
    exact = exact_means(modulus_of(name), QV, harmonics=shares)
    # The transverse mean may cancel.
    exact_scale = np.abs(exact) + np.abs(exact[1]) * np.array([0, 0, 0, 1.0])[:, None]
    assert (np.abs(found - exact) <= 2e-10 * exact_scale).all()


FEW = np.array([-20.0, 1e-3, 5.0])
MANY = np.logspace(-4, 3, 40)


@pytest.mark.parametrize(
    "v", [FEW, pytest.param(MANY, marks=pytest.mark.slow)], ids=["at points", "on a grid"]
)
@pytest.mark.parametrize(
    "spectrum",
    [ROAD, pytest.param(GROOVES, marks=pytest.mark.slow), TURNING],
    ids=["isotropic", "grooved", "turning"],
)
def test_by_node(v, spectrum):
    """A coating of two rubbers, whose stiffness is written down in complex numbers."""
    q, d = 700.0, 2e-3
    layer, base = rubber("four terms"), rf.Prony(3e6, [2e8, 1e7], [1e-5, 1e-2], 0.0)
    scene = facing(layer, spectrum=spectrum, layer=rf.Coating(d, base))
    needs = EVEN if spectrum is ROAD else ALL
    shares = ((), ())
    if spectrum is not ROAD:
        shares = [np.asarray(x) for x in spectrum.harmonics_at(jnp.asarray(q))]
    found = means_at(scene, MeansMethod.BY_NODE, q, v, needs)
    exact = exact_means(lambda omega: coated(layer, base, q * d, omega), v, q, shares)[: len(found)]
    scale = np.abs(exact)
    if len(found) == 4:
        scale[3] += scale[1]
    assert (np.abs(found - exact) <= 1e-10 * scale).all(), np.abs(found - exact) / scale


def coated(layer, base, x, omega):
    """E_r Sbar over the scale, printed above `rubberfric.materials.coating`, for two solids with nu = 0."""
    from support.oracles.oracle_solids import coating_coefficients

    one, two = (
        m.E_inf + np.sum(m.E * 1j * omega[..., None] * m.tau / (1 + 1j * omega[..., None] * m.tau), -1)
        for m in (layer, base)
    )
    c = np.array([float(c) for c in coating_coefficients(x, 0.0, 0.0)])
    powers = np.stack([one * one, one * two, two * two], -1)
    F = one * (powers @ c[:3]) / (powers @ c[3:]) / SCALE
    return F.real, F.imag


@pytest.mark.parametrize("v", [FEW, MANY], ids=["at points", "on a grid"])
def test_softened_in_series(v):
    q, spring = 5e3, 30.0
    scene = facing(rubber("four terms"), rf.Elastic(spring * SCALE, 0.0), softening=SOFTENING)
    from rubberfric.scene.softening import softening_factors

    f, g = (float(x) for x in softening_factors(rough_surfaces_of(scene)[0].softened, jnp.asarray(q)))
    found = means_at(scene, MeansMethod.BY_NODE, q, v)
    exact = exact_means(modulus_of("four terms", f, g, spring), v, q)[:3]
    np.testing.assert_allclose(found, exact, rtol=1e-10)


@pytest.mark.parametrize(
    "scene",
    [
        facing(rubber("one term")),
        pytest.param(facing(rubber("one term"), rf.Elastic(3e7, 0.0)), marks=pytest.mark.slow),
        facing(rubber("one term"), spectrum=GROOVES),
        pytest.param(facing(rubber("one term"), softening=SOFTENING), marks=pytest.mark.slow),
        facing(rubber("one term"), rf.Elastic(3e7, 0.0), softening=SOFTENING),
        pytest.param(
            facing(rubber("one term"), layer=rf.Coating(1e-3, rubber("four terms"))), marks=pytest.mark.slow
        ),
    ],
    ids=["closed form", "table", "grooves", "softened", "softened in series", "coating"],
)
@pytest.mark.parametrize("points", [3, pytest.param(40, marks=pytest.mark.slow)])
def test_at_rest(scene, points):
    """At v = 0 the loss vanishes, and its derivative is the slope of the line through 0."""
    surface, q = rough_surfaces_of(scene)[0], jnp.full((1, 1), 500.0)

    @jax.jit
    def loss(v):
        made = stiffness_means(surface, jnp.asarray(SCALE), q, EVEN)
        found = made.means(q, jnp.concatenate([v[None], jnp.linspace(1e-3, 2.0, points - 1)]))
        return found["mean_cos_loss"][0][0, 0, 0]

    slope = float(loss(1e-14)) / 1e-14
    assert slope > 0 and float(loss(0.0)) == 0.0
    for found in (jax.grad(loss)(0.0), jax.jvp(loss, (0.0,), (1.0,))[1]):
        assert float(found) == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rest_at_shifts_beyond_the_range_of_numbers(dtype):
    """At v = 0 a mean that is odd in v vanishes, even if exp(ln a_T) overflows."""
    log_shift = jnp.asarray(2 * np.log(np.finfo(dtype).max), dtype)

    def sign(v):
        return passing(v, log_shift, jnp.asarray(-5.0, dtype), loss_at_rest=False).sign

    found = sign(jnp.array([-1.0, 0.0, 1.0], dtype))
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, [-1, 0, 1])
    assert 0 < float(jax.grad(sign)(jnp.zeros((), dtype))) < np.inf
