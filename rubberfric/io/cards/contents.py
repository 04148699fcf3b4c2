r"""Contents of cards with a Prony series, and conversions that several programs need.

Cards hold the glassy moduli, relative weights and relaxation times,

.. math:: G(t) = G_0 \Big[1 - \sum_i g_i (1 - e^{-t/\tau_i})\Big],\qquad
          B(t) = B_0 \Big[1 - \sum_i k_i (1 - e^{-t/\tau_i})\Big]

as *VISCOELASTIC, TIME=PRONY of Abaqus defines them. COMSOL, LS-DYNA and OpenRadioss hold the shear moduli
G_0 g_i. A constant Poisson's ratio means k_i = g_i, and an elastic bulk modulus means k_i = 0.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rubberfric.base.units import bulk_from_young, shear_from_young
from rubberfric.io.cards.text import need

# Change of ln b_T between the temperatures of a table. The law for b_T interpolates ln b_T, and the programs
# interpolate the moduli. The difference between the two is below 1e-4.
_FINE = 0.028
# Relative difference of Poisson's ratios at two temperatures that counts as a constant ratio.
_CONSTANT = 1e-6


class CardOptions(NamedTuple):
    """Units of a file, and options for reading the file."""

    stress: str | None  # unit; None: named in the file
    zero: float  # zero of the temperature scale [K]
    poisson: float | None = None
    shift: bool = True  # read the shift


class Cards(NamedTuple):
    """Contents of cards, in the units of the file."""

    rest: float  # relaxed shear modulus
    moduli: np.ndarray  # shear moduli of the terms, shape (n,)
    k: np.ndarray  # relative weights of the bulk modulus [-], shape (n,)
    tau: np.ndarray  # relaxation times [s], shape (n,)
    poisson: float  # nan where the cards have a bulk modulus instead
    bulk: float  # bulk modulus, if k = 0
    wlf: tuple[float, ...] = ()  # reference temperature, C1 and C2; (): no shift
    vertical: tuple[np.ndarray, np.ndarray] | None = None  # temperatures and b_T; None: b_T = 1


class CardMaterial(NamedTuple):
    """A material with a Prony series in a file."""

    names: tuple[str, ...]  # name or number, and title; (): unnamed
    read: Callable[[], Cards]


class CardSeries(NamedTuple):
    """A material to be written, in the units of the file."""

    young: float  # glassy Young's modulus
    poisson: float  # glassy Poisson's ratio [-]
    bulk: float  # glassy bulk modulus; inf for poisson = 0.5
    g: np.ndarray  # relative weights of the shear modulus [-], shape (n,)
    k: np.ndarray  # relative weights of the bulk modulus [-], shape (n,)
    tau: np.ndarray  # relaxation times [s], shape (n,)
    rest: float  # relaxed / glassy shear modulus [-]; exact where 1 - sum(g) cancels
    shear: float  # glassy shear modulus
    wlf: tuple[float, ...]  # reference temperature, C1 and C2; (): no shift
    options: CardOptions
    mass: float | None  # density
    name: str  # of the material
    rows: tuple[np.ndarray, np.ndarray] | None = None  # temperatures in the unit of the file, and b_T
    hyperelastic: bool = False  # neo-Hookean cards instead of linear elastic ones

    @property
    def scales(self) -> list[tuple[float | None, float]]:
        """Temperature, or None, and factor b_T of the moduli for each row of cards."""
        return (
            [(None, 1.0)] if self.rows is None else list(zip(*(x.tolist() for x in self.rows), strict=True))
        )

    @property
    def D1(self) -> float:
        """Compressibility 2 / B of neo-Hookean cards; 0 for an incompressible solid."""
        return 2 / self.bulk if math.isfinite(self.bulk) else 0.0


class CardFormat(NamedTuple):
    """Format of the cards of one program."""

    sign: str  # regular expression that identifies them
    comment: str  # beginning of a comment line; "": none
    has_shift: bool  # whether they can hold a WLF shift
    read: Callable[[str, CardOptions], list[CardMaterial]]
    write: Callable[[CardSeries], Iterator[str]]  # lines


class Elastic(NamedTuple):
    """Isotropic moduli of cards at one temperature, glassy or relaxed."""

    shear: float
    poisson: float
    temperature: float | None = None  # None: not stated


def glassy_bulk(young: float, poisson: float) -> float:
    """Return the bulk modulus for Young's modulus and Poisson's ratio; inf for an incompressible solid."""
    return float(bulk_from_young(young, poisson)) if poisson < 0.5 else math.inf


def elastic_from_young(
    young: float, poisson: float, temperature: float | None = None, where: str = ""
) -> Elastic:
    """Return the moduli for Young's modulus and Poisson's ratio. Raise ValueError if they are impossible."""
    need(young > 0, f"{where}: Young's modulus {young:g}: must be > 0")
    need(-1 < poisson <= 0.5, f"{where}: Poisson's ratio {poisson:g}: must be at most 0.5")
    return Elastic(shear_from_young(young, poisson), poisson, temperature)


def relative(
    rows: Sequence[Elastic],
    g: np.ndarray,
    k: np.ndarray,
    tau: np.ndarray,
    wlf: tuple[float, ...] = (),
    *,
    shift: bool = True,
    long_term: bool = False,
    where: str = "",
) -> Cards:
    """Convert cards with relative weights and the glassy or, if `long_term`, the relaxed moduli.

    Parameters
    ----------
    rows : moduli at one temperature or several
    wlf : reference temperature, C1 and C2, or () without a WLF shift
    shift : False leaves the shift out; the moduli are those at the reference temperature
    where : keyword of the moduli, for messages
    """
    elastic, vertical = _at_reference(rows, wlf[0] if wlf else None, where)
    total = float(np.sum(g))
    need(total <= 1 + 1e-12, f"the weights of the shear modulus add up to {total:g}: must be at most 1")
    rest = max(1 - total, 0.0)
    message = "MODULI=LONG TERM with weights that add up to 1: must add up to less than 1"
    need(rest > 1e-12 or not long_term, message)
    shear, nu = elastic.shear, elastic.poisson
    glassy, relaxed = (shear / rest, shear) if long_term else (shear, shear * rest)
    bulk = glassy_bulk(2 * (1 + nu) * shear, nu)
    kept, vertical = (wlf, vertical) if shift else ((), None)
    return Cards(relaxed, glassy * g, k, tau, nu, bulk, kept, vertical)


def _at_reference(rows, reference, where):
    """Return the moduli at the reference temperature, and (temperatures, b_T) or None if b_T = 1."""
    need(rows, f"{where} has no moduli: must have data")
    if len(rows) == 1:
        return rows[0], None
    need(
        all(row.temperature is not None for row in rows),
        f"{where} has {len(rows)} rows, not all with a temperature: must have one row, or temperatures",
    )
    T = np.array([row.temperature for row in rows])
    shear, nu = np.array([row.shear for row in rows]), np.array([row.poisson for row in rows])
    need((np.diff(T) > 0).all(), f"{where} has the temperatures {_listed(T)}: must rise from row to row")
    need(
        np.allclose(nu, nu[0], rtol=_CONSTANT, atol=0),
        f"{where} has Poisson's ratios {_listed(nu)} at {_listed(T)}: must be constant; keep the row of one"
        " temperature",
    )
    if (shear == shear[0]).all():
        return rows[0], None
    need(
        reference is not None,
        f"{where} has rows at the temperatures {_listed(T)}, but no WLF shift states the temperature of the"
        " Prony series: must have one row, or the shift",
    )
    # The programs interpolate the moduli linearly, and keep them constant outside the rows.
    nodes = np.union1d(T, [reference])
    log = np.log(np.interp(nodes, T, shear))
    parts = np.maximum(np.ceil(np.abs(np.diff(log)) / _FINE), 1).astype(int)
    inner = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(nodes, nodes[1:], parts, strict=False)]
    nodes = np.append(np.concatenate(inner), nodes[-1])
    at_reference = float(np.interp(reference, T, shear))
    return Elastic(at_reference, nu[0], reference), (nodes, np.interp(nodes, T, shear) / at_reference)


def _listed(values):
    return ", ".join(f"{value:g}" for value in values[:6]) + (" ..." if len(values) > 6 else "")
