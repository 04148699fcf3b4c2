"""Synthetic isotherms with known shifts."""

import dataclasses

import numpy as np
from support.scenes import fits

import rubberfric as rf
from fitting import ModulusData

LAW = rf.WLF(8.0, 110.0, 293.15)


T = np.array([243.15, 253.15, 263.15, 273.15, 283.15, 293.15, 303.15, 318.15, 333.15])


TIMES = np.geomspace(1e-12, 1e6, 19)


def fractional_zener(omega):
    z = (1j * omega * 1e-3) ** 0.4
    return 1e6 + 1e9 * z / (1 + z)


def prony(omega):
    """One term a decade, whose ripples a curve must follow."""
    E = 3e6 * (1 + 30 * np.exp(-0.5 * ((np.log10(TIMES) + 6) / 2) ** 2))
    return np.asarray(rf.complex_modulus(rf.Prony(2e6, E, TIMES), omega))


CURVES = {"zener": fractional_zener, "prony": prony}


def isotherms(curve="zener", noise=0.03, seed=0, law=LAW, temperatures=T, points=16, factor=None, **options):
    """Three decades of frequency at every temperature T, where the moduli are multiplied by factor(T)."""
    omega, at = np.meshgrid(2 * np.pi * np.geomspace(0.1, 100.0, points), temperatures)
    omega, at = omega.ravel(), at.ravel()
    modulus = CURVES[curve](omega * np.exp(np.asarray(law.log_factor(at))))
    modulus = modulus * (1.0 if factor is None else factor(at))
    values = fits.noise((2, omega.size), noise, seed) * [modulus.real, modulus.imag]
    return ModulusData(omega, *values, temperature=at, **options)


def part(data, rows):
    """Some rows of a data set."""
    columns = {name: getattr(data, name)[rows] for name in ("omega", "storage", "loss", "temperature")}
    return dataclasses.replace(data, **columns)


def pulls(found, law=LAW):
    """(shifts, parameters of the law) less the true ones, in standard errors."""
    moved = np.arange(found.T.size) != found.reference
    true = np.asarray(law.log_factor(found.T))
    shifts = ((found.log_aT - true)[moved]) / found.stderr[moved]
    fitted = found.wlf if isinstance(law, rf.WLF) else found.arrhenius
    return shifts, (fitted.values - [float(getattr(law, name)) for name in fitted.names]) / fitted.stderr
