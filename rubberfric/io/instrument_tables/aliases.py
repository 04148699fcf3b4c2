"""Names and units of columns as instruments and other programs spell them."""

import re

# Another name of a column: which of `columns.COLUMNS` it is. "M_..." is E_... or G_..., as the caller says.
ALIASES = {
    "E'": "E_stor",
    "E''": "E_loss",
    "|E*|": "E_comp",
    "E*": "E_comp",
    "G'": "G_stor",
    "G''": "G_loss",
    "|G*|": "G_comp",
    "G*": "G_comp",
    "storage modulus": "M_stor",
    "loss modulus": "M_loss",
    "complex modulus": "M_comp",
    "tan(delta)": "tan_del",
    "tan delta": "tan_del",
    "tan(\u03b4)": "tan_del",
    "tan \u03b4": "tan_del",
    "tan d": "tan_del",
    "loss factor": "tan_del",
    "angular frequency": "omega",
    "\u03c9": "omega",
    "frequency": "f",
    "temperature": "T",
    "temp": "T",
    "shift factor": "aT",
    "velocity": "v",
    "sliding velocity": "v",
    "friction coefficient": "mu",
    "coefficient of friction": "mu",
    "mu_visc": "mu",
    "\u03bc": "mu",
    "pressure": "p",
    "contact pressure": "p",
    "contact area": "A_over_A0",
    "A/A0": "A_over_A0",
    "wavevector": "q",
    "wavenumber": "q",
}
# Set values, taken where the measured ones are not there.
SET_VALUES = {"f_set": "f", "T_set": "T"}
# Columns that belong to such tables and are never read.
OTHERS = (
    "Set",
    "t",
    "t_set",
    "E_relax",
    "G_relax",
    "E_stor_filt",
    "E_loss_filt",
    "G_stor_filt",
    "G_loss_filt",
)

_UNITS = {
    "°C": "C",
    "\u00baC": "C",
    "℃": "C",
    "degC": "C",
    "rad/sec": "rad/s",
    "N/mm²": "MPa",
    "N/mm^2": "MPa",
    "N/mm2": "MPa",
    "N/m²": "Pa",
    "N/m^2": "Pa",
    "m⁴": "m^4",
    "m4": "m^4",
    "m³": "m^3",
    "m3": "m^3",
    "m⁻¹": "1/m",
    "m^-1": "1/m",
    "": "-",
    "1": "-",
}
# Signs that stand for a prime, for two of them, and for the Greek letter mu.
_PRIMES, _DOUBLE = "\u00b4\u0060\u2018\u2019\u2032\u02b9", '"\u2033\u201d'
_MARKS = str.maketrans({p: "'" for p in _PRIMES} | {d: "''" for d in _DOUBLE} | {"\u00b5": "\u03bc"})
_LOGARITHM = re.compile(r"(?:log_?10|log|lg)[ _(]\s*(.+?)\s*\)?")
_BRACKETS = re.compile(r"(.+?)\s*[\[(]([^\[\]()]*(?:\([^()]*\))?)[\])]")


def is_foreign(title, known, columns):
    """Whether a title, and what `known_name` says of it, is of another program, not of an own table."""
    name, _ = known
    return title in OTHERS or (
        name is not None and (name not in columns or not columns[name].offered or name != title)
    )


def known_name(title, columns, generic):
    """What a column's title, "name" or "name [unit]", says: (name, unit), or None for what it does not.

    The name is one of `columns` or `SET_VALUES`; a "storage modulus" is one of `generic`, "E" or "G".
    """
    title = title.strip()
    for text, unit in ((title, None), *((m[1], m[2]) for m in [_BRACKETS.fullmatch(title)] if m)):
        known = _known(text, columns)
        if known is not None:
            return (generic + known[1:] if known.startswith("M_") else known), unit
    return None, None


def _known(text, columns):
    if text in columns or text in SET_VALUES:
        return text
    text = " ".join(text.translate(_MARKS).split())
    if text in ALIASES:
        return ALIASES[text]
    words = re.sub(r"[\s_.]+", " ", text).strip().lower()
    if words in ALIASES:
        return ALIASES[words]
    logarithm = _LOGARITHM.fullmatch(text)
    if logarithm:
        known = _known(logarithm[1], columns)
        return f"log10_{known}" if f"log10_{known}" in columns else None
    return None


def known_unit(unit, known, columns):
    """A unit as `columns.COLUMNS` spells it."""
    unit = (unit or "").strip().translate(str.maketrans({"\u00b5": "u", "\u03bc": "u"}))
    unit = _UNITS.get(unit, unit)
    units = columns[known].units if known in columns else ()
    return f"log10({unit})" if unit not in units and f"log10({unit})" in units else unit
