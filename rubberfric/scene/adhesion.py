r"""Adhesion: solids that gain a work of adhesion where they touch, in the two limits of its range.

Where the attraction reaches less far than the solids deform, it holds the area that a higher load p_1 would
make, at the least energy [Ciavarella, J. Mech. Phys. Solids 114, 209 (2018), doi:10.1016/j.jmps.2018.02.011],

.. math:: p_1 = \sigma_0 + \sqrt{2\,\Delta\gamma\, A'(p_1) / u''(p_1)}

Where it reaches further, it presses the solids together as a load would [Persson and Scaraggi, J. Chem. Phys.
141, 124701 (2014), doi:10.1063/1.4895789],

.. math:: p_\mathrm{rep} = \sigma_0 + \int P(u; p_\mathrm{rep})\, p_a(u)\, du,\qquad
          p_a(u) = \frac{\Delta\gamma}{r}\, e^{-u/r}

Between them lies Tabor's parameter of asperities of radius R, :math:`(R\,\Delta\gamma^2/E_r^2 r^3)^{1/3}`.
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
    work : of adhesion per area of contact [J/m^2], > 0; 0.05 for rubber on most clean solids
    limit : "short" or "long" (static)
    range : r of the attraction [m], > 0; of long range only. Van der Waals forces reach some 0.3 nm,
        electrostatic ones micrometres.

    `rubberfric.analysis.adhesion_matters` says beforehand whether it is worth its cost. In friction contact
    shear acts on the area that adheres, and the viscoelastic part has S P of that area, or of
    p_1; both are over sigma_0 alone.

    Short range: against boundary elements (q1/q0 = 8, Tabor 3) areas are good to 15 % for works up
    to an eighth of the energy of full contact where up to a third touches, to 20 % at a quarter, and 11 to
    31 % too small where more than half does, for elements fall into contact sooner; all with S in G, without
    it they are as much smaller as without adhesion. Of several solutions it is the least, where approaching
    solids come to rest; pulled apart again they hold up to three times as much. Where no load is large enough
    contact is full. Derivatives are those of the solution, without bounds next to a jump, and 0 where contact
    is full: a fit of the work begins with little of it.

    Long range: area, separation, and S P of the viscoelastic friction equal those without adhesion under the
    pressure p_rep = sigma_0 + p_ad. The attraction decays exponentially, integrates to the work, and its mean
    over Gaussian separations has a closed form. Boundary elements use the same law. The attraction also acts
    on the area of contact, which bears it. This is exact where r far exceeds all gaps: p_rep = sigma_0 +
    work / r. If several p_rep satisfy the equation, the least is returned. Approaching solids, which start
    without adhesion, come to rest there. They jump into closer contact where this solution ends, and
    derivatives grow without bounds there. Two solutions closer than an eleventh of ln(1 + work / (r sigma_0))
    may be missed: then the next one is returned.
    Areas solve the equation to about 1e-6 where more than 1 % touches, and to 1e-3 at the lightest loads if r
    is less than a tenth of the rms height. Where more than 1 % touches, derivatives agree with differences to
    1e-9.
    Against boundary elements areas are good to 4 % at Tabor 0.1 (with S in G); at 0.3 they are up to 22 % too
    large at light load, because the attraction deforms the solids.

    Limits: E_r is that of the moduli at the frequencies of sliding, at rest the relaxed one; no energy is
    lost in the rubber by the opening of cracks. Not together with heating. The tables of boundary elements
    are in tests/rubberfric/theory/area/test_adhesive_elements.py.
    """

    work: Number = leaf(POSITIVE, unit="J/m^2", plausible=(1e-9, 1e3))
    limit: Literal["short", "long"] = static(default="short")
    range: OptionalNumber = leaf(POSITIVE, unit="m", plausible=(1e-11, 1e-3), default=None)

    def _check(self):
        if self.limit == "long" and self.range is None:
            raise ValueError("Adhesion.range is None: must be given, in m, for adhesion of long range")
        if self.limit == "short" and self.range is not None:
            raise ValueError(
                'Adhesion.range: adhesion of short range has none; must be None, or limit "long"'
            )
