r"""The textbook method: the theory as anyone writes it down, in NumPy, to compare with.

.. math:: G(q) = \frac{1}{2\sigma_0^2}\int_{q_0}^{q} d^2q \sum_j C_j |K_j|^2,\qquad
          P = \mathrm{erf}\frac{1}{2\sqrt G},\qquad S = \gamma + (1-\gamma)P^2
.. math:: \mu = \frac{1}{\sigma_0}\int d^2q\, S P \sum_j C_j\, q\cos\varphi\,\mathrm{Im} K_j,\qquad
          \bar u = \int d^2q \sum_j C_j\,\mathrm{Re} K_j
          \int_{\sigma_0}^\infty \frac{dp}{2p}\frac{\partial[SP]}{\partial p}

[Scaraggi & Persson, arXiv:1506.06955, eqs. (10), (A11), (A17), (A18)]

Trapezoids over ln q and over phi, complex moduli at every frequency q v cos(phi), a cumulative trapezoid for
G, and another over ln p for the separation. The scene supplies numbers only. No formula, mesh or table of
the library is used, so the results are an independent check. Errors are of second order in the spacing of the
nodes, of first order if a spectrum ends between nodes. In phi they fall only once the nodes resolve every
cos(phi) ~ 1/(q v tau).

Series and layers are of [Scaraggi & Persson, eqs. (A6), (A8), (A10)], coatings as in
`rubberfric.materials.series.layer_and_base`; E(omega), shifts and spectra as in their classes.
"""

import math
from collections.abc import Sequence

import numpy as np
import scipy
from jax.typing import ArrayLike
from scipy.special import ndtr

from rubberfric.materials.coating import Coating
from rubberfric.materials.elastic import Elastic, Rigid
from rubberfric.materials.material import Material
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts.laws import WLF, Arrhenius, Entropic, Shift, VerticalShift
from rubberfric.materials.shifts.tables import TabulatedShift, TabulatedVertical
from rubberfric.materials.slab import Slab
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.roughness.spectra import SelfAffine, Spectrum
from rubberfric.roughness.tabulated import TabulatedSpectrum
from rubberfric.scene.scene import Body, Scene, present
from rubberfric.scene.shear import ContactShear
from rubberfric.theory.quantities import QUANTITIES

_AT_ONCE = 1_000_000  # complex moduli: 16 MB
_FULL = 6.0  # erf is 1 to the last bit beyond


def covers(scene: Scene) -> bool:
    """Return True if the scene has no heating, softening, adhesion, correlation or anisotropy."""
    bodies = (scene.lower, scene.upper)
    return present(scene) <= {"shear", "area_correction"} and all(map(knows, bodies))


def textbook_solve(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    nodes: tuple[int, int] = (200, 64),
    quantities: Sequence[str] = QUANTITIES,
) -> dict[str, np.ndarray]:
    """Compute area, friction and separation by the textbook method.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    nodes : (int, int)
        of the trapezoids over ln q and over phi. The pressure integral has as many as phi.
    quantities : some of "area", "friction", "separation"

    Returns
    -------
    dict from the names in `quantities` to arrays of the broadcast shape [-], [-], [m].

    Raises
    ------
    ValueError : the method does not cover the scene, see `covers`.
    """
    if not covers(scene):
        raise ValueError("scene: heating, softening, adhesion, correlation and anisotropy must be absent")
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


_BOLTZMANN_EV = 8.617333262e-5  # [eV/K]

_MATERIALS = (Rigid, Elastic, Prony, PronyShear, TabulatedModulus)
_SHIFTS = (WLF, Arrhenius, TabulatedShift, type(None))
_VERTICAL = (Entropic, TabulatedVertical, type(None))
_LAYERS = (Slab, Coating, type(None))
_SPECTRA = (SelfAffine, TabulatedSpectrum, type(None))


def knows(body: Body) -> bool:
    """Return True if this module implements the material, shifts, layer and spectrum of a body."""
    shifts = [body.material.shift, None if body.layer is None else body.layer.shift]
    parts = [(body.material, _MATERIALS), (body.layer, _LAYERS), (body.spectrum, _SPECTRA)]
    parts += [(shift, _SHIFTS) for shift in shifts]
    parts += [(shift.vertical, _VERTICAL) for shift in shifts if shift is not None]
    return all(isinstance(part, kinds) for part, kinds in parts)


