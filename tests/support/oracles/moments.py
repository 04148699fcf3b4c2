"""Moments of broken power laws by their definition, in the working precision of mpmath."""

import itertools

import mpmath as mp


def moment_of_plateau(spectrum, order, q):
    """2 pi int q^(1 + order) C dq up to q, for (q0, qr, q1, H) and C = 1 on the plateau."""
    q0, qr, q1, hurst = spectrum
    rise = max(min(q, qr), q0)
    total = (rise ** (order + 2) - q0 ** (order + 2)) / (order + 2)
    if q > qr:
        k = order - 2 * hurst
        width = mp.log(min(q, q1) / qr)
        total += qr ** (order + 2) * (width if k == 0 else mp.expm1(k * width) / k)
    return 2 * mp.pi * total


def self_affine_moment(leaves, order, q):
    """The moment up to q for (q0, qr, q1, H, h_rms)."""
    *spectrum, h_rms = leaves
    return h_rms**2 * moment_of_plateau(spectrum, order, q) / moment_of_plateau(spectrum, 0, spectrum[2])


def table_moment(knots, values, order, q):
    """The moment up to q of a table that is linear in logarithms."""
    total = mp.mpf(0)
    for (a, b), (left, right) in zip(itertools.pairwise(knots), itertools.pairwise(values), strict=True):
        if q > a:
            k = mp.log(right / left) / mp.log(b / a) + 2 + order
            width = mp.log(min(q, b) / a)
            total += 2 * mp.pi * left * a ** (order + 2) * (width if k == 0 else mp.expm1(k * width) / k)
    return total
