r"""What all cards of Prony series have in common: the series, their units, and how numbers are written.

Cards hold the glassy moduli, relative weights and times (LS-DYNA: moduli and rates),

.. math:: G(t) = G_0 \Big[1 - \sum_i g_i (1 - e^{-t/\tau_i})\Big],\qquad
          B(t) = B_0 \Big[1 - \sum_i k_i (1 - e^{-t/\tau_i})\Big]

as *VISCOELASTIC, TIME=PRONY of Abaqus defines them. A Prony has a constant Poisson's ratio: k_i = g_i.
A PronyShear has an elastic bulk modulus: k_i = 0.
"""

import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from rubberfric.base.checks import POSITIVE, as_leaf, check_values, shown
from rubberfric.base.units import ZERO_CELSIUS, bulk_from_young, shear_from_young, young_from_shear
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts.laws import WLF

STRESS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9}
TEMPERATURE = {"K": 0.0, "C": ZERO_CELSIUS}

Material = Prony | PronyShear


class Units(NamedTuple):
    """Units of the numbers in a file."""

    stress: str | None  # None: the file says it
    pascal: float  # the unit of stress [Pa]
    zero: float  # of the temperature [K]


class Series(NamedTuple):
    """A material as cards have it."""

    shear: float  # glassy [Pa]
    poisson: float  # of the glassy moduli [-]
    g: np.ndarray  # relative weights of the shear modulus [-], shape (n,)
    k: np.ndarray  # of the bulk modulus [-], shape (n,)
    tau: np.ndarray  # [s], shape (n,)
    rest: float  # relaxed over glassy shear modulus, 1 - sum(g) without its cancellation [-]
    shift: object  # of the material, or None

    def young(self, units: Units) -> float:
        """Glassy Young's modulus in the unit of stress."""
        return young_from_shear(self.shear, self.poisson) / units.pascal

    def wlf(self, units: Units) -> tuple[float, float, float]:
        """Reference temperature, C1 and C2 of the shift."""
        assert isinstance(self.shift, WLF)
        return float(self.shift.T_ref) - units.zero, float(self.shift.C1), float(self.shift.C2)


def elastic_bulk(series: Series, program: str) -> float:
    """The bulk modulus [Pa] for a program that has an elastic one; ValueError if the series has none."""
    if series.poisson >= 0.5 or series.k.any():
        raise ValueError(
            f"bulk is missing: must be given for {program}, whose bulk modulus is elastic, such as 2e9 [Pa]"
        )
    return float(bulk_from_young(young_from_shear(series.shear, series.poisson), series.poisson))


class Format(NamedTuple):
    """The cards of one program."""

    sign: str  # regular expression that tells them

    shifts: bool  # whether they have a WLF shift
    comment: str  # what a comment begins with, "" if there is none
    read: Callable[[str, Units, float | None, bool], Material]  # of text, units, poisson, whether with shift
    write: Callable[[Series, Units, float | None, str], Iterator[str]]  # lines; of mass per volume and name


def series_of(material: object, bulk: float | None, shift: bool) -> Series:
    """The `Series` of a material; ValueError if it is none of Prony type, or `bulk` does not suit it."""
    material = getattr(material, "material", material)
    if isinstance(material, PronyShear):
        if bulk is not None:
            raise ValueError(f"bulk = {shown(bulk)}: must not be given; the PronyShear has its own")
        rest, weights, bulk = float(material.G_inf), np.asarray(material.G, float), float(material.bulk)
        poisson = 0.5  # that of its glassy moduli follows below
    elif isinstance(material, Prony):
        poisson = float(material.poisson)
        rest = shear_from_young(float(material.E_inf), poisson)
        weights = shear_from_young(np.asarray(material.E, float), poisson)
        if bulk is not None:
            bulk = float(as_leaf("bulk", bulk, 0))
            check_values("bulk", bulk, POSITIVE)
    else:
        raise ValueError(
            f"material is a {type(material).__name__}: must be Prony or PronyShear; see fit_prony"
        )
    glassy = float(rest + np.sum(weights))
    g = k = weights / glassy
    if bulk is not None:
        poisson, k = (3 * bulk - 2 * glassy) / (2 * (3 * bulk + glassy)), 0 * g
        if not poisson > 0:
            raise ValueError(f"bulk = {bulk:g} Pa: must be > 2/3 of the glassy shear modulus, {glassy:g} Pa")
    elif poisson == 0.5:
        k = 0 * g
    law = material.shift if shift else None
    return Series(glassy, poisson, g, k, np.asarray(material.tau, float), rest / glassy, law)


def relaxing_alike(
    rest: float, weights: np.ndarray, tau: np.ndarray, poisson: float, shift: WLF | None
) -> Prony:
    """The material of shear moduli [Pa] and a constant Poisson's ratio."""
    return Prony(young_from_shear(rest, poisson), young_from_shear(weights, poisson), tau, poisson, shift)


def from_relative(
    modulus: float,
    nu: float,
    long_term: bool,
    g: np.ndarray,
    k: np.ndarray,
    tau: np.ndarray,
    poisson: float | None,
    shift: WLF | None,
) -> Material:
    """The material of a Young's modulus [Pa], relaxed if `long_term`, else glassy, and relative weights.

    Parameters
    ----------
    nu : Poisson's ratio in the file
    g, k, tau : as in `Series`
    poisson : a constant Poisson's ratio in place of what k says, or None
    """
    total = float(np.sum(g))
    if total > 1 + 1e-12:
        raise ValueError(f"the weights of the shear modulus add up to {total:g}: must be at most 1")
    rest = max(1 - total, 0.0)
    if long_term and not rest > 0:
        raise ValueError("MODULI=LONG TERM with weights that add up to 1: must add up to less")
    if poisson is None and not np.any(k) and nu < 0.5:
        bulk = float(bulk_from_young(modulus, nu))
    elif poisson is not None or nu == 0.5 or np.allclose(k, g, rtol=1e-6, atol=0):
        bulk = None
    else:
        i = int(np.argmax(~np.isclose(k, g, rtol=1e-6, atol=0)))
        raise ValueError(
            f"term {i + 1}: weight {k[i]:g} of the bulk and {g[i]:g} of the shear modulus: must be equal, or"
            " all of the bulk 0; poisson=... takes the shear series alone"
        )
    shear = shear_from_young(modulus, nu)
    glassy = shear / rest if long_term else shear
    relaxed = shear if long_term else shear * rest
    if bulk is not None:
        return PronyShear(relaxed, glassy * g, tau, bulk, shift)
    return relaxing_alike(relaxed, glassy * g, tau, nu if poisson is None else poisson, shift)


def number(field: str) -> float:
    """A number of a card, with an exponent D as Fortran has it; 0 where nothing stands."""
    try:
        return float(re.sub(r"[dD](?=[+-]?\d+$)", "e", field.strip() or "0"))
    except ValueError:
        raise ValueError(f"{field.strip()!r}: must be a number") from None


def text_of(value: float, width: int = 20) -> str:
    """A number in at most so many characters, as near as they allow."""
    value = float(value)
    texts = [repr(value), f"{value:.{width}f}"[:width]]
    for digits in range(width):
        mantissa, exponent = f"{value:.{digits}E}".split("E")
        texts.append(f"{mantissa}E{int(exponent)}")
    return min((t for t in texts if len(t) <= width), key=lambda text: (abs(float(text) - value), len(text)))
