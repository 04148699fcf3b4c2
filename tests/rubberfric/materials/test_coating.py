"""A layer on a deformable half-space: its stiffness from Navier's equations, scenes against the oracle."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import problems
import pytest
from support.cases.solids import RIGID, ROAD, WORN
from support.cases.stored import QUANTITIES, as_arrays, quantities, scene
from support.oracles import oracle
from support.oracles.oracle_solids import coating_coefficients

import rubberfric as rf
from rubberfric.scene.body import relaxes
from rubberfric.scene.scene import dissipates

POISSON = [0.0, 0.3, 0.4999999, 0.5]
FINE = [0.0, 0.2, 0.3, 0.45, 0.4999, 0.4999999999, 0.5]


def exact_factor(d, nu1, nu0, mu1, mu0):
    """Sbar at q = 1, as printed."""
    r, c = mu1 / mu0, coating_coefficients(d, nu1, nu0, mp.mp.dps + 20)
    return (c[0] * r * r + c[1] * r + c[2]) / (c[3] * r * r + c[4] * r + c[5])


def body_of(d, nu1, nu0, mu1, mu0):
    """A coated body from traced numbers, checked by no constructor."""
    made = rf.Body(rf.Elastic(1.0, 0.3), None, rf.Coating(1.0, rf.Elastic(1.0, 0.3)))
    leaves = [2 * mu1 * (1 + nu1), nu1, d, 2 * mu0 * (1 + nu0), nu0]
    return jax.tree.unflatten(jax.tree.structure(made), leaves)


def coated_spring(body, layer, base, q):
    """E_r Sbar from E_r of layer and base."""
    return body.layer.E_r_S_bar(body.material.poisson, q, layer, base)


def factor(*numbers):
    """Sbar at q = 1 of two solids that do not relax."""
    body = body_of(*numbers)
    layer, base = 2 * numbers[3] / (1 - numbers[1]), 2 * numbers[4] / (1 - numbers[2])
    return coated_spring(body, layer, base, jnp.ones(())) / layer


def evaluated(function, points):
    """Values and gradients at rows of numbers, one compilation."""
    both = jax.jit(jax.vmap(jax.value_and_grad(lambda row: function(*row))))
    return [np.asarray(x) for x in both(jnp.asarray(points, float))]


def grid(thickness, poisson, ratio):
    return [(x, a, b, r, 1.0) for x in thickness for a in poisson for b in poisson for r in ratio]


def test_factor():
    """Compared with 50 digits for all thicknesses, shear moduli and Poisson's ratios."""
    points = grid([1e-8, 1e-3, 0.1, 0.9, 1.1, 10.0, 30.0, 1e8], FINE, [1e-12, 1e-4, 0.7, 1e5, 1e12])
    with mp.workdps(50):
        exact = [float(exact_factor(*map(mp.mpf, (min(p[0], 1e3), *p[1:])))) for p in points]
    np.testing.assert_allclose(evaluated(factor, points)[0], exact, rtol=1e-13)


@pytest.mark.slow
def test_derivatives_of_factor():
    """Per ln d, nu and ln mu, relative to the value or to the derivative where that is larger."""
    points = grid([1e-8, 1e-3, 0.9, 6.0, 25.0], POISSON, [1e-12, 1.0, 1e12])
    values, slopes = evaluated(factor, points)
    for point, value, slope in zip(points, values, slopes, strict=True):
        with mp.workdps(90):
            at = [mp.mpf(x) for x in point]
            for i, unit in enumerate((point[0], 1.0, 1.0, point[3], 1.0)):
                h = mp.mpf(10) ** -30 * (at[i] or 1)
                ends = [exact_factor(*at[:i], at[i] + s * h, *at[i + 1 :]) for s in (1, -1)]
                exact = float((ends[0] - ends[1]) / (2 * h))
                error = abs(slope[i] - exact) * unit
                assert error < 2e-8 * max(value, abs(exact) * unit), (point, i, slope[i], exact)


def navier(x, nu1, nu0, mu1, mu0):
    """Sbar from displacements and stresses (u_x, u_z, s_xz, s_zz) integrated through the layer, q = 1."""

    def matrix(mu, nu):
        rise = nu / (1 - nu)
        return mp.matrix(
            [
                [0, 1, 1 / mu, 0],
                [-rise, 0, 0, (1 - 2 * nu) / (2 * mu * (1 - nu))],
                [2 * mu / (1 - nu), 0, 0, rise],
                [0, 0, -1, 0],
            ]
        )

    under = matrix(mu0, nu0) + mp.eye(4)
    decaying = (under * under)[:, :2]  # what dies out below: the eigenvalue -1 is projected away
    top = mp.expm(matrix(mu1, nu1) * x, method="taylor") * decaying
    # A pressure on top and no shear: s_xz = 0, s_zz = 1.
    share = mp.lu_solve(top[2:4, :], mp.matrix([0, 1]))
    return (1 / (top[1, :] * share)[0]) / (mu1 / (1 - nu1))


