r"""Boundary elements of an elastic half-space that attracts a rigid rough surface: test code, no theory.

Gaps g >= 0 that make least

.. math:: \sum_q \tfrac12 K |g_q + h_q|^2 + p\,\bar g - \Big\langle\Delta\gamma\,e^{-g/r}\Big\rangle,\qquad
          K = \tfrac12 q E_r

by Douglas and Rachford's splitting with Anderson's steps: a division in Fourier space and Newton's method
point by point. Of several minima the one next to a distant start.
"""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np

_HISTORY = 8


@functools.partial(jax.jit, static_argnames=("most_steps",))
def _minimise(heights, length, modulus, pressure, work, reach, weight, tolerance, most_steps):
    n, unit = heights.shape[0], 2 * np.pi / length
    q = jnp.hypot(unit * np.fft.fftfreq(n, 1 / n)[:, None], unit * np.arange(n // 2 + 1))
    K, modes = 0.5 * modulus * q, jnp.fft.rfft2(heights)

    def elastic(z):
        found = jnp.fft.rfft2(z)
        mean = found[0, 0] - pressure / weight * z.size
        return jnp.fft.irfft2(((weight * found - K * modes) / (K + weight)).at[0, 0].set(mean), s=z.shape)

    def adhesive(a):
        g = jnp.maximum(a, 0.0)
        for _ in range(6):
            pull = work / reach * jnp.exp(-g / reach)
            slope = jnp.maximum(weight - pull / reach, 0.1 * weight)
            g = jnp.maximum(g - (weight * (g - a) + pull) / slope, 0.0)
        return g

    def change_at(z):
        x = elastic(z)
        gap = adhesive(2 * x - z)
        return gap - x, gap

    def advance(progress):
        k, z, change, _, steps, changes, products, residual, least = progress
        regular = jnp.diag(1e-10 * jnp.trace(products) + (jnp.diag(products) == 0))
        shares = jnp.linalg.solve(products + regular, jnp.einsum("mxy,xy->m", changes, change))
        step = change - jnp.einsum("m,mxy->xy", shares, steps + changes)
        new, gap = change_at(z + step)
        residual = jnp.sqrt(jnp.mean(new**2))
        place, kept = k % _HISTORY, residual < 30 * least
        changes = changes.at[place].set(new - change)
        row = jnp.einsum("mxy,xy->m", changes, changes[place])
        products = products.at[place].set(row).at[:, place].set(row)
        steps = steps.at[place].set(step)
        kept_ones = (jnp.where(kept, x, 0.0) for x in (steps, changes, products))
        return k + 1, z + step, new, gap, *kept_ones, residual, jnp.minimum(residual, least)

    start = jnp.full_like(heights, 2 * jnp.std(heights))
    change, gap = change_at(start)
    residual = jnp.sqrt(jnp.mean(change**2))
    empty, products = jnp.zeros((_HISTORY, n, n)), jnp.zeros((_HISTORY, _HISTORY))
    goal = tolerance * jnp.std(heights)
    first = 0, start, change, gap, empty, empty, products, residual, residual
    last = jax.lax.while_loop(lambda p: (p[0] < most_steps) & (p[-2] > goal), advance, first)
    return last[3], last[-2] <= goal


def adhesive_contact(heights, length, modulus, pressure, work=0.0, reach=1.0, most_steps=4000):
    """Share of the area in contact, gaps, and whether they were found.

    heights : (n, n) of a period, of the given length; modulus : E_r; work, reach : of p_a = work/r exp(-u/r)
    """
    slope, curvature = slopes_of(heights, length)
    weight = max(0.25 * modulus * curvature / slope, 1.3 * work / reach**2)
    gap, found = _minimise(heights, length, modulus, pressure, work, reach, weight, 1e-6, most_steps)
    gap = np.asarray(gap)
    touching = gap == 0
    border = sum(np.sum(touching != np.roll(touching, 1, axis)) for axis in (0, 1))
    # Half a pixel of border is too much, as in `rubberfric.analysis.elements.sliding`.
    area = np.mean(touching) - (math.pi - 1 + math.log(2)) / 24 * border / touching.size
    return float(area), gap, bool(found)


def slopes_of(heights, length):
    """Root mean squares of slope and curvature."""
    n = heights.shape[0]
    q = 2 * np.pi / length * np.fft.fftfreq(n, 1 / n)
    square = q[:, None] ** 2 + q**2
    power = np.abs(np.fft.fft2(heights) / n**2) ** 2
    return math.sqrt(np.sum(square * power)), math.sqrt(np.sum(square**2 * power))
