"""Prony series (generalised Maxwell models) of Young's modulus or the shear modulus.

[Ferry, Viscoelastic Properties of Polymers, 3rd edition, Wiley 1980, chapters 1 and 3]
"""

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import (
    NONNEGATIVE,
    PLAUSIBLE_STRESS,
    POSITIVE,
    NumberLike,
    check_lengths,
    check_values,
    is_concrete,
)
from rubberfric.base.objects.fields import Number, Vector, child, leaf
from rubberfric.base.objects.physical import physical
from rubberfric.materials.in_series import in_series
from rubberfric.materials.material import (
    POISSON,
    Material,
    Series,
    plane_strain_factor,
    series_modulus,
)
from rubberfric.materials.shifts import Shift

# Smallest relaxed modulus of rubber in MPa. Smaller numbers are rounding errors of fits and of files whose
# moduli add up to the glassy modulus.
_SOFTEST = 0.01

# Ratio of E_inf to the smallest E above which both have the same unit: series that a fit gives to a melt fall
# over many decades without a gap.
_GAP = 1e-3


@physical
class Prony(Material):
    r"""Viscoelastic solid as a Prony series (generalised Maxwell model).

    .. math:: E(\omega) = E_\infty + \sum_i E_i \frac{i\omega\tau_i}{1 + i\omega\tau_i}

    Parameters
    ----------
    E_inf : relaxed modulus [Pa], >= 0 (0: a liquid)
    E : relaxing moduli [Pa], >= 0, shape (n,), n >= 1
    tau : relaxation times [s], > 0, any order, equal values allowed, shape (n,)
    poisson : Poisson's ratio [-], 0 ... 0.5
    shift : WLF, Arrhenius, TabulatedShift or None
        change with temperature: E(omega, T) = b_T E(a_T omega).

    Examples
    --------
    >>> wlf = rf.WLF(C1=8.86, C2=101.6, T_ref=293.15)
    >>> rubber = rf.Prony(E_inf=1e6, E=[1e7], tau=[1e-3], shift=wlf)
    >>> E = np.asarray(rf.complex_modulus(rubber, 1e3, np.array([293.15, 273.15])))
    >>> (E.imag / E.real).round(4)
    array([0.8333, 0.0061])
    >>> float(rubber.static_modulus())
    1000000.0
    """

    E_inf: Number = leaf(NONNEGATIVE, unit="Pa", plausible=PLAUSIBLE_STRESS, plus="E")
    E: Vector = leaf(NONNEGATIVE, unit="Pa", over="tau")
    tau: Vector = leaf(POSITIVE, unit="s")
    poisson: Number = leaf(POISSON, unit="-", default=0.5)
    shift: Shift | None = child(default=None)

    def _check(self):
        _check_terms("Prony", "E", self.E_inf, self.E, self.tau)

    def doubts(self) -> list[str]:
        """Return a list with a warning if E_inf and E seem to have different units."""
        return _doubts_of_terms("E", self.E_inf, self.E)

    def reduced_series(self, scale: NumberLike) -> Series:
        """Return E_r divided by `scale` [Pa] as a Prony series."""
        unit = plane_strain_factor(self) / scale
        return Series(self.E_inf * unit, self.E * unit, self.tau)

    def relaxation_times(self) -> jax.Array:
        """Return `tau`, the relaxation times [s] of shape (n,)."""
        return self.tau

    def static_modulus(self) -> jax.Array:
        """Return E(omega = 0) [Pa]."""
        return self.E_inf


