"""Columns of tables: names, units, conversion to SI, and spellings of instruments and other programs."""

import math
import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from rubberfric.base.atomic import is_number
from rubberfric.io.text_tables import units
from rubberfric.io.text_tables.spellings import SPELLINGS
from rubberfric.io.text_tables.units import UNIT_SPELLINGS, plain_unit


class Column(NamedTuple):
    """Quantity and units of a column."""

    name: str  # quantity in SI
    units: Mapping[str, float]  # {unit: factor}, value in SI = factor * value + offset
    positive: bool = True
    nonzero: bool = False
    limit: tuple[float, str] | None = None  # (value in SI, text); all values must be below
    log10: bool = False  # the file holds the logarithm of the value in the unit
    offered: bool = True  # listed in messages; other columns are read from exports only

    def value(self, number: float, unit: str) -> float:
        """Convert a number in a file to SI."""
        return self.units[unit] * (10.0**number if self.log10 else number) + units.OFFSETS.get(unit, 0.0)

    def read(self, where: str, text: str, unit: str) -> float:
        """Convert the text of a field to a number in SI.

        The message of the ValueError for an invalid field begins with `where`.
        """
        try:
            if "_" in text:  # Python's digit grouping is not allowed in CSV
                raise ValueError
            value = float(text)
        except ValueError:
            advice = "; save the formula's value in the file" if text.startswith("=") else ""
            raise ValueError(f"{where}: must be a number{advice}") from None
        if not math.isfinite(value):
            raise ValueError(f"{where}: must be finite")
        try:
            value = self.value(value, unit)
        except OverflowError:
            value = math.inf
        self.check(where, value)
        return value

    def check(self, where: str, value: float) -> None:
        """Raise ValueError if a value in SI is invalid. The message begins with `where`."""
        if not math.isfinite(value):
            raise ValueError(f"{where}: must be finite in SI units")
        if self.positive and not value > 0:
            raise ValueError(f"{where}: must be > 0{' K' if self.name == 'T' else ''}")
        if self.nonzero and value == 0:
            raise ValueError(f"{where}: must not be 0")
        if self.limit is not None and not value < self.limit[0]:
            raise ValueError(f"{where}: must be < {self.limit[1]}")


def _log10(name: str, units: Mapping[str, float], offered: bool = False) -> Column:
    """Return a column that holds the decimal logarithm of a quantity.

    The units of the column are texts such as "log10(Pa)". If the quantity has no unit, the unit "-" is
    allowed too.
    """
    own = dict(units) if list(units) == ["-"] else {}
    logs = own | {f"log10({unit})": factor for unit, factor in units.items()}
    return Column(name, logs, log10=True, offered=offered)


