r"""Angular means of a solid that is no Prony series, for every node by an integral of its own.

If the spring in series or a layer varies with q, or the means are wanted at few q v: by the trapezoidal rule
over the circle of `rubberfric.theory.stiffness.circle_means`, with E' and E'' from splines over ln omega.
"""

import functools
import math
import operator
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.materials.material import Material
from rubberfric.materials.tabulated_modulus import LONGEST_TABLE, REACH
from rubberfric.theory.stiffness.angular_means import Harmonics, Means
from rubberfric.theory.stiffness.circle_means import circle_rule, harmonic
from rubberfric.theory.stiffness.splines import BEFORE, BESIDE, MARGIN, at, splines
from rubberfric.theory.structure import RequiredMeans

# Steps of the grid in the finest detail of E over ln omega, and of the integral of a node.
PER_DETAIL, _PER_DETAIL_OF_A_NODE = 6, 2

# ln E''/E' at the first entry of a table, of which `far_below` takes account.
_MOST_EXCESS = 40.0


class Tabulated(NamedTuple):
    """F = f k / (f + k) with f(omega) the scaled E_r and a spring k, its means taken at every node."""

    material: Material  # without a series
    scale: jax.Array  # f = scale * E [1/Pa], shape () or (nodes,)
    spring: jax.Array | None  # [-], shape () or (nodes,); None: rigid

    @property
    def by_node(self) -> bool:
        """Whether every node has its own."""
        return self.scale.ndim > 0

    def means(
        self, qv: jax.Array, needs: RequiredMeans, split: bool = False, harmonics: Harmonics | None = None
    ) -> Means:
        """Means of F for roughness passing at q v; arguments as `PronyStiffness.means`."""
        return means_of_log(
            self.material, qv, harmonics, lambda x: _by_node(self, x, needs, split, harmonics)
        )


def means_of_log(
    material: Material, qv: jax.Array, harmonics: Harmonics | None, means: Callable[[jax.Array], Means]
) -> Means:
    """Means at q v from those at ln |q v|, which have harmonics that vary with q one by one.

    Parameters
    ----------
    material : whose modulus it is
    qv : q v a_T [1/s], any shape
    harmonics : as of `PronyStiffness.means`
    means : function of ln |q v|
    """
    log_qv, sign = log_frequency(material, qv)
    return of_direction(means(log_qv), sign, harmonics)


def of_direction(found: Means, sign: jax.Array, harmonics: Harmonics | None) -> Means:
    """Means with their harmonics, which were apart if they vary with q; those odd in q v times `sign`."""
    if harmonics is not None and _vary(harmonics):
        cosine, sine = harmonics
        found = {
            kind: (_mixed(sine if kind == "mean_sin_loss" else cosine, values),)
            for kind, values in found.items()
        }
    odd = {kind: found[kind] for kind in ("mean_cos_loss", "mean_sin_loss") if kind in found}
    return found | {kind: tuple(x * sign for x in values) for kind, values in odd.items()}


