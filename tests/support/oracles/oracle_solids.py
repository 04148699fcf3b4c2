"""Solids of the brute force: complex moduli, shifts, and the stiffening by layers and coatings."""

import mpmath as mp
import numpy as np
from scipy.interpolate import PchipInterpolator
from support.oracles.tables import law

BOLTZMANN = 8.617333262e-5  # [eV/K]


class Solid:
    def __init__(self, data, temperature):
        self.kind = data["kind"]
        self.nu = data.get("nu", 0.5)
        self.thickness, self.base = data.get("thickness"), data.get("base", "bonded")
        self.data, self.temperature = data, temperature
        self.a_T = 1.0 if temperature is None else self.shift(temperature)
        # Where a table bends: the borders of panels.
        self.kinks = np.zeros(0)
        if self.kind == "table":
            around = np.exp(data.get("smoothing", 0.1) * np.array([-6.0, -3.0, 0.0, 3.0, 6.0]))
            self.kinks = np.sort(np.outer(data["omega"], around).ravel()) / self.a_T
        self.coating = data.get("coating")
        if self.coating is not None:
            base = self.coating["base"]
            if base["kind"] == "prony" and not base.get("shift"):
                base = {**base, "shift": data.get("shift")}
            self.under = Solid(base, temperature)

    def shift(self, temperature):
        """a_T."""
        shift = self.data.get("shift")
        return shift_factor(shift, temperature) if shift else np.ones(np.shape(temperature))

    def modulus(self, omega, temperature=None):
        """Return E' + i E'' at omega >= 0, for a relaxing shear G' + i G'', at the case's temperature."""
        temperature = self.temperature if temperature is None else temperature
        if temperature is None:
            return self._at_reference(np.asarray(omega, float))
        b_T = vertical_factor(self.data.get("shift"), temperature)
        return b_T * self._at_reference(self.shift(temperature) * np.asarray(omega, float))

    def _at_reference(self, omega):
        if self.kind == "elastic":
            return np.full(omega.shape, self.data["E"], complex)
        if self.kind == "table":
            return table_modulus(self.data, omega)
        names = ("G_inf", "G") if self.kind == "shear" else ("E_inf", "E")
        total = np.full(omega.shape, self.data[names[0]], complex)
        for E, tau in zip(self.data[names[1]], self.data["tau"], strict=True):
            s = 1j * omega * tau
            total += E * (s / (1 + s))
        return total

    def compliance(self, q, omega, factor, soft, temperature=None):
        """M = 2 / (q E_r Sbar); a liquid at rest has an infinite one. soft: f and g of E' and E''."""
        if self.kind == "rigid":
            return np.zeros(np.broadcast_shapes(q.shape, omega.shape), complex)
        E = self.modulus(omega, temperature)
        if self.kind == "shear":  # E_r = 2 G / (1 - nu) with the complex nu
            E = E * 2 / (1 - complex_poisson(E, self.data["bulk"]))
        else:
            E = E / (1 - self.nu**2)
        if self.coating is not None:
            one, two = (s.modulus(omega, temperature) / (2 * (1 + s.nu)) for s in (self, self.under))
            N0, N1, N2, D0, D1, D2 = np.moveaxis(factor, -1, 0)
            top, bottom = (
                (a * one**2 + b * one * two + c * two**2) for a, b, c in ((N0, N1, N2), (D0, D1, D2))
            )
            factor = top / bottom
        elif self.kind != "elastic":
            E = soft[0] * E.real + 1j * soft[1] * E.imag
        with np.errstate(divide="ignore", invalid="ignore"):
            M = 2 / (q * E * factor)
        return np.where(E == 0, np.inf, M)

    def factor(self, q):
        """Sbar(q d) of the slab; of a coating N0, N1, N2, D0, D1, D2 along a last axis."""
        if self.coating is not None:
            x = q * self.coating["thickness"]
            nus = self.nu, self.under.nu
            return np.array([[float(c) for c in coating_coefficients(float(x_i), *nus)] for x_i in x])
        if self.thickness is None or self.kind == "rigid":
            return np.ones(q.shape)
        x = q * self.thickness
        return np.array([float(slab_factor(float(x_i), self.nu, self.base)) for x_i in x])


