"""What roughness excites as it slides over a solid that relaxes: angular means of the stiffness."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.materials.shifts import Shift
from rubberfric.scene.pairs import Pair
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.angular_means import Harmonics, Means, Relaxing
from rubberfric.theory.stiffness.factors import harmonic_shares
from rubberfric.theory.stiffness.means_table import MeansTable, means_table
from rubberfric.theory.stiffness.series import relaxing_stiffness
from rubberfric.theory.stiffness.softened_means import SoftenedInSeries
from rubberfric.theory.stiffness.tabulated_means import Tabulated


class Excitation(NamedTuple):
    """The stiffness that roughness of given wavevectors meets, and which of its means are needed."""

    stiffness: Relaxing | Tabulated | MeansTable | SoftenedInSeries
    shift: Shift | None  # of the strained solid
    harmonics: Harmonics | None  # as `harmonic_shares`
    split: bool  # whether <F'^2> and <F''^2> are needed apart
    needs: Needs

    def means(self, q: jax.Array, velocity: jax.Array, temperature: jax.Array | None = None) -> Means:
        """Angular means at the wavevectors that the stiffness was made for.

        Parameters
        ----------
        q : [1/m], shape (panels, order)
        velocity : [m/s], shape (points,)
        temperature : of the strained solid [K], None, (points,) or (panels, points, order)

        Returns
        -------
        Means, arrays (panels, points, order)
        """
        F, speed = self.stiffness, self._shifted(velocity, temperature)
        if F.by_node:
            # All nodes in one row, as the stiffness has them.
            speed = speed[:, None] if speed.ndim == 1 else jnp.swapaxes(speed, 0, 1).reshape(-1, q.size)
            harmonics = self._harmonics(lambda shares: shares.reshape(-1, q.size))
            means = F.means(speed * q.reshape(-1), self.needs, self.split, harmonics)
            return jax.tree.map(lambda x: jnp.swapaxes(x.reshape(-1, *q.shape), 0, 1), means)
        speed = speed[:, None] if speed.ndim == 1 else speed
        harmonics = self._harmonics(lambda shares: shares[:, :, None])
        return F.means(speed * q[:, None], self.needs, self.split, harmonics)

    def _harmonics(self, arranged):
        """The shares of the harmonics, those that differ from q to q as the stiffness takes them."""
        if self.harmonics is None or self.harmonics[0].ndim == 1:
            return self.harmonics
        cosine, sine = self.harmonics
        return arranged(cosine), arranged(sine)

    def _shifted(self, velocity, temperature):
        """v a_T [m/s]."""
        if temperature is None or self.shift is None:
            return velocity
        factor = jnp.exp(self.shift.log_factor(temperature))
        return velocity * factor if temperature.ndim == 1 else velocity[:, None] * factor


def excitation(pair: Pair, scale: jax.Array, q: jax.Array, needs: Needs) -> Excitation:
    """`Excitation` by roughness of wavevectors q.

    Parameters
    ----------
    pair : Pair whose strained solid relaxes
    scale : modulus scale [Pa]
    q : [1/m], shape (panels, order)
    needs : Needs
    """
    F, harmonics = relaxing_stiffness(pair, scale, q), harmonic_shares(pair, q)
    split = pair.softens_apart
    if isinstance(F, Tabulated) and not F.by_node:
        F = means_table(F, needs, split, harmonics)
    return Excitation(F, pair.strained.material.shift, harmonics, split, needs)
