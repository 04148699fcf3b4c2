r"""The interface of two solids: contact shear, adhesion and correlation of the roughness.

Contact shear is the resistance of the contact area to shearing, in addition to viscoelastic losses.

.. math:: \mu_\mathrm{con} = \frac{\tau_f(v^*)}{\sigma_0}\frac{A}{A_0},\qquad
          \tau_f = \tau_{f0}\, e^{-c\,[\log_{10}(v^*/v_0)]^2},\qquad v^* = a_T' v

This law is empirical: friction on smooth glass is such a bell curve, which shifts with temperature
[Grosch, Proc. R. Soc. A 274 (1963) 21].

Adhesion has short or long range, the two limits of the attraction between solids. If the range of the
attraction is smaller than the deformation, the area equals the area without adhesion at a larger load p_1,
which minimises the energy [Ciavarella, J. Mech. Phys. Solids 114, 209 (2018),
doi:10.1016/j.jmps.2018.02.011],

.. math:: p_1 = \sigma_0 + \sqrt{2\,\Delta\gamma\, A'(p_1) / u''(p_1)}

If the range is larger, adhesion acts like an additional load [Persson and Scaraggi, J. Chem. Phys.
141, 124701 (2014), doi:10.1063/1.4895789],

.. math:: p_\mathrm{rep} = \sigma_0 + \int P(u; p_\mathrm{rep})\, p_a(u)\, du,\qquad
          p_a(u) = \frac{\Delta\gamma}{r}\, e^{-u/r}

Tabor's parameter distinguishes the limits. For asperities of radius R it is :math:`(R\,\Delta\gamma^2/E_r^2
r^3)^{1/3}`.

Roughness of two solids is correlated, for example, on a replica and its mould.

.. math:: \langle h_1(q)\,h_2^*(q)\rangle:\quad C_{12} = \kappa\sqrt{C_1 C_2},\qquad
          C_1 + C_2 \to C_1 + C_2 - 2 C_{12}

This is the spectrum of the difference of the surfaces, which determines the contact of solids at rest. In
sliding, the two surfaces excite the solids at different frequencies. The cross terms then vanish in the time
average, and the theory of uncorrelated roughness holds [Scaraggi & Persson, arXiv:1506.06955].
"""

import math
from typing import Literal

import jax
import jax.numpy as jnp

from rubberfric.base.checks import NONNEGATIVE, PLAUSIBLE_STRESS, POSITIVE, between
from rubberfric.base.logarithms import floored_log
from rubberfric.base.objects.fields import Number, OptionalNumber, child, leaf, static
from rubberfric.base.objects.physical import Kind, PhysicalObject, physical
from rubberfric.materials.shifts import Shift, log_vertical
from rubberfric.roughness.moments import safe_root

_LN_10 = math.log(10.0)  # a NumPy float would widen float32


class ShearLaw(Kind):
    """Base class of the shear stress in the contact area.

    A subclass implements `stress` and may have a field `shift`. The stress depends on velocity and
    temperature only through a_T' v and the factor b_T' of the shift, and not on the pressure. Heat balance
    and maps rely on this.
    """

    # Change with temperature, tau_f = b_T' tau_f(a_T' v).
    shift: Shift | None = None

    def stress(self, log_speed: jax.Array) -> jax.Array:
        """Return tau_f [Pa], >= 0, at the reference temperature and log_speed = ln(v / (1 m/s)).

        At rest log_speed is the logarithm of the smallest positive number. The friction is then set to 0.
        """
        raise NotImplementedError(f"{type(self).__name__}.stress")


