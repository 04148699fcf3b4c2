"""One object of every class."""

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf


def examples(number=float, vector=np.array):
    """One object of every class, its leaves made by `number` and `vector`."""
    wlf = rf.WLF(C1=number(8.0), C2=number(100.0), T_ref=number(293.0))
    entropic = rf.Entropic(expansion=number(6e-4))
    vertical = rf.TabulatedVertical(T=vector([280.0, 300.0, 320.0]), bT=vector([1.2, 1.0, 0.7]))
    arrhenius = rf.Arrhenius(energy=number(1.0), T_ref=number(293.0), vertical=vertical)
    table = rf.TabulatedShift(
        T=vector([280.0, 300.0, 320.0]),
        aT=vector([10.0, 0.5, 0.1]),
        T_ref=number(293.0),
        vertical=entropic,
    )
    elastic = rf.Elastic(young=number(1e6), poisson=number(0.3))
    prony = rf.Prony(
        E_inf=number(1e6),
        E=vector([1e6, 2e6, 3e6]),
        tau=vector([1e-3, 1.0, 1e2]),
        poisson=number(0.5),
        shift=wlf,
    )
    sheared = rf.PronyShear(
        G_inf=number(1e6), G=vector([1e6, 2e6, 3e6]), tau=vector([1e-3, 1.0, 1e2]), bulk=number(2e9)
    )
    modulus = rf.TabulatedModulus(
        omega=vector([1e-3, 1.0, 1e2]),
        storage=vector([1e6, 2e6, 3e6]),
        loss=vector([1e5, 2e5, 1e5]),
        poisson=number(0.49),
        shift=table,
        outside="hold",
    )
    road = rf.SelfAffine(
        q0=number(1e2), qr=number(1e3), q1=number(1e5), hurst=number(0.8), h_rms=number(1e-4)
    )
    spectrum = rf.TabulatedSpectrum(
        q=vector([1e2, 1e3, 1e5]), C=vector([1e-9, 1e-12, 1e-19]), q0=number(2e2), q1=number(3e4)
    )
    stretched = rf.Anisotropic(base=road, ratio=number(2.0), angle=number(0.3), harmonics=8)
    directions = rf.TabulatedAnisotropic(
        q=vector([1e2, 1e3, 1e5]),
        C=vector([[1e-9, 2e-9, 3e-9, 1e-9], [1e-12, 2e-12, 1e-12, 1e-12], [3e-19, 2e-19, 1e-19, 1e-19]]),
        angle=number(-0.2),
        q1=number(3e4),
    )
    slab = rf.Slab(thickness=number(1e-3), base="frictionless")
    coating = rf.Coating(thickness=number(1e-3), base=elastic)
    thermal = rf.ThermalProperties(
        density=number(2.4e3), heat_capacity=number(0.9e3), conductivity=number(1.5)
    )
    shear = rf.ContactShear(tau_f0=number(6.5e6), c=number(0.1), v0=number(6e-3), shift=arrhenius)
    softening = rf.Softening(
        strain=vector([1e-2, 0.1, 1.0]),
        storage=vector([1.0, 0.7, 0.4]),
        loss=vector([1.0, 1.1, 0.6]),
        factor=number(1.2),
    )
    body = rf.Body(prony, road, slab, thermal, softening)
    adhesion = rf.Adhesion(work=number(0.05), limit="long", range=number(1e-8))
    correlation = rf.Correlation(coherence=number(0.7))
    heating = rf.Heating(
        density=number(1.2e3),
        heat_capacity=number(1.6e3),
        conductivity=number(0.23),
        radius=number(1e-3),
        area_fraction=number(0.05),
        shear_share=number(0.4),
        shear_at="background",
    )
    scene = rf.Scene(body, rf.Body(modulus, spectrum), gamma=number(0.45), area_correction=True, shear=shear)
    objects = [
        rf.Rigid(),
        elastic,
        prony,
        sheared,
        modulus,
        wlf,
        arrhenius,
        table,
        entropic,
        vertical,
        road,
        spectrum,
        stretched,
        directions,
        slab,
        coating,
        shear,
        softening,
        adhesion,
        correlation,
        heating,
        thermal,
    ]
    return {type(x).__name__: x for x in (*objects, body, scene)}


EXAMPLES = examples()


def same(a, b):
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert jnp.result_type(x) == jnp.result_type(y)
        np.testing.assert_array_equal(x, y)