@pytest.mark.parametrize("nu1", [0.0, 0.3, 0.5])
def test_factor_solves_the_equations_of_elasticity(nu1):
    for x, nu0, rho in ((0.01, 0.5, 30.0), (0.4, 0.2, 0.01), (1.3, 0.45, 1e3), (3.0, 0.0, 2.0)):
        with mp.workdps(50):
            exact = navier(*(mp.mpf(z) for z in (x, nu1, nu0, rho, 1.0)))
        assert float(factor(x, nu1, nu0, rho, 1.0)) == pytest.approx(float(exact), rel=1e-13)


def test_limits():
    q, layer = jnp.logspace(-3, 2, 11), rf.Elastic(2e6, 0.4)

    def spring(thickness, base, factor=1.0):
        body = rf.Body(layer, None, rf.Coating(thickness, base))
        springs = (m.reduced_series(1.0)[0] for m in (layer, base))
        return coated_spring(body, *springs, q) * factor

    own = layer.reduced_series(1.0)[0]
    soft = rf.Elastic(3e5, 0.2)
    np.testing.assert_allclose(spring(1e6, soft), own, rtol=1e-15)
    np.testing.assert_allclose(spring(1e-12, soft), soft.reduced_series(1.0)[0], rtol=1e-9)
    np.testing.assert_allclose(spring(0.3, layer), own, rtol=1e-14)
    slab = rf.Slab(0.3).stiffening(layer.poisson, q)
    np.testing.assert_allclose(spring(0.3, rf.Elastic(1e25, 0.1)), own * slab, rtol=1e-12)
    # A liquid below leaves the free plate, a liquid on top nothing.
    body = rf.Body(layer, None, rf.Coating(0.3, soft))
    free = coated_spring(body, own, 0.0, q)
    np.testing.assert_allclose(free, coated_spring(body, own, 1e-30 * own, q), rtol=1e-12)
    assert (coated_spring(body, 0.0, own, q) == 0).all()
    assert (coated_spring(body, 0.0, 0.0, q) == 0).all()


RUBBER = rf.Prony(3.6e6, [1e9, 1e8, 2e7, 5e6, 1e6], [1e-8, 1e-6, 1e-4, 1e-2, 1.0])
OTHER = rf.Prony(2e5, [3e7, 5e6, 5e6], [1e-6, 1e-2, 3.0], 0.3)
LIQUID = rf.Prony(0.0, [1e7, 1e5], [1e-5, 1.0], 0.45)


@pytest.mark.parametrize(
    ("layer", "base"),
    [
        pytest.param(RUBBER, OTHER, id="shared times"),
        pytest.param(RUBBER, rf.Elastic(1e7, 0.3), id="on elastic", marks=pytest.mark.slow),
        pytest.param(rf.Elastic(1e9, 0.3), OTHER, id="below elastic", marks=pytest.mark.slow),
        pytest.param(RUBBER, RUBBER, id="same", marks=pytest.mark.slow),
        pytest.param(OTHER, LIQUID, id="liquid below", marks=pytest.mark.slow),
    ],
)
def test_complex_factor(layer, base):
    """The loss keeps nine digits, also where one solid has hardly any."""
    q, omega = np.logspace(0, 6, 13), 10 ** np.random.default_rng(0).uniform(-6, 12, 12)
    coating = rf.Coating(1e-3, base)
    moduli = [np.asarray(rf.complex_modulus(m, omega))[:, None] for m in (layer, base)]
    reduced = [E / (1 - m.poisson**2) for E, m in zip(moduli, (layer, base), strict=True)]
    found = np.asarray(jax.jit(lambda one, two: coating.E_r_S_bar(layer.poisson, q, one, two))(*reduced))
    for i, x in enumerate(1e-3 * q):
        with mp.workdps(30):
            c = coating_coefficients(x, layer.poisson, base.poisson)
            for k in range(omega.size):
                one, two = (
                    mp.mpc(E[k, 0]) / (2 * (1 + m.poisson))
                    for E, m in zip(moduli, (layer, base), strict=True)
                )
                powers = one * one, one * two, two * two
                top, bottom = (
                    sum(a * b for a, b in zip(part, powers, strict=True)) for part in (c[:3], c[3:])
                )
                exact = complex(2 * one / (1 - layer.poisson) * top / bottom)
                assert abs(found[k, i] - exact) < 1e-12 * abs(exact)
                assert abs(found[k, i].imag - exact.imag) < 1e-9 * exact.imag


# Scenes.

ON_RIGID = rf.Body(rf.Rigid(), problems.ROAD)
TAU = [1e-8, 1e-6, 1e-4, 1e-2, 1.0]


def rubber(scale=1.0, nu=0.5, slower=1.0):
    E = [scale * E for E in (1e9, 1e8, 2e7, 5e6, 1e6)]
    return {"kind": "prony", "E_inf": 3.6e6 * scale, "E": E, "tau": [slower * t for t in TAU], "nu": nu}


