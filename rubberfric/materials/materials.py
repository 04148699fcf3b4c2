"""Materials: the complex Young's modulus E(omega) = E' + i E'' with E'' > 0 for omega > 0.

Contact mechanics uses the reduced modulus E_r = E / (1 - poisson^2).
"""

import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import (
    NONNEGATIVE,
    POSITIVE,
    as_leaf,
    between,
    check_increasing,
    check_lengths,
    check_values,
    is_concrete,
)
from rubberfric.base.objects import child, leaf, physical, static
from rubberfric.materials.master_curve import interpolated_modulus
from rubberfric.materials.series.prony_and_spring import in_series

POISSON = between(0.0, 0.5)
SHIFTS = ("WLF", "Arrhenius", "TabulatedShift")


@physical
class Rigid:
    """A solid that does not deform: compliance M = 0, and nothing of it is traced."""


@physical
class Elastic:
    """Elastic solid, E(omega) = young.

    Parameters
    ----------
    young : Young's modulus [Pa], > 0
    poisson : Poisson's ratio [-], 0 ... 0.5
    """

    young: float = leaf(POSITIVE)
    poisson: float = leaf(POISSON)


@physical
class Prony:
    r"""Viscoelastic solid as a Prony series (generalised Maxwell model).

    .. math:: E(\omega) = E_\infty + \sum_i E_i \frac{i\omega\tau_i}{1 + i\omega\tau_i}

    Parameters
    ----------
    E_inf : relaxed modulus [Pa], >= 0 (0: a liquid)
    E : relaxing moduli [Pa], >= 0, shape (n,), n >= 1
    tau : relaxation times [s], > 0, any order, equal ones allowed, shape (n,)
    poisson : Poisson's ratio [-], 0 ... 0.5
    shift : WLF, Arrhenius, TabulatedShift or None
        how the relaxation times move with temperature: E(omega, T) = E(a_T omega).
    """

    E_inf: float = leaf(NONNEGATIVE)
    E: object = leaf(NONNEGATIVE, ndim=1)
    tau: object = leaf(POSITIVE, ndim=1)
    poisson: float = leaf(POISSON, default=0.5)
    shift: object = child(SHIFTS, default=None)

    def _check(self):
        check_lengths("Prony", E=self.E, tau=self.tau)
        if self.E.shape[0] < 1:
            raise ValueError("Prony.E is empty: must have at least 1 term (use Elastic for none)")
        if is_concrete(self.E_inf) and is_concrete(self.E):
            rule = ("with all E = 0 the solid has no stiffness; must be > 0 then", lambda x: x > 0)
            check_values("Prony.E_inf", self.E_inf + jnp.sum(self.E), rule)


@physical
class PronyShear:
    r"""Viscoelastic solid whose shear relaxes while its compression is elastic.

    .. math:: G(\omega) = G_\infty + \sum_i G_i \frac{i\omega\tau_i}{1 + i\omega\tau_i},\qquad
              E = \frac{9 B G}{3 B + G},\qquad \nu = \frac{3 B - 2 G}{2 (3 B + G)}

    So Poisson's ratio follows the frequency: 1/2 where G << B, less where the solid is glassy. The
    reduced modulus is a Prony series of twice the terms,

    .. math:: E_r = \frac{E}{1 - \nu^2} = G + \frac{3}{4} \frac{3 B \cdot 4 G}{3 B + 4 G}

    Parameters
    ----------
    G_inf : relaxed shear modulus [Pa], >= 0 (0: a liquid)
    G : relaxing shear moduli [Pa], >= 0, shape (n,), n >= 1
    tau : relaxation times of the shear [s], > 0, any order, equal ones allowed, shape (n,)
    bulk : bulk modulus B [Pa], > 0
    shift : WLF, Arrhenius, TabulatedShift or None
        how the relaxation times move with temperature: G(omega, T) = G(a_T omega).

    Limits: half-spaces only, for the factor of a layer depends on Poisson's ratio.
    """

    G_inf: float = leaf(NONNEGATIVE)
    G: object = leaf(NONNEGATIVE, ndim=1)
    tau: object = leaf(POSITIVE, ndim=1)
    bulk: float = leaf(POSITIVE)
    shift: object = child(SHIFTS, default=None)

    def _check(self):
        check_lengths("PronyShear", G=self.G, tau=self.tau)
        if self.G.shape[0] < 1:
            raise ValueError("PronyShear.G is empty: must have at least 1 term (use Elastic for none)")
        if is_concrete(self.G_inf) and is_concrete(self.G):
            rule = ("with all G = 0 the solid has no stiffness; must be > 0 then", lambda x: x > 0)
            check_values("PronyShear.G_inf", self.G_inf + jnp.sum(self.G), rule)


@physical
class TabulatedModulus:
    r"""Viscoelastic solid from a master curve.

    Between the entries ln E' and ln E'' are linear in ln omega. Below the table E'
    holds its first value, which is E(0) and sets every static term, and E'' falls like
    omega; above it E' holds its last value and E'' falls like 1/omega.

    Parameters
    ----------
    omega : angular frequencies, strictly increasing [rad/s], shape (n,), n >= 2
    storage, loss : E' and E'' [Pa], > 0, shape (n,)
    poisson : Poisson's ratio [-], 0 ... 0.5
    shift : WLF, Arrhenius, TabulatedShift or None
    outside : "fall", "hold" or "none" (static)
        E'' outside the table. "fall": as above. "hold": its end values, as some programs
        have it; then the friction does not vanish at v = 0+. "none": zero, which shows
        how much of the friction comes from outside the table.

    Limits: the angular integrals are done by quadrature (no closed form), which is slower,
    and the kinks at the entries leave errors of 1e-5 ... 1e-3 (a smooth ... a noisy
    table); `Quadrature.angle` lowers them.
    """

    omega: object = leaf(POSITIVE, ndim=1)
    storage: object = leaf(POSITIVE, ndim=1)
    loss: object = leaf(POSITIVE, ndim=1)
    poisson: float = leaf(POISSON, default=0.5)
    shift: object = child(SHIFTS, default=None)
    outside: str = static(("fall", "hold", "none"), default="fall")

    def _check(self):
        check_lengths("TabulatedModulus", omega=self.omega, storage=self.storage, loss=self.loss)
        if self.omega.shape[0] < 2:
            raise ValueError(
                f"TabulatedModulus.omega has {self.omega.shape[0]} entries: must have at least 2"
            )
        check_increasing("TabulatedModulus.omega", self.omega)


