r"""Adhesion: solids that gain a work of adhesion where they touch, in the two limits of its range.

Where the attraction reaches less far than the solids deform, it holds the area that a higher load p_1 would
make, at the least energy [Ciavarella, J. Mech. Phys. Solids 114, 209 (2018), doi:10.1016/j.jmps.2018.02.011],

.. math:: p_1 = \sigma_0 + \sqrt{2\,\Delta\gamma\, A'(p_1) / u''(p_1)}

or, after fracture mechanics at every length scale, cracks of detached area open at a stress [Persson, Eur.
Phys. J. E 8, 385 (2002), doi:10.1140/epje/i2002-10025-1],

.. math:: \sigma_a(q)^2 = c\, E_r(q)\, q\, \gamma_\mathrm{eff}(q)

Where it reaches further, it presses the solids together as a load would [Persson and Scaraggi, J. Chem. Phys.
141, 124701 (2014), doi:10.1063/1.4895789],

.. math:: p_\mathrm{rep} = \sigma_0 + \int P(u; p_\mathrm{rep})\, p_a(u)\, du,\qquad
          p_a(u) = \frac{\Delta\gamma}{r}\, e^{-u/r}

Between them lies Tabor's parameter of asperities of radius R, :math:`(R\,\Delta\gamma^2/E_r^2 r^3)^{1/3}`.
"""

import math
from typing import Literal

from rubberfric.base.checks import POSITIVE, between
from rubberfric.base.objects.fields import Number, OptionalNumber, leaf, static
from rubberfric.base.objects.physical import PhysicalObject, physical

PREFACTOR = 4 / math.pi  # [Persson 2002]


@physical
class Adhesion(PhysicalObject):
    r"""Adhesion of short range (Johnson, Kendall, Roberts) or of long range (Derjaguin, Muller, Toporov).

    Parameters
    ----------
    work : of adhesion per area of contact [J/m^2], > 0; 0.05 for rubber on most clean solids
    prefactor : c of the detachment stress [-]; None: 4/pi [Persson 2002]; 0.4 to 1.3 by the geometry of the
        cracks; of the criterion "stress" alone
    limit : "short" or "long" (static)
    range : r of the attraction [m], > 0; of long range only. Van der Waals forces reach some 0.3 nm,
        electrostatic ones micrometres.
    criterion : of short range, what contact is held by, "energy" or "stress" (static)

    `rubberfric.analysis.adhesion_matters` says beforehand whether it is worth its cost. In friction contact
    shear acts on the area that adheres, and the viscoelastic part is eq. (A17) with S P of that area, or of
    p_1; both are over sigma_0 alone.

    Short range, by energy: against boundary elements (q1/q0 = 8, Tabor 3) areas are good to 15 % for works up
    to an eighth of the energy of full contact where up to a third touches, to 20 % at a quarter, and 11 to
    31 % too small where more than half does, for elements fall into contact sooner; all with S in G, without
    it they are as much smaller as without adhesion. Of several solutions it is the least, where approaching
    solids come to rest; pulled apart again they hold up to three times as much. Where no load is large enough
    contact is full. Derivatives are those of the solution, without bounds next to a jump, and 0 where contact
    is full: a fit of the work begins with little of it.

    By stress: 34 to 67 % too small against the same elements, whatever c, for the elastic energy that the
    load has stored is taken from what adhesion may hold: of use to compare with what others computed by it.
    The iteration begins at contact without adhesion. Near a load or a work at which the
    contact jumps into full contact it may end at either state, or at none: then it warns (`solve`:
    "converged"). The mean separation is not defined; not together with S in G. Areas are those of the
    equations to 1e-8; where solids are about to jump into contact, or hardly any of the work is left, to
    3e-5, and derivatives to 2e-4.

    Long range: area, separation, and S P of the viscoelastic friction equal those without adhesion under the
    pressure p_rep = sigma_0 + p_ad. The attraction decays exponentially, integrates to the work, and its mean
    over Gaussian separations has a closed form. Boundary elements use the same law. The attraction also acts
    on the area of contact, which bears it. This is exact where r far exceeds all gaps: p_rep = sigma_0 +
    work / r. If several p_rep satisfy the equation, the least is returned. Approaching solids, which start
    without adhesion, come to rest there. They jump into closer contact where this solution ends, and
    derivatives grow without bounds there. Two solutions closer than a twelfth of ln(1 + work / (r sigma_0))
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
    prefactor: OptionalNumber = leaf(between(1e-3, 1e3), unit="-", default=None)
    limit: Literal["short", "long"] = static(default="short")
    range: OptionalNumber = leaf(POSITIVE, unit="m", plausible=(1e-11, 1e-3), default=None)
    criterion: Literal["energy", "stress"] = static(default="energy")

    def _check(self):
        if self.limit == "long" and self.range is None:
            raise ValueError("Adhesion.range is None: must be given, in m, for adhesion of long range")
        if self.limit == "short" and self.range is not None:
            raise ValueError(
                'Adhesion.range: adhesion of short range has none; must be None, or limit "long"'
            )
        if self.limit == "long" and self.criterion == "stress":
            raise ValueError(
                'Adhesion.criterion is "stress": of short range only; must be "energy", or limit "short"'
            )
        if self.prefactor is not None and not self.by_stress:
            raise ValueError(
                'Adhesion.prefactor: of the detachment stress alone; must be None, or criterion "stress"'
            )

    @property
    def by_stress(self) -> bool:
        """Whether contact is pulled off at a stress."""
        return self.limit == "short" and self.criterion == "stress"
