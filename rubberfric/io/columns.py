"""Columns of tables: names, units, conversion to SI, and spellings of instruments and other programs."""

import math
import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from rubberfric.base.atomic import is_number
from rubberfric.base.units import ZERO_CELSIUS, hertz


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
        return self.units[unit] * (10.0**number if self.log10 else number) + _OFFSETS.get(unit, 0.0)

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


_ONE = {"-": 1.0}  # factors, which are never in percent
_RATIO = {"-": 1.0, "%": 1e-2}  # friction, area, strain, relative errors
_FREQUENCY = {"Hz": hertz(1.0), "kHz": hertz(1e3), "MHz": hertz(1e6), "mHz": hertz(1e-3)}  # [rad/s]
_FREQUENCY |= {"rpm": hertz(1 / 60)}
_ANGULAR = {"rad/s": 1.0}  # angular frequencies
_PSI = 6894.757293168361  # lbf/in^2 [Pa]
_PRESSURE = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5}  # pressures and moduli [Pa]
_PRESSURE |= {"psi": _PSI, "ksi": 1e3 * _PSI, "dyn/cm2": 0.1, "mbar": 100.0, "N/cm2": 1e4}
_PRESSURE |= {"hPa": 100.0, "atm": 101325.0, "kgf/cm2": 98066.5}
_FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605}  # [N]
_MOMENT = {"N m": 1.0, "N mm": 1e-3, "kN m": 1e3, "lbf ft": 4.4482216152605 * 0.3048}  # [N m]
_ANGLE = {"rad": 1.0, "deg": math.pi / 180, "mrad": 1e-3}  # [rad]
_SPEED = {"m/s": 1.0, "mm/s": 1e-3, "um/s": 1e-6, "nm/s": 1e-9}  # [m/s]
_SPEED |= {"cm/s": 1e-2, "mm/min": 1e-3 / 60, "m/min": 1.0 / 60, "km/h": 1 / 3.6}
_SPEED |= {"mph": 0.44704, "in/s": 0.0254, "ft/s": 0.3048, "in/min": 0.0254 / 60, "ft/min": 0.3048 / 60}
_TEMPERATURE = {"K": 1.0, "C": 1.0, "°C": 1.0, "°F": 5 / 9}  # kelvins per degree
_OFFSETS = {"C": ZERO_CELSIUS, "°C": ZERO_CELSIUS, "°F": 459.67 * 5 / 9}  # zeros of the scales [K]
_LENGTHS = {"m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6, "nm": 1e9}  # number of each length in a metre
_WAVEVECTOR = {f"1/{length}": per for length, per in _LENGTHS.items()}  # angular wavevectors [1/m]
# Spatial frequencies. 1/m of a column n or "spatial frequency" is cycles/m.
_CYCLES = {f"{of}/{length}": 2 * math.pi * per for of in ("cycles", "1") for length, per in _LENGTHS.items()}
# 1/m is no unit of a wavenumber, which may be 2 pi over the wavelength or one over it.
_NUMBER = {f"rad/{length}": per for length, per in _LENGTHS.items()}
_NUMBER |= {unit: factor for unit, factor in _CYCLES.items() if unit.startswith("cycles")}
_SPECTRUM = {"m^4": 1.0, "cm^4": 1e-8, "mm^4": 1e-12, "um^4": 1e-24, "nm^4": 1e-36}  # C of a surface [m^4]
_LINE = {"m^3": 1.0, "cm^3": 1e-6, "mm^3": 1e-9, "um^3": 1e-18, "nm^3": 1e-27}  # C_1D of a profile [m^3]


# Names of columns. The first unit of each is SI, in which tables are written.
COLUMNS = {
    "omega": Column("omega", _ANGULAR),
    "f": Column("omega", _FREQUENCY),
    "E_stor": Column("E_stor", _PRESSURE),
    "E_loss": Column("E_loss", _PRESSURE),
    "q": Column("q", _WAVEVECTOR),
    "log10_q": _log10("q", _WAVEVECTOR, offered=True),
    "C": Column("C", _SPECTRUM),
    "log10_C": _log10("C", _SPECTRUM, offered=True),
    "C_1D": Column("C_1D", _LINE),
    "log10_C_1D": _log10("C_1D", _LINE, offered=True),
    "phi": Column("phi", {"rad": 1.0}, positive=False),
    "phi_deg": Column("phi", {"deg": math.pi / 180}, positive=False),
    "T": Column("T", _TEMPERATURE),
    "aT": Column("aT", _ONE),
    "bT": Column("bT", _ONE),
    "strain": Column("strain", _RATIO),
    "storage_factor": Column("storage_factor", _ONE),
    "loss_factor": Column("loss_factor", _ONE),
    "v": Column("v", _SPEED, positive=False),
    "log10_v": _log10("v", _SPEED, offered=True),
    "p": Column("p", _PRESSURE),
    "mu": Column("mu", _RATIO, positive=False),
    "A_over_A0": Column("A_over_A0", _RATIO),
    "sigma": Column("sigma", _RATIO),
    "sigma_stor": Column("sigma_stor", _PRESSURE),
    "sigma_loss": Column("sigma_loss", _PRESSURE),
    "sigma_C": Column("sigma_C", _SPECTRUM),
    "relative_sigma": Column("relative_sigma", _RATIO),
    "log10_omega": _log10("omega", _ANGULAR),
    "log10_f": _log10("omega", _FREQUENCY),
    **{f"log10_{name}": _log10(name, _PRESSURE) for name in ("E_stor", "E_loss")},
    **{f"log10_{name}": _log10(name, _ONE) for name in ("aT", "bT")},
    "log10_p": _log10("p", _PRESSURE),
    **{name: Column(name, _PRESSURE, offered=False) for name in ("E_comp", "G_stor", "G_loss", "G_comp")},
    **{f"log10_{name}": _log10(name, _PRESSURE) for name in ("G_stor", "G_loss")},
    "tan_del": Column("tan_del", _RATIO, offered=False),
    "k": Column("q", _WAVEVECTOR, offered=False),
    "n": Column("q", _CYCLES, offered=False),
    "wavenumber": Column("q", _NUMBER, offered=False),
    **{name: Column("C_1D", _LINE, offered=False) for name in ("W1", "Wr", "G_d")},
    "delta": Column("delta", _ANGLE, limit=(math.pi / 2, "90 deg; is it in deg or rad?"), offered=False),
    "F_t": Column("F_t", _FORCE, positive=False, offered=False),
    "F_n": Column("F_n", _FORCE, positive=False, nonzero=True, offered=False),
    "v_travel": Column("v_travel", _SPEED, positive=False, offered=False),
    "slip_angle": Column("slip_angle", _ANGLE, positive=False, offered=False),
    "slip_ratio": Column("slip_ratio", _RATIO, positive=False, offered=False),
    "moment": Column("moment", _MOMENT, positive=False, offered=False),
    "sigma_F_t": Column("sigma_F_t", _FORCE, offered=False),
    "sigma_moment": Column("sigma_moment", _MOMENT, offered=False),
}

# Other spellings of the names in `COLUMNS`; M_... is E_... or G_..., see `known_name`.
SPELLINGS = {
    name: tuple(text.split("; "))
    for name, text in {
        "E_stor": "E'; e storage",
        "E_loss": "E''; e loss",
        "E_comp": "|E*|; E*",
        "G_stor": "G'; g storage; shear modulus (elastic component)",
        "G_loss": "G''; g loss; shear modulus (viscous component)",
        "G_comp": "|G*|; G*; complex shear modulus",
        "M_stor": "M'; storage modulus; speichermodul; module de conservation; module de stockage",
        "M_loss": "M''; loss modulus; verlustmodul; module de perte; module de dissipation",
        "M_comp": "complex modulus; komplexer modul; betrag komplexer modul; module complexe",
        "tan_del": (
            "tan(delta); tan delta; tan(\u03b4); tan \u03b4; tan d; tan(d); tand; loss factor; "
            "damping factor; verlustfaktor; dämpfungsfaktor; facteur de perte"
        ),
        "delta": (
            "\u03b4; phase; phase angle; phase angle delta; phase angle \u03b4; phase lag; phase shift; "
            "phase difference; loss angle; phasenwinkel; phasenwinkel \u03b4; phasenwinkel delta; "
            "phasenverschiebung; phasenverschiebungswinkel; phasendifferenz; verlustwinkel; angle de phase; "
            "angle de perte; déphasage"
        ),
        "omega": "angular frequency; \u03c9; kreisfrequenz; winkelfrequenz; pulsation; fréquence angulaire",
        "f": "frequency; freq; oscillation frequency; frequenz; prüffrequenz; fréquence",
        "T_surface": "surface temperature; oberflächentemperatur; température de surface",
        "T": "temperature; temp; Ts; sample temperature; temperatur; probentemperatur; température",
        "aT": "shift factor; verschiebungsfaktor; facteur de translation",
        "bT": "vertical shift factor; vertikaler verschiebungsfaktor; facteur de translation verticale",
        "strain": (
            "strain; strain amplitude; strain dyn; dyn strain; dynamic strain; oscillation strain; "
            "shear strain; dehnung; dyn dehnung; dehnungsamplitude; deformation; deformationsamplitude; "
            "scherdeformation; déformation; amplitude de déformation"
        ),
        "v": (
            "velocity; sliding velocity; speed; sliding speed; geschwindigkeit; gleitgeschwindigkeit; "
            "vitesse; vitesse de glissement"
        ),
        "v_travel": (
            "travel speed; travelling speed; rolling speed; wheel speed; forward speed; track speed; "
            "vehicle speed; fahrgeschwindigkeit; rollgeschwindigkeit; umfangsgeschwindigkeit; "
            "vitesse de roulement; vitesse d'avancement"
        ),
        "slip_angle": (
            "slip angle; side slip angle; \u03b1; schräglaufwinkel; angle de dérive; angle de glissement"
        ),
        "slip_ratio": (
            "slip ratio; longitudinal slip; slip; \u03ba; kappa; umfangsschlupf; längsschlupf; schlupf; "
            "glissement; taux de glissement; glissement longitudinal"
        ),
        "moment": (
            "mz; m z; aligning moment; aligning torque; self aligning moment; self-aligning moment; "
            "self aligning torque; self-aligning torque; rückstellmoment; moment d'auto-alignement; "
            "couple d'auto-alignement"
        ),
        "F_t": (
            "ft; f t; fx; f x; fy; f y; friction force; tangential force; lateral force; side force; "
            "traction force; horizontal force; brake force; braking force; longitudinal force; "
            "cornering force; reibkraft; reibungskraft; tangentialkraft; seitenkraft; querkraft; "
            "horizontalkraft; bremskraft; umfangskraft; längskraft; force de frottement; force tangentielle; "
            "force latérale; force de freinage; force longitudinale"
        ),
        "F_n": (
            "fn; f n; fz; f z; normal force; normal load; load; vertical force; vertical load; wheel load; "
            "normalkraft; last; normallast; radlast; belastung; vertikalkraft; auflast; force normale; "
            "charge; charge normale"
        ),
        "mu": (
            "friction coefficient; friction coeff; friction factor; coefficient of friction; cof; mu_visc; "
            "side force coefficient; lateral force coefficient; \u03bc; reibwert; reibbeiwert; "
            "reibungskoeffizient; reibungszahl; seitenkraftbeiwert; coefficient de frottement; "
            "coefficient de friction"
        ),
        "p": (
            "pressure; contact pressure; druck; kontaktdruck; anpressdruck; flächenpressung; pression; "
            "pression de contact"
        ),
        "A_over_A0": "contact area; A/A0; kontaktfläche; aire de contact",
        "q": "wavevector; angular wavenumber; wellenvektor; kreiswellenzahl; vecteur d'onde",
        "wavenumber": "wavenumber; wave number; wellenzahl; nombre d'onde",
        "n": "spatial frequency; raumfrequenz; ortsfrequenz; fréquence spatiale",
        "G_d": "Gd; Gd(n); G_d(n); displacement psd",
        "W1": "W1(k)",
        "Wr": "Wr(k)",
    }.items()
}
_NAMES = {spelling: name for name, spellings in SPELLINGS.items() for spelling in spellings}
# Set values and temperatures of a surface, used if the column itself is missing. The first one counts.
SET_VALUES = {"f_set": "f", "T_set": "T", "T_surface": "T"}
# Columns of exports that are never read.
_UNUSED = ("Set", "t", "t_set", *(f"{m}_{n}" for m in "EG" for n in ("relax", "stor_filt", "loss_filt")))

# Other spellings of units. Signs such as µ, ², ⁻¹ and · are recognised in all of them.
UNIT_SPELLINGS = {
    "C": ("°C", "\u00baC", "℃", "degC", "deg C", "° C", "Grad C", "Cel"),
    "K": ("Kelvin",),
    "°F": ("degF", "deg F", "° F", "F"),
    "rad/s": ("rad/sec", "rad s-1", "s-1", "1/s"),
    "deg": ("°", "degree", "degrees", "Grad"),
    "MPa": ("N/mm2", "N mm-2", "MN/m2"),
    "kPa": ("kN/m2",),
    "kgf/cm2": ("kp/cm2", "kg/cm2"),
    "rpm": ("rev/min", "r/min", "U/min", "tr/min"),
    "Pa": ("N/m2", "N m-2"),
    **{f"{of}N m": (f"{of}Nm", f"{of}N*m") for of in ("", "k")},
    **{"N mm": ("Nmm", "N*mm"), "lbf ft": ("lbf*ft", "ft lbf", "ft*lbf", "lb ft", "lb-ft", "ft-lb")},
    "-": ("", "1"),
    **{f"{of}m/s": (f"{of}m s-1", f"{of}m/sec") for of in ("", "m", "u", "n")},
    **{f"{of}m^4": (f"{of}m4",) for of in ("", "c", "m", "u", "n")},
    **{f"{of}m^3": (f"{of}m3",) for of in ("", "c", "m", "u", "n")},
    **{f"1/{of}m": (f"{of}m-1", f"rad/{of}m") for of in ("", "c", "m", "u", "n")},
    **{f"cycles/{of}m": (f"cycle/{of}m", f"cyc/{of}m", f"c/{of}m") for of in ("", "c", "m", "u", "n")},
}
# Plain spelling of units: u for micro, digits for exponents.
_PLAIN = str.maketrans("\u00b5\u03bc⁻¹²³⁴·\u22c5", "uu-1234  ", "^")
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
# Between a name and a unit, as in "E'/MPa", "Temp., °C", "E' in MPa" and "Freq Hz".
_BETWEEN = re.compile(r"\s*/\s*|,\s*|\s+in\s+|\s+")


def quantities_of(names: Iterable[str | None]) -> list[str]:
    """Return the quantities of columns with the given names; None stands for an unknown column."""
    return [COLUMNS[SET_VALUES.get(name, name)].name for name in names if name is not None]


def is_foreign(title: str, name: str | None) -> bool:
    """Return True if only other programs, and not this project, write a column title.

    `name` is the name that `known_name` returns for the title.
    """
    own = name in COLUMNS and COLUMNS[name].offered and name == title
    return title in _UNUSED or (name is not None and not own)


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
    """
    title = title.strip()
    if len(title) > LONGEST_TITLE:
        return None, None
    bracket, suffix = _BRACKETS.fullmatch(title), _SUFFIX.fullmatch(title)
    candidates = [(title, None)]
    candidates += [(bracket[1], bracket[2])] if bracket else []
    candidates += [(suffix[1], _SUFFIXES[suffix[2].lower()])] if suffix else []
    for between in _BETWEEN.finditer(title):
        unit = title[between.end() :]
        if _is_unit(unit) and ("/" in between[0] or not is_number(unit)):
            candidates.append((title[: between.start()], unit))
    for text, unit in candidates:
        known = _known(text) or _with_symbol(text)
        if known is not None:
            return (generic + known[1:] if known.startswith("M_") else known), unit
    logarithm = _LOGARITHM.fullmatch(title)  # such as lg(f/Hz)
    if logarithm:
        known, unit = known_name(logarithm[1], generic)
        if f"log10_{known}" in COLUMNS:
            return f"log10_{known}", unit
    return None, None


def known_unit(unit: str | None, name: str | None) -> str:
    """Return a unit in the spelling of `COLUMNS[name]`.

    For example, "N/mm²" and "[N/mm²]" become "MPa", and "um/s" of the column log10_v becomes "log10(um/s)".

    Parameters
    ----------
    unit, name : results of `known_name`. A missing unit becomes "-".
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
    """Return the name of a wavevector column after its unit: n for cycles/m, q for a wavenumber in rad/m.

    A column n whose unit is no spatial frequency, such as a counter, is unknown. Other names are unchanged.
    """
    if name not in ("q", "k", "wavenumber", "n"):
        return name
    plain = known_unit(unit, name)
    if plain.startswith("cycles/"):
        return "n"
    if "rad" in (unit or ""):
        return "q"
    return None if name == "n" and plain not in _CYCLES else name


def plain_unit(unit: str) -> str:
    """Return a unit in plain spelling, with u for micro, digits for exponents and single blanks."""
    return " ".join(unit.translate(_PLAIN).split())


def is_unit(text: str) -> bool:
    """Return True for a unit of a column except "-", possibly in brackets."""
    text = _AROUND.sub(r"\1", text.strip()).strip()
    return text not in UNIT_SPELLINGS["-"] and text != "-" and _is_unit(text)


def _is_unit(text: str) -> bool:
    plain = plain_unit(text)
    return plain in _KNOWN_UNITS or _UNITS.get(plain, "") in _KNOWN_UNITS


def _with_symbol(text: str) -> str | None:
    """Return the known name in a text such as "Storage modulus (E')", where name and symbol agree."""
    bracket = _BRACKETS.fullmatch(text)
    name, symbol = (_known(bracket[1]), _known(bracket[2])) if bracket else (None, None)
    agree = name is not None and symbol is not None and name[name.startswith("M_") :] in (symbol, symbol[1:])
    return symbol if agree else None


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
