r"""Adhesion of short and of long range, the two limits of the attraction between solids.

If the range of the attraction is smaller than the deformation, the area equals the area without adhesion at a
larger load p_1, which minimises the energy [Ciavarella, J. Mech. Phys. Solids 114, 209 (2018),
doi:10.1016/j.jmps.2018.02.011],

.. math:: p_1 = \sigma_0 + \sqrt{2\,\Delta\gamma\, A'(p_1) / u''(p_1)}

If the range is larger, adhesion acts like an additional load [Persson and Scaraggi, J. Chem. Phys.
141, 124701 (2014), doi:10.1063/1.4895789],

.. math:: p_\mathrm{rep} = \sigma_0 + \int P(u; p_\mathrm{rep})\, p_a(u)\, du,\qquad
          p_a(u) = \frac{\Delta\gamma}{r}\, e^{-u/r}

Tabor's parameter distinguishes the limits. For asperities of radius R it is :math:`(R\,\Delta\gamma^2/E_r^2
r^3)^{1/3}`.
"""

from typing import Literal

from rubberfric.base.checks import POSITIVE
from rubberfric.base.objects.fields import Number, OptionalNumber, leaf, static
from rubberfric.base.objects.physical import PhysicalObject, physical


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
    If more than 1 % of the area touches, areas solve the equation to about 1e-6, and derivatives agree with
    differences to 1e-9. At the lightest loads, areas solve the equation to 1e-3 if r is less than a tenth of
    the rms height.
    Compared with boundary elements, areas have errors up to 4 % at Tabor 0.1 (with S in G). At Tabor 0.3
    areas are up to 22 % too large at light load, because the attraction deforms the solids.

    Limits: E_r is taken at the frequencies of sliding, and from the relaxed moduli at rest. Losses of opening
    cracks are not included. Adhesion and heating cannot be combined. The tables of boundary elements are in
    tests/rubberfric/theory/area/test_adhesive_elements.py.
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
