r"""Means over the direction of sliding for a stiffness F that depends on the wavevector itself.

Coatings, layers in series and softened solids in series have another F at every wavevector. Two rules give
the means at a node:

- `on_grid`: F is evaluated at even steps of y = ln(v a_T). The means at all points are one matrix product,
  whose matrix holds the weights of the circle (`rubberfric.theory.stiffness.circle`) and the interpolation
  between the steps.
- `at_points`: F is evaluated at every point in every direction of a trapezoidal rule. This serves few points,
  and temperatures that change F by more than a_T and a common factor.
"""

import functools
import math
import operator
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import typed
from rubberfric.theory.stiffness.circle import LEAD, circle_rule, full_weights, harmonic
from rubberfric.theory.stiffness.closed_form import Harmonics, Means
from rubberfric.theory.stiffness.kinds import MeanKind

# Step of y for a relaxation spectrum, whose singularities are pi/2 from the real axis: error 2e-12.
_STEP = 0.1

# Steps of y per finest detail of E over ln omega.
_PER_DETAIL = 4

# Points of the interpolation between the steps. Every look-up takes as many products.
_POINTS = 12

# Points before the cell of a look-up, so that the cell is the middle one, where the error is smallest.
_BEFORE = _POINTS // 2 - 1

# Largest -ln cos(phi) on the grid. The share e^-28 = 7e-13 of the circle beyond it is neglected.
_DEEPEST = 28.0

# Span of y if it is unknown at trace time: 45 decades of relaxation times with ten decades of wavevectors.
_WIDEST = 190.0

# Step of the trapezoidal rule for a relaxation spectrum and isotropic roughness: error 1e-11.
_ANGULAR_STEP = 0.3

# Harmonics that halve the step. cos(2 m phi) has a pole of order 2 m at t = i pi / 2.
_HARMONICS = 4

# Value of t at which the step is larger by sqrt(2). With 5 the error is 2e-10.
_GROWTH = 7.0

# Steps of the trapezoidal rule per finest detail of E.
_PER_DETAIL_OF_AN_ANGLE = 2


