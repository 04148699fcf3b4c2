"""Reading and writing Prony series as material cards of other programs."""

import math
import os
import re

import numpy as np

from rubberfric.base.atomic import read_text, write_text
from rubberfric.base.checks import POSITIVE, NumberLike, as_leaf, check_choice, check_values, shown
from rubberfric.base.units import shear_from_young, young_from_shear
from rubberfric.io.cards import abaqus, ansys, branch_tables, lsdyna, openradioss
from rubberfric.io.cards.contents import CardFormat, CardMaterial, CardOptions, Cards, CardSeries, glassy_bulk
from rubberfric.io.cards.over_temperature import at_temperature, rows_of
from rubberfric.io.cards.shear_series import shear_series
from rubberfric.io.cards.text import STRESS, TEMPERATURE, format_number, need
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import WLF, TabulatedVertical

FORMATS = {
    "abaqus": CardFormat(abaqus.SIGN, "**", True, abaqus.read, abaqus.write),
    "ansys": CardFormat(ansys.SIGN, "!", True, ansys.read, ansys.write),
    "comsol": CardFormat(
        branch_tables.COMSOL, "%", True, branch_tables.read_comsol, branch_tables.write_comsol
    ),
    "lsdyna": CardFormat(lsdyna.SIGN, "$", True, lsdyna.read, lsdyna.write),
    "openradioss": CardFormat(openradioss.SIGN, "#", False, openradioss.read, openradioss.write),
    "pyvisco": CardFormat(
        branch_tables.PYVISCO, "", False, branch_tables.read_pyvisco, branch_tables.write_pyvisco
    ),
}

# Programs for which neo-Hookean cards are written.
_HYPERELASTIC = ("abaqus", "ansys")

# Density in the unit that belongs to a unit of stress, with m or mm and s [kg/m^3].
_DENSITY = {"Pa": 1.0, "MPa": 1e12}
_BULK = "bulk is missing: must be given for {}, such as 2e9 [Pa], because the program needs "
_RELAXED = "material has relaxed modulus 0: must be > 0 for {}"
_TERMS = "material has {n} terms: must be at most %s for {}; fit_prony with fewer terms"
# Requirements on a series: programs, test, message.
_REQUIREMENTS = (
    ("lsdyna openradioss", lambda s: s.mass is not None, "density is missing: must be given for {} [kg/m^3]"),
    ("comsol lsdyna", lambda s: s.poisson < 0.5 and not s.k.any(), _BULK + "an elastic bulk modulus"),
    ("ansys openradioss", lambda s: s.poisson < 0.5, _BULK + "Poisson's ratio < 0.5"),
    ("pyvisco", lambda s: s.poisson == 0.5 or all(s.k == s.g), "shear and bulk weights must be equal for {}"),
    ("openradioss", lambda s: s.rest > 0, _RELAXED),
    ("abaqus", lambda s: s.rest > 0 and sum(float(format_number(weight)) for weight in s.g) < 1, _RELAXED),
    ("ansys", lambda s: s.tau.size <= 100, _TERMS % "100"),
    ("lsdyna", lambda s: s.tau.size + (s.rest > 0) <= 18, _TERMS % "18, including the relaxed modulus,"),
    (
        "lsdyna",
        lambda s: not s.wlf or not s.options.zero,
        "unit_temperature = 'C': must be K for a shift of {}",
    ),
)