VISCOELASTIC = (Prony, PronyShear, TabulatedModulus)


def static_modulus(material):
    """E(omega = 0) [Pa], real."""
    if isinstance(material, Elastic):
        return material.young
    if isinstance(material, Prony):
        return material.E_inf
    if isinstance(material, PronyShear):
        return _young(material.G_inf, material.bulk)
    return material.storage[0]


def _young(shear, bulk):
    """E of shear and bulk modulus; no product of the two, which float32 may not hold."""
    return 3 * shear / (1 + shear / (3 * bulk))


def _reduced(shear, bulk):
    """E_r of a real shear modulus and the bulk modulus."""
    return shear + 3 * shear / (1 + 4 * shear / (3 * bulk))


def plane_strain(material):
    """1 / (1 - poisson^2), written so that poisson -> 1 would keep its digits [-]."""
    return 1.0 / ((1.0 - material.poisson) * (1.0 + material.poisson))


def static_reduced(material):
    """E_r(omega = 0) [Pa], real."""
    if isinstance(material, PronyShear):
        return _reduced(material.G_inf, material.bulk)
    return static_modulus(material) * plane_strain(material)


def glassy_reduced(material):
    """The largest |E_r| at any frequency [Pa]: the value at infinity, of a table the highest entry."""
    if isinstance(material, PronyShear):
        return _reduced(material.G_inf + jnp.sum(material.G), material.bulk)
    if isinstance(material, Elastic):
        glassy = material.young
    elif isinstance(material, Prony):
        glassy = material.E_inf + jnp.sum(material.E)
    else:
        glassy = jnp.max(material.storage)
    return glassy * plane_strain(material)


def reduced_series(material, scale):
    """E_r over a scale [Pa] as (rest, weight, tau) of a Prony series, of no terms if Elastic."""
    if isinstance(material, PronyShear):
        rest, weight, bulk = material.G_inf / scale, material.G / scale, material.bulk / scale
        held = in_series(4 * rest, 4 * weight, material.tau, jnp.asarray(3 * bulk))
        relaxing = jnp.concatenate([weight, 0.75 * held[1]])
        return rest + 0.75 * held[0], relaxing, jnp.concatenate([material.tau, held[2]])
    unit = plane_strain(material) / scale
    if isinstance(material, Elastic):
        nothing = jnp.zeros(0, jnp.result_type(material.young))
        return material.young * unit, nothing, nothing
    return material.E_inf * unit, material.E * unit, material.tau


def complex_modulus(material, omega, temperature=None):
    r"""E(omega, T) [Pa], complex: the definition behind every angular integral.

    For plots, fits of master curves and tests; the contact integrals use closed forms.

    Parameters
    ----------
    material : Elastic, Prony, PronyShear or TabulatedModulus
    omega : angular frequency, >= 0 (Prony, PronyShear, Elastic: any real; TabulatedModulus: > 0) [rad/s]
    temperature : broadcastable to omega [K], or None for the reference temperature

    Raises
    ------
    ValueError : another material, Rigid, or frequencies that are no numbers.
    """
    if isinstance(material, Rigid):
        raise ValueError("material is Rigid: it has no modulus")
    if not isinstance(material, (Elastic, *VISCOELASTIC)):
        kinds = "Elastic, Prony, PronyShear or TabulatedModulus"
        raise ValueError(f"material is a {type(material).__name__}: must be {kinds}")
    if not isinstance(omega, int | float):
        omega = as_leaf("omega", omega, np.ndim(omega))
    omega = jnp.asarray(omega, jnp.result_type(omega, float))
    if isinstance(material, Elastic):
        return material.young + 0j * omega
    if temperature is not None and material.shift is not None:
        omega = omega * jnp.exp(material.shift.log_factor(temperature))
    if isinstance(material, TabulatedModulus):
        # ln 0 has no finite derivative; below the smallest number E' is held and E'' is 0.
        storage, loss = interpolated_modulus(
            material, jnp.log(jnp.maximum(omega, jnp.finfo(omega.dtype).tiny))
        )
        return storage + 1j * jnp.where(omega > 0, loss, 0.0)
    if isinstance(material, PronyShear):
        return _young(_relaxing(material.G_inf, material.G, material.tau, omega), material.bulk)
    return _relaxing(material.E_inf, material.E, material.tau, omega)


def _relaxing(rest, weight, tau, omega):
    """A Prony series at omega, complex."""
    # a^2 must not overflow; beyond the bound it is the glassy modulus to the last bit.
    bound = 1e150 if omega.dtype == jnp.float64 else 1e18
    a = jnp.clip(omega[..., None] * tau, -bound, bound)
    terms = weight * ((a * a + 1j * a) / (1 + a * a))
    return rest + jnp.sum(terms, -1)
