r"""Angular means of a solid without a Prony series, by one integral for every node.

The integrals are used if the spring in series or a layer depends on q, or for few q v. They apply the
trapezoidal rule of `rubberfric.theory.stiffness.circle_means`, with E' and E'' from splines over ln omega.
"""

import functools
import math
import operator
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.logarithms import floored_log
from rubberfric.materials.material import Material
from rubberfric.materials.tabulated_modulus import LONGEST_TABLE, REACH
from rubberfric.theory.stiffness.angular_means import Harmonics, Means
from rubberfric.theory.stiffness.circle_means import circle_rule, harmonic
from rubberfric.theory.stiffness.splines import BEFORE, BESIDE, MARGIN, at, splines
from rubberfric.theory.structure import RequiredMeans

# Steps per finest detail of E over ln omega: of the grid, and of the integral of a node.
PER_DETAIL, _PER_DETAIL_OF_A_NODE = 6, 2

# Largest ln E''/E' at the first entry of a table for `far_below`.
_MOST_EXCESS = 40.0


class Tabulated(NamedTuple):
    """Series stiffness F = f k / (f + k) of a scaled modulus f(omega) and a spring k."""

    material: Material  # without a series
    scale: jax.Array  # f = scale * E [1/Pa], shape () or (nodes,)
    spring: jax.Array | None  # [-], shape () or (nodes,); None: rigid

    @property
    def by_node(self) -> bool:
        """Return True if F differs between nodes."""
        return self.scale.ndim > 0

    def means(
        self, qv: jax.Array, needs: RequiredMeans, split: bool = False, harmonics: Harmonics | None = None
    ) -> Means:
        """Return the means of F for roughness that passes with q v; see `PronyStiffness.means`."""
        return means_of_log(
            self.material, qv, harmonics, lambda x: _by_node(self, x, needs, split, harmonics)
        )


def means_of_log(
    material: Material, qv: jax.Array, harmonics: Harmonics | None, means: Callable[[jax.Array], Means]
) -> Means:
    """Return means at q v from a function that computes means at ln |q v|.

    Parameters
    ----------
    material : material of the modulus
    qv : q v a_T [1/s], any shape
    harmonics : as in `PronyStiffness.means`
    means : function of ln |q v|; it returns harmonics that depend on q separately
    """
    log_qv, sign = log_frequency(material, qv)
    return of_direction(means(log_qv), sign, harmonics)


def of_direction(found: Means, sign: jax.Array, harmonics: Harmonics | None) -> Means:
    """Add harmonics that depend on q to the means, and multiply means that are odd in q v by `sign`."""
    if harmonics is not None and _vary(harmonics):
        cosine, sine = harmonics
        found = {
            kind: (_mixed(sine if kind == "mean_sin_loss" else cosine, values),)
            for kind, values in found.items()
        }
    odd = {kind: found[kind] for kind in ("mean_cos_loss", "mean_sin_loss") if kind in found}
    return found | {kind: tuple(x * sign for x in values) for kind, values in odd.items()}