@physical
class ContactShear(ShearLaw):
    r"""Shear stress in the contact area, a bell curve over the logarithm of the velocity.

    .. math:: \tau_f = \tau_{f0} \exp\left(-c\,[\log_{10}(a_T' v / v_0)]^2\right)

    Parameters
    ----------
    tau_f0 : largest shear stress, >= 0 [Pa]; 6.5e6 for a tread compound
    c : decay on either side of v0, >= 0 [-]; about 0.1
    v0 : velocity of the largest stress at the reference temperature, > 0 [m/s]; about 6e-3, up to 10
        in the literature
    shift : WLF, Arrhenius, TabulatedShift or None
        shift of v0 with temperature, independent of the material's shift; a_T' = 1 if None or without a
        temperature. Arrhenius(energy, T_ref), energy about 0.97 eV, gives
        ln a_T' = (energy / k_B) (1/T - 1/T_ref). A vertical shift multiplies the stress by b_T'.

    Limits: the stress is odd in the velocity. For c > 0 the stress decreases faster than any power of v for v
    -> 0, so value and slope are 0 at v = 0. The stress falls to 1/e of its maximum at v = v0 10^(1/sqrt(c)),
    so a very small c is like c = 0. For c = 0 the stress is dry friction, tau_f0 sign(v), which is
    discontinuous at v = 0, where value and derivatives are set to 0. ln a_T' saturates at a quarter of the
    exponent range (see `rubberfric.materials.shifts`).

    Examples
    --------
    >>> shear = rf.ContactShear(tau_f0=6.5e6, c=0.1, v0=6e-3)
    >>> round(float(shear.stress(np.log(6e-4))) / 1e6, 3)  # MPa at 0.6 mm/s
    5.881
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml").replace(shear=shear)
    """

    tau_f0: Number = leaf(NONNEGATIVE, unit="Pa", plausible=PLAUSIBLE_STRESS)
    c: Number = leaf(NONNEGATIVE, unit="-")
    v0: Number = leaf(POSITIVE, unit="m/s")
    shift: Shift | None = child(default=None)

    def stress(self, log_speed: jax.Array) -> jax.Array:
        """Return tau_f [Pa] at log_speed = ln(v / (1 m/s))."""
        return self.tau_f0 * _bell(self.c, (log_speed - jnp.log(self.v0)) / _LN_10)


def shear_friction(
    shear: ShearLaw,
    area: jax.Array,
    velocity: jax.Array,
    pressure: jax.Array,
    temperature: jax.Array | None = None,
) -> jax.Array:
    """Return the friction coefficient of contact shear, (tau_f / sigma_0) (A / A_0) sign(v) [-].

    The arrays area [-], velocity [m/s], pressure [Pa] and temperature [K] broadcast.
    """
    # At rest the friction has the exact factor sign(v) = 0, which would otherwise multiply ln 0 in the value
    # and 1/0 in derivatives.
    log_speed = floored_log(jnp.abs(velocity))
    if temperature is not None and shear.shift is not None:
        log_speed = log_speed + shear.shift.log_factor(temperature)
    mu = shear.stress(log_speed) * area / pressure
    log_vertical_factor = log_vertical(shear.shift, temperature)
    if log_vertical_factor is not None:
        mu = mu * jnp.exp(log_vertical_factor)
    return jnp.sign(velocity) * mu


@jax.custom_jvp
def _bell(c, x):
    return jnp.exp(-c * x * x)


@_bell.defjvp
def _bell_jvp(primals, tangents):
    # The value comes first in every product. Otherwise c x dx in forward mode may overflow (c = 1e30 or
    # dx = dv/v = 1e30) before it is multiplied by e^(-c x^2) = 0.
    c, x = primals
    value = _bell(c, x)
    return value, -(value * x * x) * tangents[0] - (2 * (value * c) * x) * tangents[1]


