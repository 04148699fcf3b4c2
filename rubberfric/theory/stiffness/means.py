"""Means of the stiffness over the direction of sliding, by the method that suits the scene.

`rubberfric.theory.structure.MeansMethod` lists the methods. Building a table of a tabulated modulus takes as
long as looking up fifty velocities. Such tables are kept (`known_tables`) for plain calls and for functions
under `jit` that close over a scene. If a number of a modulus is traced, the table is part of the compiled
function.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import is_concrete
from rubberfric.base.compilation import exact_products, quick_options
from rubberfric.base.quadrature import between_nodes
from rubberfric.materials.material import series_of
from rubberfric.materials.shifts import Shift, log_vertical
from rubberfric.roughness.spectra import log_ratio
from rubberfric.scene.scene import Scene, temperature_by_scale
from rubberfric.theory.stiffness.by_node import at_points, grid_is_cheaper, on_grid
from rubberfric.theory.stiffness.closed_form import Harmonics, Means, PronyStiffness
from rubberfric.theory.stiffness.complex_stiffness import (
    F_j,
    factors_of_q,
    frequency_range,
    modulus_scale,
    quick,
)
from rubberfric.theory.stiffness.kinds import kinds_of, passing
from rubberfric.theory.stiffness.table import BetweenKnots, MeansTable, means_table
from rubberfric.theory.structure import (
    AT_REFERENCE,
    MeansMethod,
    RequiredMeans,
    RoughSurface,
    Structure,
    SurfaceTemperatures,
    rough_surfaces_of,
)

# Number of tables kept. Each takes 0.4 MB for each kind of mean.
_KEPT = 4

# Number of compiled functions that build tables.
_PROGRAMS = 16

Tables = tuple[MeansTable | None, ...]

# Kept tables, oldest first.
_kept: dict[Any, Tables | None] = {}


class Factors(NamedTuple):
    """Factors that multiply the product of q^4 C and each mean, as tuples in the order of `Means`.

    The angular means are smooth in ln q and are interpolated between the angular nodes. The factors of layers
    and softening are exact at every contact node. If softening multiplies a table, <|F|^2> has two factors,
    of <F'^2> and <F''^2>.
    """

    storage: jax.Array
    loss: jax.Array
    mean_abs2: tuple[jax.Array, ...]

    def of(self, kind: str, values: jax.Array) -> tuple[jax.Array, ...]:
        """Return a tuple with `values` times the factor of each mean of this kind, for example of <|F|^2>."""
        if kind == "mean_abs2":
            return tuple(values * factor for factor in self.mean_abs2)
        return (values * (self.storage if kind == "mean_storage" else self.loss),)


def factors_at(surface: RoughSurface, scale: jax.Array, q: jax.Array) -> Factors:
    """Return the `Factors` at wavevectors q [1/m] of any shape.

    If the stiffness is static, the factors contain F.
    """
    if surface.method is MeansMethod.CONSTANT:
        F = F_j(surface, q, None, unit=scale)
        return Factors(F, F, (F**2,))
    if surface.method in (MeansMethod.CLOSED_FORM, MeansMethod.TABLE):
        storage, loss = factors_of_q(surface, q)
    else:
        storage = loss = jnp.ones_like(q)
    return Factors(storage, loss, (storage**2, loss**2) if surface.separate_storage_loss else (storage**2,))


class StiffnessMeans(NamedTuple):
    """Means of F = 2 K_j / (q scale) of one rough surface, without the `Factors`."""

    surface: RoughSurface
    scale: jax.Array  # [Pa]
    prepared: PronyStiffness | MeansTable | None  # None: F is evaluated at the nodes
    harmonics: Harmonics | None  # at the wavevectors of the means, or at the knots of a table
    knots: BetweenKnots | None  # position of the wavevectors, if a table has harmonics that depend on q
    needs: RequiredMeans
    span: float | None  # of ln(v a_T) over the points, static; None: unknown

    def means(
        self, q: jax.Array, velocity: jax.Array, temperatures: SurfaceTemperatures = AT_REFERENCE
    ) -> Means:
        """Return the means over the direction of sliding.

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
        T, shift = temperatures.strained, self.surface.strained.material.shift
        if self.prepared is None:
            means = self._by_node(q, velocity, temperatures)
        else:
            log_shift = _log_shift(shift, T)
            if isinstance(self.prepared, MeansTable):
                log_shift = None if log_shift is None else _by_points(log_shift)
                split, grooved = self.surface.separate_storage_loss, self.surface.harmonics > 0
                means = self.prepared.means(
                    q[:, None], velocity[:, None], log_shift, self.needs, split, grooved, self.knots
                )
            else:
                speed = velocity if log_shift is None else _times(velocity, jnp.exp(log_shift))
                means = self.prepared.means(_by_points(speed) * q[:, None], self.needs)
        log_factor = None if self.surface.method is MeansMethod.AT_POINTS else log_vertical(shift, T)
        if log_factor is None:
            return means
        stiffer = _by_points(jnp.exp(log_factor))
        return {
            kind: tuple(x * (stiffer**2 if kind == "mean_abs2" else stiffer) for x in values)
            for kind, values in means.items()
        }

    def _by_node(self, q, velocity, temperatures):
        surface, varies = self.surface, self.surface.method is MeansMethod.AT_POINTS
        if not surface.relaxes:
            T = jax.tree.map(_by_points, temperatures)
            at = q[:, None]
            # The modulus of a half-space at rest is the same at all wavevectors.
            F = F_j(surface, at, None, T, self.scale)
            F = jnp.broadcast_to(F, jnp.broadcast_shapes(F.shape, at.shape))
            return {"mean_abs2": (F * F,), "mean_storage": (F,)}
        log_shift = _log_shift(surface.strained.material.shift, temperatures.strained)
        least = frequency_range(surface).rest - jax.lax.stop_gradient(jnp.max(jnp.log(q)))
        loss_at_rest = surface.strained.material.loss_at_rest
        speed = velocity if log_shift is None or log_shift.ndim == 1 else velocity[:, None]
        log_speed, sign = passing(speed, log_shift, least, loss_at_rest)
        kinds = kinds_of(self.needs, False, surface.strained.material.loss_beyond)
        solids, scale = quick(surface), self.scale
        arguments = kinds, self.harmonics, surface.detail
        points = velocity.shape[0]
        if (
            not varies
            and log_speed.ndim == 1
            and grid_is_cheaper(points, self.span, surface.detail, surface.harmonics)
        ):

            def of_q(q, omega):
                return F_j(solids, q, omega, unit=scale)

            means = on_grid(of_q, q, log_speed, *arguments, self.span)
        else:
            # If only a_T changes F, omega a_T takes the place of omega, and temperatures are not needed.
            T = temperatures if varies else AT_REFERENCE
            at = log_speed - log_shift if varies and log_shift is not None else log_speed

            def of_point(q, omega, strained, rough):
                return F_j(solids, q, omega, SurfaceTemperatures(strained, rough), scale)

            means = at_points(of_point, q, at, tuple(T), *arguments)
        odd = ("mean_cos_loss", "mean_sin_loss")
        sign = _by_points(sign)
        return {kind: tuple(x * sign if kind in odd else x for x in values) for kind, values in means.items()}