# Names of columns. The first unit of each is SI, in which tables are written.
COLUMNS = {
    "omega": Column("omega", units.ANGULAR),
    "f": Column("omega", units.FREQUENCY),
    "E_stor": Column("E_stor", units.PRESSURE),
    "E_loss": Column("E_loss", units.PRESSURE),
    "t": Column("t", units.TIME),
    "t_step": Column("t", units.TIME, offered=False),
    "E_relax": Column("E_relax", units.PRESSURE),
    "D_creep": Column("D_creep", units.COMPLIANCE),
    "q": Column("q", units.WAVEVECTOR),
    "log10_q": _log10("q", units.WAVEVECTOR, offered=True),
    "C": Column("C", units.SPECTRUM),
    "log10_C": _log10("C", units.SPECTRUM, offered=True),
    "C_1D": Column("C_1D", units.LINE),
    "log10_C_1D": _log10("C_1D", units.LINE, offered=True),
    "phi": Column("phi", {"rad": 1.0}, positive=False),
    "phi_deg": Column("phi", {"deg": math.pi / 180}, positive=False),
    "T": Column("T", units.TEMPERATURE),
    "aT": Column("aT", units.ONE),
    "bT": Column("bT", units.ONE),
    "strain": Column("strain", units.RATIO),
    "storage_factor": Column("storage_factor", units.ONE),
    "loss_factor": Column("loss_factor", units.ONE),
    "v": Column("v", units.SPEED, positive=False),
    "log10_v": _log10("v", units.SPEED, offered=True),
    "p": Column("p", units.PRESSURE),
    "mu": Column("mu", units.RATIO, positive=False),
    "A_over_A0": Column("A_over_A0", units.RATIO),
    "sigma": Column("sigma", units.RATIO),
    "sigma_stor": Column("sigma_stor", units.PRESSURE),
    "sigma_loss": Column("sigma_loss", units.PRESSURE),
    "sigma_relax": Column("sigma_relax", units.PRESSURE),
    "sigma_creep": Column("sigma_creep", units.COMPLIANCE),
    "sigma_C": Column("sigma_C", units.SPECTRUM),
    "relative_sigma": Column("relative_sigma", units.RATIO),
    "log10_omega": _log10("omega", units.ANGULAR),
    "log10_f": _log10("omega", units.FREQUENCY),
    **{f"log10_{name}": _log10(name, units.PRESSURE) for name in ("E_stor", "E_loss")},
    **{f"log10_{name}": _log10(name, units.ONE) for name in ("aT", "bT")},
    "log10_p": _log10("p", units.PRESSURE),
    **{
        name: Column(name, units.PRESSURE, offered=False)
        for name in ("E_comp", "G_stor", "G_loss", "G_comp", "G_relax", "E_stress", "G_stress")
    },
    **{
        f"{letter}_{part}": Column(f"{letter}_{part}", units.COMPLIANCE, offered=False)
        for letter in "DJ"
        for part in ("stor", "loss", "comp", "creep")[: 4 if letter == "J" else 3]
    },
    **{f"log10_{name}": _log10(name, units.PRESSURE) for name in ("G_stor", "G_loss")},
    "tan_del": Column("tan_del", units.RATIO, offered=False),
    "k": Column("q", units.WAVEVECTOR, offered=False),
    "n": Column("q", units.CYCLES, offered=False),
    "wavenumber": Column("q", units.NUMBER, offered=False),
    **{
        name: Column("C_1D", units.LINE, offered=False)
        for name in ("W1", "Wr", "G_d", "q_C_iso_over_pi", "C_1D_surfacetopography")
    },
    "delta": Column("delta", units.ANGLE, limit=(math.pi / 2, "90 deg; is it in deg or rad?"), offered=False),
    "F_t": Column("F_t", units.FORCE, positive=False, offered=False),
    "F_n": Column("F_n", units.FORCE, positive=False, nonzero=True, offered=False),
    "v_travel": Column("v_travel", units.SPEED, positive=False, offered=False),
    "slip_angle": Column("slip_angle", units.ANGLE, positive=False, offered=False),
    "slip_ratio": Column("slip_ratio", units.RATIO, positive=False, offered=False),
    "x": Column("x", units.PATH, positive=False, offered=False),
    "stroke": Column("stroke", units.PATH, offered=False),
    "A": Column("A", units.AREA, offered=False),
    "moment": Column("moment", units.MOMENT, positive=False, offered=False),
    "sigma_F_t": Column("sigma_F_t", units.FORCE, offered=False),
    "sigma_moment": Column("sigma_moment", units.MOMENT, offered=False),
}

_NAMES = {spelling: name for name, spellings in SPELLINGS.items() for spelling in spellings}
# Set values and temperatures of a surface, used if the column itself is missing. The first one counts.
SET_VALUES = {"f_set": "f", "T_set": "T", "T_surface": "T"}
# Columns that are used if there are others of their quantity, such as times since the start of a test.
PREFERRED = ("t_step",)
# Quantities that are measured over time.
TRANSIENTS = ("E_relax", "D_creep", "G_relax", "J_creep")
# Letters of quantities in tension and in shear, by the letter of a title that leaves this open.
_GENERIC = {"M": {"E": "E", "G": "G"}, "N": {"E": "D", "G": "J"}}
# Titles that only other programs write.
_UNUSED = ("Set", "t", "t_set", *(f"{m}_{n}" for m in "EG" for n in ("relax", "stor_filt", "loss_filt")))