@physical
class Adhesion(PhysicalObject):
    r"""Adhesion of short range (Johnson, Kendall, Roberts) or of long range (Derjaguin, Muller, Toporov).

    Parameters
    ----------
    work : work of adhesion per contact area [J/m^2], > 0; 0.05 for rubber on most clean solids
    limit : "short" or "long" (static)
    range : range r of the attraction [m], > 0, only for limit = "long"
        Van der Waals forces have a range of 0.3 nm, and electrostatic forces have a range of micrometres.

    `rubberfric.analysis.adhesion_matters` estimates if adhesion changes the result. Contact shear acts on the
    area with adhesion. The viscoelastic friction uses S and P at the load p_1 (short range) or p_rep (long
    range). Both parts of the friction are divided by sigma_0.

    Short range: if the equation has several solutions, the smallest is returned, which approaching solids
    reach first. Separating solids may have up to three times this area. If no load satisfies the equation,
    contact is full. Derivatives diverge next to a jump and are 0 in full contact, so begin a fit of the work
    with a small value. Areas were compared with boundary elements (q1/q0 = 8, Tabor 3, S in G). If A/A0 is
    below 1/3, their error is up to 15 % for a work of 1/8 of the energy of full contact, and 20 % for 1/4. If
    A/A0 is above 1/2, areas are 11 to 31 % too small, because boundary elements jump into contact at smaller
    loads. Without S in G areas are smaller by the same factor as without adhesion.

    Long range: area, separation, and S P of the viscoelastic friction equal those without adhesion under the
    pressure p_rep = sigma_0 + p_ad. The attraction decays exponentially with the separation, and its integral
    is the work. The attraction also acts on the area of contact. If r far exceeds all gaps, p_rep = sigma_0 +
    work / r is exact. If several p_rep satisfy the equation, the smallest is returned, at which approaching
    solids come to rest. Where this solution ends, the solids jump into closer contact, and derivatives grow
    without bounds. Two solutions that differ by less than an eleventh of ln(1 + work / (r sigma_0)) in
    ln p_rep may be missed. The next solution is then returned.
    If more than 1 % of the area touches, areas solve the equation to 5e-6, and their derivatives to 1e-4. At
    the lightest loads, areas solve the equation to 1e-3 if r is less than a tenth of the rms height.
    Compared with boundary elements, areas have errors up to 4 % at Tabor 0.1 (with S in G). At Tabor 0.3
    areas are up to 22 % too large at light load, because the attraction deforms the solids.

    Limits: E_r is taken at the frequencies of sliding, and from the relaxed moduli at rest. Losses of opening
    cracks are not included. Adhesion and heating cannot be combined. The tables of boundary elements are in
    tests/rubberfric/theory/area/test_adhesive_elements.py.

    Examples
    --------
    >>> seal = rf.load_scene("data/rubber_seal.toml").replace(adhesion=None)
    >>> sticky = seal.replace(adhesion=rf.Adhesion(work=2e-3))
    >>> round(float(rf.contact_area(seal, 0.0, 1e4)), 4)
    0.0427
    >>> round(float(rf.contact_area(sticky, 0.0, 1e4)), 4)
    0.0679
    """

    work: Number = leaf(POSITIVE, unit="J/m^2", plausible=(1e-9, 1e3))
    limit: Literal["short", "long"] = static(default="short")
    range: OptionalNumber = leaf(POSITIVE, unit="m", plausible=(1e-11, 1e-3), default=None)

    def _check(self):
        if self.limit == "long" and self.range is None:
            raise ValueError("Adhesion.range is None: must be given, in m, for adhesion of long range")
        if self.limit == "short" and self.range is not None:
            raise ValueError(
                'Adhesion.range: must be None for adhesion of short range, or limit must be "long"'
            )


@physical
class Correlation(PhysicalObject):
    r"""Correlation of the two surfaces of a scene.

    Parameters
    ----------
    coherence : kappa, constant over all wavevectors [-], -1 ... 1
        If kappa is 1 and the spectra are equal, the surfaces match. If kappa is 0, the surfaces are not
        correlated. If kappa is -1, the peaks of one surface lie on the peaks of the other surface.

    Limits: both surfaces must be rough and isotropic, and the solids must be at rest (velocity 0). Heating
    and softening are not allowed. Traced velocities other than 0 give NaN.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> body = rf.Body(rf.Elastic(young=3e6, poisson=0.5), road)
    >>> scene = rf.Scene(body, body, correlation=rf.Correlation(coherence=1.0))
    >>> round(float(rf.contact_area(scene, 0.0, 0.15e6)), 6)
    1.0
    """

    coherence: Number = leaf(between(-1.0, 1.0), unit="-")


def difference(
    correlation: Correlation, heights: tuple[jax.Array, jax.Array], lower: jax.Array, upper: jax.Array
) -> jax.Array:
    """Return the spectrum of the height difference of two surfaces.

    Parameters
    ----------
    correlation : Correlation
    heights : scales of both heights [m], >= 0
    lower, upper : spectra divided by the squares of the scales, >= 0, with the shape of the result
    """
    # The heights are outside the roots, because the root of a squared height has no derivative at height 0.
    a, b = (height * safe_root(shape) for height, shape in zip(heights, (lower, upper), strict=True))
    # A square plus a remainder >= 0, so that the result is never negative.
    return (a - b) ** 2 + 2 * (1 - correlation.coherence) * (a * b)
