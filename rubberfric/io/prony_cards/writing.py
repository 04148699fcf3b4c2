r"""Prony series as material cards of finite-element programs, and as the table of pyvisco.

All of them hold the glassy modulus, relative weights and times (LS-DYNA: moduli and rates),

.. math:: G(t) = G_0 \Big[1 - \sum_i g_i (1 - e^{-t/\tau_i})\Big],\qquad
          B(t) = B_0 \Big[1 - \sum_i k_i (1 - e^{-t/\tau_i})\Big]

A Prony has a constant Poisson's ratio: k_i = g_i. A PronyShear has an elastic bulk modulus: k_i = 0.
"""

from typing import NamedTuple

import numpy as np

from rubberfric.base.atomic import as_path, replacing
from rubberfric.base.checks import POSITIVE, as_leaf, check_values, closest, shown
from rubberfric.base.units import ZERO_CELSIUS, shear_from_young, young_from_shear
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import WLF

STRESS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9}
TEMPERATURE = {"K": 0.0, "C": ZERO_CELSIUS}
# Of the mass per volume that belongs to a stress, metres or millimetres and seconds [kg/m^3].
DENSITY = {"Pa": ("kg/m^3", 1.0), "MPa": ("t/mm^3", 1e12)}
PROGRAMS = ("abaqus", "ansys", "lsdyna", "pyvisco")
LSDYNA_TERMS = 18
ANSYS_TERMS = 100


class Series(NamedTuple):
    """Glassy moduli [Pa], relative weights, times [s] and the shift of a material."""

    shear: float
    poisson: float  # of the glassy moduli
    g: np.ndarray
    k: np.ndarray
    tau: np.ndarray
    rest: float  # relaxed over glassy shear modulus, 1 - sum(g) without its cancellation
    shift: object


def write_prony(
    path,
    material,
    program="abaqus",
    *,
    unit_stress="Pa",
    unit_temperature="K",
    bulk=None,
    density=None,
    shift=True,
    name="RUBBER",
):
    """A Prony series as material cards.

    Parameters
    ----------
    path : file to write, whole or not at all, or None for the text alone
    material : Prony, PronyShear, or what holds one as `material`: a Body, a PronyFit
    program : "abaqus", "ansys", "lsdyna" or "pyvisco"
        abaqus: *ELASTIC and *VISCOELASTIC, TIME=PRONY, with *TRS for a WLF shift. Poisson's ratio 0.5 is
        written as it is (k_i = 0): hybrid elements take it, all others need one below 0.5, so `bulk`.
        ansys: MP,EX and PRXY, TB,PRONY for shear and bulk, TB,SHIFT; at most 100 terms.
        lsdyna: *MAT_GENERAL_VISCOELASTIC (076) in fields of 10 characters, which hold 6 digits; at most
        18 terms, of which the relaxed modulus is one (rate 0); no shift.
        pyvisco: its CSV table of terms, of Young's modulus.
    unit_stress : "Pa", "kPa", "MPa" or "GPa"; times are in s
    unit_temperature : "K" or "C", of the reference temperature of a shift
    bulk : elastic bulk modulus [Pa] for a Prony, whose shear modulus alone relaxes then, or None
    density : [kg/m^3], written in kg/m^3 beside Pa, in t/mm^3 beside MPa; lsdyna must have it
    shift : bool; False leaves out the shift, for cards at its reference temperature
    name : of the material, for abaqus

    Returns
    -------
    the text

    Raises
    ------
    ValueError
        one line: another material; too many terms; a shift the program has no card for; no bulk modulus
        where there must be one; E_inf = 0 where the weights must add up to less than 1.
    """
    for what, value, allowed in (
        ("program", program, PROGRAMS),
        ("unit_stress", unit_stress, STRESS),
        ("unit_temperature", unit_temperature, TEMPERATURE),
    ):
        if not isinstance(value, str) or value not in allowed:
            raise ValueError(f"{what} = {shown(value)}: {closest(value, tuple(allowed))}")
    mass = _density(density, unit_stress)
    series = _series(material, bulk, shift)
    if series.shift is not None and not (type(series.shift) is WLF and program in ("abaqus", "ansys")):
        raise ValueError(
            f"material has the shift {type(series.shift).__name__}: {program} cards must have"
            f" {'WLF' if program in ('abaqus', 'ansys') else 'none'}; shift=False leaves it out"
        )
    degrees = f", {unit_temperature}" if series.shift is not None else ""
    head = f"Prony series of {series.tau.size} terms. Units: {unit_stress}, s{degrees}"
    scale, zero = STRESS[unit_stress], TEMPERATURE[unit_temperature]
    writer = {"abaqus": _abaqus, "ansys": _ansys, "lsdyna": _lsdyna, "pyvisco": _pyvisco}[program]
    lines = writer(series, scale, zero, mass, head, unit_stress if program == "pyvisco" else name)
    text = "\n".join(lines) + "\n"
    if path is not None:
        folder = as_path(path).parent
        if not folder.is_dir():
            raise ValueError(f"{path}: there is no folder {str(folder)!r}; it must exist")
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")
    return text


