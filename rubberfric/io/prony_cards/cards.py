"""Prony series from and to the files of other programs: one module a format beside this one."""

import os
import re

from rubberfric.base.atomic import as_path, replacing
from rubberfric.base.checks import POSITIVE, as_leaf, check_values, closest, shown
from rubberfric.io.prony_cards.abaqus import ABAQUS
from rubberfric.io.prony_cards.ansys import ANSYS
from rubberfric.io.prony_cards.comsol import COMSOL
from rubberfric.io.prony_cards.lsdyna import LSDYNA
from rubberfric.io.prony_cards.openradioss import OPENRADIOSS
from rubberfric.io.prony_cards.pyvisco import PYVISCO
from rubberfric.io.prony_cards.series import STRESS, TEMPERATURE, Material, Units, series_of
from rubberfric.io.tables.text import read_text
from rubberfric.materials.shifts.laws import WLF

FORMATS = {
    "abaqus": ABAQUS,
    "ansys": ANSYS,
    "comsol": COMSOL,
    "lsdyna": LSDYNA,
    "openradioss": OPENRADIOSS,
    "pyvisco": PYVISCO,
}
# Of the mass per volume that belongs to a stress, metres or millimetres and seconds [kg/m^3].
_DENSITY = {"Pa": 1.0, "MPa": 1e12}


def read_prony(
    path: str | os.PathLike[str],
    program: str | None = None,
    *,
    unit_stress: str | None = None,
    unit_temperature: str = "K",
    poisson: float | None = None,
    shift: bool = True,
) -> Material:
    """The Prony series in a file of material cards; of several materials the first.

    Parameters
    ----------
    path : file
    program : "abaqus", "ansys", "comsol", "lsdyna", "openradioss" or "pyvisco"; None: as the file looks
    unit_stress : "Pa", "kPa", "MPa" or "GPa"; must be given but for pyvisco, whose file says it
    unit_temperature : "K" or "C", of a WLF shift
    poisson : Poisson's ratio [-], or None
        a constant one for the shear series of the cards, whatever they say of the bulk modulus; needed for
        pyvisco: of Young's modulus it says none (0.5 if None), for a shear modulus it must be given.
    shift : bool; False leaves the shift out

    Returns
    -------
    Prony where shear and bulk modulus relax alike, poisson is given or Poisson's ratio is 0.5;
    PronyShear where the bulk modulus is elastic.

    Raises
    ------
    ValueError
        one line naming the file and what is missing or wrong: no such cards, no units, bulk terms of
        their own, weights that add up to more than 1, a shift other than WLF.
    """
    text = read_text(path)
    try:
        if program is None:
            found = [name for name, form in FORMATS.items() if re.search(form.sign, text, re.I | re.M)]
            if not found:
                raise ValueError(
                    "has no Prony series: must be cards of abaqus, ansys, lsdyna or openradioss, or a table"
                    " of comsol or pyvisco"
                )
            program = found[0]
        _check("program", program, FORMATS)
        if unit_stress is not None:
            _check("unit_stress", unit_stress, STRESS)
        _check("unit_temperature", unit_temperature, TEMPERATURE)
        if unit_stress is None and program != "pyvisco":
            raise ValueError("unit_stress is missing: must be given, cards do not say it; Pa, MPa, ...")
        units = Units(unit_stress, STRESS[unit_stress or "Pa"], TEMPERATURE[unit_temperature])
        return FORMATS[program].read(text, units, poisson, shift)
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
) -> str:
    """A Prony series as material cards.

    Parameters
    ----------
    path : file to write, whole or not at all, or None for the text alone
    material : Prony, PronyShear, or what holds one as `material`: a Body, a PronyFit
    program : "abaqus", "ansys", "comsol", "lsdyna", "openradioss" or "pyvisco"
        abaqus: *ELASTIC and *VISCOELASTIC, TIME=PRONY, with *TRS for a WLF shift. Poisson's ratio 0.5 is
        written as it is (k_i = 0): hybrid elements take it, all others need one below 0.5, so `bulk`.
        ansys: MP,EX and PRXY, TB,PRONY for shear and bulk, TB,SHIFT; at most 100 terms.
        lsdyna: *MAT_GENERAL_VISCOELASTIC (076) in fields of 10 characters, which hold 6 digits; at most
        18 terms, of which the relaxed modulus is one (rate 0); a WLF shift in K.
        comsol: the table of branches that its Generalized Maxwell model loads; moduli and shift in comments.
        openradioss: /MAT/LAW42 with the relaxed moduli and /VISC/PRONY; no shift.
        pyvisco: its CSV table of terms, of Young's modulus.
    unit_stress : "Pa", "kPa", "MPa" or "GPa"; times are in s
    unit_temperature : "K" or "C", of the reference temperature of a shift
    bulk : elastic bulk modulus [Pa] for a Prony, whose shear modulus alone relaxes then, or None
    density : [kg/m^3], written in kg/m^3 beside Pa, in t/mm^3 beside MPa; lsdyna and openradioss must
        have it
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
    _check("program", program, FORMATS)
    _check("unit_stress", unit_stress, STRESS)
    _check("unit_temperature", unit_temperature, TEMPERATURE)
    mass = _density(density, unit_stress)
    series, form = series_of(material, bulk, shift), FORMATS[program]
    if series.shift is not None and not (isinstance(series.shift, WLF) and form.shifts):
        raise ValueError(
            f"material has the shift {type(series.shift).__name__}: {program} cards must have"
            f" {'WLF' if form.shifts else 'none'}; shift=False leaves it out"
        )
    if series.shift is not None and series.shift.vertical is not None:
        raise ValueError(
            f"material.shift.vertical is {type(series.shift.vertical).__name__}: must be None for {program};"
            " shift=False leaves out all of the shift"
        )
    degrees = f", {unit_temperature}" if series.shift is not None else ""
    head = f"Prony series of {series.tau.size} terms. Units: {unit_stress}, s{degrees}"
    lines = [f"{form.comment} {head}"] if form.comment else []
    lines += form.write(
        series, Units(unit_stress, STRESS[unit_stress], TEMPERATURE[unit_temperature]), mass, name
    )
    text = "\n".join(lines) + "\n"
    if path is not None:
        folder = as_path(path).parent
        if not folder.is_dir():
            raise ValueError(f"{path}: there is no folder {str(folder)!r}; it must exist")
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8", newline="\n")
    return text


def _check(name: str, value: object, allowed: dict) -> None:
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name} = {shown(value)}: {closest(value, tuple(allowed))}")


def _density(density: float | None, unit_stress: str) -> float | None:
    if density is None:
        return None
    if unit_stress not in _DENSITY:
        raise ValueError(f"density = {shown(density)}: must be absent; unit_stress must be Pa or MPa for it")
    check_values("density", as_leaf("density", density, 0), POSITIVE)
    return float(density) / _DENSITY[unit_stress]
