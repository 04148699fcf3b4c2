r"""Adhesion: solids that gain a work of adhesion where they touch.

Where the attraction reaches less far than the solids deform, cracks of detached area open at a stress that
follows from fracture mechanics [Persson, Eur. Phys. J. E 8, 385 (2002), doi:10.1140/epje/i2002-10025-1],

.. math:: \sigma_a(q)^2 = c\, E_r(q)\, q\, \gamma_\mathrm{eff}(q)
"""

import math

from rubberfric.base.checks import POSITIVE, between
from rubberfric.base.objects.fields import Number, leaf
from rubberfric.base.objects.physical import PhysicalObject, physical


@physical
class Adhesion(PhysicalObject):
    r"""Adhesion in the limit of a short range of attraction (Johnson, Kendall and Roberts).

    Parameters
    ----------
    work : of adhesion per area of contact [J/m^2], > 0; 0.05 for rubber on most clean solids
    prefactor : c of the detachment stress [-], 4/pi [Persson 2002]; 0.4 to 1.3 by the geometry of the cracks

    Full contact follows from the same equations, and so does contact without adhesion where the elastic
    energy outweighs the work. `rubberfric.analysis.adhesion_matters` says beforehand whether it is worth
    its cost. The iteration begins at contact without adhesion. Near a load or a work at which the contact
    jumps into full contact it may end at either state, or at none: then it warns (`solve`: "converged").

    Limits: E_r is that of the moduli at the frequencies of sliding, at rest the relaxed one; no energy is
    lost in the rubber by the opening of cracks. Contact shear acts on the area that adheres, and the
    viscoelastic friction is eq. (A17) with S P of that area. The mean separation is not defined; not together
    with heating or with S in G. sigma_a begins as a square root where the energy ceases to outweigh the work:
    areas are good to about a percent if that is within the roughness.
    """

    work: Number = leaf(POSITIVE, unit="J/m^2", plausible=(1e-9, 1e3))
    prefactor: Number = leaf(between(1e-3, 1e3), unit="-", default=4 / math.pi)