def _series(material, bulk, shift):
    """The `Series` of a material."""
    material = getattr(material, "material", material)
    if not isinstance(material, Prony | PronyShear):
        raise ValueError(
            f"material is a {type(material).__name__}: must be Prony or PronyShear; see fit_prony"
        )
    if bulk is not None:
        if isinstance(material, PronyShear):
            raise ValueError(f"bulk = {shown(bulk)}: must not be given; the PronyShear has its own")
        bulk = float(as_leaf("bulk", bulk, 0))
        check_values("bulk", bulk, POSITIVE)
    if isinstance(material, PronyShear):
        rest, weights, bulk = (np.asarray(x, float) for x in (material.G_inf, material.G, material.bulk))
    else:
        young = (np.asarray(x, float) for x in (material.E_inf, material.E))
        rest, weights = (shear_from_young(E, float(material.poisson)) for E in young)
    glassy = float(rest + np.sum(weights))
    g = weights / glassy
    if bulk is None:
        poisson = float(material.poisson)
        k = g if poisson < 0.5 else 0 * g
    else:
        poisson, k = float((3 * bulk - 2 * glassy) / (2 * (3 * bulk + glassy))), 0 * g
        if not poisson > 0:
            raise ValueError(
                f"bulk = {float(bulk):g} Pa: must be > 2/3 of the glassy shear modulus, {glassy:g} Pa"
            )
    tau, law = np.asarray(material.tau, float), material.shift if shift else None
    return Series(glassy, poisson, g, k, tau, float(rest) / glassy, law)


def _density(density, unit_stress):
    if density is None:
        return None
    if unit_stress not in DENSITY:
        raise ValueError(f"density = {shown(density)}: must be absent; unit_stress must be Pa or MPa for it")
    check_values("density", as_leaf("density", density, 0), POSITIVE)
    return float(density) / DENSITY[unit_stress][1]


def _abaqus(series, scale, zero, mass, head, name):
    if sum(map(float, map(_field, series.g))) >= 1:
        raise ValueError(
            "material has no relaxed modulus: it must be > 0 for abaqus, whose weights add up to < 1"
        )
    yield f"** {head}"
    yield f"*MATERIAL, NAME={name}"
    if mass is not None:
        yield from ("*DENSITY", f"{_field(mass)},")
    young = young_from_shear(series.shear, series.poisson) / scale
    yield from ("*ELASTIC, MODULI=INSTANTANEOUS", f"{_field(young)}, {_field(series.poisson)}")
    yield "*VISCOELASTIC, TIME=PRONY"
    for row in zip(series.g, series.k, series.tau, strict=True):
        yield ", ".join(map(_field, row))
    if series.shift is not None:
        yield from ("*TRS, DEFINITION=WLF", ", ".join(map(_field, _wlf(series.shift, zero))))