# Words of titles of standard errors, in English, German and French.
_OF_ERRORS = {
    *("std", "sd", "stdev", "stddev", "stderr", "sem", "se", "sigma", "var", "variance", "ci"),
    *("err", "error", "errors", "uncertainty"),
    *("standardabweichung", "fehler", "unsicherheit", "incertitude"),
}
_AROUND = re.compile(r"^[\[(]([^\[\]()]*)[\])]$")  # brackets around a unit
_LOG_UNIT = re.compile(r"log_?10\((.+)\)")
_KNOWN_UNITS = {unit for column in COLUMNS.values() for unit in column.units}
_UNITS = {spelling: unit for unit, spellings in UNIT_SPELLINGS.items() for spelling in spellings}
# Signs that stand for a prime.
_PRIMES = "\u00b4\u0060\u2018\u2019\u2032\u02b9"
# Signs that stand for two primes.
_DOUBLES = '"\u2033\u201d'
# One sign for each prime, and for the Greek letter mu.
_ONE_SIGN = str.maketrans({p: "'" for p in _PRIMES} | {d: "''" for d in _DOUBLES} | {"\u00b5": "\u03bc"})
_LOGARITHM = re.compile(r"(?:log_?10|log|lg)[ _(]\s*(.+?)\s*\)?")
# Longer texts are no titles. The patterns take seconds on a file without line ends.
LONGEST_TITLE = 1000
# Units behind an underscore, as in "freq_hz".
_SUFFIXES = {
    **{text.lower(): text for text in ("Hz", "kHz", "Pa", "kPa", "MPa", "GPa", "C", "K")},
    **{"deg": "deg", "rad": "rad"},
    **{"rad_s": "rad/s", "pct": "%", "percent": "%", "m_s": "m/s", "mm_s": "mm/s", "um_s": "um/s"},
    "km_h": "km/h",
}
_SUFFIX = re.compile(rf"(.+?)_({'|'.join(_SUFFIXES)})", re.IGNORECASE)
_BRACKETS = re.compile(r"(.+?)\s*[\[(]([^\[\]()]*(?:\([^()]*\))?)[\])]")
# Between a name and a unit, as in "E'/MPa", "Temp., °C", "E' in MPa", "E' en MPa" and "Freq Hz".
_BETWEEN = re.compile(r"\s*/\s*|,\s*|\s+(?:in|en)\s+|\s+")


def quantities_of(names: Iterable[str | None]) -> list[str]:
    """Return the quantities of columns with the given names; None stands for an unknown column."""
    return [COLUMNS[SET_VALUES.get(name, name)].name for name in names if name is not None]


def is_foreign(title: str, name: str | None) -> bool:
    """Return True if only other programs, and not this project, write a column title.

    `name` is the name that `known_name` returns for the title.
    """
    own = name in COLUMNS and COLUMNS[name].offered and name == title
    return title in _UNUSED or (name is not None and not own)


def is_error(title: str) -> bool:
    """Return True if a word of a column title names an error, as in "std mu", "mu_err" and "±"."""
    return "±" in title or not _OF_ERRORS.isdisjoint(re.split(r"[\W_]+", title.lower()))


def known_name(title: str, generic: str = "E") -> tuple[str | None, str | None]:
    """Return the name and the unit in the title of a column.

    For example, "Temperature (°C)", "Temp./°C" and "Temp °C" give ("T", "°C"). A unit may stand behind an
    underscore: "freq_hz" gives ("f", "Hz").

    Parameters
    ----------
    title : "name", "name [unit]" or "name (unit)", in the spelling of an instrument or another program
    generic : "E" or "G", the modulus that "storage modulus" means

    Returns
    -------
    Tuple of the name in `rubberfric.io.COLUMNS` and the unit as written. The unit is None if the title has no
    unit. An unknown title gives (None, None).

    Examples
    --------
    >>> rf.io.known_name("Speichermodul (MPa)"), rf.io.known_name("Sliding velocity [mm/s]")
    (('E_stor', 'MPa'), ('v', 'mm/s'))
    >>> rf.io.known_name("storage modulus", generic="G")
    ('G_stor', None)
    """
    title = title.strip()
    if len(title) > LONGEST_TITLE:
        return None, None
    bracket, suffix = _BRACKETS.fullmatch(title), _SUFFIX.fullmatch(title)
    candidates = [(title, None)]
    candidates += [(bracket[1], bracket[2])] if bracket else []
    candidates += [(suffix[1], _SUFFIXES[suffix[2].lower()])] if suffix else []
    for between in _BETWEEN.finditer(title):
        text, unit = title[: between.start()], title[between.end() :]
        of_time = unit in units.TIME  # "T min" is a minimum
        if (
            _is_unit(unit)
            and ("/" in between[0] or not is_number(unit))
            and not (of_time and not _is_time(text))
        ):
            candidates.append((text, unit))
    for text, unit in candidates:
        known = _known(text) or _with_symbol(text)
        if known is not None:
            return generic_name(known, generic), unit
    logarithm = _LOGARITHM.fullmatch(title)  # such as lg(f/Hz)
    if logarithm:
        known, unit = known_name(logarithm[1], generic)
        if f"log10_{known}" in COLUMNS:
            return f"log10_{known}", unit
    return None, None