def read_prony(
    path: str | os.PathLike[str],
    program: str | None = None,
    *,
    unit_stress: str | None = None,
    unit_temperature: str = "K",
    poisson: float | None = None,
    shift: bool = True,
    name: str | int | None = None,
) -> Prony | PronyShear:
    """Read a Prony series from a file of material cards.

    Parameters
    ----------
    path : file
    program : "abaqus", "ansys", "comsol", "lsdyna", "openradioss" or "pyvisco"
        None recognises the program from the text.
    unit_stress : "Pa", "kPa", "MPa" or "GPa"; required except for pyvisco, whose files name the unit
    unit_temperature : "K" or "C", unit of the reference temperature of a WLF shift
    poisson : constant Poisson's ratio [-], or None
        If `poisson` is given, it replaces the bulk modulus of the cards. pyvisco files hold no Poisson's
        ratio. The default is then 0.5 for Young's modulus, and `poisson` must be given for a shear modulus.
    shift : False ignores the shift
        Moduli over temperature are then read at the reference temperature of the shift.
    name : name, number or title of the material in the file; None if the file has one material with a Prony
        series

    Returns
    -------
    Prony if shear and bulk modulus relax alike, if `poisson` is given, or if Poisson's ratio is 0.5.
    PronyShear if the bulk modulus is elastic.

    Raises
    ------
    ValueError : cards or units are missing, bulk terms are unlike the shear terms, weights add up to more
        than 1, or the shift is not WLF. The file has several materials with a Prony series, and no `name` is
        given. A card that may change the modulus is not read: anisotropic moduli, rows for field variables,
        parameters, included files, damping. The message names the file and the fault.

    Notes
    -----
    Hyperelastic cards are read with their shear and bulk modulus at small strain: `*HYPERELASTIC` of Abaqus
    (Neo Hooke, Mooney-Rivlin, polynomials, Yeoh, Ogden, Arruda-Boyce, Van der Waals), TB,HYPER of ANSYS (NEO,
    MOONEY, POLY, YEOH, OGDEN, BOYCE, GENT), `*MAT_077_H` and `*MAT_077_O` of LS-DYNA, and /MAT/LAW42 of
    OpenRadioss. `*MAT_006` of LS-DYNA has one term. Moduli at several temperatures become the vertical shift
    b_T of the WLF shift, a `TabulatedVertical` over the temperatures of the cards, if Poisson's ratio is
    constant and the material is a Prony. Times are in s.

    Examples
    --------
    >>> rubber = rf.Prony(E_inf=1e6, E=[2e6, 1e6], tau=[1e-3, 1e-1], poisson=0.49)
    >>> text = rf.io.write_prony("tyre.inp", rubber, unit_stress="MPa", name="TREAD")
    >>> again = rf.io.read_prony("tyre.inp", unit_stress="MPa", name="TREAD")
    >>> round(float(again.E_inf)), np.asarray(again.tau)
    (1000000, array([0.001, 0.1  ]))
    """
    text = read_text(path)
    try:
        if program is None:
            programs = [name for name, form in FORMATS.items() if re.search(form.sign, text, re.I | re.M)]
            known = f"must have a Prony series of {', '.join(FORMATS)}"
            other = "for another program, such as Marc, pass the numbers to rubberfric.Prony"
            need(programs, f"is not recognised: {known}; {other}")
            message = f"has keywords of {' and '.join(programs)}: program must be given"
            need(len(programs) == 1 or programs[1:] == ["pyvisco"], message)
            program = programs[0]
        check_choice("program", program, FORMATS)
        if unit_stress is not None:
            check_choice("unit_stress", unit_stress, STRESS)
        check_choice("unit_temperature", unit_temperature, TEMPERATURE)
        message = "unit_stress is missing: must be the stress unit of the cards, for example 'MPa'"
        need(unit_stress is not None or program == "pyvisco", message)
        _check_stated_units(text, unit_stress, unit_temperature)
        options = CardOptions(unit_stress, TEMPERATURE[unit_temperature], poisson, shift)
        return _material(_selected(FORMATS[program].read(text, options), name, program).read(), options)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write_prony(
    path: str | os.PathLike[str] | None,
    material: object,
    program: str = "abaqus",
    *,
    unit_stress: str = "Pa",
    unit_temperature: str = "K",
    bulk: float | None = None,
    density: float | None = None,
    shift: bool = True,
    name: str = "RUBBER",
    temperature: NumberLike | None = None,
    hyperelastic: bool = False,
) -> str:
    """Write a Prony series as material cards.

    Parameters
    ----------
    path : file, or None to return the text only
    material : Prony, PronyShear, or an object whose attribute `material` is a Prony or PronyShear, such as a
        Body or a PronyFit
    program : "abaqus", "ansys", "comsol", "lsdyna", "openradioss" or "pyvisco"
        abaqus: `*ELASTIC` and `*VISCOELASTIC, TIME=PRONY`, with `*TRS` for a WLF shift. Poisson's ratio 0.5
        is written with k_i = 0 for hybrid elements. Other elements need `bulk`.
        ansys: MP,EX and PRXY, TB,PRONY for shear and bulk, and TB,SHIFT, with at most 100 terms.
        comsol: table of branches for its Generalized Maxwell model, with moduli and shift in comments.
        lsdyna: `*MAT_GENERAL_VISCOELASTIC` (076) in fields of 10 characters, which hold 6 digits. There are
        at most 18 terms including the relaxed modulus. A WLF shift must be in K.
        openradioss: /MAT/LAW42 with the relaxed moduli and /VISC/PRONY, without a shift.
        pyvisco: CSV table of the terms of Young's modulus, without a shift.
    unit_stress : "Pa", "kPa", "MPa" or "GPa"; times are in s
    unit_temperature : "K" or "C", unit of the reference temperature of a shift
    bulk : elastic bulk modulus B [Pa] for a Prony, or None
        If `bulk` is given, the cards keep E of the material at every frequency, and only the shear modulus
        relaxes, G = 3 B E / (9 B - E). It is a Prony series with the same number of terms and slightly
        shorter times. To keep a shear modulus instead, write a PronyShear.
    density : density [kg/m^3], required by lsdyna and openradioss
        The density is written in kg/m^3 with Pa, and in t/mm^3 with MPa.
    shift : False leaves out the shift, for cards at its reference temperature, or at `temperature`
    name : name of the material, for abaqus and openradioss, on one line and without commas or quotes
    temperature : (lowest, highest) temperature [K] of a vertical shift, or None for the range of its table
        abaqus and ansys: a row for each temperature holds the moduli E b_T. Between the rows the
        programs interpolate, with an error of b_T below 1e-4. The range must include the reference
        temperature. Entropic needs a range.
        With shift=False: the temperature of the cards, one number. Their moduli are E b_T and their times
        a_T tau.
    hyperelastic : True writes neo-Hookean cards with the same moduli at small strain, for large strains
        abaqus: `*HYPERELASTIC, NEO HOOKE`; ansys: TB,HYPER,,,,NEO.

    Returns
    -------
    text of the file

    Raises
    ------
    ValueError : the material is not a Prony series, or the cards of the program cannot represent the material

    Examples
    --------
    >>> rubber = rf.Prony(E_inf=1e6, E=[2e6, 1e6], tau=[1e-3, 1e-1], poisson=0.5)
    >>> print(rf.io.write_prony(None, rubber, "abaqus", unit_stress="MPa"), end="")
    ** Prony series of 2 terms. Units: MPa, s
    *MATERIAL, NAME=RUBBER
    *ELASTIC, MODULI=INSTANTANEOUS
    4.0, 0.5
    *VISCOELASTIC, TIME=PRONY
    0.5, 0.0, 1E-3
    0.25, 0.0, 0.1
    """
    check_choice("program", program, FORMATS)
    check_choice("unit_stress", unit_stress, STRESS)
    check_choice("unit_temperature", unit_temperature, TEMPERATURE)
    fits = isinstance(name, str) and re.fullmatch(r"[^\s,\"'*/$#!=][^\n\r,\"=]{0,79}", name)
    need(fits, f"name = {shown(name)}: must have 1 ... 80 characters on one line, without commas and quotes")
    mass, form = None, FORMATS[program]
    if density is not None:
        message = f"unit_stress = {unit_stress!r}: must be Pa or MPa if a density is given"
        need(unit_stress in _DENSITY, message)
        check_values("density", as_leaf("density", density, 0), POSITIVE)
        mass = float(density) / _DENSITY[unit_stress]
    material = getattr(material, "material", material)
    need(isinstance(hyperelastic, bool), f"hyperelastic = {shown(hyperelastic)}: must be True or False")
    need(
        not hyperelastic or program in _HYPERELASTIC,
        f"hyperelastic = True: must be False for {program}; {' and '.join(_HYPERELASTIC)} have such cards",
    )
    options = CardOptions(unit_stress, TEMPERATURE[unit_temperature], shift=shift)
    rows = None
    if not shift and temperature is not None:
        material = at_temperature(material, as_leaf("temperature", temperature, 0))
    elif shift:
        rows = rows_of(material, program, temperature, bulk, options.zero)
    series = _series(material, bulk, program, options)
    series = series._replace(mass=mass, name=name, rows=rows, hyperelastic=hyperelastic)
    for programs, holds, message in _REQUIREMENTS:
        if program in programs.split():
            need(holds(series), message.format(program, n=series.tau.size))
    degrees = f", {unit_temperature}" if series.wlf else ""
    head = f"{form.comment} Prony series of {series.tau.size} terms. Units: {unit_stress}, s{degrees}"
    text = "\n".join([head] * bool(form.comment) + list(form.write(series))) + "\n"
    if path is not None:
        write_text(path, text)
    return text