def _ansys(series, scale, zero, mass, head, _):
    terms = series.tau.size
    if series.poisson >= 0.5:
        raise ValueError(
            "material has Poisson's ratio 0.5: it must be < 0.5 for ansys; give bulk, such as 2e9 [Pa]"
        )
    if terms > ANSYS_TERMS:
        raise ValueError(
            f"material has {terms} terms: must be at most {ANSYS_TERMS} for ansys; fit_prony with fewer"
        )
    yield f"! {head}"
    yield f"MP,EX,1,{young_from_shear(series.shear, series.poisson) / scale!r}"
    yield f"MP,PRXY,1,{series.poisson!r}"
    if mass is not None:
        yield f"MP,DENS,1,{mass!r}"
    for what, weights in (("SHEAR", series.g), ("BULK", series.k)):
        if weights.any():
            yield f"TB,PRONY,1,1,{terms},{what}"
            pairs = np.stack([weights, series.tau], 1).tolist()
            for i in range(0, terms, 3):
                yield f"TBDATA,{2 * i + 1}," + ",".join(repr(x) for pair in pairs[i : i + 3] for x in pair)
    if series.shift is not None:
        yield "TB,SHIFT,1,1,3,WLF"
        yield "TBDATA,1," + ",".join(map(repr, _wlf(series.shift, zero)))


def _lsdyna(series, scale, zero, mass, head, _):
    terms = series.tau.size + (series.rest > 0)
    if terms > LSDYNA_TERMS:
        raise ValueError(
            f"material has {series.tau.size} terms: must be at most {LSDYNA_TERMS} for lsdyna, the relaxed"
            " modulus being one; fit_prony with fewer terms"
        )
    if mass is None:
        raise ValueError("density is missing: must be given for lsdyna [kg/m^3]")
    if series.poisson >= 0.5 or series.k.any():
        raise ValueError(
            "bulk is missing: must be given for lsdyna, whose bulk modulus is elastic, such as 2e9 [Pa]"
        )
    bulk = 2 * series.shear * (1 + series.poisson) / (3 * (1 - 2 * series.poisson))
    yield f"$ {head}"
    yield "*MAT_GENERAL_VISCOELASTIC"
    yield "$#     mid        ro      bulk       pcf        ef      tref         a         b"
    yield f"{1:10d}" + "".join(f"{_field(x, 10):>10}" for x in (mass, bulk / scale))
    yield "$#    lcid        nt    bstart     tramp     lcidk       ntk   bstartk    trampk"
    yield f"{0:10d}"
    yield "$#      gi     betai        ki    betaki"
    rows = [(series.rest, 0.0)] * (series.rest > 0) + list(zip(series.g, 1 / series.tau, strict=True))
    for weight, rate in rows:
        yield "".join(f"{_field(x, 10):>10}" for x in (weight * series.shear / scale, rate))


def _pyvisco(series, scale, zero, mass, head, unit):
    if not (series.k == series.g).all() and series.poisson < 0.5:
        raise ValueError(
            "material has an elastic bulk modulus: pyvisco must have one series of Young's modulus"
        )
    young = young_from_shear(series.shear, series.poisson) / scale
    yield "i,tau_i,alpha_i,E_0,E_i"
    yield f"-,s,-,{unit},{unit}"
    for i, (g, tau) in enumerate(zip(series.g.tolist(), series.tau.tolist(), strict=True), start=1):
        yield f"{i},{tau!r},{g!r},{young!r},{g * young!r}"


def _wlf(shift, zero):
    return float(shift.T_ref) - zero, float(shift.C1), float(shift.C2)


def _field(value, width=20):
    """A number in at most so many characters, as near as they allow."""
    value = float(value)
    texts = [repr(value), f"{value:.{width}f}"[:width]]
    for digits in range(width):
        mantissa, exponent = f"{value:.{digits}E}".split("E")
        texts.append(f"{mantissa}E{int(exponent)}")
    return min((t for t in texts if len(t) <= width), key=lambda text: (abs(float(text) - value), len(text)))
