r"""Tabulated moduli: E(omega) between and beyond the entries, and its angular means.

No closed form here. With cos(phi) = sin(psi), psi = (pi/2) e^-y the structure of E at
cos(phi) ~ omega_i / (q v), whatever decade that is in, becomes structure in y, and

.. math:: \langle h\rangle = \frac{2}{\pi}\int_0^\infty h(q v \sin\psi)\,\psi\,dy

is done by Gauss panels in y. For a half-space the means depend on q v alone: they are
tabulated once over ln(q v) and interpolated for every node and velocity.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import gauss
from rubberfric.materials.master_curve import interpolated_modulus
from rubberfric.materials.materials import TabulatedModulus
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.angular_means import Means

# Panels in y; short ones first, where the weight psi is: e^-25 of the circle is left out.
_EDGES = np.array([0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 11.0, 25.0])

# Entries of the table over ln(q v), for one node of the angular integral.
_ENTRIES_PER_NODE = 4


class Tabulated(NamedTuple):
    """F = f k / (f + k) with the tabulated f(omega) = scaled E_r and a spring k (None: rigid)."""

    material: TabulatedModulus
    scale: jax.Array  # f = scale * E [1/Pa], shape () or (nodes,)
    spring: jax.Array | None  # [-], shape () or (nodes,)
    angle: int  # nodes of the angular integral

    @property
    def by_node(self) -> bool:
        """Whether every node has its own."""
        return self.scale.ndim > 0

    def means(
        self, qv: jax.Array, needs: Needs, split: bool = False, harmonics: tuple | None = None
    ) -> Means:
        """Means of F for roughness passing at q v; arguments as `Relaxing.means`."""
        return Means(*tabulated_means(self, qv, needs, self.angle, split, harmonics))


def tabulated_means(F, qv, wanted, angle, split=False, mix=None):
    """(power, dissipation, storage, transverse) of a Tabulated stiffness, as `angular.angular_means`."""
    # Far below the table F is its static value and Im F is linear in q v: the means are
    # taken at the floor and the dissipation scaled, so that v = 0 keeps its derivative.
    floor = jnp.log(F.material.omega[0]) - math.log(1e9)
    tiny = jnp.finfo(qv.dtype).tiny
    log_qv = jnp.maximum(jnp.log(jnp.maximum(jnp.abs(qv), tiny)), floor)
    harmonics = 0 if mix is None else mix[0].shape[0]
    # Shares that depend on q are not those of a table over q v: the harmonics are kept apart till then.
    late, mix = (mix, None) if mix is not None and mix[0].ndim > 1 else (None, mix)
    if F.spring is not None and F.spring.ndim:
        means = _direct(F, log_qv, wanted, angle, split, harmonics, mix)
    else:
        means = _by_table(F, log_qv, wanted, angle, split, harmonics, mix)
    if late is not None:
        means = _mixed(means, *late)
    power, dissipation, storage, transverse = means
    # If E'' does not vanish at v = 0+, only the sign is left.
    sign = jnp.sign(qv) if F.material.outside == "hold" else qv * jnp.exp(-log_qv)
    signed = (None if m is None else tuple(mean * sign for mean in m) for m in (dissipation, transverse))
    dissipation, transverse = signed
    return power, dissipation, storage, transverse


def _mixed(means, cosine, sine):
    """One mean of each kind from its harmonics, the isotropic one first but for the transverse."""
    *even, odd = means
    even = (
        None if m is None else (sum((c * x for c, x in zip(cosine, m[1:], strict=True)), m[0]),) for m in even
    )
    return *even, None if odd is None else (sum(s * x for s, x in zip(sine, odd, strict=True)),)


def _angles(count):
    """psi and its weights in a mean over the circle, host arrays."""
    order = max(2, count // (len(_EDGES) - 1))
    node, weight = gauss(order)
    y = (_EDGES[:-1, None] + np.diff(_EDGES)[:, None] * node).ravel()
    psi = 0.5 * np.pi * np.exp(-y)
    weight = (np.diff(_EDGES)[:, None] * weight).ravel() * psi * (2 / np.pi)
    return psi, weight / weight.sum()


def angular_rule(count, dtype):
    """(cos(phi), weight) of a mean over the directions of sliding, of a function even in cos(phi)."""
    psi, weight = _angles(count)
    return jnp.asarray(np.sin(psi), dtype), jnp.asarray(weight, dtype)


def _direct(F, log_qv, wanted, angle, split, harmonics, mix):
    """Means at every node by its own angular integral; scale and spring of shape () or (nodes,)."""
    psi, weight = _angles(angle)
    m = np.arange(1, harmonics + 1)[:, None]
    # phi = pi/2 - psi: cos 2 m phi = (-1)^m cos 2 m psi, sin 2 m phi = -(-1)^m sin 2 m psi.
    even = np.concatenate([np.ones((1, psi.size)), (-1.0) ** m * np.cos(2 * m * psi)])
    odd = -((-1.0) ** m) * np.sin(2 * m * psi) * np.cos(psi)
    sine = jnp.asarray(np.sin(psi), log_qv.dtype)
    even, odd = (jnp.asarray(weight * rows, log_qv.dtype) for rows in (even, odd))
    if mix is not None:
        even, odd = even[:1] + mix[0] @ even[1:], (mix[1] @ odd)[None]
    storage, loss = interpolated_modulus(F.material, log_qv[..., None] + jnp.log(sine))
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

    def means(name, values, rows):
        return tuple(jnp.moveaxis(values @ rows.T, -1, 0)) if getattr(wanted, name) else None

    return (
        sum((means("power", power, even) for power in powers), ()) if wanted.power else None,
        means("dissipation", loss * sine, even),
        means("storage", storage, even),
        means("transverse", loss, odd),
    )


def _by_table(F, log_qv, wanted, angle, split, harmonics, mix):
    """Means over a uniform grid of ln(q v), cubic between its entries; <|F|^2> in the logarithm.

    Where E' steps up, a cubic of <|F|^2> itself would swing below 0.
    """
    count = _ENTRIES_PER_NODE * angle
    low, high = (jax.lax.stop_gradient(f(log_qv)) for f in (jnp.min, jnp.max))
    step = jnp.maximum(high - low, 1e-3) / (count - 3)
    grid = low + step * (np.arange(count) - 1)
    table = _direct(F, grid, wanted, angle, split, harmonics, mix)
    position = (log_qv - grid[0]) / step
    index = jnp.clip(jnp.floor(jax.lax.stop_gradient(position)).astype(int), 1, count - 3)
    t = position - index
    # Lagrange weights of the entries at -1, 0, 1, 2.
    weights = (
        -t * (t - 1) * (t - 2) / 6,
        (t + 1) * (t - 1) * (t - 2) / 2,
        -(t + 1) * t * (t - 2) / 2,
        (t + 1) * t * (t - 1) / 6,
    )

    def interpolate(values):
        return sum(w * values[index + k - 1] for k, w in enumerate(weights))

    power, *others = table
    if power is not None:
        positive = power if split else power[:1]  # harmonics have any sign
        logarithmic = (jnp.exp(interpolate(log_power(mean))) for mean in positive)
        power = (*logarithmic, *map(interpolate, power[len(positive) :]))
    return power, *(None if means is None else tuple(map(interpolate, means)) for means in others)


def log_power(power):
    """ln <|F|^2>; the floor is for F = 0 (two liquids at rest), where G need only be as good as 0."""
    return jnp.log(jnp.maximum(power, float(jnp.finfo(power.dtype).tiny) ** 0.8))