def _check_stated_units(text: str, stress: str | None, temperature: str) -> None:
    """Raise ValueError if the comment in which `write_prony` states the units contradicts the units given."""
    stated = re.search(r"Prony series of \d+ terms\. Units: (\w+), s(?:, ([KC]))?\s*$", text, re.M)
    if stated is None:
        return
    message = f"unit_stress = {stress!r}: must be {stated[1]!r}, the unit in the comment of the file"
    need(stress in (None, stated[1]), message)
    message = (
        f"unit_temperature = {temperature!r}: must be {stated[2]!r}, the unit in the comment of the file"
    )
    need(stated[2] in (None, temperature), message)


def _selected(materials: list[CardMaterial], name: str | int | None, program: str) -> CardMaterial:
    """Return the material with a name or number, or the only one."""
    need(materials, f"has no material with a Prony series of {program}: must have one")
    listed = ", ".join(" ".join(map(repr, material.names)) or "without a name" for material in materials[:20])
    listed += f" and {len(materials) - 20} more" if len(materials) > 20 else ""
    if name is None:
        need(
            len(materials) == 1,
            f"has {len(materials)} materials with a Prony series: name must be one of {listed}",
        )
        return materials[0]
    wanted = str(name).strip().casefold()
    same_name = [material for material in materials if wanted in map(str.casefold, material.names)]
    need(same_name, f"name = {shown(name)}: must be one of {listed}")
    need(
        len(same_name) == 1,
        f"name = {shown(name)}: {len(same_name)} materials with a Prony series have"
        " this name: must be unique",
    )
    return same_name[0]


