"""Angular means of the stiffness for roughness that slides over a viscoelastic solid.

Building a table of means takes as long as looking up fifty velocities. Tables are kept (`known_tables`) for
plain calls and for functions under `jit` that close over a scene. If a number of a modulus is traced, the
table is part of the compiled function.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import is_concrete
from rubberfric.base.compilation import exact_products, quick_options
from rubberfric.materials.shifts import Shift, log_vertical
from rubberfric.scene.scene import Scene
from rubberfric.theory.stiffness.angular_means import Harmonics, Means, PronyStiffness
from rubberfric.theory.stiffness.means_table import MeansTable, means_table
from rubberfric.theory.stiffness.series import (
    modulus_scale,
    relaxing_stiffness,
    static_stiffness,
    tabulated_stiffness,
)
from rubberfric.theory.stiffness.softened_means import SoftenedInSeries
from rubberfric.theory.stiffness.tabulated_means import Tabulated
from rubberfric.theory.structure import (
    AT_REFERENCE,
    RequiredMeans,
    RoughSurface,
    Structure,
    SurfaceTemperatures,
    rough_surfaces_of,
)


class VaryingSeries(NamedTuple):
    r"""Series stiffness F of two solids whose stiffnesses change differently with temperature.

    .. math:: K_j = \frac{1}{M_o(q, a_o\omega)/b_o + M_j(q, 0)/b_j}

    with the shift factors a and b at the temperatures of the solids at q. With a vertical shift b_T of one of
    two deformable solids, or different shifts of layer and base of a coating, temperature does more than
    multiply the relaxation times of K_j by a common a_T. F is computed for each q and temperature.
    """

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


# Number of tables kept (0.4 MB for each kind of mean), and of compiled functions that build them.
_KEPT, _PROGRAMS = 4, 16

Tables = tuple[MeansTable | None, ...]

# Kept tables, oldest first.
_kept: dict[Any, Tables | None] = {}


class StiffnessMeans(NamedTuple):
    """Stiffness at given wavevectors, with the list of needed means."""

    # None if nothing relaxes; then F is `varying`, or the factors contain all of it.
    stiffness: PronyStiffness | Tabulated | MeansTable | SoftenedInSeries | None
    varying: VaryingSeries | None  # F if temperature changes its form
    shift: Shift | None  # of the strained solid
    resting: Shift | None  # of the rough solid
    harmonics: Harmonics | None  # from `_harmonic_shares`
    split: bool  # <F'^2> and <F''^2> are needed separately
    needs: RequiredMeans

    def means(
        self, q: jax.Array, velocity: jax.Array, temperatures: SurfaceTemperatures = AT_REFERENCE
    ) -> Means:
        """Return the angular means at the wavevectors of the stiffness.

        Parameters
        ----------
        q : [1/m], shape (panels, order)
        velocity : [m/s], shape (points,)
        temperatures : SurfaceTemperatures [K]. A temperature is None, or has the shape (points,) or
            (panels, points, order).

        Returns
        -------
        Means, arrays of shape (panels, points, order). The second axis may have the length 1 if the stiffness
        does not relax.
        """
        if self.stiffness is None:
            if self.varying is not None:
                return self.varying.static(q, temperatures)
            return {kind: (jnp.ones_like(q)[:, None],) for kind in self.needs.kinds}
        F, log_shift = self.stiffness, self._log_shift(temperatures.strained)
        if isinstance(F, SoftenedInSeries):
            factors = (self._vertical(*x) for x in zip((self.shift, self.resting), temperatures, strict=True))
            speed = _by_points(_shifted(velocity, log_shift))
            return F.means(speed * q[:, None], self.needs, *factors)
        if self.varying is not None and temperatures.strained is not None:
            speed = _shifted(velocity, log_shift)
            return self.varying.means(q, speed, temperatures, self.needs, self.harmonics)
        means = self._means(F, q, velocity, log_shift)
        factor = self._vertical(self.shift, temperatures.strained)
        if factor is None:
            return means
        square = factor * factor
        return {
            kind: tuple(x * (square if kind == "mean_abs2" else factor) for x in values)
            for kind, values in means.items()
        }

    def _means(self, F, q, velocity, log_shift):
        if isinstance(F, MeansTable):
            harmonics = self._harmonics(lambda shares: shares[:, :, None])
            log_shift = None if log_shift is None else _by_points(log_shift)
            return F.means(q[:, None], velocity[:, None], log_shift, self.needs, self.split, harmonics)
        speed = _shifted(velocity, log_shift)
        if F.by_node:
            # The stiffness has all nodes in one row.
            speed = speed[:, None] if speed.ndim == 1 else jnp.swapaxes(speed, 0, 1).reshape(-1, q.size)
            harmonics = self._harmonics(lambda shares: shares.reshape(-1, q.size))
            means = F.means(speed * q.reshape(-1), self.needs, self.split, harmonics)
            return jax.tree.map(lambda x: jnp.swapaxes(x.reshape(-1, *q.shape), 0, 1), means)
        harmonics = self._harmonics(lambda shares: shares[:, :, None])
        return F.means(_by_points(speed) * q[:, None], self.needs, self.split, harmonics)

    @staticmethod
    def _vertical(shift, temperature):
        """Return the vertical shift b_T, or None if b_T is 1.

        The shape of b_T broadcasts to (panels, points, order).
        """
        log_factor = log_vertical(shift, temperature)
        return None if log_factor is None else _by_points(jnp.exp(log_factor))

    def _harmonics(self, arranged):
        # `arranged` reshapes shares that depend on q.
        if self.harmonics is None or self.harmonics[0].ndim == 1:
            return self.harmonics
        cosine, sine = self.harmonics
        return arranged(cosine), arranged(sine)

    def _log_shift(self, temperature):
        return None if temperature is None or self.shift is None else self.shift.log_factor(temperature)


def _shifted(velocity, log_shift):
    if log_shift is None:
        return velocity
    return (velocity if log_shift.ndim == 1 else velocity[:, None]) * jnp.exp(log_shift)


def _by_points(values):
    """Make values of shape (points,) broadcastable to (panels, points, order)."""
    return values[:, None] if values.ndim == 1 else values


def stiffness_means(
    surface: RoughSurface,
    scale: jax.Array,
    q: jax.Array,
    needs: RequiredMeans,
    table: MeansTable | None = None,
) -> StiffnessMeans:
    """Return the `StiffnessMeans` for roughness of wavevectors q.

    Parameters
    ----------
    surface : RoughSurface
    scale : modulus scale [Pa]
    q : [1/m], shape (panels, order)
    needs : RequiredMeans
    table : MeansTable of the surface if already built, or None
    """
    varying = VaryingSeries(surface, scale) if surface.varies else None
    shifts = surface.strained.material.shift, surface.rough.material.shift
    if not surface.relaxes:
        return StiffnessMeans(None, varying, *shifts, None, False, needs)
    F, harmonics = relaxing_stiffness(surface, scale, q), _harmonic_shares(surface, q)
    split = surface.separate_storage_loss
    if isinstance(F, PronyStiffness) and not split:
        # Here and not in `means`, so that derivatives at many points do not repeat it.
        F = F.with_square_weight()
    if isinstance(F, Tabulated) and not F.by_node:
        F = means_table(F, needs, split, harmonics) if table is None else table
    return StiffnessMeans(F, varying, *shifts, harmonics, split, needs)


def _harmonic_shares(surface: RoughSurface, q: jax.Array) -> Harmonics | None:
    """Return the shares (c_m, s_m) of the harmonics at wavevectors q, or None without harmonics.

    c_m and s_m have the shape (harmonics, *q.shape), or (harmonics,) if they are equal at all wavevectors.
    """
    return surface.spectrum.harmonics_at(q) if surface.harmonics else None


def known_tables(scene: Scene, quantities: tuple[str, ...], dtype: np.dtype) -> Tables | None:
    """Return the table of each rough surface, or None if no surface has a table.

    The entry of a surface without a table is None. Tables are kept for the next call with the same numbers of
    the materials.

    Parameters
    ----------
    scene : Scene
    quantities : fields of `Solution`
    dtype : dtype of the tables
    """
    materials = scene.lower.material, scene.upper.material
    if scene.heating is not None or not any(one.deforms and one.needs_quadrature for one in materials):
        return None
    needs = Structure.of(scene, quantities).needs
    if not needs.mean_abs2 or not all(map(is_concrete, jax.tree.leaves(scene))):
        return None
    leaves, structure = jax.tree.flatten(scene)
    numbers = [np.asarray(leaf, dtype) for leaf in leaves]
    # The key has bytes, because arrays may be changed in place. No table depends on the roughness.
    bodies = (body.material for body in (scene.lower, scene.upper))
    moduli = [np.asarray(leaf, dtype) for leaf in jax.tree.leaves(tuple(bodies))]
    key = structure, needs, dtype, tuple((x.shape, x.tobytes()) for x in moduli)
    if key not in _kept:
        build = _compiled_build(structure, tuple(x.shape for x in numbers), dtype, needs)
        tables = build(jax.tree.unflatten(structure, numbers))
        _kept[key] = tables if any(table is not None for table in tables) else None
        while len(_kept) > _KEPT:
            del _kept[next(iter(_kept))]
    return _kept[key]


@functools.lru_cache(maxsize=_PROGRAMS)
def _compiled_build(structure, shapes, dtype, needs):
    """Return `_build`, compiled for scenes of one structure.

    The compiled function runs immediately, even while JAX traces another function.
    `jax.ensure_compile_time_eval` would compile each operation separately and take a second longer.
    """
    numbers = [jax.ShapeDtypeStruct(shape, dtype) for shape in shapes]
    # It runs once, so its compile time matters most.
    options: dict[str, Any] = {**(quick_options() or {}), "xla_backend_optimization_level": 0}
    return _build.lower(jax.tree.unflatten(structure, numbers), needs).compile(options)


@functools.partial(jax.jit, static_argnums=1)
@exact_products
def _build(scene, needs):
    scale = modulus_scale(scene)
    return tuple(_table(surface, scale, needs) for surface in rough_surfaces_of(scene))


def _table(surface: RoughSurface, scale, needs):
    F = tabulated_stiffness(surface, scale)
    return (
        None if F is None or surface.harmonics else means_table(F, needs, surface.separate_storage_loss, None)
    )
