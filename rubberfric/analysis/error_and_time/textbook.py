r"""The textbook method: the theory as anyone writes it down, in NumPy, to compare with.

.. math:: G(q) = \frac{1}{2\sigma_0^2}\int_{q_0}^{q} d^2q \sum_j C_j |K_j|^2,\qquad
          P = \mathrm{erf}\frac{1}{2\sqrt G},\qquad S = \gamma + (1-\gamma)P^2
.. math:: \mu = \frac{1}{\sigma_0}\int d^2q\, S P \sum_j C_j\, q\cos\varphi\,\mathrm{Im} K_j,\qquad
          \bar u = \int d^2q \sum_j C_j\,\mathrm{Re} K_j
          \int_{\sigma_0}^\infty \frac{dp}{2p}\frac{\partial[SP]}{\partial p}

Trapezoids over ln q and over phi, complex moduli at every frequency q v cos(phi), a cumulative
trapezoid for G, and one more over ln p for the separation. Numbers are taken from the scene and
nothing else: no formula, mesh or table of the library, so that it is a second opinion as well.
Its errors are of second order in the distance of the nodes, of first order where a spectrum ends
between two, and in phi there is no order until the nodes resolve every cos(phi) ~ 1/(q v tau).
"""

import math

import numpy as np

from rubberfric.materials.coating import Coating
from rubberfric.materials.elastic import Elastic, Rigid
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import WLF, Arrhenius
from rubberfric.roughness.spectra import SelfAffine, TabulatedSpectrum

QUANTITIES = ("area", "friction", "separation")
BOLTZMANN_EV = 8.617333262e-5  # [eV/K]

_AT_ONCE = 1_000_000  # complex moduli: 16 MB
_FULL = 6.0  # P = 1 to the last bit from this argument of erf on

# NumPy has no erf, and math.erf takes one number at a time: a table, and Taylor's series from its
# nearest entry, as quick as scipy's.
_PER_UNIT = 256
_ENTRIES = np.arange(6 * _PER_UNIT + 1) / _PER_UNIT
_ERF = np.array([math.erf(x) for x in _ENTRIES])
_SLOPE = 2 / math.sqrt(math.pi) * np.exp(-(_ENTRIES**2))


def _erf(x):
    """erf for x >= 0, to 1e-14."""
    x = np.minimum(x, _FULL)
    nearest = np.rint(_PER_UNIT * x).astype(int)
    y = _ENTRIES[nearest]
    d = x - y
    series = 1 + d * (-y + d * ((2 * y**2 - 1) / 3 - d * (y * (2 * y**2 - 3) / 6)))
    return _ERF[nearest] + _SLOPE[nearest] * d * series


def covers(scene):
    """Whether the method has all that is in a scene: not heating, softening and anisotropic roughness."""
    spectra = (body.spectrum for body in (scene.lower, scene.upper) if body.spectrum is not None)
    isotropic = all(isinstance(spectrum, SelfAffine | TabulatedSpectrum) for spectrum in spectra)
    return scene.heating is None and scene.softening is None and isotropic


def solve(scene, velocity, pressure, temperature=None, *, nodes=(200, 64), quantities=QUANTITIES):
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
        raise ValueError("scene: heating, softening and anisotropic roughness must be absent here")
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
    velocity, pressure, temperature = (*points, None)[:3]
    bodies = ((scene.lower, scene.upper), (scene.upper, scene.lower))
    pairs = [(rough, other) for rough, other in bodies if rough.spectrum is not None]
    results = dict(zip(QUANTITIES, (np.ones_like(pressure), *np.zeros((2, pressure.size))), strict=True))
    if pairs:
        limits = [limit for rough, _ in pairs for limit in _range(rough.spectrum)]
        q = np.geomspace(min(limits), max(limits), nodes[0])
        log_q = np.log(q)
        power, dissipation, storage = _over_angle(pairs, q, velocity, temperature, nodes[1], quantities)
        density = q**2 * power / (2 * pressure[:, None] ** 2)
        plain = _cumulative(density, log_q)
        gamma = float(scene.gamma)
        fluctuation = _stepped(density, log_q, gamma) if scene.area_correction else plain
        x = _argument(fluctuation)
        results["area"] = _erf(x[:, -1])
        if "friction" in quantities:
            P = _erf(x)
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
    power = dissipation = storage = 0.0
    for rough, other in pairs:
        roughness = 2 * np.pi * _spectrum(rough.spectrum, q)
        omega = q[:, None] * (velocity[:, None, None] * cosine)
        K = _series(_stiffness(other, q, omega, temperature), _stiffness(rough, q, None, None))
        power = power + roughness * np.mean(K.real**2 + K.imag**2, -1)
        if "friction" in quantities:
            dissipation = dissipation + roughness * np.mean(K.imag * cosine, -1)
        if "separation" in quantities:
            storage = storage + roughness * np.mean(K.real, -1)
    return power, dissipation, storage


