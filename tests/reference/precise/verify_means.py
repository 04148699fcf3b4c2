"""Holds the angular means of `solids.py` against quadrature over the angle.

    python tests/reference/precise/verify_means.py

Both in 30 digits.
"""

import mpmath as mp
import numpy as np
from gmpy2 import mpfr
from make_extremes import exact
from solids import angular_means


def main():
    """Angular means by their poles against quadrature over the angle; raises if 30 digits do not agree."""
    mp.mp.dps = 50
    random = np.random.default_rng(1)
    worst = mp.mpf(0)
    for number in range(8):
        tau = np.sort(10.0 ** random.uniform(-9, 2, 3))
        prony = {
            "kind": "prony",
            "E_inf": float(10.0 ** random.uniform(4, 7)) * (number != 3),
            "E": [float(x) for x in 10.0 ** random.uniform(5, 9, 3)],
            "tau": [float(x) for x in tau],
            "nu": float(random.uniform(0, 0.5)),
        }
        if number == 5:
            prony["tau"][1] = prony["tau"][0]
        if number % 2:
            prony |= {"thickness": float(10.0 ** random.uniform(-7, -2))}
        rough = (
            {"kind": "rigid"},
            {"kind": "elastic", "E": 10.0 ** random.uniform(3, 10), "nu": 0.3},
            {"kind": "elastic", "E": 10.0 ** random.uniform(3, 10), "nu": 0.1, "thickness": 1e-5},
        )[number % 3]
        q, v = 10.0 ** random.uniform(2, 6), 10.0 ** random.uniform(-6, 3)
        found = angular_means(exact(rough), exact(prony), np.array([mpfr(q)], object), mpfr(v), None)
        for one, other in zip(found, _by_angle(rough, prony, q, v), strict=True):
            worst = max(worst, abs(mp.mpf(str(one[0])) / other - 1))
    print("angular means against quadrature over the angle: worst relative difference", mp.nstr(worst, 2))
    if worst > mp.mpf("1e-30"):
        raise ArithmeticError("angular means are wrong")


def _by_angle(rough, other, q, v):
    """The three means from the complex modulus at every angle, cos phi = sin((pi/2) e^-y)."""
    q, v = mp.mpf(q), mp.mpf(v)

    def reduced(body, omega):
        if body["kind"] == "elastic":
            E = mp.mpc(body["E"])
        else:
            s = 1j * omega
            E = mp.mpf(body["E_inf"]) + sum(
                mp.mpf(E) * s * mp.mpf(tau) / (1 + s * mp.mpf(tau))
                for E, tau in zip(body["E"], body["tau"], strict=True)
            )
        nu = mp.mpf(body["nu"])
        factor = mp.mpf(1)
        if "thickness" in body:
            x, a = q * mp.mpf(body["thickness"]), 3 - 4 * nu
            with mp.workdps(100):
                top = 2 * a * mp.sinh(x) ** 2 + 2 * x**2 + 8 * (1 - nu) ** 2
                factor = top / (a * (mp.sinh(2 * x) - 2 * x) + 4 * (1 - 2 * nu) * x)
        return E * factor / (1 - nu**2)

    def F(cosine):
        compliance = 1 / reduced(other, q * v * cosine)
        if rough["kind"] != "rigid":
            compliance += 1 / reduced(rough, mp.mpf(0))
        return 1 / compliance

    def mean(of):
        def integrand(y):
            psi = mp.pi / 2 * mp.exp(-y)
            return psi * of(mp.sin(psi))

        return 2 / mp.pi * mp.quad(integrand, mp.linspace(0, 80, 161), method="gauss-legendre", maxdegree=5)

    return (
        mean(lambda c: abs(F(c)) ** 2),
        mean(lambda c: c * mp.im(F(c))),
        mean(lambda c: mp.re(F(c))),
    )


if __name__ == "__main__":
    main()
