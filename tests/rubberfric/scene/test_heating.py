"""Temperatures of friction: the kernel by quadrature, by its closed form and by heat conduction; the energy.

Heated scenes as wholes are in test_heated_scenes.py.
"""

import functools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.oracles import oracle_heating

import rubberfric as rf
from rubberfric.scene.heating import diffusion, heat_kernel, rise_below_surface, rise_inside

LAW = {"density": 1200.0, "heat_capacity": 1600.0, "conductivity": 0.23, "radius": 2e-3}
# Heat capacity of a volume [J/(m^3 K)].
HEAT = LAW["density"] * LAW["heat_capacity"]
R = LAW["radius"]
D = LAW["conductivity"] / HEAT
NODES = rf.Quadrature().heat


def heating(diffusivity, radius=R):
    return rf.Heating(1200.0, 1600.0, diffusivity * HEAT, radius)


@functools.partial(jax.jit, static_argnames="count")
def kernels(heating, q, source_q, velocity, count=NODES):
    """g(q, q'), shape (velocities, q, q'), and the kernel of heat at the surface, (velocities, q).

    g dq' f is the rise of f dq' = 2 q' power / (rho c_p), and the power of the library is over v.
    """
    ends = jnp.minimum(q[0], source_q[0]), jnp.maximum(q[-1], source_q[-1])
    known = heat_kernel(heating, diffusion(source_q, q, ends, count), velocity, True)
    one_source = known._replace(
        weight=jnp.repeat(known.weight, source_q.size, 0), closed=jnp.repeat(known.closed, source_q.size)
    )
    power = jnp.tile(jnp.eye(source_q.size), (velocity.size, 1))
    inside = rise_inside(one_source, power).reshape(velocity.size, source_q.size, q.size)
    surface = rise_below_surface(known, jnp.ones(velocity.size))
    v = velocity[:, None]
    inside = inside * (known.heat / (2 * source_q[:, None] * v[..., None]))
    return jnp.swapaxes(inside, 1, 2), surface * (known.heat / v)


def closed_form(diffusivity, t0, q):
    """g among wavevectors, and the kernel of heat at the surface, 8 q^2 K(2 q) / (pi D), to 30 digits."""
    with mp.workdps(60):
        one, s = mp.mpf(float(diffusivity)), mp.sqrt(mp.mpf(float(diffusivity)) * mp.mpf(float(t0)))
        x = [2 * mp.mpf(float(value)) for value in q]
        K = [_K(y, s) for y in x]

        def g(i, j):
            if x[i] != x[j]:
                return 2 * x[j] * x[i] ** 2 / (mp.pi * one) * (K[j] - K[i]) / (x[i] ** 2 - x[j] ** 2)
            z = x[i] * s
            root = 3 * mp.sqrt(mp.pi) * s - 3 * mp.pi / (2 * x[i]) * (1 - _erfcx(z))
            return (root - mp.pi * x[i] * s**2 * _erfcx(z)) / (mp.pi * one * x[i])

        inside = [[float(g(i, j)) for j in range(q.size)] for i in range(q.size)]
        return np.array(inside), np.array(
            [float(2 * y**2 / (mp.pi * one) * k) for y, k in zip(x, K, strict=True)]
        )


def _K(x, s):
    z = x * s
    if z < 0.01:
        return mp.pi / 2 * s**3 / z * sum((-z) ** n / mp.gamma(mp.mpf(n) / 2 + 2) for n in range(30))
    return (mp.sqrt(mp.pi) * s - mp.pi / (2 * x) * (1 - _erfcx(z))) / x**2


def _erfcx(z):
    if z < 1e4:
        return mp.exp(z**2) * mp.erfc(z)
    return sum((-1) ** n * mp.fac2(2 * n - 1) / (2 * z * z) ** n for n in range(8)) / (z * mp.sqrt(mp.pi))


DIFFUSIVITIES = [1e-18, D, 3.0, 1e12]
VELOCITIES = np.logspace(-12, 12, 9)


@pytest.mark.parametrize("diffusivity", DIFFUSIVITIES)
@pytest.mark.parametrize("radius", [1e-8, R, 1.0])
def test_kernel_is_its_closed_form(diffusivity, radius):
    """Over 24 decades of v, 30 of D and 8 of R, and up to nine of q."""
    for q in (np.array([1e2, 1e2 * (1 + 1e-9), 3e3, 1e5, 4e7]), np.geomspace(1e2, 1e11, 5)):
        found = kernels(heating(diffusivity, radius), q, q, VELOCITIES)
        for j in (0, 4, 8):
            inside, surface = closed_form(diffusivity, radius / VELOCITIES[j], q)
            np.testing.assert_allclose(found[0][j], inside, rtol=1e-9)
            np.testing.assert_allclose(found[1][j], surface, rtol=1e-11)