def log_frequency(material: Material, omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """ln |omega|, bounded far below the frequencies of a material, and the factor of what is odd in omega.

    Far below, E is E(0) and E'' linear in omega: so v = 0 keeps its derivative. If E'' does not vanish at
    v = 0+, only the sign is left.
    """
    floor = log_range(material)[0] - far_below(material)
    tiny, largest = (float(x) for x in (jnp.finfo(omega.dtype).tiny, jnp.finfo(omega.dtype).max))
    log_omega = jnp.maximum(jnp.log(jnp.maximum(jnp.abs(omega), tiny)), floor)
    return log_omega, jnp.sign(omega) if material.loss_at_rest else jnp.clip(
        omega * jnp.exp(jnp.minimum(-floor, 0.85 * math.log(largest))), -1.0, 1.0
    )


def far_below(material: Material) -> jax.Array | float:
    """How far below the frequencies of a material it is at rest: there E'' is 1e-9 of E' or less [ln omega].

    A table may begin where E'' is 1e14 of E'.
    """
    if material.loss_beyond != "fall":
        return math.log(1e9)
    storage, loss = material.storage_and_loss(log_range(material)[0])
    excess = jnp.log(jnp.where(loss > storage, loss, 1.0)) - jnp.log(jnp.where(loss > storage, storage, 1.0))
    # Where E(0) = 0 nothing is small beside it.
    return math.log(1e9) + jax.lax.stop_gradient(jnp.clip(excess, 0.0, _MOST_EXCESS))


def log_range(material: Material) -> jax.Array:
    """ln of the lowest and highest frequency of what a modulus without a series does [rad/s], (2,)."""
    ends = material.frequency_range()
    if ends is None:
        raise ValueError(f"{type(material).__name__}: must answer reduced_series or frequency_range")
    return jnp.log(jnp.stack(ends))


def _vary(harmonics):
    """Whether the shares of the harmonics depend on q."""
    return harmonics is not None and harmonics[0].ndim > 1


def constant_shares(harmonics: Harmonics | None) -> tuple[int, Harmonics | None]:
    """How many harmonics; their shares if they are constant. Those of others are kept apart till later."""
    if harmonics is None:
        return 0, None
    return harmonics[0].shape[0], None if _vary(harmonics) else harmonics


def _mixed(shares: jax.Array, means: tuple[jax.Array, ...]) -> jax.Array:
    """The mean with its harmonics, which are the last of the means; the transverse one has no other."""
    first = len(means) - len(shares)
    terms = (share * mean for share, mean in zip(shares, means[first:], strict=True))
    return functools.reduce(operator.add, (*means[:first], *terms))


class Parts(NamedTuple):
    """Of a complex stiffness F."""

    storage: jax.Array  # F'
    loss: jax.Array  # F''
    abs2: jax.Array  # |F|^2


def stiffness_parts(F: Tabulated, storage: jax.Array, loss: jax.Array) -> Parts:
    """`Parts` of F for E' and E'', for a spring that is constant or has their shape."""
    storage, loss = F.scale * storage, F.scale * loss
    power = storage**2 + loss**2
    if F.spring is None:
        return Parts(storage, loss, power)
    # F = f k / (f + k), by parts; a liquid at rest is a spring of k = 0.
    share = F.spring / ((storage + F.spring) ** 2 + loss**2)
    return Parts(share * (F.spring * storage + power), share * F.spring * loss, share * F.spring * power)


class MeanKind(NamedTuple):
    """One of the functions that means are taken of, and of which there is a row or several in a table."""

    name: str
    part: str  # of `Parts`
    weights: int  # which of those of `circle_weights`
    squared: bool = False
    positive: bool = False  # the first of its rows

    @property
    def odd(self) -> bool:
        """Whether it is odd in q v."""
        return self.name in ("mean_cos_loss", "mean_sin_loss")

    def of(self, parts: Parts) -> jax.Array:
        """The function."""
        values = getattr(parts, self.part)
        return values**2 if self.squared else values


def kinds_of(needs: RequiredMeans, split: bool, loss_beyond: str) -> list[MeanKind]:
    """`MeanKind` of everything that is wanted, in the order of `Means`."""
    # Where E' steps up, a spline of <|F|^2> itself would swing below 0.
    squares = [MeanKind("mean_abs2", "abs2", 0, positive=True)]
    if split:
        falls = loss_beyond != "none"
        squares = [
            MeanKind("mean_abs2", "storage", 0, True, True),
            MeanKind("mean_abs2", "loss", 0, True, falls),
        ]
    others = [
        MeanKind("mean_cos_loss", "loss", 1),
        MeanKind("mean_storage", "storage", 0),
        MeanKind("mean_sin_loss", "loss", 2),
    ]
    return [kind for kind in (*squares, *others) if kind.name in needs.kinds]


def _by_node(F, log_qv, needs, split, harmonics):
    """Means at every node by its own integral over the circle; scale and spring of shape () or (nodes,)."""
    count, mix = constant_shares(harmonics)
    s, psi, weight = rule_of_node(F.material)
    kernels = [np.ones((2, psi.size)), *(np.stack(harmonic(m, psi)) for m in range(1, count + 1))]
    even, across = (jnp.asarray(weight * rows, log_qv.dtype) for rows in np.stack(kernels, 1))
    across = across[1:]
    if mix is not None:
        even, across = even[:1] + mix[0] @ even[1:], (mix[1] @ across)[None]
    along = even * jnp.asarray(np.sin(psi), log_qv.dtype)
    moduli = moduli_on_grid(F.material)

    def of_points(log_qv):
        nodes = F._replace(
            scale=F.scale[..., None] if F.scale.ndim else F.scale,
            spring=None if F.spring is None else F.spring[..., None],
        )
        parts = stiffness_parts(
            nodes, *moduli_at(F.material, moduli, log_qv[..., None] - jnp.asarray(s, log_qv.dtype))
        )
        by = even, along, across

        def rows(kind):
            return tuple(jnp.moveaxis(kind.of(parts) @ by[kind.weights].T, -1, 0))

        found: Means = {kind: () for kind in needs.kinds}
        for kind in kinds_of(needs, split, F.material.loss_beyond):
            found[kind.name] += rows(kind)
        return found

    if log_qv.ndim < 2:
        return of_points(log_qv)
    # Row by row, and again for the gradient: all circles at once would take gigabytes.
    return jax.lax.map(jax.checkpoint(of_points), log_qv)


def rule_of_node(material: Material) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`circle_rule` fine enough for a material without a series."""
    return circle_rule(material.detail / _PER_DETAIL_OF_A_NODE)


class Moduli(NamedTuple):
    """Splines over a uniform grid of ln omega through ln E' and ln E'' of a material without a series."""

    first: jax.Array  # the first cell begins at step * first
    ends: jax.Array  # ln omega where the moduli become powers, below and above
    cells: jax.Array


def moduli_on_grid(material: Material) -> Moduli:
    """`Moduli`, for `moduli_at`."""
    step, reach = material.detail / PER_DETAIL, REACH * material.detail
    low, high = log_range(material)
    ends = jax.lax.stop_gradient(jnp.stack([low - reach, high + reach]))
    first = jnp.floor(ends[0] / step) - BEFORE
    count = math.ceil((LONGEST_TABLE + 2 * reach) / step) + 12 + 2 * MARGIN
    logarithms = log_floored(jnp.stack(material.storage_and_loss_on_grid(first, step, count)))
    logarithms = jnp.where(high - low <= LONGEST_TABLE, logarithms, jnp.nan)
    return Moduli(first + MARGIN + BESIDE, ends, splines(logarithms))


def moduli_at(material: Material, moduli: Moduli, log_omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """E' and E'' [Pa] at ln omega, any shape: `material.storage_and_loss` of its `Moduli`, at many points."""
    inside = jnp.clip(log_omega, *moduli.ends)
    storage, loss = jnp.exp(at(moduli.cells, inside * (PER_DETAIL / material.detail) - moduli.first))
    if material.loss_beyond == "fall":
        loss = loss * jnp.exp(-jnp.abs(log_omega - inside))
    elif material.loss_beyond == "none":
        loss = jnp.where(log_omega == inside, loss, 0.0)
    return storage, loss


def log_floored(values: jax.Array) -> jax.Array:
    """Return ln of values >= 0; the floor is for two liquids at rest, where G need only be as good as 0."""
    return jnp.log(jnp.maximum(values, float(jnp.finfo(values.dtype).tiny) ** 0.8))
