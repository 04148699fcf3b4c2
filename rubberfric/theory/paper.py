r"""The paper, executable: Scaraggi and Persson's general case, one expression for each equation.

Source: M. Scaraggi and B. N. J. Persson, arXiv:1506.06955. The letters and the equation numbers are the
paper's. Solid 2 (`scene.upper`) slides with v over solid 1 (`scene.lower`). In the frame of each solid, its
own roughness is at rest, and the roughness of the other solid passes with the frequency q.v.

These functions are plain JAX: `jax.jit` and `jax.grad` go through them. They cover half-spaces and slabs of
every material that gives E(omega), two rough solids, contact shear, and S in G (`area_correction`). They use
no closed form, table or interpolation of the fast functions in `rubberfric.theory`, which are tested against
them, and take ten to a hundred times as long.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf

from rubberfric.base.blocks import broadcast_shape
from rubberfric.base.checks import ArrayLike
from rubberfric.base.quadrature import gauss, legendre_transform
from rubberfric.roughness.spectra import power_spectrum
from rubberfric.scene.interface import shear_friction
from rubberfric.scene.scene import Scene, optional_parts
from rubberfric.theory.stiffness.complex_stiffness import K_j
from rubberfric.theory.structure import Solution, SurfaceTemperatures, rough_surfaces_of


class Nodes(NamedTuple):
    """Nodes and weights of the integrals.

    Every piece of ln q between two kinks of the spectra has the same nodes.
    """

    y: np.ndarray  # ln q = ln q_left + (ln q_right - ln q_left) y, shape (n,)
    dy: np.ndarray  # weights of the integral over a piece, shape (n,)
    until: np.ndarray  # weights of the integrals from the left end to every node, shape (n, n)
    cos_phi: np.ndarray  # cos(phi), shape (angles,)
    dphi: np.ndarray  # weights of the integral over the circle of a function that is even in cos(phi)
    z: np.ndarray  # the pressure, as a share of its range in ln p, shape (pressures,)
    dz: np.ndarray


@functools.cache
def gauss_nodes(order: int = 12, panels: int = 6, graded: int = 14, step: float = 0.25) -> Nodes:
    """Return nodes with errors of 1e-14 for area and friction, and of 1e-10 for the separation.

    For a tabulated modulus, step = 0.05 and panels = 12 give errors of 1e-9.

    Parameters
    ----------
    order : Gauss nodes of a panel
    panels : equal panels of a piece of ln q, in s = sqrt(y)
    graded : further panels towards the left end of a piece, each a quarter of the next, because P falls from
        1 within ln(q / q0) = 1e-4 at tyre pressures and 1e-18 at light loads
    step : step of the trapezoidal rule in t, cos(phi) = 1 / cosh(t), which converges as exp(-pi^2 / step)
    """
    edges = np.arange(1, panels + 1) / panels
    edges = np.concatenate([[0.0], edges[0] * 4.0 ** np.arange(-graded, 0), edges])
    (node, weight), width = gauss(order), np.diff(edges)
    s, ds = (edges[:-1, None] + width[:, None] * node).ravel(), np.outer(width, weight).ravel()
    basis = np.polynomial.legendre.Legendre.basis
    integrals = np.stack([basis(k).integ(lbnd=-1)(2 * node - 1) / 2 for k in range(order)], -1)
    inside = np.kron(np.diag(width), integrals @ legendre_transform(order))
    before = np.kron(np.tri(width.size, k=-1), np.ones((order, order))) * ds
    t = step * np.arange(int(36 / step))
    dphi = 4 * step / np.cosh(t)
    dphi[0] /= 2
    return Nodes(s**2, 2 * s * ds, (inside + before) * 2 * s, 1 / np.cosh(t), dphi, *gauss(2 * order))


@functools.cache
def trapezoid_nodes(n_q: int, n_phi: int) -> Nodes:
    """Return nodes of the trapezoidal rule: n_q for each piece of ln q, and n_phi on the circle."""
    y, step = np.linspace(0, 1 - 1e-12, n_q), 1 / (n_q - 1)  # C is 0 from the end of the last piece on
    until = step * (np.tri(n_q) - 0.5 * np.eye(n_q) - 0.5 * np.eye(1, n_q))
    cos_phi = np.cos(2 * np.pi * np.arange(n_phi) / n_phi)
    return Nodes(y, until[-1], until, cos_phi, np.full(n_phi, 2 * np.pi / n_phi), y, until[-1])


def covers(scene: Scene) -> bool:
    """Return True if `solve` of this module covers the scene.

    The scene may have isotropic roughness, half-spaces, slabs, contact shear and S in G, and nothing else.
    """
    bodies = scene.lower, scene.upper
    separable = all(body.separable for body in bodies)
    isotropic = not any(body.spectrum is not None and body.spectrum.harmonic_count() for body in bodies)
    return separable and isotropic and optional_parts(scene) <= {"shear", "area_correction"}


def solve(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    nodes: Nodes | None = None,
) -> Solution:
    """Return a `Solution` with area, friction and separation, of the broadcast shape.

    Parameters
    ----------
    scene : Scene for which `covers` is true, of solids with E(0) > 0
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
        The derivative with respect to the velocity is not defined at rest.
    nodes : Nodes, or None for `gauss_nodes()`

    Raises
    ------
    ValueError : `covers` is false.
    """
    if not covers(scene):
        raise ValueError("scene has a part that the paper's general case lacks: use rubberfric.solve")
    broadcast_shape(velocity=velocity, pressure=pressure, temperature=temperature)
    conditions = [jnp.asarray(x, float) for x in (velocity, pressure, temperature) if x is not None]
    conditions = jnp.broadcast_arrays(*conditions)
    points = tuple(x.reshape(-1) for x in conditions)
    solutions = jax.lax.map(lambda point: _at_point(scene, nodes or gauss_nodes(), *point), points)
    return jax.tree.map(lambda x: x.reshape(conditions[0].shape), solutions)


def _at_point(scene, nodes, v, sigma_0, T=None):
    rough = rough_surfaces_of(scene)
    area, mu, u_bar = jnp.ones(()), jnp.zeros(()), jnp.zeros(())
    if rough:
        area, mu, u_bar = _integrals(scene.gamma, scene.area_correction, rough, nodes, v, sigma_0, T)
    if scene.shear is not None:
        mu = mu + shear_friction(scene.shear, area, v, sigma_0, T)
    return Solution(area, mu, u_bar)


def _integrals(gamma, S_in_G, rough, nodes, v, sigma_0, T):
    kinks = jnp.sort(jnp.concatenate([surface.law.q for surface in rough]))
    piece = jnp.diff(jnp.log(kinks))[:, None]  # axes: pieces of ln q, nodes in a piece, phi
    q, dq_q = kinks[:-1, None] * jnp.exp(piece * nodes.y), piece * nodes.dy

    def mean(C, f):  # sum over j of C_j times the integral of f over phi
        return sum(c * jnp.sum(f(k) * nodes.dphi, -1) for c, k in zip(C, K, strict=True))

    def until(f):  # integral of f d ln q up to every node
        pieces = jnp.cumsum(jnp.sum(f * dq_q, -1))
        return jnp.concatenate([jnp.zeros(1), pieces[:-1]])[:, None] + piece * (f @ nodes.until.T)

    C = [power_spectrum(surface.spectrum, q) for surface in rough]
    Q, omega = q[..., None], q[..., None] * v * nodes.cos_phi
    at_T = SurfaceTemperatures(T, T)
    K = [K_j(surface, Q, omega, at_T) for surface in rough]  # (A6)
    stress2 = q**2 * mean(C, lambda K: jnp.abs(K) ** 2) / (2 * sigma_0**2)  # (A8)
    G, G_end = until(stress2), jnp.sum(stress2 * dq_q)  # (A11)
    x = plain = 0.5 / jnp.sqrt(G)
    if S_in_G:  # dG = S dG_plain, solved by iteration from q0 on
        x = jax.lax.fori_loop(0, 60, lambda _, x: 0.5 / jnp.sqrt(until(S(erf(x), gamma) * stress2)), x)
        G_end = jnp.sum(S(erf(x), gamma) * stress2 * dq_q)
    P = erf(x)  # (10)
    loss = q**3 * mean(C, lambda K: nodes.cos_phi * jnp.imag(K))
    mu = jnp.sum(S(P, gamma) * P * loss * dq_q) / sigma_0  # (A17)
    stored = q**2 * mean(C, jnp.real)
    u_bar = jnp.sum(stored * pressure_integral(plain, gamma, nodes) * dq_q) / sigma_0  # (A18)
    return erf(0.5 / jnp.sqrt(G_end)), mu, u_bar


def S(P: jax.Array, gamma: jax.Array) -> jax.Array:
    """Return the elastic energy factor S(P) [-]."""
    return gamma + (1 - gamma) * P**2  # (14)


def pressure_integral(x: jax.Array, gamma: jax.Array, nodes: Nodes) -> jax.Array:
    """Return sigma_0 times the integral over p of d[S P]/dp / (2 p), at x = 1 / (2 sqrt(G))."""
    x = jnp.minimum(x, 7.0)[..., None]  # P = 1 to the last bit
    # t = x p / sigma_0; ln t is cut where the integrand is no longer constant.
    low, cut, total = jnp.log(x), jnp.maximum(jnp.log(x), -2.0), 0.0
    for start, end in ((low, cut), (cut, np.log(7.0))):
        t = jnp.exp(start + (end - start) * nodes.z)
        slope = 2 / np.sqrt(np.pi) * jnp.exp(-(t**2)) * (gamma + 3 * (1 - gamma) * erf(t) ** 2)  # d[S P]/dt
        total = total + jnp.sum((end - start) * nodes.dz * slope, -1)
    return x[..., 0] / 2 * total
