"""Data of three moduli, and of a dry rubber whose friction is linear in x, for tests of error bars."""

import numpy as np
from support.scenes import fits
from support.scenes.fits import E_INF, THREE_TERMS, E

import rubberfric as rf
from fitting import Free, Positive

TAU = np.asarray(THREE_TERMS.tau)
MODULI = np.asarray(THREE_TERMS.E)
BOTH = {E_INF: Positive(), E: Positive()}
OMEGA = np.logspace(-1, 7, 20)
DRY_FREE = {"shear.tau_f0": Positive(), "shear.c": Free(scale=0.1)}
VELOCITY = np.logspace(-6, 1, 12)


def modulus(omega=OMEGA, material=THREE_TERMS):
    return np.asarray(rf.complex_modulus(material, omega))


def modulus_data(relative=0.03, noise=0.03, seed=0, omega=OMEGA, given=True):
    return fits.modulus_data(THREE_TERMS, omega, noise, seed, relative=relative if given else None)


def basis(omega=OMEGA):
    return fits.maxwell_columns(omega, TAU)


def every_gap_is_explained(result):
    """NaN exactly where `withheld` gives a reason."""
    for name, error in zip(result.names, result.stderr, strict=True):
        assert np.isnan(error) == (name in result.withheld), name
        assert result.withheld.get(name, "a reason")
    known = [name not in result.withheld for name in result.names]
    for matrix in (result.covariance, result.correlation):
        np.testing.assert_array_equal(np.isfinite(matrix), np.outer(known, known))
    low, high = result.interval()
    np.testing.assert_array_equal(np.isfinite(low) & np.isfinite(high), known)
    assert np.isfinite(result.values).all() and np.isfinite(result.cost)
