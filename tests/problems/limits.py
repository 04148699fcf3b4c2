"""Two ways to say a scene: a part that vanishes and none, or the same in other words."""

import dataclasses
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from problems.solids import HEATING, SHEAR, SOFT
from rubberfric.base.objects.physical import parts_of
from rubberfric.scene.body import relaxes

BODIES = ("lower", "upper")
STIFF = rf.Elastic(1e21, 0.3)  # so stiff that only the other solid deforms


@dataclasses.dataclass
class Limit:
    """Two ways to say a scene."""

    change: Callable  # of a scene
    has: tuple = ()
    lacks: tuple = ()
    rtol: float = 1e-9
    atol: float = 1e-12  # of friction
    other: Callable | None = None  # the scene that the changed one equals, if it is not the problem's own
    rest: bool = False  # at v = 0
    temperatures: tuple | None = None  # of both scenes, if they differ
    ordinary: tuple = ()  # problems of the ordinary run


def parts(scene, *classes):
    """Paths and objects of classes."""
    return [(path, part) for path, part in parts_of(scene) if isinstance(part, classes)]


def replaced(scene, cls, new):
    """Replace the parts of a class in a scene."""
    return scene.replace({path: new(part) for path, part in parts(scene, cls)})


def without(part):
    """Leave out an optional part of a scene."""
    return lambda scene: scene.replace({part: None})


def with_layer(layer):
    """Make each solid that deforms a layer."""

    def change(scene):
        deforming = [body for body in BODIES if not isinstance(getattr(scene, body).material, rf.Rigid)]
        return scene.replace({f"{body}.layer": layer(getattr(scene, body).material) for body in deforming})

    return change


def as_table(spectrum):
    """A self-affine spectrum by its entries, which must not round to beyond its ends."""
    q = np.unique([spectrum.q0, spectrum.qr, spectrum.q1, np.sqrt(spectrum.qr * spectrum.q1)])
    inside = np.clip(q, q[0] * (1 + 1e-13), q[-1] * (1 - 1e-13))
    return rf.TabulatedSpectrum(q, rf.power_spectrum(spectrum, inside))


def with_tables(scene):
    """Tables of the bodies' spectra. The base of grooves cannot be a table."""
    spectra = {body: getattr(scene, body).spectrum for body in BODIES}
    affine = {body: spectrum for body, spectrum in spectra.items() if isinstance(spectrum, rf.SelfAffine)}
    return scene.replace({f"{body}.spectrum": as_table(spectrum) for body, spectrum in affine.items()})


def in_all_directions(spectrum):
    return rf.TabulatedAnisotropic(spectrum.q, np.repeat(np.asarray(spectrum.C)[:, None], 5, 1))


def with_dead_terms(scene):
    return replaced(scene, rf.Prony, lambda solid: solid.replace(E=0 * solid.E))


def of_springs(scene):
    return replaced(scene, rf.Prony, lambda solid: rf.Elastic(solid.E_inf, solid.poisson))


def one_solid(scene):
    """Replace two elastic half-spaces by one that faces a rigid one: the values of 1 / E_r add up."""
    compliance = sum(
        (1 - body.material.poisson**2) / body.material.young for body in (scene.lower, scene.upper)
    )
    solids = {"lower.material": rf.Elastic(1 / compliance, 0.0), "upper.material": rf.Rigid()}
    return scene.replace(solids)


def with_spectra_exchanged(scene):
    return scene.replace({"lower.spectrum": scene.upper.spectrum, "upper.spectrum": scene.lower.spectrum})


def with_half_of_the_power_on_each(scene):
    rough = scene.lower.spectrum or scene.upper.spectrum
    half = rough.replace(h_rms=rough.h_rms / np.sqrt(2))
    return scene.replace({"lower.spectrum": half, "upper.spectrum": half})


def with_other_roughness(h_rms):
    """A smooth solid with roughness of this height, which is hardly any."""

    def change(scene):
        smooth = [body for body in BODIES if getattr(scene, body).spectrum is None]
        spectrum = rf.SelfAffine(300.0, 2000.0, 4e5, 0.7, h_rms)
        return scene.replace({f"{body}.spectrum": spectrum for body in smooth})

    return change


