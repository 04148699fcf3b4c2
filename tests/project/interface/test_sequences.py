"""Functions that take arrays also take lists and tuples, and `help` names the type of these arguments."""

import dataclasses
import pydoc

import jax
import numpy as np
import pytest
from problems import RIGID, ROAD, TREAD, scene
from support.cases.stored import slow_if

import fitting
import rubberfric as rf

SCENE = scene((TREAD,), (RIGID, ROAD))
COARSE = rf.Quadrature(order=6, panels=3, graded=2, ratio=5.0, angular_order=6)
V, P, Q = np.array([0.01, 0.1]), np.array([[1e5], [2e5]]), np.geomspace(1e2, 1e5, 5)
C, LINE = 1e-3 * Q**-3.6, 1e-3 * Q**-2.6
OMEGA, LOSS = np.geomspace(1.0, 1e4, 5), np.array([1e5, 2e5, 3e5, 2e5, 1e5])
X = np.linspace(0.0, 1e-3, 64)
Z = 1e-6 * np.sin(2e5 * X**1.2)
MAP = np.sin(np.arange(16.0) ** 2) * np.cos(np.arange(16.0) ** 2)[:, None] * 1e-6
STRAIN = np.array([1e-3, 1e-2, 1e-1])

roughness = rf.roughness
# Each function of `c` converts its arrays with `c`.
CALLS = {
    "friction": lambda c: rf.friction(SCENE, c(V), c(P), quadrature=COARSE),
    "contact_area": lambda c: rf.contact_area(SCENE, c(V), 1e5, quadrature=COARSE),
    "solve": lambda c: rf.solve(SCENE, 0.1, c(P), quadrature=COARSE).area,
    "tuned": lambda c: rf.tuned(SCENE, c(P)).quadrature,
    "profile": lambda c: rf.analysis.profile(SCENE, c(V), 1e5, q=c(Q), quadrature=COARSE)[1],
    "sensitivity": lambda c: fitting.sensitivity(
        SCENE, c(V), 1e5, parameters=c(["gamma"]), quadrature=COARSE
    ),
    "power_spectrum": lambda c: rf.power_spectrum(ROAD, c(Q)),
    "rms_slope": lambda c: rf.rms_slope(ROAD, c(Q)),
    "rms_height": lambda c: roughness.rms_height(ROAD, c(Q)),
    "complex_modulus": lambda c: rf.complex_modulus(TREAD, c(OMEGA)),
    "line_spectrum": lambda c: roughness.line_spectrum(ROAD, c(Q)),
    "spectrum_from": lambda c: roughness.spectrum_from("C_1D", c(Q), c(LINE), 0.8),
    "spectrum_from without H": lambda c: roughness.spectrum_from("C_1D", c(Q), c(LINE)),
    "spectrum_as": lambda c: roughness.spectrum_as("C_1D", c(Q), c(C), 0.8),
    "spectrum_as without H": lambda c: roughness.spectrum_as("C_1D", c(Q), c(C)),
    "heights_by_normalisation": lambda c: roughness.heights_by_normalisation(c(Q), c(C)),
    "areal_spectrum": lambda c: roughness.areal_spectrum(c(Q), c(LINE), c(0 * Q + 0.1)).C,
    "spectrum_of_profile": lambda c: roughness.spectrum_of_profile(c(X), c(Z)).C,
    "spectrum_of_topography": lambda c: roughness.spectrum_of_topography(c(MAP), 1e-6).C,
    "detrended": lambda c: roughness.detrended(c(MAP)),
    "top_heights": lambda c: roughness.top_heights(c(MAP)),
    "prony_from_compliance": lambda c: rf.materials.prony_from_compliance(
        1e-9, c(STRAIN * 1e-6), c(STRAIN), 0.0
    ),
    "contact_conductance": lambda c: rf.applications.contact_conductance(
        SCENE, c(P), conductivity=c(np.array([0.2, 200.0])), quadrature=COARSE
    ),
    "FrictionData": lambda c: fitting.FrictionData(c(V), c(V), pressure=c(0 * V + 1e5)).friction,
    "ModulusData": lambda c: fitting.ModulusData(c(OMEGA), c(9 * LOSS), c(LOSS), relative=0.1).loss,
    "softening_from_sweep": lambda c: fitting.softening_from_sweep(c(STRAIN), c(1 - STRAIN), c(STRAIN + 0.1)),
    "fit_spectrum": lambda c: fitting.fit_spectrum((c(Q), c(C)), qr=1e2).spectrum.hurst,
    "Prony": lambda c: rf.Prony(1e6, c(LOSS), c(OMEGA)),
    "TabulatedAnisotropic": lambda c: rf.TabulatedAnisotropic(c(Q), c(C[:, None] * np.ones(4))),
}


def as_list(values):
    return values.tolist() if isinstance(values, np.ndarray) else values


def as_tuple(values):
    values = as_list(values)
    return tuple(map(as_tuple, values)) if isinstance(values, list) else values


SLOW = ("fit_spectrum", "spectrum_from without H", "contact_conductance", "profile", "sensitivity")


@pytest.mark.parametrize("name", slow_if(SLOW.__contains__, CALLS.keys()))
def test_lists_and_tuples(name):
    expected = jax.tree.leaves(CALLS[name](lambda values: values))
    for convert in (as_list, as_tuple):
        found = jax.tree.leaves(CALLS[name](convert))
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)


def test_help_names_the_type():
    public = [getattr(package, name) for package in (rf, fitting) for name in package.__all__]
    texts = {
        one.__name__: pydoc.plain(pydoc.render_doc(one))
        for one in public
        if callable(one) and not dataclasses.is_dataclass(one)
    }
    assert "velocity: rubberfric.base.checks.ArrayLike, pressure" in texts["friction"]
    spelt_out = [name for name, text in texts.items() if "numpy.number" in text or "_Buffer" in text]
    assert not spelt_out
