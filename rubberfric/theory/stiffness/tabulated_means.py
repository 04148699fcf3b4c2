r"""Moduli without a Prony series, such as a master curve: angular means by quadrature.

No closed form here. With cos(phi) = sin(psi), psi = (pi/2) e^-y the structure of E at
cos(phi) ~ omega_i / (q v), whatever decade that is in, becomes structure in y, and

.. math:: \langle h\rangle = \frac{2}{\pi}\int_0^\infty h(q v \sin\psi)\,\psi\,dy

is done by Gauss panels in y.
"""

import functools
import math
import operator
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import gauss
from rubberfric.materials.material import Material
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.angular_means import Harmonics, Means

# Panels in y; short ones first, where the weight psi is: e^-25 of the circle is left out.
_EDGES = np.array([0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 11.0, 25.0])


class Tabulated(NamedTuple):
    """F = f k / (f + k) with f(omega) the scaled E_r and a spring k, its means taken at every node."""

    material: Material  # without a series
    scale: jax.Array  # f = scale * E [1/Pa], shape () or (nodes,)
    spring: jax.Array | None  # [-], shape () or (nodes,); None: rigid
    angle: int  # nodes of the angular integral

    @property
    def by_node(self) -> bool:
        """Whether every node has its own."""
        return self.scale.ndim > 0

    def means(
        self, qv: jax.Array, needs: Needs, split: bool = False, harmonics: Harmonics | None = None
    ) -> Means:
        """Means of F for roughness passing at q v; arguments as `Relaxing.means`."""
        return means_of_log(
            self.material, qv, harmonics, lambda x: angular_integrals(self, x, needs, split, harmonics)
        )


def means_of_log(
    material: Material, qv: jax.Array, harmonics: Harmonics | None, means: Callable[[jax.Array], Means]
) -> Means:
    """Means at q v from those at ln |q v|, which have harmonics that vary with q one by one.

    Parameters
    ----------
    material : whose modulus it is
    qv : q v a_T [1/s], any shape
    harmonics : as of `Relaxing.means`
    means : function of ln |q v|
    """
    log_qv, sign = held_below(material, qv)
    found = means(log_qv)
    if harmonics is not None and _vary(harmonics):
        cosine, sine = harmonics
        found = {
            kind: (_mixed(sine if kind == "transverse" else cosine, values),)
            for kind, values in found.items()
        }
    odd = {kind: found[kind] for kind in ("dissipation", "transverse") if kind in found}
    return found | {kind: tuple(x * sign for x in values) for kind, values in odd.items()}


def held_below(material: Material, omega: jax.Array) -> tuple[jax.Array, jax.Array]:
    """ln |omega|, held far below the frequencies of a material, and the factor of what is odd in omega.

    Far below, E is E(0) and E'' linear in omega: so v = 0 keeps its derivative. If E'' does not vanish at
    v = 0+, only the sign is left.
    """
    floor = jnp.log(ends_of(material)[0]) - math.log(1e9)
    tiny = float(jnp.finfo(omega.dtype).tiny)
    log_omega = jnp.maximum(jnp.log(jnp.maximum(jnp.abs(omega), tiny)), floor)
    return log_omega, jnp.sign(omega) if material.loss_at_rest else omega * jnp.exp(-log_omega)


def ends_of(material: Material) -> tuple[jax.Array, jax.Array]:
    """Lowest and highest frequency of what a modulus without a series does [rad/s]."""
    ends = material.frequency_range()
    if ends is None:
        raise ValueError(f"{type(material).__name__}: must answer reduced_series or frequency_range")
    return ends


def angular_rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Psi and its weights in a mean over the circle of a function even in cos(phi); about `count` nodes."""
    order = max(2, count // (len(_EDGES) - 1))
    node, weight = gauss(order)
    y = (_EDGES[:-1, None] + np.diff(_EDGES)[:, None] * node).ravel()
    psi = 0.5 * np.pi * np.exp(-y)
    weight = (np.diff(_EDGES)[:, None] * weight).ravel() * psi * (2 / np.pi)
    return psi, weight / weight.sum()


def angular_integrals(
    F: Tabulated, log_qv: jax.Array, needs: Needs, split: bool, harmonics: Harmonics | None
) -> Means:
    """Means at ln |q v| by an angular integral each, those of harmonics that vary one by one."""
    psi, weight = angular_rule(F.angle)
    m = np.arange(1, 1 + (0 if harmonics is None else harmonics[0].shape[0]))[:, None]
    # phi = pi/2 - psi: cos 2 m phi = (-1)^m cos 2 m psi, sin 2 m phi = -(-1)^m sin 2 m psi.
    even = np.concatenate([np.ones((1, psi.size)), (-1.0) ** m * np.cos(2 * m * psi)])
    odd = -((-1.0) ** m) * np.sin(2 * m * psi) * np.cos(psi)
    sine = jnp.asarray(np.sin(psi), log_qv.dtype)
    even, odd = (jnp.asarray(weight * rows, log_qv.dtype) for rows in (even, odd))
    if harmonics is not None and not _vary(harmonics):
        even, odd = even[:1] + harmonics[0] @ even[1:], (harmonics[1] @ odd)[None]
    storage, loss = F.material.storage_and_loss(log_qv[..., None] + jnp.log(sine))
    scale = F.scale[..., None] if F.scale.ndim else F.scale
    storage, loss = scale * storage, scale * loss
    power = storage**2 + loss**2
    if F.spring is not None:
        # F = f k / (f + k), by parts; a liquid at rest is a spring of k = 0.
        spring = F.spring[..., None]
        share = spring / ((storage + spring) ** 2 + loss**2)
        storage = share * (spring * storage + power)
        power, loss = share * spring * power, share * spring * loss
    powers = (storage**2, loss**2) if split else (power,)

    def means(values, rows):
        return tuple(jnp.moveaxis(values @ rows.T, -1, 0))

    found = {}
    if needs.power:
        found["power"] = sum((means(power, even) for power in powers), ())
    if needs.dissipation:
        found["dissipation"] = means(loss * sine, even)
    if needs.storage:
        found["storage"] = means(storage, even)
    if needs.transverse:
        found["transverse"] = means(loss, odd)
    return found


def log_power(power: jax.Array) -> jax.Array:
    """ln <|F|^2>; the floor is for F = 0 (two liquids at rest), where G need only be as good as 0."""
    return jnp.log(jnp.maximum(power, float(jnp.finfo(power.dtype).tiny) ** 0.8))


def _vary(harmonics):
    """Whether the shares of the harmonics depend on q."""
    return harmonics is not None and harmonics[0].ndim > 1


def _mixed(shares: jax.Array, means: tuple[jax.Array, ...]) -> jax.Array:
    """The mean with its harmonics, which are the last of the means; the transverse one has no other."""
    first = len(means) - len(shares)
    terms = (share * mean for share, mean in zip(shares, means[first:], strict=True))
    return functools.reduce(operator.add, (*means[:first], *terms))
