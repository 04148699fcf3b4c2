r"""The textbook method: the theory as anyone writes it down, in NumPy, to compare with.

.. math:: G(q) = \frac{1}{2\sigma_0^2}\int_{q_0}^{q} d^2q \sum_j C_j |K_j|^2,\qquad
          P = \mathrm{erf}\frac{1}{2\sqrt G},\qquad S = \gamma + (1-\gamma)P^2
.. math:: \mu = \frac{1}{\sigma_0}\int d^2q\, S P \sum_j C_j\, q\cos\varphi\,\mathrm{Im} K_j,\qquad
          \bar u = \int d^2q \sum_j C_j\,\mathrm{Re} K_j
          \int_{\sigma_0}^\infty \frac{dp}{2p}\frac{\partial[SP]}{\partial p}

[Scaraggi & Persson, arXiv:1506.06955, eqs. (10), (A11), (A17), (A18)]

Trapezoids over ln q and over phi, complex moduli at every frequency q v cos(phi), a cumulative
trapezoid for G, and one more over ln p for the separation. Numbers are taken from the scene and
nothing else: no formula, mesh or table of the library, so that it is a second opinion as well.
Its errors are of second order in the distance of the nodes, of first order where a spectrum ends
between two, and in phi there is no order until the nodes resolve every cos(phi) ~ 1/(q v tau).
"""

from collections.abc import Sequence

import numpy as np
import scipy
from jax.typing import ArrayLike

from rubberfric.analysis.error_and_time.textbook_solids import (
    knows,
    range_of,
    series,
    shift_factor,
    spectrum_at,
    stiffness,
    vertical_factor,
)
from rubberfric.scene.scene import Scene, present
from rubberfric.scene.shear import ContactShear
from rubberfric.theory.quantities import QUANTITIES

_AT_ONCE = 1_000_000  # complex moduli: 16 MB
_FULL = 6.0  # P = 1 to the last bit from this argument of erf on


def covers(scene: Scene) -> bool:
    """Whether the method has all in a scene: no heating, softening, adhesion, correlation, anisotropy."""
    bodies = (scene.lower, scene.upper)
    return present(scene) <= {"shear", "area_correction"} and all(map(knows, bodies))