def softened_alike(storage, loss=None):
    """Use the same factors of E' and E'' at all strains."""

    def change(scene):
        flat = rf.Softening([0.01, 0.1, 1.0], [storage] * 3, [storage if loss is None else loss] * 3)
        return scene.replace(softening=flat)

    return change


def with_softer(cls, **factors):
    """Multiply fields of the solids of a class by factors."""

    def softer(solid):
        return solid.replace({name: factor * getattr(solid, name) for name, factor in factors.items()})

    return lambda scene: replaced(scene, cls, softer)


def with_tables_of_the_bodies(scene):
    softens = [body for body in BODIES if relaxes(getattr(scene, body))]
    return scene.replace({"softening": None, **{f"{body}.softening": scene.softening for body in softens}})


def turned(angle, ratio=lambda x: x):
    def change(scene):
        new = {}
        for path, part in parts(scene, rf.Anisotropic):
            new |= {f"{path}.angle": part.angle + angle, f"{path}.ratio": ratio(part.ratio)}
        return scene.replace(new)

    return change


T_REF, WARM = 293.15, 320.0
LAW = rf.WLF(8.86, 101.6, T_REF, vertical=rf.Entropic(6e-4))


def with_shift(scene):
    """A shift in time and in modulus, in place of others."""
    return replaced(scene, rf.Prony, lambda solid: solid.replace(shift=LAW))


def as_when_warm(scene):
    """b_T times the moduli, whose times are a_T times as long."""
    a = 10 ** (-8.86 * (WARM - T_REF) / (101.6 + WARM - T_REF))
    b = WARM / T_REF * np.exp(-6e-4 * (WARM - T_REF))
    return replaced(
        scene, rf.Prony, lambda solid: rf.Prony(b * solid.E_inf, b * solid.E, a * solid.tau, solid.poisson)
    )


def with_split_terms(scene):
    """Two terms of half the modulus for each."""
    return replaced(
        scene,
        rf.Prony,
        lambda solid: solid.replace({"E": jnp.repeat(solid.E / 2, 2), "tau": jnp.repeat(solid.tau, 2)}),
    )


def on_stiff_base(scene):
    def of(layer):
        return rf.Coating(layer.thickness, rf.Elastic(1e25, 0.1))

    return replaced(scene, rf.Slab, of)


