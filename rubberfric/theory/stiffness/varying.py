r"""Two solids in series whose stiffnesses change differently with temperature.

With a vertical shift b_T of one of two deformable solids, or different shifts of layer and base of a coating,
temperature does more than multiply the relaxation times of K_j by a common a_T:

.. math:: K_j = \frac{1}{M_o(q, a_o\omega)/b_o + M_j(q, 0)/b_j}

a and b are the shift factors at the temperatures of the solids at q. The Prony series is computed for each q
and temperature.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.theory.stiffness.angular_means import Harmonics, Means, PronyStiffness
from rubberfric.theory.stiffness.series import relaxing_stiffness, static_stiffness
from rubberfric.theory.stiffness.tabulated_means import Tabulated
from rubberfric.theory.structure import RequiredMeans, RoughSurface, SurfaceTemperatures


class VaryingSeries(NamedTuple):
    """Series stiffness F of a surface, which is computed for every temperature."""

    surface: RoughSurface
    scale: jax.Array  # modulus scale [Pa]

    def means(
        self,
        q: jax.Array,
        speed: jax.Array,
        temperatures: SurfaceTemperatures,
        needs: RequiredMeans,
        harmonics: Harmonics | None,
    ) -> Means:
        """Return the means of F.

        Parameters
        ----------
        q : [1/m], shape (panels, order)
        speed : v a_T of the strained solid [m/s], shape (points,) or (panels, points, order)
        temperatures : [K], shapes (points,) or (panels, points, order)
        needs, harmonics : as in `PronyStiffness.means`; shares (harmonics,) or (harmonics, panels, order)

        Returns
        -------
        Means, arrays (panels, points, order)
        """
        points = speed.shape[-2] if speed.ndim > 1 else speed.shape[0]
        at_points = all(x is None or x.ndim == 1 for x in (speed, *temperatures))
        shares = None
        if harmonics is not None and harmonics[0].ndim > 1:
            shares = [jnp.moveaxis(x, 1, 0) for x in harmonics]
        if at_points and not self.surface.by_wavevector and shares is None:
            # One series per point serves all wavevectors.
            F = self._series(q[0, 0] * jnp.ones(points, q.dtype), temperatures)
            found = F.means(q.reshape(-1, 1) * speed, needs, False, harmonics)
            return jax.tree.map(lambda x: jnp.swapaxes(x.reshape(*q.shape, points), 1, 2), found)

        def everywhere(x):
            x = x[:, None] if x.ndim == 1 else x
            return jnp.broadcast_to(x, (q.shape[0], points, q.shape[1]))

        def panel(values):
            q, speed, temperatures, shares = values
            at = jnp.broadcast_to(q, speed.shape).reshape(-1)
            F = self._series(at, jax.tree.map(jnp.ravel, temperatures))
            own = harmonics
            if shares is not None:
                cosine, sine = (jnp.tile(x, (1, points))[:, None] for x in shares)
                own = cosine, sine
            found = F.means((at * speed.reshape(-1))[None], needs, False, own)
            return jax.tree.map(lambda x: x.reshape(speed.shape), found)

        values = q, everywhere(speed), jax.tree.map(everywhere, temperatures), shares
        # Panel by panel, recomputed for the gradient, because all series at once take much memory.
        return jax.lax.map(jax.checkpoint(panel), values)

    def static(self, q: jax.Array, temperatures: SurfaceTemperatures) -> Means:
        """Return the means if the strained solid does not relax.

        The arrays have the shape (panels, points or 1, order).
        """
        at = jax.tree.map(lambda T: T[:, None] if T.ndim == 1 else T, temperatures)
        F = static_stiffness(self.surface, self.scale, q[:, None], at)
        return {"mean_abs2": (F * F,), "mean_storage": (F,)}

    def _series(self, q, temperatures):
        # q and temperatures have the shape (nodes,).

        def one(q, temperatures):
            F = relaxing_stiffness(self.surface, self.scale, q[None, None], temperatures)
            assert isinstance(F, PronyStiffness | Tabulated)
            if isinstance(F, PronyStiffness):
                return F.rest.reshape(()), F.weight.reshape(-1), F.tau.reshape(-1)
            return tuple(jnp.reshape(x, ()) for x in (F.scale, F.spring) if x is not None)

        found = jax.vmap(one)(q, temperatures)
        if len(found) == 3:
            return PronyStiffness(*found)
        return Tabulated(self.surface.strained.material, found[0], found[1])
