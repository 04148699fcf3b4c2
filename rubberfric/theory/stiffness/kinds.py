"""Functions of the complex stiffness F whose means over the direction of sliding are needed."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.logarithms import floored_log
from rubberfric.theory.structure import RequiredMeans


class MeanKind(NamedTuple):
    """A function of F whose means over the circle are needed, with one or more rows for harmonics."""

    name: str
    part: str  # "abs2", "storage" or "loss"
    weights: int  # index into the results of `circle_weights`
    squared: bool = False
    positive: bool = False  # applies to the first row

    @property
    def odd(self) -> bool:
        """Return True if the function is odd in q v."""
        return self.name in ("mean_cos_loss", "mean_sin_loss")

    def of(self, F: jax.Array) -> jax.Array:
        """Return the values of the function from F, which is complex."""
        storage, loss = jnp.real(F), jnp.imag(F)
        values = {"storage": storage, "loss": loss}.get(self.part)
        if values is None:
            return storage**2 + loss**2
        return values**2 if self.squared else values


def kinds_of(needs: RequiredMeans, split: bool, loss_beyond: str) -> list[MeanKind]:
    """Return the `MeanKind` of every needed mean, in the order of `Means`.

    `split` is True if <F'^2> and <F''^2> are needed separately.
    """
    # Where E' has a step, an interpolant of <|F|^2> itself would become negative.
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


class Passing(NamedTuple):
    """Speed at which roughness passes the solid that it strains."""

    log_speed: jax.Array  # ln(|v| a_T), at least `least`
    sign: jax.Array  # factor of means that are odd in v


def passing(
    velocity: jax.Array, log_shift: jax.Array | None, least: jax.Array, loss_at_rest: bool
) -> Passing:
    """Return the `Passing` of a velocity.

    Parameters
    ----------
    velocity : [m/s]
    log_shift : ln a_T, with the shape of the velocity or more axes; None: 0
    least : value of ln(|v| a_T) below which E is E(0) and E'' is linear in omega at every wavevector. The
        derivative at v = 0 is therefore right.
    loss_at_rest : E'' does not vanish at v = 0+, so the factor is only the sign
    """
    log_speed = floored_log(jnp.abs(velocity))
    shifted = log_speed if log_shift is None else log_speed + log_shift
    sign = jnp.sign(velocity)
    if not loss_at_rest:
        log_factor = -least if log_shift is None else log_shift - least
        log_factor = jnp.minimum(log_factor, 0.85 * math.log(float(jnp.finfo(velocity.dtype).max)))
        sign = jnp.clip(velocity * jnp.exp(log_factor), -1.0, 1.0)
    return Passing(jnp.maximum(shifted, least), sign)