def angular_rule(detail: float | None, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Return psi = pi/2 - phi and the weights of the mean over the circle."""
    if detail is None:
        return circle_rule(_ANGULAR_STEP / (1 + harmonics / _HARMONICS), _GROWTH)
    return circle_rule(detail / _PER_DETAIL_OF_AN_ANGLE)


def grid_is_cheaper(points: int, span: float | None, detail: float | None, harmonics: int) -> bool:
    """Return True if `on_grid` evaluates F less often than `at_points`."""
    return points * angular_rule(detail, harmonics)[0].size > _grid_size(span, detail)


def _step_of(detail):
    return _STEP if detail is None else detail / _PER_DETAIL


def _count(span, detail):
    return math.ceil((_WIDEST if span is None else span) / _step_of(detail)) + 2


def _band(step):
    """Return the number of entries of `full_weights` that are used."""
    return LEAD + math.ceil(_DEEPEST / step)


def _grid_size(span, detail):
    return _count(span, detail) + _band(_step_of(detail)) + _POINTS - 2


@functools.lru_cache(maxsize=16)
def _interpolated(step: float, harmonics: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the weights of F at ascending y in the means at a point between two steps.

    There is an array for each result of `full_weights`, of shape (1 + harmonics, entries, powers). The powers
    are those of the position in the cell.
    """
    at = np.arange(_POINTS) - _BEFORE - 0.5
    lagrange = [np.poly(np.delete(at, i))[::-1] / np.prod(at[i] - np.delete(at, i)) for i in range(_POINTS)]
    interpolated = []
    for rows in full_weights(step, harmonics):
        band = _band(step)
        ascending = rows[:, band - 1 :: -1]
        mixed_rows = np.zeros((len(rows), band + _POINTS - 1, _POINTS))
        for k, polynomial in enumerate(lagrange):
            mixed_rows[:, k : k + band] += ascending[..., None] * polynomial
        interpolated.append(mixed_rows)
    return tuple(interpolated)


def on_grid(
    F: Callable[[jax.Array, jax.Array], jax.Array],
    q: jax.Array,
    y: jax.Array,
    kinds: list[MeanKind],
    harmonics: Harmonics | None,
    detail: float | None,
    span: float | None,
) -> Means:
    """Return the means at nodes and points from F on an even grid of y.

    Parameters
    ----------
    F : function of q and omega, of shapes that broadcast
    q : [1/m], shape (panels, order)
    y : ln(|v| a_T), shape (points,)
    kinds : means that are needed
    harmonics : coefficients (c_m, s_m) of anisotropic roughness, or None. Each has the shape (harmonics,),
        or (harmonics, panels, order) if it depends on q. The means then include the harmonics.
    detail : finest detail of F over ln omega; None for relaxation spectra
    span : largest y minus smallest y, static; None: unknown. The means of a larger span are NaN.

    Returns
    -------
    Means, arrays (panels, points, order)
    """
    step, count = _step_of(detail), _count(span, detail)
    first = jnp.floor(jax.lax.stop_gradient(jnp.min(y)) / step)
    position = y / step - first
    cell = jnp.clip(jnp.floor(jax.lax.stop_gradient(position)), 0, count - 1)
    powers = (position - cell - 0.5)[:, None] ** typed(np.arange(_POINTS), y)
    powers = jnp.where((position <= count)[:, None], powers, jnp.nan)
    count_of_harmonics, mix = _constant_shares(harmonics)
    tables = [typed(rows, y) for rows in _interpolated(step, count_of_harmonics)]
    band = tables[0].shape[1]
    size = count + band - 1
    which = np.arange(size) - cell.astype(int)[:, None]
    inside = (which >= 0) & (which < band)
    which = jnp.where(inside, which, 0)[None]

    def matrices(rows, shares):
        if shares is not None:
            rows = (rows[0] + jnp.tensordot(shares, rows[1:], 1))[None]
        weights = jnp.einsum("hmc,pc->hpm", rows, powers)
        return jnp.where(inside, jnp.take_along_axis(weights, which, 2, mode="promise_in_bounds"), 0.0)

    shares = (None, None, None) if mix is None else (mix[0], mix[0], mix[1])
    needed = {kind.weights for kind in kinds}
    weights = {i: matrices(tables[i], shares[i]) for i in needed}
    # Position of the first entry on which the mean at the first step depends.
    grid = step * (first + typed(np.arange(size) + (LEAD - _BEFORE - (band - _POINTS)), y))

    def panel(values):
        (q,), shares = values
        at = F(q[:, None], jnp.exp(jnp.log(q)[:, None] + grid))
        rows = {kind: jnp.einsum("cg,hpg->hpc", kind.of(at), weights[kind.weights]) for kind in kinds}
        return _with_harmonics(rows, shares)

    return _over_panels(panel, (q,), harmonics)


def at_points(
    F: Callable[..., jax.Array],
    q: jax.Array,
    log_speed: jax.Array,
    arguments: tuple[jax.Array | None, ...],
    kinds: list[MeanKind],
    harmonics: Harmonics | None,
    detail: float | None,
) -> Means:
    """Return the means at nodes and points by a trapezoidal rule over the circle.

    Parameters
    ----------
    F : function of q, omega and the `arguments`, of shapes that broadcast
    q : [1/m], shape (panels, order)
    log_speed : logarithm of omega / (q cos(phi)), shape (points,) or (panels, points, order)
    arguments : further arguments of F, each None or of a shape like `log_speed`
    kinds, harmonics, detail : as in `on_grid`

    Returns
    -------
    Means, arrays (panels, points, order)
    """
    count, mix = _constant_shares(harmonics)
    psi, weight = angular_rule(detail, count)
    higher = (np.stack(harmonic(m, psi)) for m in range(1, count + 1))
    kernels = np.stack([np.ones((2, psi.size)), *higher], 1)
    even, across = (typed(weight * rows, q) for rows in kernels)
    across = jnp.concatenate([0 * across[:1], across[1:]])
    if mix is not None:
        even, across = (even[0] + mix[0] @ even[1:])[None], (mix[1] @ across[1:])[None]
    sine = typed(np.sin(psi), q)
    weights = even, even * sine, across

    def everywhere(x):
        x = x[:, None] if x.ndim == 1 else x
        return jnp.broadcast_to(x, (q.shape[0], x.shape[-2], x.shape[-1]))

    def panel(values):
        (q, log_speed, *arguments), shares = values
        omega = jnp.exp(jnp.log(q) + log_speed)[..., None] * sine
        at = F(q[:, None], omega, *(None if x is None else x[..., None] for x in arguments))
        rows = {kind: jnp.moveaxis(kind.of(at) @ weights[kind.weights].T, -1, 0) for kind in kinds}
        return _with_harmonics(rows, shares)

    arrays = (None if x is None else everywhere(x) for x in (log_speed, *arguments))
    return _over_panels(panel, (q, *arrays), harmonics)


def _constant_shares(harmonics: Harmonics | None) -> tuple[int, Harmonics | None]:
    """Return the number of harmonics, and the shares of the harmonics.

    The shares are None if they depend on q, or if there are no harmonics.
    """
    if harmonics is None:
        return 0, None
    return harmonics[0].shape[0], None if harmonics[0].ndim > 1 else harmonics


def _with_harmonics(rows, shares):
    """Return the means of a panel from rows of shape (1 + harmonics, points, order), or (1, ...) if mixed."""
    means: Means = {}
    for kind, values in rows.items():
        if shares is None:
            means[kind.name] = (values[0],)
        else:
            start = values[1:] if kind.name == "mean_sin_loss" else values
            means[kind.name] = (_mixed(shares[kind.name == "mean_sin_loss"], tuple(start)),)
    return means


def _mixed(shares: jax.Array, means: tuple[jax.Array, ...]) -> jax.Array:
    """Return a mean plus the sum of its harmonics times their shares.

    The harmonics are the last entries of `means`, as many as there are shares. A transverse mean has only
    harmonics.
    """
    first = len(means) - len(shares)
    terms = (share * mean for share, mean in zip(shares, means[first:], strict=True))
    return functools.reduce(operator.add, (*means[:first], *terms))


def _over_panels(panel, arrays, harmonics):
    shares = None
    if harmonics is not None and harmonics[0].ndim > 1:
        shares = tuple(jnp.moveaxis(x, 1, 0) for x in harmonics)
    # Panel by panel, recomputed for the gradient: the values of a panel stay in the cache of the processor.
    return jax.lax.map(jax.checkpoint(panel), (arrays, shares))