def complex_poisson(G, bulk):
    """nu of a complex shear and a bulk modulus."""
    return (3 * bulk - 2 * G) / (2 * (3 * bulk + G))


def slab_factor(x, nu, base="bonded", digits=60):
    """Sbar as printed; infinite arguments are cut at x = 1e4."""
    with mp.workdps(digits):
        x, nu = mp.mpf(min(x, 1e4)), mp.mpf(nu)
        if base == "frictionless":
            return mp.coth(x) + x / mp.sinh(x) ** 2
        a = 3 - 4 * nu
        top = 2 * a * mp.sinh(x) ** 2 + 2 * x**2 + 8 * (1 - nu) ** 2
        return top / (a * (mp.sinh(2 * x) - 2 * x) + 4 * (1 - 2 * nu) * x)


def coating_coefficients(x, nu1, nu0, digits=60):
    """e^-2x times N, D of Sbar = (N0 r^2 + N1 r + N2)/(D0 r^2 + D1 r + D2), r = mu1/mu0."""
    with mp.workdps(digits):
        x = mp.mpf(min(x, 1e4))
        a, b = 3 - 4 * mp.mpf(nu1), 3 - 4 * mp.mpf(nu0)
        sinh, cosh, exp = mp.sinh(2 * x), mp.cosh(2 * x), mp.exp(2 * x)
        found = (
            4 * b * (mp.sinh(x) ** 2 - x * x),
            2 * (a + b) * sinh + (a - 1) * (b - 1) * (exp - 1) + 4 * x * x * (b - 1),
            2 * a * cosh + 1 + a * a + 4 * x * x,
            2 * b * (sinh + 2 * x),
            2 * (a + b) * cosh + (a - 1) * (b - 1) * exp - 4 * x * (b - 1),
            2 * (a * (sinh - 2 * x) + 2 * x * (a - 1)),
        )
        return [c / exp for c in found]


def table_modulus(data, omega):
    """ln E' and ln E'' linear in ln omega, averaged with a Gaussian; E'' ~ omega below, 1/omega above."""
    table = [np.log(np.asarray(data[name], float)) for name in ("omega", "storage", "loss")]
    omega = np.asarray(omega, float)
    x = np.log(np.where(omega > 0, omega, 1e-300))
    E1, E2 = law(table, data.get("outside", "fall"), x, data.get("smoothing", 0.1))
    return E1 + 1j * np.where(omega > 0, E2, 0.0)


def shift_factor(shift, T):
    """a_T of a shift law."""
    above = T - shift["T_ref"]
    if shift["kind"] == "wlf":
        return 10 ** (-shift["C1"] * above / (shift["C2"] + above))
    if shift["kind"] == "arrhenius":
        return np.exp(shift["energy"] / BOLTZMANN * (1 / T - 1 / shift["T_ref"]))
    return tabulated_factor(shift["T"], shift["aT"], T, shift["T_ref"])


def tabulated_factor(temperatures, factors, T, T_ref):
    """A factor over that at T_ref."""
    law = interpolated_log(temperatures, factors)
    return np.exp(law(T) - law(T_ref))


def interpolated_log(temperatures, factors):
    """ln of a factor: a monotone cubic through a table and a point on either end's line."""
    temperatures = np.asarray(temperatures, float)
    log, far = np.log(factors), 1e3
    slopes = np.diff(log)[[0, -1]] / np.diff(temperatures)[[0, -1]]
    temperatures = np.concatenate([[temperatures[0] - far], temperatures, [temperatures[-1] + far]])
    log = np.concatenate([[log[0] - far * slopes[0]], log, [log[-1] + far * slopes[1]]])
    return PchipInterpolator(temperatures, log)


def vertical_factor(shift, T):
    """b_T, 1 without."""
    vertical = (shift or {}).get("vertical")
    if not vertical:
        return 1.0
    if vertical["kind"] == "entropic":
        return T / shift["T_ref"] * np.exp(-vertical["expansion"] * (T - shift["T_ref"]))
    return tabulated_factor(vertical["T"], vertical["bT"], T, shift["T_ref"])