def _log_shift(shift: Shift | None, temperature: jax.Array | None):
    return None if temperature is None or shift is None else shift.log_factor(temperature)


def _times(velocity, factor):
    return (velocity if factor.ndim == 1 else velocity[:, None]) * factor


def _by_points(values):
    """Make values of shape (points,) broadcastable to (panels, points, order)."""
    return values[:, None] if values.ndim == 1 else values


def stiffness_means(
    surface: RoughSurface,
    scale: jax.Array,
    q: jax.Array,
    needs: RequiredMeans,
    table: MeansTable | None = None,
    span: float | None = None,
) -> StiffnessMeans:
    """Return the `StiffnessMeans` for roughness of wavevectors q.

    Parameters
    ----------
    surface : RoughSurface that is not static
    scale : modulus scale [Pa]
    q : [1/m], shape (panels, order)
    needs : RequiredMeans
    table : MeansTable of the surface if already built, or None
    span : of ln(v a_T) over the points, or None
    """
    spectrum, harmonics, knots = surface.spectrum, None, None
    if surface.harmonics:
        at = q
        if surface.method is MeansMethod.TABLE and spectrum.harmonics_vary:
            at = spectrum.harmonic_knots()
            knots = BetweenKnots(*between_nodes(log_ratio(at, at[0]), log_ratio(q, at[0])[:, None]))
        harmonics = spectrum.harmonics_at(at)
    prepared: PronyStiffness | MeansTable | None = None
    if surface.method is MeansMethod.CLOSED_FORM:
        prepared = PronyStiffness.of(*series_of(surface.strained.material, scale))
    elif surface.method is MeansMethod.TABLE:
        prepared = table
        if table is None:
            prepared = means_table(surface, scale, needs, surface.separate_storage_loss, harmonics)
    return StiffnessMeans(surface, scale, prepared, harmonics, knots, needs, span)


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
    details = (body.material.detail for body in (scene.lower, scene.upper) if body.material.deforms)
    if temperature_by_scale(scene) or all(detail is None for detail in details):
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
    if surface.method is not MeansMethod.TABLE or surface.detail is None or surface.harmonics:
        return None
    return means_table(surface, scale, needs, surface.separate_storage_loss)