def generic_name(name: str, generic: str) -> str:
    """Return the quantity in tension (generic = "E") or shear ("G") for a name such as M_stor or N_creep.

    Other names are unchanged.
    """
    letters = _GENERIC.get(name[0], {}) if name[1:2] == "_" else {}
    return letters[generic] + name[1:] if generic in letters else name


def known_unit(unit: str | None, name: str | None) -> str:
    """Return a unit in the spelling of `COLUMNS[name]`.

    For example, "N/mm²" and "[N/mm²]" become "MPa", and "um/s" of the column log10_v becomes "log10(um/s)".

    Parameters
    ----------
    unit, name : results of `known_name`. A missing unit becomes "-".

    Examples
    --------
    >>> rf.io.known_unit("[N/mm²]", "E_stor"), rf.io.known_unit(None, "mu")
    ('MPa', '-')
    """
    unit = _AROUND.sub(r"\1", (unit or "").strip()).strip()
    units = COLUMNS[name].units if name in COLUMNS else ()
    logarithm = _LOG_UNIT.fullmatch(unit)
    if unit in units:
        return unit
    plain = plain_unit(logarithm[1] if logarithm else unit)
    unit = _UNITS.get(plain, plain if plain in _KNOWN_UNITS else unit)
    return f"log10({unit})" if unit not in units and f"log10({unit})" in units else unit


def settled_axis(name: str | None, unit: str | None) -> str | None:
    """Return the name of an abscissa or an area after its unit.

    A frequency in rad/s is omega. A wavevector in cycles/m is n, and a wavenumber in rad/m is q. A contact
    area in m^2 is A. A column n whose unit is no spatial frequency, such as a counter, and a column A whose
    unit is no area, are unknown. Other names are unchanged.
    """
    if name in ("A", "A_over_A0"):
        is_area = known_unit(unit, "A") in units.AREA
        return "A" if is_area else None if name == "A" else name
    plain = known_unit(unit, name)
    if name == "f":
        return "omega" if plain in units.ANGULAR else "f"
    if name not in ("q", "k", "wavenumber", "n"):
        return name
    if plain.startswith("cycles/"):
        return "n"
    if "rad" in (unit or ""):
        return "q"
    return None if name == "n" and plain not in units.CYCLES else name


def is_unit(text: str) -> bool:
    """Return True for a unit of a column except "-", possibly in brackets."""
    text = _AROUND.sub(r"\1", text.strip()).strip()
    return text not in UNIT_SPELLINGS["-"] and text != "-" and _is_unit(text)


def _is_unit(text: str) -> bool:
    plain = plain_unit(text)
    return plain in _KNOWN_UNITS or _UNITS.get(plain, "") in _KNOWN_UNITS


def _is_time(text: str) -> bool:
    return (_known(text) or _with_symbol(text)) in ("t", "t_step")


def _with_symbol(text: str) -> str | None:
    """Return the known name in "Storage modulus (E')" or "Storage modulus E'".

    The result is None if name and symbol do not agree.
    """
    bracket = _BRACKETS.fullmatch(text)
    for words in ((bracket[1], bracket[2]) if bracket else (), text.rpartition(" ")[::2]):
        name, symbol = map(_known, words or ("", ""))
        if name is not None and symbol is not None:
            meanings = (name, generic_name(name, "E"), generic_name(name, "G"))
            if symbol in meanings or quantity_of(symbol) == quantity_of(name):
                return symbol
    return None


def quantity_of(name: str) -> str:
    """Return the quantity of a column with a known name; other names are unchanged."""
    return COLUMNS[name].name if name in COLUMNS else name


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