def _material(cards: Cards, options: CardOptions) -> Prony | PronyShear:
    pascal, poisson = STRESS[options.stress or "Pa"], options.poisson
    for what, values, rule in (("weight", cards.moduli, ">= 0"), ("time", cards.tau, "> 0")):
        good = values > 0 if rule == "> 0" else values >= 0
        for i in np.flatnonzero(~good)[:1]:
            raise ValueError(f"term {i + 1}: {what} {values[i]:g}: must be {rule}")
    if poisson is None and cards.poisson == 0.5:
        poisson = 0.5
    elif poisson is None and cards.k.any():
        g = cards.moduli / (cards.rest + cards.moduli.sum())
        for i in np.flatnonzero(~np.isclose(cards.k, g, rtol=1e-6, atol=0))[:1]:
            raise ValueError(
                f"term {i + 1}: weight {cards.k[i]:g} of the bulk modulus and {g[i]:g} of the shear modulus:"
                " must be equal, or all bulk weights must be 0; poisson=... reads the shear series only"
            )
        poisson = cards.poisson
    law = None
    if cards.wlf:
        T_ref, C1, C2 = cards.wlf
        law = WLF(C1, C2, T_ref + options.zero)
    if cards.vertical is not None:
        assert law is not None
        need(
            poisson is not None,
            "the moduli change with temperature, and the bulk modulus does not relax: poisson must be given,"
            " for example 0.5, or the cards must have one temperature",
        )
        T, factors = cards.vertical
        law = law.replace(vertical=TabulatedVertical(T + options.zero, factors))
    rest, weights = cards.rest * pascal, cards.moduli * pascal
    if poisson is None:
        return PronyShear(rest, weights, cards.tau, cards.bulk * pascal, law)
    return Prony(young_from_shear(rest, poisson), young_from_shear(weights, poisson), cards.tau, poisson, law)


