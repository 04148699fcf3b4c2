r"""Correlated roughness of two solids, such as a replica on its mould.

.. math:: \langle h_1(q)\,h_2^*(q)\rangle:\quad C_{12} = \kappa\sqrt{C_1 C_2},\qquad
          C_1 + C_2 \to C_1 + C_2 - 2 C_{12}

This is the spectrum of the difference of the surfaces, which determines the contact of solids at rest. In
sliding, the two surfaces excite the solids at different frequencies. The cross terms then vanish in the time
average, and the theory of uncorrelated roughness holds [Scaraggi & Persson, arXiv:1506.06955].
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
    coherence : kappa, constant over all wavevectors [-], -1 ... 1
        If kappa is 1 and the spectra are equal, the surfaces match. If kappa is 0, the surfaces are not
        correlated. If kappa is -1, the peaks of one surface lie on the peaks of the other surface.

    Limits: both surfaces must be rough and isotropic, and the solids must be at rest (velocity 0). Heating
    and softening are not allowed. Traced velocities other than 0 give NaN.
    """

    coherence: Number = leaf(between(-1.0, 1.0), unit="-")


def difference(correlation: Correlation, lower: jax.Array, upper: jax.Array) -> jax.Array:
    """Return the spectrum of the height difference of two surfaces with the spectra `lower` and `upper`.

    The spectra must be >= 0 and may have any unit.
    """
    one, other = _root(lower), _root(upper)
    # A square plus a remainder >= 0, so that the result is never negative.
    return (one - other) ** 2 + 2 * (1 - correlation.coherence) * (one * other)


def _root(square):
    """Return the square root of `square`, with derivative 0 if `square` is 0 (smooth surface)."""
    rough = square > 0
    return jnp.where(rough, jnp.sqrt(jnp.where(rough, square, 1.0)), 0.0)
