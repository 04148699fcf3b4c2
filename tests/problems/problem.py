"""A scene with its conditions, and the compiled function to its results that all properties share."""

import functools
from typing import NamedTuple

import jax
import numpy as np
from support.cases.stored import as_arrays

import rubberfric as rf
from rubberfric.roughness.anisotropy import Anisotropic, TabulatedAnisotropic
from rubberfric.scene.body import relaxes

# Points of each call, so that every property uses the same compiled function of a structure.
POINTS = 4


class Problem(NamedTuple):
    """A scene, its conditions, and where the expected values come from."""

    name: str
    scene: rf.Scene
    velocity: float
    pressure: float
    temperature: float | None = None
    source: str = ""  # "paper", the name of a file of tests/reference, or "" for the properties alone
    case: dict | None = None  # of tests/reference, with the expected values

    @property
    def conditions(self):
        """Velocity, pressure and, if the scene has one, temperature."""
        conditions = self.velocity, self.pressure
        return conditions if self.temperature is None else (*conditions, self.temperature)

    @property
    def arguments(self):
        """Arguments of `rf.solve`, all leaves arrays."""
        return as_arrays((self.scene, *self.conditions))

    @property
    def names(self):
        """Quantities of the scene that are numbers."""
        return tuple(name for name in rf.quantities_of(self.scene) if name != "converged")

    @property
    def tags(self):
        """Return names of the parts and cases of the scene."""
        return tags_of(self.scene, self.velocity) | ({self.source} - {""})

    @property
    def structure(self):
        """Return the tags that compile separately."""
        return frozenset(self.tags - {self.source, "rest"})

    def solved(self, dtype=float, quadrature=None, **changes):
        """Results by their names, arrays of up to POINTS points; `changes` replace scene or conditions."""
        changed = self._replace(**changes)
        return solved(changed.scene, *changed.conditions, dtype=dtype, quadrature=quadrature)


def tags_of(scene, velocity):
    """Return names of the parts and cases of a scene, from its classes."""
    bodies = scene.lower, scene.upper
    materials = [body.material for body in bodies]
    spectra = [body.spectrum for body in bodies if body.spectrum is not None]
    layers = [body.layer for body in bodies if body.layer is not None]
    materials += [layer.base for layer in layers if isinstance(layer, rf.Coating)]
    liquid = any(material.deforms and material.is_liquid() for material in materials)
    law = scene.contact_model == "boundary_elements"
    has = {
        "two rubbers": all(map(relaxes, bodies)),
        "rigid": any(isinstance(material, rf.Rigid) for material in materials),
        "prony": any(isinstance(material, rf.Prony) for material in materials),
        "liquid": liquid,
        "static": not any(map(relaxes, bodies)),
        "both rough": len(spectra) == 2,
        "layer": any(isinstance(layer, rf.Slab) for layer in layers),
        "bonded layer": any(isinstance(layer, rf.Slab) and layer.base == "bonded" for layer in layers),
        "sliding layer": any(isinstance(layer, rf.Slab) and layer.base != "bonded" for layer in layers),
        "coating": any(isinstance(layer, rf.Coating) for layer in layers),
        "shear modulus": any(isinstance(material, rf.PronyShear) for material in materials),
        "tabulated": any(isinstance(material, rf.TabulatedModulus) for material in materials),
        "tabulated spectrum": any(isinstance(spectrum, rf.TabulatedSpectrum) for spectrum in spectra),
        "self-affine": any(isinstance(spectrum, rf.SelfAffine) for spectrum in spectra),
        "grooves": any(isinstance(spectrum, Anisotropic) for spectrum in spectra),
        "anisotropic": any(isinstance(spectrum, Anisotropic | TabulatedAnisotropic) for spectrum in spectra),
        "softening": any(part.softening is not None for part in (scene, *bodies)),
        "shift": any(getattr(part, "shift", None) is not None for part in (*materials, scene.shear)),
        "S in G": scene.area_correction,
        "law": law,
        "law of a liquid": law and liquid,
        "rest": velocity == 0,
        **{
            name: getattr(scene, name) is not None for name in ("shear", "heating", "adhesion", "correlation")
        },
    }
    return {tag for tag, held in has.items() if held}


@functools.partial(jax.jit, static_argnames=("names", "quadrature"))
def compiled(arguments, names, quadrature=None):
    """Results by their names: one compilation for every structure of scene."""
    solution = rf.solve(*arguments, quantities=names, quadrature=quadrature)
    return {name: getattr(solution, name) for name in names}


def solved(scene, *conditions, dtype=float, quadrature=None):
    """Results of a scene by their names at up to POINTS points."""
    conditions = np.broadcast_arrays(*map(np.atleast_1d, conditions))
    count = conditions[0].size
    arguments = as_arrays((scene, *(np.resize(x, POINTS) for x in conditions)), dtype)
    results = compiled(arguments, rf.quantities_of(scene), quadrature)
    return {name: np.asarray(x)[:count] for name, x in results.items()}