def log_frequency(material: Material, omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return ln |omega| with a lower bound, and a sign factor for functions that are odd in omega.

    The bound lies far below the frequencies of the material. At the bound, E is E(0) and E'' is linear in
    omega, so the derivative at v = 0 is right. If E'' does not vanish at v = 0+, the factor is only the sign.
    """
    floor = log_range(material)[0] - far_below(material)
    largest = float(jnp.finfo(omega.dtype).max)
    log_omega = jnp.maximum(floored_log(jnp.abs(omega)), floor)
    return log_omega, jnp.sign(omega) if material.loss_at_rest else jnp.clip(
        omega * jnp.exp(jnp.minimum(-floor, 0.85 * math.log(largest))), -1.0, 1.0
    )


def far_below(material: Material) -> jax.Array | float:
    """Return the distance in ln omega below the lowest frequency of a material at which E'' < 1e-9 E'.

    At the lowest frequency of a table, E'' may be 1e14 times E'.
    """
    if material.loss_beyond != "fall":
        return math.log(1e9)
    storage, loss = material.storage_and_loss(log_range(material)[0])
    excess = jnp.log(jnp.where(loss > storage, loss, 1.0)) - jnp.log(jnp.where(loss > storage, storage, 1.0))
    # If E(0) = 0, no E'' is small compared with it.
    return math.log(1e9) + jax.lax.stop_gradient(jnp.clip(excess, 0.0, _MOST_EXCESS))


def log_range(material: Material) -> jax.Array:
    """Return ln of the lowest and highest frequencies of a modulus without a series, of shape (2,).

    The frequencies are in rad/s.
    """
    ends = material.frequency_range()
    if ends is None:
        raise ValueError(f"{type(material).__name__} must implement reduced_series or frequency_range")
    return jnp.log(jnp.stack(ends))


def _vary(harmonics):
    return harmonics is not None and harmonics[0].ndim > 1


def constant_shares(harmonics: Harmonics | None) -> tuple[int, Harmonics | None]:
    """Return the number of harmonics, and the shares of the harmonics.

    The shares are None if they depend on q, or if there are no harmonics.
    """
    if harmonics is None:
        return 0, None
    return harmonics[0].shape[0], None if _vary(harmonics) else harmonics


def _mixed(shares: jax.Array, means: tuple[jax.Array, ...]) -> jax.Array:
    """Return a mean plus the sum of its harmonics times their shares.

    The harmonics are the last entries of `means`, as many as there are shares. A transverse mean has only
    harmonics.
    """
    first = len(means) - len(shares)
    terms = (share * mean for share, mean in zip(shares, means[first:], strict=True))
    return functools.reduce(operator.add, (*means[:first], *terms))


class Parts(NamedTuple):
    """Parts of a complex stiffness F."""

    storage: jax.Array  # F'
    loss: jax.Array  # F''
    abs2: jax.Array  # |F|^2


def stiffness_parts(F: Tabulated, storage: jax.Array, loss: jax.Array) -> Parts:
    """Return the `Parts` of F for E' and E''. The spring is a constant, or has the shape of E' and E''."""
    storage, loss = F.scale * storage, F.scale * loss
    power = storage**2 + loss**2
    if F.spring is None:
        return Parts(storage, loss, power)
    # F = f k / (f + k), by parts; a liquid at rest is a spring with k = 0.
    share = F.spring / ((storage + F.spring) ** 2 + loss**2)
    return Parts(share * (F.spring * storage + power), share * F.spring * loss, share * F.spring * power)


class MeanKind(NamedTuple):
    """A function of F whose means over the circle are needed. A table has one or more rows per function."""

    name: str
    part: str  # field of `Parts`
    weights: int  # index into the result of `circle_weights`
    squared: bool = False
    positive: bool = False  # applies to the first row

    @property
    def odd(self) -> bool:
        """Return True if the function is odd in q v."""
        return self.name in ("mean_cos_loss", "mean_sin_loss")

    def of(self, parts: Parts) -> jax.Array:
        """Return the values of the function from the parts of F."""
        values = getattr(parts, self.part)
        return values**2 if self.squared else values


def kinds_of(needs: RequiredMeans, split: bool, loss_beyond: str) -> list[MeanKind]:
    """Return the `MeanKind` of every needed mean, in the order of `Means`."""
    # Where E' has a step, a spline of <|F|^2> itself would become negative.
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
    """Return the means at every node by integrals over the circle.

    The scale and the spring of F have the shape () or (nodes,).
    """
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
    # Row by row, recomputed for the gradient, because all circles at once would take gigabytes.
    return jax.lax.map(jax.checkpoint(of_points), log_qv)


def rule_of_node(material: Material) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a `circle_rule` that is fine enough for a material without a series."""
    return circle_rule(material.detail / _PER_DETAIL_OF_A_NODE)


class Moduli(NamedTuple):
    """Splines of ln E' and ln E'' over a uniform grid of ln omega, for a material without a series."""

    first: jax.Array  # the first cell begins at step * first
    ends: jax.Array  # ln omega where the moduli become powers, below and above
    cells: jax.Array


def moduli_on_grid(material: Material) -> Moduli:
    """Return the `Moduli` of a material."""
    step, reach = material.detail / PER_DETAIL, REACH * material.detail
    low, high = log_range(material)
    ends = jax.lax.stop_gradient(jnp.stack([low - reach, high + reach]))
    first = jnp.floor(ends[0] / step) - BEFORE
    count = math.ceil((LONGEST_TABLE + 2 * reach) / step) + 12 + 2 * MARGIN
    logarithms = log_floored(jnp.stack(material.storage_and_loss_on_grid(first, step, count)))
    logarithms = jnp.where(high - low <= LONGEST_TABLE, logarithms, jnp.nan)
    return Moduli(first + MARGIN + BESIDE, ends, splines(logarithms))


def moduli_at(material: Material, moduli: Moduli, log_omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return E' and E'' [Pa] at ln omega of any shape, evaluated from splines."""
    inside = jnp.clip(log_omega, *moduli.ends)
    storage, loss = jnp.exp(at(moduli.cells, inside * (PER_DETAIL / material.detail) - moduli.first))
    if material.loss_beyond == "fall":
        loss = loss * jnp.exp(-jnp.abs(log_omega - inside))
    elif material.loss_beyond == "none":
        loss = jnp.where(log_omega == inside, loss, 0.0)
    return storage, loss


def log_floored(values: jax.Array) -> jax.Array:
    """Return the logarithm of values >= 0, with a floor.

    Values are 0 if two liquids are at rest, where G is 0.
    """
    return floored_log(values, 0.8)
