r"""Boundary elements of an elastic half-space that attracts a rigid rough surface: test code, no theory.

The gaps g >= 0 minimise the energy

.. math:: \sum_q \tfrac12 K |g_q + h_q|^2 + p\,\bar g - \Big\langle\Delta\gamma\,e^{-g/r}\Big\rangle,\qquad
          K = \tfrac12 q E_r

Conjugate gradients of the points out of contact find the minimum, after Polonsky and Keer [Wear 231, 206
(1999)]. The step is halved until the energy falls. The result is the minimum below the start.
"""

import math

import numpy as np
import scipy.fft


def adhesive_contact(
    heights,
    length,
    modulus,
    pressure,
    work=0.0,
    reach=1.0,
    *,
    together=False,
    tolerance=1e-4,
    most_steps=6000,
):
    """Share of the area in contact, gaps, and whether they were found.

    heights : (n, n) of a period, of the given length; modulus : E_r; work, reach : of p_a = work/r exp(-u/r);
    together : start from full contact, not apart; tolerance : residual stresses over stresses of the solids
    """
    heights = np.asarray(heights)
    K = 0.5 * modulus * _wavevectors(len(heights), length)

    def elastic(x):
        return scipy.fft.irfft2(K * scipy.fft.rfft2(x), s=x.shape)

    def energy(gap, stress):
        stored = 0.5 * np.mean((gap + heights) * stress)
        return stored + pressure * gap.mean() - work * np.mean(np.exp(-gap / reach))

    gap = np.zeros_like(heights) if together else heights.max() - heights
    stress = elastic(gap + heights)
    least, direction, before, found = energy(gap, stress), np.zeros_like(gap), None, False
    for _ in range(most_steps):
        pull = work / reach * np.exp(-gap / reach)
        force = -(stress + pressure + pull)
        force = np.where((gap > 0) | (force > 0), force, 0.0)
        square = _dot(force, force)
        found = math.sqrt(square) <= tolerance * max(math.sqrt(_dot(stress, stress)), pressure * len(heights))
        if found:
            break
        share = 0.0 if before is None else max(0.0, square - _dot(force, before)) / _dot(before, before)
        direction = np.where(force != 0, force + share * direction, 0.0)
        if _dot(force, direction) <= 0:
            direction = force
        turned = elastic(direction)
        stiff = _dot(direction, turned)
        soft = _dot(direction * pull, direction) / reach
        # Along it the energy may be no parabola with a minimum.
        step = _dot(force, direction) / (stiff - soft if soft < 0.9 * stiff else stiff)
        for _ in range(40):
            moved = gap + step * direction
            touching = moved < 0
            if touching.any():
                moved = np.where(touching, 0.0, moved)
                new = elastic(moved + heights)
            else:
                new = stress + step * turned
            now = energy(moved, new)
            if now <= least + 1e-13 * abs(least):
                break
            step *= 0.5
        gap, stress, least, before = moved, new, now, force
        direction = np.where(touching, 0.0, direction)
    return _area(gap == 0), gap, bool(found)


def energy_of(gap, heights, length, modulus):
    """Elastic energy over the area."""
    displacement = gap + np.asarray(heights)
    moved = scipy.fft.fft2(displacement) / displacement.size
    q = _wavevectors(len(displacement), length, whole=True)
    return float(np.sum(0.25 * modulus * q * np.abs(moved) ** 2))


def slopes_of(heights, length):
    """Root mean squares of slope and curvature."""
    square = _wavevectors(len(heights), length, whole=True) ** 2
    power = np.abs(scipy.fft.fft2(np.asarray(heights)) / np.size(heights)) ** 2
    return math.sqrt(np.sum(square * power)), math.sqrt(np.sum(square**2 * power))


def _dot(one, two):
    """No BLAS threads, which wait for each other if processes share the cores."""
    return float(np.sum(one * two))


def _wavevectors(n, length, whole=False):
    q = 2 * np.pi / length * np.fft.fftfreq(n, 1 / n)
    return np.hypot(q[:, None], q if whole else abs(q[: n // 2 + 1]))


def _area(touching):
    """Half a pixel of border is too much, as in `rubberfric.analysis.boundary_elements`."""
    border = sum(np.sum(touching != np.roll(touching, 1, axis)) for axis in (0, 1))
    return float(np.mean(touching) - (math.pi - 1 + math.log(2)) / 24 * border / touching.size)