@pytest.mark.parametrize(("q", "source_q", "v"), [(1e2, 1e4, 1e-3), (3e4, 5e2, 10.0), (1e3, 1e3, 1e7)])
def test_brute_force_kernel_in_15_digits(q, source_q, v):
    borders = sorted({0.0, 1 / np.sqrt(D * R / v), q, source_q})
    borders = [*borders, 100 * borders[-1], mp.inf]

    def integral(source):
        def f(k):
            return -mp.expm1(-D * k * k * (R / v)) / (D * k * k) * source(k) * 4 * q**2 / (k * k + 4 * q**2)

        return float(mp.quad(f, borders) / mp.pi)

    inside, surface = integral(lambda k: 4 * source_q / (k * k + 4 * source_q**2)), integral(lambda _: 2)
    found = oracle_heating.kernel(LAW, v, np.array([q]), np.array([source_q]))[0, 0]
    assert found == pytest.approx(inside, rel=1e-12)
    assert oracle_heating.surface_kernel(LAW, v, np.array([q]))[0] == pytest.approx(surface, rel=1e-10)
    wanted = closed_form(D, R / v, np.array([q, source_q]))
    np.testing.assert_allclose([inside, surface], [wanted[0][0, 1], wanted[1][0]], rtol=1e-12)


@pytest.mark.slow
def test_more_decades_need_more_nodes():
    q = np.geomspace(1.0, 1e12, 5)
    found = {count: kernels(heating(D), q, q, VELOCITIES, count)[0] for count in (160, 240)}
    for j, v in enumerate(VELOCITIES):
        wanted = oracle_heating.kernel(LAW, v, q, q)
        np.testing.assert_allclose(found[160][j], wanted, rtol=3e-8)
        np.testing.assert_allclose(found[240][j], wanted, rtol=3e-11)


def test_no_heat_diffuses():
    """Then g = t_0 q / (q + q'), and of heat at the surface 2 q t_0: the energy stays where it is."""
    q = np.array([1e2, 1e3, 5e3, 7e4, 1e6])
    inside, surface = kernels(heating(1e-48), q, q, VELOCITIES)
    t0 = R / VELOCITIES[:, None, None]
    np.testing.assert_allclose(inside, t0 * q[:, None] / (q[:, None] + q), rtol=1e-9)
    np.testing.assert_allclose(surface, t0[..., 0] * 2 * q, rtol=1e-9)


def conduction(t, q, source_q):
    r"""Temperatures seen by q after a time t of heating exp(-2 q' z), or the surface, by elements.

    Each scale q' heats a half-space z > 0 with insulated surface like exp(-2 q' z), and q sees the mean
    over depth with weight 2 q exp(-2 q z):

    .. math:: \dot T = D T'' + e^{-2q'z},\quad T'(0) = 0,\qquad T_q = \int_0^\infty 2q e^{-2qz} T dz

    Every cosine of k decays at its rate D k^2; the profile has 2q'/(k^2 + 4q'^2) of it and the weight
    4q^2/(k^2 + 4q^2), so that T_q = g. Solved here without k: polynomials of degree 12 on intervals of z,
    exact in time.

    Returns
    -------
    (inside, surface), shapes (q, q') and (q,); the surface for heat of 1 per area and time
    """
    node, weight = gauss_lobatto(12)
    basis = [np.polynomial.Polynomial.fromroots(np.delete(node, j)) for j in range(13)]
    slope = np.array([p.deriv()(node) / p(x) for p, x in zip(basis, node, strict=True)])
    diffused = np.sqrt(D * t)
    both = np.concatenate([q, source_q])
    first, last = 0.5 * min(0.5 / both.max(), diffused), 40 * (0.5 / both.min() + diffused)
    edges = np.append(0.0, np.geomspace(first, last, 2 + int(np.log(last / first) / np.log(1.8))))
    size = 12 * (edges.size - 1) + 1
    z, mass, stiff = np.zeros(size), np.zeros(size), np.zeros((size, size))
    for i, half in enumerate(0.5 * np.diff(edges)):
        own = slice(12 * i, 12 * i + 13)
        z[own] = edges[i] + half * (1 + node)
        mass[own] += half * weight
        stiff[own, own] += (slope * weight) @ slope.T / half
    root = np.sqrt(mass)
    rate, mode = np.linalg.eigh(D * t * stiff / root / root[:, None])
    safe = np.maximum(rate, 1e-12)
    response = (2 * q * np.exp(-2 * z[:, None] * q) * root[:, None]).T @ mode
    response = response * (t * -np.expm1(-safe) / safe) @ mode.T
    return response @ (np.exp(-2 * z[:, None] * source_q) * root[:, None]), response[:, 0] / root[0]


def gauss_lobatto(degree):
    legendre = np.polynomial.legendre.Legendre.basis(degree)
    node = np.concatenate([[-1.0], np.sort(legendre.deriv().roots().real), [1.0]])
    return node, 2 / (degree * (degree + 1) * legendre(node) ** 2)


def test_kernel_conducts_heat():
    q, source_q = np.array([1e2, 1.1e2, 2e3, 5e4, 6e4]), np.array([1e2, 3e2, 1e3, 1e4, 8e4])
    v = np.logspace(-4, 6, 9)
    inside, surface = kernels(heating(D), q, source_q, v)
    for j in range(0, 9, 2):
        wanted = conduction(R / v[j], q, source_q)
        np.testing.assert_allclose(inside[j], wanted[0], rtol=1e-8)
        np.testing.assert_allclose(surface[j], wanted[1], rtol=1e-8)
