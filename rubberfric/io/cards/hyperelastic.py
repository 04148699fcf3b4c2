r"""Shear and bulk modulus of hyperelastic cards at small strain.

The strain energies are written with the invariants of the deviatoric deformation and D_1 of the volume,

.. math:: \mu_0 = 2\left(\frac{\partial U}{\partial I_1} + \frac{\partial U}{\partial I_2}\right),\qquad
          B_0 = \frac{2}{D_1}

at zero strain: 2 (C_10 + C_01) of polynomials, the sum of mu_i of Ogden's energy in Abaqus, and half the sum
of mu_i alpha_i in ANSYS and LS-DYNA. D_1 = 0 is an incompressible solid. [Abaqus Materials Guide,
Hyperelastic behavior of rubberlike materials; ANSYS Material Reference, Hyperelasticity]
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from rubberfric.io.cards.contents import Elastic
from rubberfric.io.cards.text import need


class Energy(NamedTuple):
    """Strain energy: the number of its coefficients and of its D_i, and the shear modulus at small strain."""

    coefficients: int
    volumes: int
    shear: Callable[[Sequence[float]], float]

    def elastic(self, values: Sequence[float], temperature: float | None, where: str) -> Elastic:
        """Return the moduli for the coefficients and D_i in `values`, or raise ValueError."""
        shear, D = self.shear(values), [*values, 0.0][self.coefficients]
        need(shear > 0, f"{where}: shear modulus {shear:g} at small strain: must be > 0")
        need(D >= 0, f"{where}: D1 = {D:g}: must be >= 0")
        bulk = 2 / D if D > 0 else 0.0
        poisson = (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)) if D > 0 else 0.5
        need(poisson > -1, f"{where}: D1 = {D:g}: must be smaller")
        return Elastic(shear, poisson, temperature)


def polynomial(n: int, volumes: int | None = None) -> Energy:
    """Return the polynomial in I_1 and I_2 of order n, with C_10 and C_01 as the first coefficients."""
    return Energy(n * (n + 3) // 2, n if volumes is None else volumes, lambda c: 2 * (c[0] + c[1]))


def reduced_polynomial(n: int) -> Energy:
    """Return the polynomial in I_1 of order n, with C_10 as the first coefficient."""
    return Energy(n, n, lambda c: 2 * c[0])


def mooney(coefficients: int) -> Energy:
    """Return the Mooney-Rivlin energy of ANSYS with 2, 3, 5 or 9 coefficients and one volume term."""
    return Energy(coefficients, 1, lambda c: 2 * (c[0] + c[1]))


def ogden(n: int, *, halved: bool) -> Energy:
    """Return Ogden's energy of pairs mu_i and alpha_i.

    If `halved` is True, mu_0 is half the sum of mu_i alpha_i, otherwise the sum of mu_i.
    """

    def shear(c):
        return ogden_shear(c[0 : 2 * n : 2], c[1 : 2 * n : 2]) if halved else sum(c[0 : 2 * n : 2])

    return Energy(2 * n, n, shear)


def ogden_shear(mu: Sequence[float], alpha: Sequence[float]) -> float:
    """Return the shear modulus of Ogden's energy, half the sum of mu_i alpha_i."""
    return 0.5 * sum(m * a for m, a in zip(mu, alpha, strict=True))


def _chains(c):
    """Return the shear modulus of the eight-chain model with 5 terms for mu and the limiting stretch."""
    series = (1, 3 / 5, 99 / 175, 513 / 875, 42039 / 67375)
    need(c[1] > 0, f"limiting stretch {c[1]:g}: must be > 0")
    return c[0] * sum(a * c[1] ** (-2 * i) for i, a in enumerate(series))


SHEAR_AND_D = Energy(1, 1, lambda c: c[0])  # neo-Hookean with the shear modulus itself
ARRUDA_BOYCE = Energy(2, 1, _chains)  # with mu and the limiting stretch
VAN_DER_WAALS = Energy(4, 1, lambda c: c[0])  # with the shear modulus first
GENT = Energy(2, 1, lambda c: c[0])  # with the shear modulus first
