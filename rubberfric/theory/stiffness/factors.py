"""What multiplies q^4 C at a wavevector: layer, softening, and the harmonics of anisotropic roughness.

The angular means of the stiffness are smooth in ln q and interpolated between the angular
nodes; the factors here are not, and are exact at every contact node. A quantity is the sum
over its means of factor times mean, one of each unless <F'^2> and <F''^2> soften apart.
"""

from typing import NamedTuple

import jax

from rubberfric.scene.pairs import Pair
from rubberfric.scene.softening import softening_factors
from rubberfric.theory.stiffness.angular_means import Harmonics
from rubberfric.theory.stiffness.series import layer_factor


class Factors(NamedTuple):
    """Factors of the means of each kind, tuples in the order of `Means`; None is 1."""

    power: tuple[jax.Array | None, ...]
    dissipation: tuple[jax.Array | None, ...]
    storage: tuple[jax.Array | None, ...]
    transverse: tuple[jax.Array | None, ...]

    def of(self, kind: str, values: jax.Array) -> tuple[jax.Array, ...]:
        """Values times the factor of each of the means of a kind."""
        return tuple(values if factor is None else values * factor for factor in getattr(self, kind))


def factors_at(pair: Pair, q: jax.Array) -> Factors:
    """`Factors` at wavevectors q [1/m] of any shape, for a stiffness that relaxes."""
    layer = layer_factor(pair, q)
    if pair.softened is not None and pair.softens_apart:
        storage, loss = (_times(layer, x) for x in softening_factors(pair.softened, q))
        return Factors((storage**2, loss**2), (loss,), (storage,), ())
    return Factors((_times(layer, layer),), (layer,), (layer,), (layer,))


def harmonic_shares(pair: Pair, q: jax.Array) -> Harmonics | None:
    """Shares (c_m, s_m) of the harmonics of the roughness at wavevectors q; None without harmonics.

    Shape (harmonics,) each where they are the same at every wavevector, else (harmonics, *q.shape).
    """
    return pair.spectrum.harmonics_at(q) if pair.harmonics else None


def _times(a, b):
    return b if a is None else a if b is None else a * b
