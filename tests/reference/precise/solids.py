"""Solids in 120-digit arithmetic: angular means of the stiffness by the poles it has in the complex plane."""

import gmpy2
import numpy as np
from arithmetic import cosh, exp, lesser, sinh, sqrt, true
from gmpy2 import mpfr


def shift_factor(shift, temperature):
    """a_T by the WLF law."""
    if shift is None or temperature is None:
        return mpfr(1)
    above = temperature - shift["T_ref"]
    return gmpy2.exp10(-shift["C1"] * above / (shift["C2"] + above))


def stiffening(solid, q):
    """Sbar(q d) as printed; beyond 1000 it is 1 to 800 digits."""
    if "thickness" not in solid:
        return mpfr(1)
    x, nu = lesser(q * solid["thickness"], mpfr(1000)), solid["nu"]
    if solid.get("base") == "frictionless":
        return cosh(x) / sinh(x) + x / sinh(x) ** 2
    a = 3 - 4 * nu
    top = 2 * a * sinh(x) ** 2 + 2 * x**2 + 8 * (1 - nu) ** 2
    return top / (a * (sinh(2 * x) - 2 * x) + 4 * (1 - 2 * nu) * x)


def rest(solid):
    return solid["E"] if solid["kind"] == "elastic" else solid["E_inf"]


def terms(solid, a_T):
    """Rates, ascending, and moduli: none of zero, equal rates as one."""
    total = {}
    for E, tau in zip(solid["E"], solid["tau"], strict=True):
        if E != 0:
            rate = 1 / (tau * a_T)
            total[rate] = total.get(rate, mpfr(0)) + E
    return sorted(total.items())


def angular_means(rough, other, q, v, temperature):
    """Means over phi of |F|^2, cos phi Im F and Re F: 1/F = 1/(Sbar E_r)_other + 1/(Sbar E_r)_rough(0)."""
    springs = [
        None if body["kind"] == "rigid" else stiffening(body, q) / (1 - body["nu"] ** 2)
        for body in (other, rough)
    ]
    zero = q * 0
    if other["kind"] != "prony" or not any(other["E"]):
        values = [
            rest(body) * spring + zero
            for body, spring in zip((other, rough), springs, strict=True)
            if spring is not None
        ]
        if any(not np.any(value != 0) for value in values):
            return zero, zero, zero
        F = 1 / sum(1 / value for value in values)
        return F**2, zero, F
    factor = springs[0]
    series = terms(other, shift_factor(other.get("shift"), temperature))
    rates, moduli = ([term[i] for term in series] for i in (0, 1))
    f = [E * factor for E in moduli]
    f_rest = other["E_inf"] * factor
    if springs[1] is not None:
        k = rest(rough) * springs[1]
        if not np.any(k != 0):
            return zero, zero, zero
        poles = series_poles(k, f_rest, f, rates)
        slope = [
            sum(f_j * l_j / (l_j - pole) ** 2 for f_j, l_j in zip(f, rates, strict=True)) for pole in poles
        ]
        weights = [k**2 / (pole * s) for pole, s in zip(poles, slope, strict=True)]

        def stiffness(s):
            value = f_rest + sum(f_j * s / (s + l_j) for f_j, l_j in zip(f, rates, strict=True))
            return k * value / (k + value)

    else:
        poles, weights = rates, f

        def stiffness(s):
            return f_rest + sum(f_j * s / (s + l_j) for f_j, l_j in zip(f, rates, strict=True))

    F_rest = stiffness(mpfr(0))
    power, loss, storage = F_rest**2 + zero, zero, F_rest + zero
    qv = q * v
    for pole, weight in zip(poles, weights, strict=True):
        a = qv / pole
        r = sqrt(1 + a * a)
        sine = a / (r * (1 + r))
        one = a * sine  # 1 - 1/r
        power = power + 2 * weight * stiffness(pole) * one
        loss = loss + weight * sine
        storage = storage + weight * one
    return power, loss, storage


_POLES = {}  # the last arguments and poles of every shape: a start for those of a neighbouring case


def forget_poles():
    """Start anew."""
    _POLES.clear()


def series_poles(k, f_rest, f, rates):
    """The rates l where k + f(-l) = 0: one between 0 and the first of f, one between any two neighbours."""
    k, f_rest, *f = np.broadcast_arrays(*(np.array(x, object, ndmin=1) for x in (k, f_rest, *f)))
    below = [mpfr(0), *rates[:-1]]
    key = (len(rates), k.shape)
    given = [k, f_rest, *f, np.array(rates, object)]
    last, starts = _POLES.get(key, (None, None))
    if last is not None and all(map(np.array_equal, given, last)):
        return starts
    poles = None if starts is None else _polish(k, f_rest, f, rates, below, starts)
    if poles is None:
        poles = _polish(k, f_rest, f, rates, below, _bracket(k, f_rest, f, rates, below))
        if poles is None:
            raise ArithmeticError("a pole was not found")
    _POLES[key] = given, poles
    return poles


def _function(k, f_rest, f, rates, pole):
    return k + f_rest - sum(f_j * pole / (l_j - pole) for f_j, l_j in zip(f, rates, strict=True))


def _bracket(k, f_rest, f, rates, below):
    """Bisection in the logarithm of (pole - below) / (above - pole)."""
    poles = []
    for low_rate, rate in zip(below, rates, strict=True):
        low, high = np.full(k.shape, mpfr(-260)), np.full(k.shape, mpfr(260))
        for _ in range(46):
            middle = (low + high) / 2
            share = exp(middle)
            pole = (low_rate + rate * share) / (1 + share)
            positive = true(_function(k, f_rest, f, rates, pole) > 0)
            low, high = np.where(positive, middle, low), np.where(positive, high, middle)
        share = exp((low + high) / 2)
        poles.append((low_rate + rate * share) / (1 + share))
    return poles


def _polish(k, f_rest, f, rates, below, starts):
    """Newton's method for the function times its distances from both rates; None if it gets out."""
    poles = []
    for low_rate, rate, pole in zip(below, rates, starts, strict=True):
        for _ in range(12):
            inside = true(pole > low_rate) & true(pole < rate)
            if not inside.all():
                return None
            value = _function(k, f_rest, f, rates, pole)
            slope = -sum(f_j * l_j / (l_j - pole) ** 2 for f_j, l_j in zip(f, rates, strict=True))
            up, down = pole - low_rate, rate - pole
            step = value / (slope + value * ((1 / up if low_rate else 0) - 1 / down))
            pole = pole - step
            if true(abs(step) < mpfr("1e-85") * lesser(up, down)).all():
                break
        else:
            return None
        inside = true(pole > low_rate) & true(pole < rate)
        if not inside.all():
            return None
        poles.append(pole)
    return poles
