"""One object of every class."""

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf


def _objects():
    wlf, entropic = rf.WLF(8.0, 100.0, 293.0), rf.Entropic(6e-4)
    vertical = rf.TabulatedVertical([280.0, 300.0, 320.0], [1.2, 1.0, 0.7])
    arrhenius = rf.Arrhenius(1.0, 293.0, vertical=vertical)
    table = rf.TabulatedShift([280.0, 300.0, 320.0], [10.0, 0.5, 0.1], 293.0, vertical=entropic)
    elastic, E, tau = rf.Elastic(1e6, 0.3), [1e6, 2e6, 3e6], [1e-3, 1.0, 1e2]
    prony, sheared = rf.Prony(1e6, E, tau, 0.5, wlf), rf.PronyShear(1e6, E, tau, 2e9)
    modulus = rf.TabulatedModulus(tau, E, [1e5, 2e5, 1e5], 0.49, table, "hold")
    road, q = rf.SelfAffine(1e2, 1e3, 1e5, 0.8, 1e-4), [1e2, 1e3, 1e5]
    spectrum = rf.TabulatedSpectrum(q, [1e-9, 1e-12, 1e-19], 2e2, 3e4)
    stretched = rf.Anisotropic(road, 2.0, 0.3, harmonics=8)
    rows = [[1e-9, 2e-9, 3e-9, 1e-9], [1e-12, 2e-12, 1e-12, 1e-12], [3e-19, 2e-19, 1e-19, 1e-19]]
    directions = rf.TabulatedAnisotropic(q, rows, -0.2, q1=3e4)
    slab, coating = rf.Slab(1e-3, "frictionless"), rf.Coating(1e-3, elastic)
    thermal = rf.ThermalProperties(2.4e3, 0.9e3, 1.5)
    shear = rf.ContactShear(6.5e6, 0.1, 6e-3, arrhenius)
    softening = rf.Softening([1e-2, 0.1, 1.0], [1.0, 0.7, 0.4], [1.0, 1.1, 0.6], 1.2)
    adhesion, correlation = rf.Adhesion(0.05, limit="long", range=1e-8), rf.Correlation(0.7)
    heating = rf.Heating(1.2e3, 1.6e3, 0.23, 1e-3, 0.05, 0.4, "background", "falling")
    body = rf.Body(prony, road, slab, thermal, softening)
    trapezoid, measured = rf.Trapezoid(0.2), rf.MeasuredPressure([0.0, 2.0, 1.0])
    patch = rf.Patch(0.1, 0.2, 5e7, trapezoid)
    scene = rf.Scene(body, rf.Body(modulus, spectrum), 0.45, area_correction=True, shear=shear, patch=patch)
    return (
        *(rf.Rigid(), elastic, prony, sheared, modulus, wlf, arrhenius, table, entropic, vertical, road),
        *(spectrum, stretched, directions, slab, coating, shear, softening, adhesion, correlation, heating),
        *(thermal, rf.Parabolic(), rf.Uniform(), trapezoid, measured, patch, body, scene),
    )


def examples(number=float, vector=np.array):
    """One object of every class, its leaves made by `number` and `vector`."""

    def made(x):
        found = vector(x) if np.ndim(x) else number(x)
        return found if isinstance(found, float) else jnp.asarray(found)  # as constructors store it

    return {type(one).__name__: jax.tree.map(made, one) for one in _objects()}


EXAMPLES = examples()


def same(a, b):
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert jnp.result_type(x) == jnp.result_type(y)
        np.testing.assert_array_equal(x, y)