def stiffness(
    body: Body, q: np.ndarray, omega: np.ndarray | None, temperature: np.ndarray | None
) -> np.ndarray | None:
    """1 / M = q E_r Sbar / 2 [Pa/m] at omega of shape (points, q, phi), None for omega = 0; None if rigid.

    temperature : (points,) or None
    """
    material = body.material
    if isinstance(material, Rigid):
        return None
    if isinstance(material, PronyShear):
        shear, bulk = modulus_at(material, omega, temperature), float(material.bulk)
        return 2 * q[:, None] * shear * (3 * bulk + shear) / (3 * bulk + 4 * shear)
    poisson = _poisson(material)
    factor = q / (2 * (1 - poisson**2))
    if isinstance(body.layer, Coating):
        return factor[:, None] * _coated(material, body.layer, q, omega, temperature)
    if isinstance(body.layer, Slab):
        factor = factor * _layer(body.layer, poisson, q)
    return factor[:, None] * modulus_at(material, omega, temperature)


def _coated(material, layer, q, omega, temperature):
    """E(omega) Sbar(q, omega) of a layer on a half-space, which may share the layer's shift."""
    nu1, nu0, base = _poisson(material), _poisson(layer.base), layer.base
    if base.shift is None and not isinstance(base, Elastic):
        base = base.replace(shift=material.shift)
    modulus = modulus_at(material, omega, temperature)
    one, two = modulus / (1 + nu1), modulus_at(base, omega, temperature) / (1 + nu0)
    x = np.minimum(q * float(layer.thickness), 60.0)[:, None]
    a, b = 3 - 4 * nu1, 3 - 4 * nu0
    small, rise, fall = 4 * x * np.exp(-2 * x), -np.expm1(-4 * x), 1 + np.exp(-4 * x)
    wave, product = np.exp(-2 * x), (a - 1) * (b - 1)
    N = (
        4 * b * (0.25 * np.expm1(-2 * x) ** 2 - x * x * wave),
        (a + b) * rise - product * np.expm1(-2 * x) + x * small * (b - 1),
        a * fall + (1 + a * a + 4 * x * x) * wave,
    )
    D = (b * (rise + small), (a + b) * fall + product - small * (b - 1), a * (rise - small) + small * (a - 1))
    top, bottom = ((c[0] * one + c[1] * two) * one + c[2] * two * two for c in (N, D))
    return modulus * top / np.where(bottom == 0, 1.0, bottom)  # two liquids at rest: 0


def series(one: np.ndarray | None, two: np.ndarray | None) -> np.ndarray:
    """Return 1 / (M_1 + M_2) from both stiffnesses; None is a rigid solid, and one solid deforms."""
    if one is None or two is None:
        return np.asarray(two if one is None else one)
    both = one + two
    return one * two / np.where(both == 0, 1.0, both)  # two liquids at rest: 0


def modulus_at(
    material: Material, omega: np.ndarray | None, temperature: np.ndarray | None
) -> np.ndarray | float:
    """Return complex E(omega), or G(omega) of a PronyShear; the real relaxed modulus if omega is None."""
    if isinstance(material, Elastic):
        return float(material.young)
    stiffer = 1.0
    if temperature is not None and material.shift is not None and material.shift.vertical is not None:
        law = material.shift.vertical
        T_ref = float(material.shift.reference_temperature)
        stiffer = vertical_factor(law, temperature, T_ref)[:, None, None]
    return stiffer * _at_reference(material, _shifted(material, omega, temperature))


def _at_reference(material, omega):
    if isinstance(material, TabulatedModulus):
        return _interpolated(material, omega)
    assert isinstance(material, Prony | PronyShear)
    shear = isinstance(material, PronyShear)
    rest, weights = (material.G_inf, material.G) if shear else (material.E_inf, material.E)
    if omega is None:
        return float(rest)
    modulus = np.full(omega.shape, float(rest), complex)
    for weight, tau in zip(np.asarray(weights, float), np.asarray(material.tau), strict=True):
        s = 1j * omega * tau
        modulus += weight * s / (1 + s)
    return modulus


def _interpolated(material: TabulatedModulus, omega: np.ndarray | None) -> np.ndarray | float:
    if omega is None:
        return float(np.asarray(material.storage)[0])
    knots, storage, loss = (np.log(np.asarray(x)) for x in (material.omega, material.storage, material.loss))
    order = np.argsort(np.abs(omega), axis=None)
    x = np.log(np.maximum(np.abs(omega).reshape(-1)[order], np.finfo(float).tiny))
    width, fall = material.smoothing, 1.0 if material.outside == "fall" else 0.0
    flat, slanted = (_rounded(knots, *curve, width, x) for curve in ((storage, 0.0), (loss, fall)))
    lost = np.exp(slanted)
    if material.outside == "none":
        lost *= ndtr((x - knots[0]) / width) * ndtr((knots[-1] - x) / width)
    back = np.argsort(order)
    stored, lost = (values[back].reshape(omega.shape) for values in (np.exp(flat), lost))
    return stored + 1j * np.sign(omega) * lost


