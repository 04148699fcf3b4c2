"""Names and units of columns as instruments and other programs spell them."""

import re

from rubberfric.io.tables.columns import COLUMNS

# Other spellings of the names in `COLUMNS`. "M_..." is E_... or G_..., as the caller says.
_SPELLINGS = {
    "E_stor": ("E'",),
    "E_loss": ("E''",),
    "E_comp": ("|E*|", "E*"),
    "G_stor": ("G'",),
    "G_loss": ("G''",),
    "G_comp": ("|G*|", "G*"),
    "M_stor": ("storage modulus", "speichermodul", "module de conservation", "module de stockage"),
    "M_loss": ("loss modulus", "verlustmodul", "module de perte", "module de dissipation"),
    "M_comp": ("complex modulus", "komplexer modul", "betrag komplexer modul", "module complexe"),
    "tan_del": (
        *("tan(delta)", "tan delta", "tan(\u03b4)", "tan \u03b4", "tan d", "loss factor"),
        *("verlustfaktor", "facteur de perte"),
    ),
    "omega": (
        "angular frequency",
        "\u03c9",
        "kreisfrequenz",
        "winkelfrequenz",
        "pulsation",
        "fréquence angulaire",
    ),
    "f": ("frequency", "frequenz", "prüffrequenz", "fréquence"),
    "T": ("temperature", "temp", "temperatur", "probentemperatur", "température"),
    "aT": ("shift factor", "verschiebungsfaktor", "facteur de translation"),
    "bT": ("vertical shift factor", "vertikaler verschiebungsfaktor", "facteur de translation verticale"),
    "strain": (
        *("strain", "strain amplitude", "dynamic strain", "oscillation strain", "shear strain"),
        *("dehnung", "dehnungsamplitude", "deformation", "deformationsamplitude", "scherdeformation"),
        *("déformation", "amplitude de déformation"),
    ),
    "v": (
        *(
            "velocity",
            "sliding velocity",
            "speed",
            "sliding speed",
            "geschwindigkeit",
            "gleitgeschwindigkeit",
        ),
        *("vitesse", "vitesse de glissement"),
    ),
    "mu": (
        *("friction coefficient", "coefficient of friction", "cof", "mu_visc", "\u03bc"),
        *("reibwert", "reibbeiwert", "reibungskoeffizient", "reibungszahl"),
        *("coefficient de frottement", "coefficient de friction"),
    ),
    "p": (
        *("pressure", "contact pressure", "druck", "kontaktdruck", "anpressdruck", "flächenpressung"),
        *("pression", "pression de contact"),
    ),
    "A_over_A0": ("contact area", "A/A0", "kontaktfläche", "aire de contact"),
    "q": ("wavevector", "wavenumber", "wellenvektor", "wellenzahl", "vecteur d'onde", "nombre d'onde"),
}
_NAMES = {spelling: name for name, spellings in _SPELLINGS.items() for spelling in spellings}
# Set values, taken where the measured ones are not there.
SET_VALUES = {"f_set": "f", "T_set": "T"}
# Columns that belong to such tables and are never read.
OTHERS = (
    "Set",
    "t",
    "t_set",
    "E_relax",
    "G_relax",
    *(f"{name}_filt" for name in ("E_stor", "E_loss", "G_stor", "G_loss")),
)

