"""Materials: moduli over frequency, their shift with temperature, and layered materials."""

from rubberfric.base.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.materials.coating import Coating as Coating
    from rubberfric.materials.interconversion import prony_from_compliance as prony_from_compliance
    from rubberfric.materials.interconversion import terms_from_compliance as terms_from_compliance
    from rubberfric.materials.material import Elastic as Elastic
    from rubberfric.materials.material import Material as Material
    from rubberfric.materials.material import Rigid as Rigid
    from rubberfric.materials.material import complex_modulus as complex_modulus
    from rubberfric.materials.prony import Prony as Prony
    from rubberfric.materials.prony import PronyShear as PronyShear
    from rubberfric.materials.shifts import WLF as WLF
    from rubberfric.materials.shifts import Arrhenius as Arrhenius
    from rubberfric.materials.shifts import Entropic as Entropic
    from rubberfric.materials.shifts import Shift as Shift
    from rubberfric.materials.shifts import TabulatedShift as TabulatedShift
    from rubberfric.materials.shifts import TabulatedVertical as TabulatedVertical
    from rubberfric.materials.shifts import VerticalShift as VerticalShift
    from rubberfric.materials.shifts import log_factors as log_factors
    from rubberfric.materials.slab import Layer as Layer
    from rubberfric.materials.slab import Slab as Slab
    from rubberfric.materials.tabulated_modulus import TabulatedModulus as TabulatedModulus

lazily(__name__, __file__, load=True)