def _stiffness(body, q, omega, temperature):
    """1 / M = q E_r Sbar / 2 [Pa/m] at omega of shape (points, q, phi), None for omega = 0; inf if rigid."""
    material = body.material
    if isinstance(material, Rigid):
        return None
    if isinstance(material, PronyShear):
        shear, bulk = _modulus(material, omega, temperature), float(material.bulk)
        return 2 * q[:, None] * shear * (3 * bulk + shear) / (3 * bulk + 4 * shear)
    poisson = float(material.poisson)
    factor = q / (2 * (1 - poisson**2))
    if isinstance(body.layer, Coating):
        return factor[:, None] * _coated(body, q, omega, temperature)
    if body.layer is not None:
        factor = factor * _layer(body.layer, poisson, q)
    return factor[:, None] * _modulus(material, omega, temperature)


def _coated(body, q, omega, temperature):
    """E(omega) Sbar(q, omega) of a layer on a half-space, which shares the layer's shift."""
    base, nu1, nu0 = body.layer.base, float(body.material.poisson), float(body.layer.base.poisson)
    shift = getattr(body.material, "shift", None)
    if omega is not None and temperature is not None and shift is not None:
        omega = omega * _shift(shift, temperature)[:, None, None]
    modulus = _modulus(body.material, omega, None)
    one, two = modulus / (1 + nu1), _modulus(base, omega, None) / (1 + nu0)
    x = np.minimum(q * float(body.layer.thickness), 60.0)[:, None]
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


def _series(one, two):
    """1 / (M_1 + M_2)."""
    if one is None or two is None:
        return two if one is None else one
    both = one + two
    return one * two / np.where(both == 0, 1.0, both)  # two liquids at rest: 0


def _modulus(material, omega, temperature):
    """E(omega), complex, of a PronyShear G(omega); real, at omega = 0, for omega None."""
    if isinstance(material, Elastic):
        return float(material.young)
    series = None
    if isinstance(material, Prony | PronyShear):
        names = ("E_inf", "E") if isinstance(material, Prony) else ("G_inf", "G")
        series = [np.asarray(getattr(material, name), float) for name in names]
    if omega is None:
        return float(material.storage[0] if series is None else series[0])
    if temperature is not None and material.shift is not None:
        omega = omega * _shift(material.shift, temperature)[:, None, None]
    if series is not None:
        modulus = np.full(omega.shape, float(series[0]), complex)
        for weight, tau in zip(series[1], np.asarray(material.tau), strict=True):
            s = 1j * omega * tau
            modulus += weight * s / (1 + s)
        return modulus
    knots = np.log(np.asarray(material.omega))
    log_omega = np.log(np.maximum(np.abs(omega), np.finfo(float).tiny))
    storage = np.exp(np.interp(log_omega, knots, np.log(np.asarray(material.storage))))
    loss = np.exp(np.interp(log_omega, knots, np.log(np.asarray(material.loss))))
    beyond = np.abs(log_omega - np.clip(log_omega, knots[0], knots[-1]))
    if material.outside != "hold":
        loss = loss * (np.exp(-beyond) if material.outside == "fall" else beyond == 0)
    return storage + 1j * np.sign(omega) * loss


def _shift(shift, temperature):
    """a_T."""
    if isinstance(shift, WLF):
        above = temperature - float(shift.T_ref)
        return 10 ** (-float(shift.C1) * above / (float(shift.C2) + above))
    if isinstance(shift, Arrhenius):
        return np.exp(float(shift.energy) / BOLTZMANN_EV * (1 / temperature - 1 / float(shift.T_ref)))
    T, log_aT = np.asarray(shift.T), np.log(np.asarray(shift.aT))
    return np.exp(np.interp(temperature, T, log_aT) - np.interp(float(shift.T_ref), T, log_aT))