def _rounded(knots, values, fall, width, x):
    """Lines through knots, of slopes +-fall outside, averaged with a Gaussian; x in ascending order."""
    slopes = np.concatenate([[fall], np.diff(values) / np.diff(knots), [-fall]])
    total = np.interp(x, knots, values)
    total += fall * (np.minimum(x - knots[0], 0.0) - np.maximum(x - knots[-1], 0.0))
    for knot, bend in zip(knots, np.diff(slopes), strict=True):
        near = slice(*np.searchsorted(x, [knot - 9 * width, knot + 9 * width]))
        u = np.abs(x[near] - knot) / width
        total[near] += bend * width * (np.exp(-0.5 * u * u) / math.sqrt(2 * math.pi) - u * ndtr(-u))
    return total


def _shifted(material, omega, temperature):
    """a_T omega."""
    if omega is None or temperature is None or material.shift is None:
        return omega
    return omega * shift_factor(material.shift, temperature)[:, None, None]


def shift_factor(shift: Shift, temperature: np.ndarray) -> np.ndarray:
    """a_T."""
    if isinstance(shift, WLF):
        above = temperature - float(shift.T_ref)
        return 10 ** (-float(shift.C1) * above / (float(shift.C2) + above))
    if isinstance(shift, Arrhenius):
        return np.exp(float(shift.energy) / _BOLTZMANN_EV * (1 / temperature - 1 / float(shift.T_ref)))
    assert isinstance(shift, TabulatedShift)
    T, log_aT = np.asarray(shift.T), np.log(np.asarray(shift.aT))
    return np.exp(np.interp(temperature, T, log_aT) - np.interp(float(shift.T_ref), T, log_aT))


def vertical_factor(law: VerticalShift, temperature: np.ndarray, T_ref: float) -> np.ndarray:
    """b_T."""
    if isinstance(law, Entropic):
        return temperature / T_ref * np.exp(-float(law.expansion) * (temperature - T_ref))
    assert isinstance(law, TabulatedVertical)
    T, log_bT = np.asarray(law.T), np.log(np.asarray(law.bT))
    return np.exp(np.interp(temperature, T, log_bT) - np.interp(T_ref, T, log_bT))


def _poisson(material: Material) -> float:
    assert material.poisson is not None  # a PronyShear has no layer
    return float(material.poisson)


def _layer(layer: Slab, poisson: float, q: np.ndarray) -> np.ndarray:
    """Sbar(q d), which is 1 to the last bit beyond q d = 60."""
    x = np.minimum(q * float(layer.thickness), 60.0)
    if layer.base == "frictionless":
        return 1 / np.tanh(x) + x / np.sinh(x) ** 2
    a = 3 - 4 * poisson
    top = 2 * a * np.sinh(x) ** 2 + 2 * x**2 + 8 * (1 - poisson) ** 2
    return top / (a * (np.sinh(2 * x) - 2 * x) + 4 * (1 - 2 * poisson) * x)


def range_of(spectrum: Spectrum) -> tuple[float, float]:
    """First and last wavevector [1/m]."""
    if isinstance(spectrum, SelfAffine):
        return float(spectrum.q0), float(spectrum.q1)
    assert isinstance(spectrum, TabulatedSpectrum)
    q0 = spectrum.q[0] if spectrum.q0 is None else spectrum.q0
    q1 = spectrum.q[-1] if spectrum.q1 is None else spectrum.q1
    return float(q0), float(q1)


def spectrum_at(spectrum: Spectrum, q: np.ndarray) -> np.ndarray:
    """C(q) [m^4], 0 outside its range."""
    first, last = range_of(spectrum)
    if isinstance(spectrum, SelfAffine):
        qr, hurst = float(spectrum.qr), float(spectrum.hurst)
        tail = 2 * math.log(last / qr) if hurst == 0 else (1 - (last / qr) ** (-2 * hurst)) / hurst
        plateau = float(spectrum.h_rms) ** 2 / (math.pi * qr**2 * (1 - (first / qr) ** 2 + tail))
        C = plateau * np.where(q < qr, 1.0, (q / qr) ** (-2 * (1 + hurst)))
    else:
        assert isinstance(spectrum, TabulatedSpectrum)
        C = np.exp(np.interp(np.log(q), np.log(np.asarray(spectrum.q)), np.log(np.asarray(spectrum.C))))
    # A range ends at a node, but the node is rounded.
    return np.where((q >= first * (1 - 1e-12)) & (q <= last * (1 + 1e-12)), C, 0.0)