def solve(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    nodes: tuple[int, int] = (200, 64),
    quantities: Sequence[str] = QUANTITIES,
) -> dict[str, np.ndarray]:
    """Area, friction and separation by the textbook method.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    nodes : (int, int)
        of the trapezoids over ln q and over phi. The pressure integral takes as many as phi.
    quantities : names out of "area", "friction", "separation"

    Returns
    -------
    dict from the names in `quantities` to arrays of the broadcast shape [-], [-], [m].

    Raises
    ------
    ValueError : a scene that it does not cover, see `covers`.
    """
    if not covers(scene):
        raise ValueError(
            "scene: heating, softening, adhesion, correlation and anisotropy must be absent here"
        )
    given = [np.asarray(x, float) for x in (velocity, pressure, temperature) if x is not None]
    conditions = np.broadcast_arrays(*given)
    points = [x.reshape(-1) for x in conditions]
    at_once = max(1, _AT_ONCE // (nodes[0] * nodes[1]))
    blocks = [
        _block(scene, [x[i : i + at_once] for x in points], nodes, quantities)
        for i in range(0, points[0].size, at_once)
    ]
    shape = conditions[0].shape
    return {name: np.concatenate([block[name] for block in blocks]).reshape(shape) for name in quantities}


def _block(scene, points, nodes, quantities):
    """All quantities at points [velocity, pressure(, temperature)] of shape (n,)."""
    velocity, pressure, *rest = points
    temperature = rest[0] if rest else None
    bodies = ((scene.lower, scene.upper), (scene.upper, scene.lower))
    pairs = [(one.spectrum, one, other) for one, other in bodies if one.spectrum is not None]
    one, zero = np.ones_like(pressure), np.zeros_like(pressure)
    results = {"area": one, "friction": zero, "separation": zero}
    if pairs:
        limits = [limit for spectrum, _, _ in pairs for limit in range_of(spectrum)]
        q = np.geomspace(min(limits), max(limits), nodes[0])
        log_q = np.log(q)
        power, dissipation, storage = _over_angle(pairs, q, velocity, temperature, nodes[1], quantities)
        density = q**2 * power / (2 * pressure[:, None] ** 2)
        plain = _cumulative(density, log_q)
        gamma = float(scene.gamma)
        fluctuation = _stepped(density, log_q, gamma) if scene.area_correction else plain
        x = _argument(fluctuation)
        results["area"] = scipy.special.erf(x[:, -1])
        if "friction" in quantities:
            P = scipy.special.erf(x)
            integrand = q**3 * (gamma + (1 - gamma) * P**2) * P * dissipation
            results["friction"] = np.trapezoid(integrand, log_q, axis=-1) / pressure
        if "separation" in quantities:
            over_pressure = _over_pressure(_argument(plain), gamma, nodes[1])
            results["separation"] = np.trapezoid(q**2 * storage * over_pressure, log_q, axis=-1) / pressure
    if scene.shear is not None:
        shear = _contact_shear(scene.shear, velocity, temperature)
        results["friction"] = results["friction"] + shear * results["area"] / pressure
    return results


def _over_angle(pairs, q, velocity, temperature, count, quantities):
    """Integrals over phi of sum_j C_j times |K_j|^2, cos(phi) Im K_j and Re K_j, shape (points, q)."""
    cosine = np.cos(np.linspace(0, 2 * np.pi, count, endpoint=False))
    power, dissipation, storage = np.zeros((3, velocity.size, q.size))
    for spectrum, rough, other in pairs:
        roughness = 2 * np.pi * spectrum_at(spectrum, q)
        omega = q[:, None] * (velocity[:, None, None] * cosine)
        K = series(stiffness(other, q, omega, temperature), stiffness(rough, q, None, temperature))
        power = power + roughness * np.mean(np.real(K) ** 2 + np.imag(K) ** 2, -1)
        if "friction" in quantities:
            dissipation = dissipation + roughness * np.mean(np.imag(K) * cosine, -1)
        if "separation" in quantities:
            storage = storage + roughness * np.mean(np.real(K), -1)
    return power, dissipation, storage


def _cumulative(density: np.ndarray, log_q: np.ndarray) -> np.ndarray:
    """Cumulative trapezoid, 0 at the first node."""
    steps = 0.5 * (density[:, 1:] + density[:, :-1]) * np.diff(log_q)
    return np.concatenate([np.zeros_like(density[:, :1]), np.cumsum(steps, -1)], -1)


def _stepped(density: np.ndarray, log_q: np.ndarray, gamma: float) -> np.ndarray:
    """G with the energy factor inside, dG = S(P(G)) density d ln q, by Heun's steps."""
    G = np.zeros_like(density)
    for i, step in enumerate(np.diff(log_q)):
        slope = _energy(G[:, i], gamma) * density[:, i]
        ahead = _energy(G[:, i] + step * slope, gamma) * density[:, i + 1]
        G[:, i + 1] = G[:, i] + 0.5 * step * (slope + ahead)
    return G


def _energy(G: np.ndarray, gamma: float) -> np.ndarray:
    """S."""
    return gamma + (1 - gamma) * scipy.special.erf(_argument(G)) ** 2


def _argument(G: np.ndarray) -> np.ndarray:
    """1 / (2 sqrt(G)), infinite at G = 0."""
    with np.errstate(divide="ignore"):
        return 0.5 / np.sqrt(G)


def _over_pressure(x: np.ndarray, gamma: float, count: int) -> np.ndarray:
    """sigma_0 int dp/(2p) d[SP]/dp from sigma_0 to where P = 1, by a trapezoid over ln p."""
    x = np.minimum(x, _FULL)
    log_p = np.log(_FULL / x)[..., None] * np.linspace(0, 1, count)  # ln(p / sigma_0)
    here = x[..., None] * np.exp(log_p)
    slope = 2 / np.sqrt(np.pi) * here * np.exp(-(here**2))  # dP / d ln p
    slope *= gamma + 3 * (1 - gamma) * scipy.special.erf(here) ** 2
    return np.trapezoid(0.5 * np.exp(-log_p) * slope, log_p, axis=-1)


def _contact_shear(shear: ContactShear, velocity: np.ndarray, temperature: np.ndarray | None) -> np.ndarray:
    """Shear stress in the area of contact [Pa], with the sign of the velocity."""
    scaled, largest = np.abs(velocity), float(shear.tau_f0)
    if temperature is not None and shear.shift is not None:
        scaled = scaled * shift_factor(shear.shift, temperature)
        if shear.shift.vertical is not None:
            T_ref = float(shear.shift.reference_temperature)
            largest = largest * vertical_factor(shear.shift.vertical, temperature, T_ref)
    decades = np.log10(np.maximum(scaled, np.finfo(float).tiny) / float(shear.v0))
    return largest * np.exp(-float(shear.c) * decades**2) * np.sign(velocity)