def _layer(layer, poisson, q):
    """Sbar(q d); 1 from q d = 60 on, where its exponentials are far too large to notice the rest."""
    x = np.minimum(q * float(layer.thickness), 60.0)
    if layer.base == "frictionless":
        return 1 / np.tanh(x) + x / np.sinh(x) ** 2
    a = 3 - 4 * poisson
    top = 2 * a * np.sinh(x) ** 2 + 2 * x**2 + 8 * (1 - poisson) ** 2
    return top / (a * (np.sinh(2 * x) - 2 * x) + 4 * (1 - 2 * poisson) * x)


def _range(spectrum):
    """First and last wavevector [1/m]."""
    if isinstance(spectrum, SelfAffine):
        return float(spectrum.q0), float(spectrum.q1)
    return float(spectrum.q[0]), float(spectrum.q[-1])


def _spectrum(spectrum, q):
    """C(q) [m^4], 0 outside its range."""
    first, last = _range(spectrum)
    if isinstance(spectrum, SelfAffine):
        qr, hurst = float(spectrum.qr), float(spectrum.hurst)
        tail = 2 * math.log(last / qr) if hurst == 0 else (1 - (last / qr) ** (-2 * hurst)) / hurst
        plateau = float(spectrum.h_rms) ** 2 / (math.pi * qr**2 * (1 - (first / qr) ** 2 + tail))
        C = plateau * np.where(q < qr, 1.0, (q / qr) ** (-2 * (1 + hurst)))
    else:
        C = np.exp(np.interp(np.log(q), np.log(np.asarray(spectrum.q)), np.log(np.asarray(spectrum.C))))
    # A range ends at a node, but the node is rounded.
    return np.where((q >= first * (1 - 1e-12)) & (q <= last * (1 + 1e-12)), C, 0.0)


def _cumulative(density, log_q):
    """Cumulative trapezoid, 0 at the first node."""
    steps = 0.5 * (density[:, 1:] + density[:, :-1]) * np.diff(log_q)
    return np.concatenate([np.zeros_like(density[:, :1]), np.cumsum(steps, -1)], -1)


def _stepped(density, log_q, gamma):
    """G with the energy factor inside, dG = S(P(G)) density d ln q, by Heun's steps."""
    G = np.zeros_like(density)
    for i, step in enumerate(np.diff(log_q)):
        slope = _energy(G[:, i], gamma) * density[:, i]
        ahead = _energy(G[:, i] + step * slope, gamma) * density[:, i + 1]
        G[:, i + 1] = G[:, i] + 0.5 * step * (slope + ahead)
    return G


def _energy(G, gamma):
    """S."""
    return gamma + (1 - gamma) * _erf(_argument(G)) ** 2


def _argument(G):
    """1 / (2 sqrt(G)), infinite at G = 0."""
    with np.errstate(divide="ignore"):
        return 0.5 / np.sqrt(G)


def _over_pressure(x, gamma, count):
    """sigma_0 int dp/(2p) d[SP]/dp from sigma_0 to where P = 1, by a trapezoid over ln p."""
    x = np.minimum(x, _FULL)
    log_p = np.log(_FULL / x)[..., None] * np.linspace(0, 1, count)  # ln(p / sigma_0)
    here = x[..., None] * np.exp(log_p)
    slope = 2 / math.sqrt(math.pi) * here * np.exp(-(here**2))  # dP / d ln p
    slope *= gamma + 3 * (1 - gamma) * _erf(here) ** 2
    return np.trapezoid(0.5 * np.exp(-log_p) * slope, log_p, axis=-1)


def _contact_shear(shear, velocity, temperature):
    """Shear stress in the area of contact [Pa], with the sign of the velocity."""
    scaled = np.abs(velocity)
    if temperature is not None and shear.shift is not None:
        scaled = scaled * _shift(shear.shift, temperature)
    decades = np.log10(np.maximum(scaled, np.finfo(float).tiny) / float(shear.v0))
    return float(shear.tau_f0) * np.exp(-float(shear.c) * decades**2) * np.sign(velocity)