_UNIT_SPELLINGS = {
    "C": ("°C", "\u00baC", "℃", "degC", "deg C", "° C", "Grad C"),
    "K": ("Kelvin",),
    "rad/s": ("rad/sec", "rad s-1", "s-1", "1/s"),
    "MPa": ("N/mm2", "N mm-2", "MN/m2"),
    "kPa": ("kN/m2",),
    "Pa": ("N/m2", "N m-2"),
    "-": ("", "1"),
    **{f"{of}m/s": (f"{of}m s-1", f"{of}m/sec") for of in ("", "m", "u")},
    **{f"{of}m^4": (f"{of}m4",) for of in ("", "m", "u", "n")},
    **{f"{of}m^3": (f"{of}m3",) for of in ("", "m", "u", "n")},
    **{f"1/{of}m": (f"{of}m-1", f"rad/{of}m") for of in ("", "m", "u", "n")},
}
# As units are spelled above: u for micro, exponents behind their letter.
_PLAIN = str.maketrans("\u00b5\u03bc⁻¹²³⁴·\u22c5", "uu-1234  ", "^")
_LOG_UNIT = re.compile(r"log_?10\((.+)\)")
_KNOWN_UNITS = {unit for column in COLUMNS.values() for unit in column.units}
_UNITS = {spelling: unit for unit, spellings in _UNIT_SPELLINGS.items() for spelling in spellings}
# Signs that stand for a prime, for two of them, and for the Greek letter mu.
_PRIMES, _DOUBLE = "\u00b4\u0060\u2018\u2019\u2032\u02b9", '"\u2033\u201d'
_ONE_SIGN = str.maketrans({p: "'" for p in _PRIMES} | {d: "''" for d in _DOUBLE} | {"\u00b5": "\u03bc"})
_LOGARITHM = re.compile(r"(?:log_?10|log|lg)[ _(]\s*(.+?)\s*\)?")
_BRACKETS = re.compile(r"(.+?)\s*[\[(]([^\[\]()]*(?:\([^()]*\))?)[\])]")


def spellings() -> dict[str, tuple[str, ...]]:
    """Other titles under which a column of `COLUMNS` is read; those of M_... are E_... or G_..., as said."""
    return dict(_SPELLINGS)


def unit_spellings() -> dict[str, tuple[str, ...]]:
    """Other spellings of units; signs as µ, ², ⁻¹ and · are understood in all of them."""
    return dict(_UNIT_SPELLINGS)


def is_foreign(title: str, name: str | None) -> bool:
    """Whether a title, whose `known_name` is `name`, is of another program, not of an own table."""
    own = name in COLUMNS and COLUMNS[name].offered and name == title
    return title in OTHERS or (name is not None and not own)


def known_name(title: str, generic: str = "E") -> tuple[str | None, str | None]:
    """What a column's title says: "Temperature (°C)" is ("T", "°C").

    Parameters
    ----------
    title : "name", "name [unit]" or "name (unit)", as instruments and other programs spell them
    generic : "E" or "G", what a "storage modulus" is one of

    Returns
    -------
    (name, unit), the name that the column has in own tables (`rubberfric.io.COLUMNS`) and its unit as it is
        written; None for what the title does not say, both where it is none that is known
    """
    title = title.strip()
    for text, unit in ((title, None), *((m[1], m[2]) for m in [_BRACKETS.fullmatch(title)] if m)):
        known = _known(text)
        if known is not None:
            return (generic + known[1:] if known.startswith("M_") else known), unit
    return None, None


def known_unit(unit: str | None, name: str | None) -> str:
    """A unit as the column of that name spells it: "N/mm²" is "MPa", "um/s" of log10_v is "log10(um/s)".

    Parameters
    ----------
    unit, name : as `known_name` gives them; no unit is "-"
    """
    unit = (unit or "").strip()
    units = COLUMNS[name].units if name in COLUMNS else ()
    logarithm = _LOG_UNIT.fullmatch(unit)
    if unit in units:
        return unit
    plain = plain_unit(logarithm[1] if logarithm else unit)
    unit = _UNITS.get(plain, plain if plain in _KNOWN_UNITS else unit)
    return f"log10({unit})" if unit not in units and f"log10({unit})" in units else unit


def plain_unit(unit: str) -> str:
    """A unit with u for micro, digits and carets for exponents, single blanks."""
    return " ".join(unit.translate(_PLAIN).split())


def _known(text: str) -> str | None:
    if text in COLUMNS or text in SET_VALUES:
        return text
    text = " ".join(text.translate(_ONE_SIGN).split())
    if text in _NAMES:
        return _NAMES[text]
    plain = re.sub(r"[\s_.]+", " ", text).strip().lower()
    if plain in _NAMES:
        return _NAMES[plain]
    logarithm = _LOGARITHM.fullmatch(text)
    if logarithm:
        known = f"log10_{_known(logarithm[1])}"
        return known if known in COLUMNS else None
    return None