def _series(material: object, bulk: float | None, program: str, options: CardOptions) -> CardSeries:
    if isinstance(material, PronyShear):
        need(bulk is None, f"bulk = {shown(bulk)}: must not be given; the PronyShear has a bulk modulus")
        rest, weights, bulk = float(material.G_inf), np.asarray(material.G, float), float(material.bulk)
        tau, poisson = np.asarray(material.tau, float), math.nan  # Poisson's ratio follows from `bulk`
    elif isinstance(material, Prony):
        rest, weights, poisson = float(material.E_inf), np.asarray(material.E, float), float(material.poisson)
        tau = np.asarray(material.tau, float)
        if bulk is None:
            rest, weights = shear_from_young(rest, poisson), shear_from_young(weights, poisson)
        else:
            bulk, young = float(as_leaf("bulk", bulk, 0)), rest + float(np.sum(weights))
            check_values("bulk", bulk, POSITIVE)
            need(
                3 * bulk > young,
                f"bulk = {bulk:g} Pa: must be > 1/3 of the glassy Young's modulus, {young:g} Pa",
            )
            rest, weights, tau = shear_series(rest, weights, tau, bulk)
    else:
        raise ValueError(
            f"material must be Prony or PronyShear, got {type(material).__name__}; see fit_prony"
        )
    glassy = float(rest + np.sum(weights))
    g = k = weights / glassy
    if bulk is not None:
        poisson, k = (3 * bulk - 2 * glassy) / (2 * (3 * bulk + glassy)), 0 * g
        message = f"bulk = {bulk:g} Pa: must be > 2/3 of the glassy shear modulus, {glassy:g} Pa"
        need(poisson > 0, message)
    elif poisson == 0.5:
        k = 0 * g
    pascal, young = STRESS[options.stress or "Pa"], young_from_shear(glassy, poisson)
    wlf = _wlf(material.shift, program, options) if options.shift and material.shift is not None else ()
    moduli = (young / pascal, poisson, glassy_bulk(young, poisson) / pascal)
    terms = (g, k, tau, rest / glassy)
    return CardSeries(*moduli, *terms, glassy / pascal, wlf, options, None, "")


def _wlf(law: object, program: str, options: CardOptions) -> tuple[float, float, float]:
    """Return reference temperature (in the file's unit), C1 and C2 of a WLF shift, or raise ValueError."""
    kind, has_shift = type(law).__name__, FORMATS[program].has_shift
    if not (isinstance(law, WLF) and has_shift):
        allowed = "WLF" if has_shift else "none"
        raise ValueError(
            f"material has the shift {kind}: {program} cards must have {allowed}; shift=False leaves it out"
        )
    return float(law.T_ref) - options.zero, float(law.C1), float(law.C2)
