"""What multiplies q^4 C at a wavevector: layer, softening, and the harmonics of anisotropic roughness.

The angular means of the stiffness are smooth in ln q and interpolated between the angular
nodes; the factors here are not, and are exact at every contact node. A quantity is the sum
over its means of factor times mean, one of each unless <F'^2> and <F''^2> soften apart.
"""

from typing import NamedTuple

from rubberfric.scene.scene import relaxes
from rubberfric.scene.softening import softening_factors
from rubberfric.theory.stiffness.series import layer_factor


class Modes(NamedTuple):
    """Which angular means a channel needs."""

    split: bool = False  # <F'^2> and <F''^2> apart, for softening changes them differently
    harmonics: int = 0  # highest m of cos(2 m phi) in the roughness
    at_contact: bool = False  # taken at the contact nodes: what they are means of has kinks over q


class Factors(NamedTuple):
    """Factors of the means of each kind, tuples in the order of `angular.Means`; None is 1."""

    power: tuple
    dissipation: tuple
    storage: tuple
    transverse: tuple


def modes_of(rough, other, softened):
    """`Modes` of roughness on `rough` facing `other`."""
    if not relaxes(other):
        return Modes()
    of_two = softened is not None and rough.material.deforms
    return Modes(
        split=softened is not None and not of_two,
        harmonics=rough.spectrum.harmonic_count(),
        at_contact=of_two or rough.spectrum.harmonics_vary,
    )


def mix_of(rough, modes, q):
    """Shares (c_m, s_m) of the harmonics at wavevectors q; None without harmonics.

    Shape (harmonics,) each where they are the same at every wavevector, else (harmonics, *q.shape).
    """
    if not modes.harmonics:
        return None
    return rough.spectrum.harmonics_at(q)


def node_factors(rough, other, softened, q):
    """`Factors` at wavevectors q [1/m], for a stiffness that relaxes.

    Parameters
    ----------
    rough, other : Body
    softened : `softening.Softened` or None
    q : any shape
    """
    layer = layer_factor(rough, other, q)
    if modes_of(rough, other, softened).split:
        storage, loss = (_times(layer, x) for x in softening_factors(softened, q))
        return Factors((storage**2, loss**2), (loss,), (storage,), ())
    return Factors((_times(layer, layer),), (layer,), (layer,), (layer,))


def _times(a, b):
    return b if a is None else a if b is None else a * b