def elastic(young, nu):
    return {"kind": "elastic", "E": young, "nu": nu}


def coated(layer, thickness, base):
    return layer | {"coating": {"thickness": thickness, "base": base}}


def case(lower, upper, psd1=None, psd2=ROAD):
    conditions = {"v": 0.03, "pressure": 2e5, "gamma": 0.5}
    return {"solid1": lower, "solid2": upper, "psd1": psd1, "psd2": psd2} | conditions


CASES = {
    "both relax": case(coated(rubber(0.1, 0.45), 3e-4, rubber(1.0, 0.3, 3.0)), RIGID, WORN),
    "shared times": case(coated(rubber(), 1e-3, rubber(0.1)), RIGID),
    "elastic base": case(coated(rubber(), 1e-3, elastic(1e9, 0.3)), RIGID),
    "elastic layer": case(coated(elastic(1e9, 0.35), 2e-4, rubber()), RIGID),
    "facing elastic": case(coated(rubber(), 1e-3, rubber(0.01)), elastic(1e8, 0.3), WORN),
    "facing rubber": case(coated(rubber(), 1e-3, elastic(1e9, 0.3)), rubber(0.3, 0.49, 2.0), WORN),
    "two coated": case(
        coated(rubber(), 1e-3, elastic(1e6, 0.5)), coated(rubber(0.3, 0.49, 2.0), 3e-4, rubber(2.0)), WORN
    ),
    "nothing relaxes": case(coated(elastic(1e8, 0.4), 1e-4, elastic(1e6, 0.5)), RIGID),
}
SLOW = set(CASES) - {"both relax"}


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in CASES])
def test_scenes(name):
    given = CASES[name]
    exact = oracle.solve(given, halvings=60, order=10)
    found = quantities(as_arrays((scene(given), given["v"], given["pressure"])))
    np.testing.assert_allclose(found, [exact[quantity] for quantity in QUANTITIES], rtol=1e-9)


def test_elastic_layer_on_rubber_dissipates():
    def body(layer, base, spectrum=None):
        return rf.Body(layer, spectrum, rf.Coating(1e-3, base))

    stiff = rf.Elastic(1e9, 0.3)
    assert relaxes(body(stiff, RUBBER)) and relaxes(body(RUBBER, stiff)) and not relaxes(body(stiff, stiff))
    assert dissipates(rf.Scene(body(stiff, RUBBER), ON_RIGID))
    assert not dissipates(rf.Scene(body(stiff, RUBBER, ON_RIGID.spectrum), rf.Body(rf.Rigid())))
    assert not dissipates(rf.Scene(body(stiff, stiff), ON_RIGID))


@pytest.mark.slow
def test_extremes_are_finite():
    """Thin, thick, stiff, soft and liquid, values and gradients, from one compilation."""
    setting = rf.Quadrature(order=4, panels=3, graded=1, ratio=6.0, angular_order=4)

    def total(s, v):
        solution = rf.solve(s, v, 1e5, quadrature=setting)
        return sum(jnp.log1p(getattr(solution, name)) for name in QUANTITIES)

    both = jax.jit(jax.value_and_grad(total, (0, 1)))
    for d in (1e-12, 1e-4, 1e6):
        for E_inf, E in ((0.0, [1e6, 1e6]), (1e-6, [1e14, 0.0]), (1e6, [0.0, 0.0])):
            for soft, nu in ((1.0, 0.5), (1e12, 0.0), (1e-12, 0.5)):
                tau, v = [1e-20, 1e20], 1e-3
                one = rf.Prony(E_inf, np.array(E), np.array(tau), 0.5)
                two = rf.Prony(1e5 * soft, soft * np.array([1e6, 1e3]), np.array([1.0, 1.0]), nu)
                coated = rf.Scene(rf.Body(one, None, rf.Coating(d, two)), ON_RIGID)
                value, slopes = both(*as_arrays((coated, v)))
                assert np.isfinite(value) and value >= 0, (d, E_inf, soft)
                assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes)), (d, E_inf, soft)


def test_what_single_precision_cannot_hold():
    single = as_arrays(rf.Scene(rf.Body(LIQUID, None, rf.Coating(1e-3, LIQUID)), ON_RIGID), jnp.float32)
    with pytest.raises(ValueError, match=r"lower\.layer\.base\.E_inf.*float32.*float64"):
        rf.solve(single, jnp.float32(0.1), jnp.float32(1e5))


@pytest.mark.parametrize("base", [rf.Rigid(), rf.PronyShear(1e6, [1e6], [1.0], 1e9)], ids=["rigid", "shear"])
def test_refused(base):
    message = rf"^Coating\.base is a {type(base).__name__}: must be a deformable material with a constant"
    with pytest.raises(ValueError, match=message) as caught:
        rf.Coating(1e-3, base)
    assert "\n" not in str(caught.value)