COATS = ("law", "layer", "coating", "softening", "shear modulus", "heating", "correlation", "adhesion")
LIMITS = {
    "thick slab": Limit(
        with_layer(lambda _: rf.Slab(1e3)),
        lacks=("layer", "coating", "shear modulus"),
        ordinary=("rubber",),
    ),
    "thick sliding slab": Limit(
        with_layer(lambda _: rf.Slab(1e3, "frictionless")), lacks=("layer", "coating", "shear modulus")
    ),
    "on itself": Limit(with_layer(lambda solid: rf.Coating(1e-3, solid)), lacks=COATS, ordinary=("rubber",)),
    "thick layer on another": Limit(with_layer(lambda _: rf.Coating(1e3, SOFT)), lacks=COATS),
    "slab on a stiff base": Limit(
        on_stiff_base, has=("bonded layer",), lacks=(*COATS[:1], *COATS[2:], "sliding layer")
    ),
    "facing a stiff solid": Limit(
        lambda scene: replaced(scene, rf.Rigid, lambda _: STIFF),
        has=("rigid",),
        lacks=("heating", "correlation"),
        ordinary=("rubber",),
    ),
    "two elastic solids": Limit(one_solid, has=("static", "both rough"), lacks=("correlation",)),
    "no roughness": Limit(
        with_other_roughness(0.0),
        lacks=("both rough", "law", "heating"),
    ),
    "hardly any roughness": Limit(with_other_roughness(1e-14), lacks=("both rough", "law", "heating")),
    "table of the spectrum": Limit(with_tables, has=("self-affine",)),
    "no stretch": Limit(
        lambda scene: replaced(scene, rf.SelfAffine, lambda road: rf.Anisotropic(road, 1.0, 0.3, 4)),
        has=("self-affine",),
        # E_h of a liquid depends on where the circle ends, and the circle has other nodes.
        lacks=("anisotropic", "softening", "correlation", "heating", "adhesion", "law of a liquid"),
        rtol=1e-12,
        ordinary=("rubber",),
    ),
    "same in all directions": Limit(
        lambda scene: replaced(scene, rf.TabulatedSpectrum, in_all_directions),
        has=("tabulated spectrum",),
    ),
    "half a turn": Limit(turned(np.pi), has=("grooves",), rtol=1e-12),
    "a quarter of a turn of the inverse": Limit(turned(np.pi / 2, lambda x: 1 / x), has=("grooves",)),
    "spectra exchanged at rest": Limit(
        with_spectra_exchanged, has=("both rough",), lacks=("heating", "correlation"), rest=True
    ),
    "power shared at rest": Limit(
        with_half_of_the_power_on_each,
        has=("self-affine",),
        lacks=("both rough", "law", "heating", "adhesion"),
        rest=True,
    ),
    "no relaxation": Limit(
        with_dead_terms,
        other=of_springs,
        has=("prony",),
        lacks=("liquid", "softening", "heating", "tabulated", "shift"),
        atol=1e-28,
    ),
    "a temperature is another rubber": Limit(
        with_shift,
        other=as_when_warm,
        has=("prony",),
        lacks=("heating", "shear modulus", "shear"),
        temperatures=(WARM, None),
        ordinary=("rubber",),
    ),
    "split terms": Limit(with_split_terms, has=("prony",), lacks=("heating",), ordinary=("rubber",)),
    "S = 1": Limit(
        lambda scene: scene.replace({"gamma": 1.0, "area_correction": True}),
        other=lambda scene: scene.replace({"gamma": 1.0, "area_correction": False}),
        lacks=("law", "heating"),
    ),
    "softening by 1": Limit(
        softened_alike(1.0),
        lacks=("softening", "anisotropic", "coating", "correlation", "law", "static", "heating", "adhesion"),
    ),
    "softening by 0.4": Limit(
        softened_alike(0.4),
        other=with_softer(rf.Prony, E_inf=0.4, E=0.4),
        has=("prony",),
        lacks=(
            *("softening", "anisotropic", "coating", "correlation", "law", "static", "tabulated", "heating"),
            "shear modulus",
        ),
    ),
    "softening of E' and E''": Limit(
        softened_alike(0.4, 0.7),
        other=with_softer(rf.TabulatedModulus, storage=0.4, loss=0.7),
        has=("tabulated",),
        lacks=("softening", "law"),
    ),
    "a table of each body": Limit(
        with_tables_of_the_bodies,
        has=("softening",),
    ),
    "no heat": Limit(
        lambda scene: scene.replace({"heating.heat_capacity": 1e30}),
        other=without("heating"),
        has=("heating",),
    ),
    "no shear": Limit(
        lambda scene: scene.replace({"shear.tau_f0": 0.0}),
        other=without("shear"),
        has=("shear",),
        lacks=("heating",),
    ),
    "added shear": Limit(
        lambda scene: scene.replace(shear=SHEAR.replace(tau_f0=0.0, shift=None)), lacks=("shear", "heating")
    ),
    "no work of adhesion": Limit(
        lambda scene: scene.replace({"adhesion.work": 1e-28}),
        other=without("adhesion"),
        has=("adhesion",),
    ),
    "no coherence": Limit(
        lambda scene: scene.replace({"correlation.coherence": 0.0}),
        other=without("correlation"),
        has=("correlation",),
        rtol=1e-13,
        ordinary=("correlation",),
    ),
    "a patch": Limit(lambda scene: scene.replace(patch=rf.Patch(0.1, 0.2, 5e7)), lacks=("correlation",)),
    "heat far away": Limit(
        lambda scene: scene.replace(heating=HEATING.replace(density=1e30)),
        has=("shift",),
        lacks=("heating", "law", "coating", "static", "two rubbers", "both rough", "adhesion"),
    ),
}
