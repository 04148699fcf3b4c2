r"""Roughness of two solids that is correlated, as of a replica on its mould.

.. math:: \langle h_1(q)\,h_2^*(q)\rangle:\quad C_{12} = \kappa\sqrt{C_1 C_2},\qquad
          C_1 + C_2 \to C_1 + C_2 - 2 C_{12}

the spectrum of the difference of the surfaces, which is all that matters to solids at rest. As one slides
over the other their roughness excites either solid at different frequencies, and the cross terms vanish from
averages over time: theory of uncorrelated roughness holds then [Scaraggi & Persson, arXiv:1506.06955].
"""

import jax
import jax.numpy as jnp

from rubberfric.base.checks import between
from rubberfric.base.objects.fields import Number, leaf
from rubberfric.base.objects.physical import PhysicalObject, physical


@physical
class Correlation(PhysicalObject):
    r"""Correlation of the two surfaces of a scene.

    Parameters
    ----------
    coherence : kappa, the same at every wavevector [-], -1 ... 1
        1: the surfaces fit, as far as their spectra are equal; 0: they know nothing of each other;
        -1: the peaks of one lie on the peaks of the other.

    Limits: at rest only (velocity 0), between two rough isotropic surfaces; not together with heating or
    softening. Traced velocities other than 0 give NaN.
    """

    coherence: Number = leaf(between(-1.0, 1.0), unit="-")


def difference(correlation: Correlation, lower: jax.Array, upper: jax.Array) -> jax.Array:
    """Spectrum of the difference of two surfaces, of their spectra >= 0, in whatever unit."""
    one, other = _root(lower), _root(upper)
    # A square and what is left: never below 0.
    return (one - other) ** 2 + 2 * (1 - correlation.coherence) * (one * other)


def _root(square):
    """Square root with derivative 0 at 0, where a surface has no roughness."""
    rough = square > 0
    return jnp.where(rough, jnp.sqrt(jnp.where(rough, square, 1.0)), 0.0)