@physical
class PronyShear(Material):
    r"""Viscoelastic solid with a relaxing shear modulus and an elastic bulk modulus.

    .. math:: G(\omega) = G_\infty + \sum_i G_i \frac{i\omega\tau_i}{1 + i\omega\tau_i},\qquad
              E = \frac{9 B G}{3 B + G},\qquad \nu = \frac{3 B - 2 G}{2 (3 B + G)}

    Poisson's ratio depends on the frequency: 1/2 for G << B, less in the glassy state. The reduced modulus is

    .. math:: E_r = \frac{E}{1 - \nu^2} = G + 3\,\frac{G \cdot 3 B / 4}{G + 3 B / 4}

    Parameters
    ----------
    G_inf : relaxed shear modulus [Pa], >= 0 (0: a liquid)
    G : relaxing shear moduli [Pa], >= 0, shape (n,), n >= 1
    tau : relaxation times of the shear [s], > 0, any order, equal values allowed, shape (n,)
    bulk : bulk modulus B [Pa], > 0
    shift : WLF, Arrhenius, TabulatedShift or None
        change of the relaxation times with temperature: G(omega, T) = G(a_T omega). A vertical shift is not
        allowed, because it does not apply to the bulk modulus of rubber.

    Limits: the body must be a half-space, because the factor of a layer depends on Poisson's ratio.

    Examples
    --------
    >>> rubber = rf.PronyShear(G_inf=0.5e6, G=[300e6], tau=[1e-6], bulk=2e9)
    >>> f"{float(rubber.static_modulus()):.3g}", f"{float(rubber.glassy_reduced()):.4g}"
    ('1.5e+06', '1.052e+09')
    """

    G_inf: Number = leaf(NONNEGATIVE, unit="Pa", plausible=PLAUSIBLE_STRESS, plus="G")
    G: Vector = leaf(NONNEGATIVE, unit="Pa", over="tau")
    tau: Vector = leaf(POSITIVE, unit="s")
    bulk: Number = leaf(POSITIVE, unit="Pa")
    shift: Shift | None = child(default=None)

    def _check(self):
        _check_terms("PronyShear", "G", self.G_inf, self.G, self.tau)
        if self.shift is not None and self.shift.vertical is not None:
            raise ValueError(
                "PronyShear.shift.vertical is given: must be None, because it would not change the bulk "
                "modulus; use Prony"
            )

    def doubts(self) -> list[str]:
        """Return a list with a warning if G_inf and G seem to have different units."""
        return _doubts_of_terms("G", self.G_inf, self.G)

    def relaxation_times(self) -> jax.Array:
        """Return `tau`, the relaxation times [s] of the shear modulus, of shape (n,)."""
        return self.tau

    def modulus(self, omega: jax.Array) -> jax.Array:
        """Return E(omega) [Pa], complex."""
        return _young(series_modulus(Series(self.G_inf, self.G, self.tau), omega), self.bulk)

    def static_modulus(self) -> jax.Array:
        """Return E(omega = 0) [Pa]."""
        return _young(self.G_inf, self.bulk)

    def reduced_modulus(self, omega: jax.Array) -> jax.Array:
        """Return E_r(omega) [Pa], complex."""
        return _reduced(series_modulus(Series(self.G_inf, self.G, self.tau), omega), self.bulk)

    def static_reduced(self) -> jax.Array:
        """Return E_r(omega = 0) [Pa]."""
        return _reduced(self.G_inf, self.bulk)

    def glassy_reduced(self) -> jax.Array:
        """Return E_r(omega = infinity) [Pa]."""
        return _reduced(self.G_inf + jnp.sum(self.G), self.bulk)


def _check_terms(kind, name, rest, weight, tau):
    check_lengths(kind, **{name: weight, "tau": tau})
    if weight.shape[0] < 1:
        raise ValueError(f"{kind}.{name} is empty: give at least 1 term, or use Elastic")
    if is_concrete(rest) and is_concrete(weight):
        rule = (f"must be > 0 if all {name} are 0, otherwise the solid has no stiffness", lambda x: x > 0)
        check_values(f"{kind}.{name}_inf", rest + np.sum(np.asarray(weight)), rule)


def _doubts_of_terms(name, rest, weight):
    rest, weight = float(rest), np.asarray(weight, float)
    largest = float(np.max(weight))
    smallest = np.min(weight, initial=largest, where=weight > 0)
    if _SOFTEST <= rest < min(1e-6 * largest, _GAP * smallest):
        return [
            f"{name}_inf = {rest:g} Pa with {name} up to {largest:g} Pa: must be 0, or more than"
            f" 1e-6 of the largest {name}; is it in MPa? If a fit gave it, replace it by 0"
        ]
    return []


def _young(shear, bulk):
    # Without the product of the two moduli, which may overflow float32.
    return 3 * in_series(shear, 3 * bulk)


def _reduced(shear, bulk):
    return shear + 3 * in_series(shear, 0.75 * bulk)
