"""Fits of every kind: scenes, data, free parameters, priors and options by name."""

import dataclasses
import functools
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import numpy as np
from support.cases.stored import slow_if
from support.scenes import fits
from support.scenes.fits import AFFINE, E_INF, FAST, H_RMS, HURST, Q1, ROAD, E

import fitting
import rubberfric as rf
from fitting import Bounded, Free, Gaussian, Positive, Smooth, Tied
from fitting.data.measured import Measured
from rubberfric.base.objects.physical import PhysicalObject

# Rubber and road of reports, with a shift that friction at several temperatures needs.
RUBBER = rf.Prony(1e6, [1e8, 1e7, 3e6], [1e-6, 1e-4, 1e-2], shift=rf.WLF(8.0, 100.0, 293.15))
REPORTED = rf.Scene(rf.Body(rf.Rigid(), AFFINE.replace(q1=1e4, h_rms=1e-4)), rf.Body(RUBBER))
OMEGA = np.logspace(0, 7, 12)  # [rad/s]
# Shear stress times the contact area of an elastic rubber, which is equal at all velocities: ln mu is linear
# in ln tau_f0 and in c.
DRY = rf.Scene(ROAD, rf.Body(rf.Elastic(1e7, 0.5)), shear=fits.SHEAR)


class Problem(NamedTuple):
    """Arguments of `fitting.fit`."""

    scene: Any
    data: Any
    free: dict
    prior: dict | None = None
    options: Mapping = MappingProxyType({"quadrature": FAST})

    def fit(self, **changes):
        """Return the fit, with other options."""
        arguments = {"prior": self.prior} | dict(self.options) | changes
        return fitting.fit(self.scene, self.data, self.free, **arguments)


def _moduli(**options):
    data = fits.modulus_data(fits.FOUR_TERMS, np.logspace(-2, 7, 20))
    return Problem(fits.FOUR, data, {E: Positive(), E_INF: Positive()}, options=options)


def _outliers():
    problem = _moduli(loss="cauchy")
    measured = problem.data.measured * np.where(np.arange(40) % 20 == 7, 3.0, 1.0)
    return problem._replace(data=problem.data.replaced(measured))


def _linear():
    """E' and E'' with absolute errors of moduli without transformation."""
    data = fits.linear_data(fits.THREE_TERMS, OMEGA)
    return Problem(fits.THREE, data, {E: Free(), E_INF: Free()}, options={})


def _without_effect():
    """A modulus, on which gamma has no effect."""
    data = fits.modulus_data(RUBBER, OMEGA, 0.03)
    return Problem(
        REPORTED,
        data,
        {E: Positive(), "gamma": Free(scale=0.1)},
        options={"loss": "huber", "quadrature": FAST},
    )


def _many_terms():
    """A long series that the data inform only in part."""
    scene = REPORTED.replace(upper=rf.Body(rf.Prony(1e6, np.full(30, 1e6), np.logspace(-15, -2, 30))))
    return Problem(
        scene, fits.modulus_data(scene.upper.material, np.logspace(0, 12, 40), 0.03), {E: Positive()}
    )


def _spectrum():
    q = np.geomspace(2e2, 2e4, 9)
    C = np.asarray(rf.power_spectrum(AFFINE, q)) * fits.noise(9, 0.2, 2)
    free = {H_RMS: Positive(), HURST: Bounded(0.3, 1.0)}
    data = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    return Problem(fits.SCENE, data, free, {HURST: Gaussian(0.8, 0.1)}, {})


def _joint():
    """Three quantities, with errors of every kind, priors and a tied parameter."""
    v, p, T = (a.ravel() for a in np.meshgrid(np.logspace(-4, 1, 6), [1e5, 1e6], [283.15, 313.15]))
    omega, q = np.logspace(1, 6, 6), np.geomspace(200.0, 9000.0, 8)
    modulus = np.asarray(rf.complex_modulus(RUBBER, omega))
    C = np.asarray(rf.power_spectrum(REPORTED.lower.spectrum, q)) * fits.noise(8, 0.2)
    data = [
        fits.friction_data(REPORTED, v, p, 0.03, temperature=T, relative=None, name="Läufer 1"),
        fitting.ModulusData(
            omega, modulus.real, modulus.imag, sigma_storage=0.1 * modulus.real, sigma_loss=0.1 * modulus.imag
        ),
        fitting.SpectrumData(q, C, relative=np.linspace(0.1, 0.3, 8), body="lower"),
    ]
    free = {
        f"{E}[:2]": Positive(start=[9e7, 9e6]),
        f"{E}[2]": Positive(),
        E_INF: Tied(f"{E}[2]", ratio=0.3),
        HURST: Bounded(0.3, 1, start=0.7),
    }
    return Problem(REPORTED, data, free, {HURST: Gaussian(0.75, 0.1), E: Smooth(2.0)})


