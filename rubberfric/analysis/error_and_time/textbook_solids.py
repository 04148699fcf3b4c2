"""Solids and roughness of the textbook method: numbers of a scene, and no formula of the library.

Series and layers are of [Scaraggi & Persson, arXiv:1506.06955, eqs. (A6), (A8), (A10)], coatings as
`rubberfric.materials.series.layer_and_base` says, E(omega), shifts and spectra as their classes.
"""

import math

import numpy as np
from scipy.interpolate import PchipInterpolator
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
from rubberfric.scene.scene import Body

BOLTZMANN_EV = 8.617333262e-5  # [eV/K]

_MATERIALS = (Rigid, Elastic, Prony, PronyShear, TabulatedModulus)
_SHIFTS = (WLF, Arrhenius, TabulatedShift, type(None))
_VERTICAL = (Entropic, TabulatedVertical, type(None))
_LAYERS = (Slab, Coating, type(None))
_SPECTRA = (SelfAffine, TabulatedSpectrum, type(None))


def knows(body: Body) -> bool:
    """Whether the material, its shift, the layer and the spectrum of a body are ones written down here."""
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
    """1 / (M_1 + M_2), of None for a rigid solid; one deforms."""
    if one is None or two is None:
        return np.asarray(two if one is None else one)
    both = one + two
    return one * two / np.where(both == 0, 1.0, both)  # two liquids at rest: 0


def modulus_at(
    material: Material, omega: np.ndarray | None, temperature: np.ndarray | None
) -> np.ndarray | float:
    """E(omega), complex, of a PronyShear G(omega); real, at omega = 0, for omega None."""
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
        return np.exp(float(shift.energy) / BOLTZMANN_EV * (1 / temperature - 1 / float(shift.T_ref)))
    assert isinstance(shift, TabulatedShift)
    return _tabulated_factor(shift.T, shift.aT, temperature, float(shift.T_ref))


def vertical_factor(law: VerticalShift, temperature: np.ndarray, T_ref: float) -> np.ndarray:
    """b_T."""
    if isinstance(law, Entropic):
        return temperature / T_ref * np.exp(-float(law.expansion) * (temperature - T_ref))
    assert isinstance(law, TabulatedVertical)
    return _tabulated_factor(law.T, law.bT, temperature, T_ref)


def _tabulated_factor(T, factor, temperature, T_ref):
    """A factor of a table that goes on along the lines at its ends, over that at T_ref."""
    T, log = np.asarray(T), np.log(np.asarray(factor))
    ends, beyond = [0, -1], [T[0] - 1.0, T[-1] + 1.0]
    lines = log[ends] + np.array([-1.0, 1.0]) * (np.diff(log) / np.diff(T))[ends]
    T = np.concatenate([beyond[:1], T, beyond[1:]])
    law = PchipInterpolator(T, np.concatenate([lines[:1], log, lines[1:]]))
    return np.exp(law(temperature) - law(T_ref))


def _poisson(material: Material) -> float:
    assert material.poisson is not None  # a PronyShear has no layer
    return float(material.poisson)


def _layer(layer: Slab, poisson: float, q: np.ndarray) -> np.ndarray:
    """Sbar(q d); 1 from q d = 60 on, where its exponentials are far too large to notice the rest."""
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