def _friction():
    data = fits.friction_data(fits.FOUR, np.logspace(-4, 1, 24))
    return Problem(fits.FOUR, data, {E: Positive(), HURST: Bounded(0.3, 1.0)})


def _area():
    scene = rf.Scene(rf.Body(rf.Rigid(), AFFINE.replace(q1=4e4, h_rms=1e-4)), rf.Body(fits.PLAIN))
    return Problem(scene, fits.area_data(scene, np.logspace(-4, 1, 8)), {H_RMS: Positive(), Q1: Positive()})


def _shear():
    data = fits.friction_data(DRY, np.logspace(-6, 1, 12), error=0.1)
    return Problem(DRY, data, {"shear.tau_f0": Positive(), "shear.c": Free(scale=0.1)})


def _two_bodies():
    """Two rough rubbers, one of them in a layer."""
    rough = AFFINE.replace(h_rms=2e-5)
    scene = rf.Scene(rf.Body(fits.PLAIN, AFFINE), rf.Body(fits.THREE_TERMS, rough, rf.Slab(5e-3)))
    data = fits.friction_data(scene, np.logspace(-4, 1, 12))
    return Problem(scene, data, {f"{E}[0]": Positive(), H_RMS: Positive()})


def _two_scenes():
    """Two compounds on one road, with one law of contact shear."""
    one = fits.SCENE.replace(shear=fits.SHEAR)
    scenes = {"R20": one, "R40": one.replace(upper=rf.Body(rf.Prony(2e6, [3e7, 5e6], [1e-5, 1e-3])))}
    data = {
        name: fits.friction_data(scene, np.logspace(-4, 1, 6), 3e5, 0.03, seed)
        for seed, (name, scene) in enumerate(scenes.items())
    }
    return Problem(scenes, data, {"*.shear.tau_f0": Positive(), "R40.upper.material.E_inf": Positive()})


def _discrepancy():
    data = fits.friction_data(fits.SCENE, np.geomspace(1e-4, 1e1, 15), error=0.03)
    free = {E: Positive(), H_RMS: Positive()}
    options = {"quadrature": FAST, "discrepancy": fitting.Discrepancy(0.1, 1.15), "further_time": 0.0}
    return Problem(fits.SCENE, data, free, options=options)


FITS = {
    "moduli": _moduli,
    "moduli with outliers": _outliers,
    "linear": _linear,
    "without effect": _without_effect,
    "many terms": _many_terms,
    "spectrum": _spectrum,
    "joint": _joint,
    "friction": _friction,
    "area": _area,
    "shear": _shear,
    "two bodies": _two_bodies,
    "two scenes": _two_scenes,
    "discrepancy": _discrepancy,
}
# Without integrals over q and with few terms, so that they compile in a second.
SHORT = ("moduli", "linear", "without effect", "spectrum")
# Names for tests: the short ones in the ordinary run, the others in the slow set. Tests that fit again take
# FEW in the ordinary run.
PARAMETERS = slow_if(lambda name: name not in SHORT, tuple(FITS))
FEW = slow_if(lambda name: name not in ("moduli",), tuple(FITS))


@functools.cache
def problem(name):
    return FITS[name]()


@functools.cache
def fitted(name):
    """Return the fit of a problem; it is computed once."""
    return problem(name).fit()


def same(one, other):
    """Return True if two parts of results are equal to the last bit."""
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, Measured | PhysicalObject):
        names = [field.name for field in dataclasses.fields(one)]
        return type(one) is type(other) and all(same(getattr(one, n), getattr(other, n)) for n in names)
    if isinstance(one, tuple):
        return type(one) is type(other) and len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray | jax.Array):
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=True)
    return type(one) is type(other) and (one == other or one != one)
