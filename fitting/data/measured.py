"""What the kinds of measured data share: the rules of their fields, and how a fit sees them."""

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np

from rubberfric.base.checks import FINITE, POSITIVE, check_values, shown


def _likely(text, test):
    """Rule that only a wrong unit, or noise, would break."""
    return (f"{text} (check_units=False accepts it)", test)


class Field(NamedTuple):
    """What holds for a field of that name, whichever kind of data it is in."""

    unit: str = ""  # absolute errors have the one of their values
    rule: tuple = FINITE  # always
    range: tuple = ()  # unless check_units=False
    needed: bool = True


_MODULUS = (POSITIVE, _likely("must be <= 1e13 Pa", lambda E: E <= 1e13))
_ERROR = Field(rule=POSITIVE, needed=False)

FIELDS = {
    "velocity": Field(
        "m/s",
        range=(_likely("must be -1000 ... 1000 m/s; is it in mm/s or um/s?", lambda v: np.abs(v) <= 1e3),),
    ),
    "pressure": Field(
        "Pa",
        rule=POSITIVE,
        range=(
            _likely("must be >= 1 Pa; is it in MPa or GPa?", lambda p: p >= 1),
            _likely("must be <= 1e10 Pa", lambda p: p <= 1e10),
        ),
    ),
    "temperature": Field(
        "K",
        rule=POSITIVE,
        range=(
            _likely("must be >= 100 K; is it in °C? then add 273.15", lambda T: T >= 100),
            _likely("must be <= 2000 K", lambda T: T <= 2000),
        ),
        needed=False,
    ),
    "omega": Field("rad/s", rule=POSITIVE),
    "q": Field(
        "1/m",
        rule=POSITIVE,
        range=(_likely("must be 1e-6 ... 1e12 1/m", lambda q: (q >= 1e-6) & (q <= 1e12)),),
    ),
    "friction": Field(
        "-",
        range=(_likely("must be -50 ... 50; is it in percent?", lambda mu: np.abs(mu) <= 50),),
    ),
    "area": Field(
        "-",
        range=(
            POSITIVE,
            _likely("must be <= 1; is it in percent, or not divided by A0?", lambda A: A <= 1),
        ),
    ),
    "storage": Field(
        "Pa",
        range=(*_MODULUS, _likely("must be >= 1e3 Pa; is it in MPa or GPa?", lambda E: E >= 1e3)),
    ),
    "loss": Field(
        "Pa",
        range=(*_MODULUS, _likely("must be >= 1 Pa; is it in MPa or GPa, or tan(delta)?", lambda E: E >= 1)),
    ),
    "C": Field(
        "m^4",
        range=(POSITIVE, _likely("must be <= 1e3 m^4; is it in mm^4 or um^4?", lambda C: C <= 1e3)),
    ),
    "sigma": _ERROR,
    "sigma_storage": _ERROR,
    "sigma_loss": _ERROR,
    "relative": _ERROR._replace(
        unit="-",
        range=(_likely("must be <= 3; is it in percent? 3 % is 0.03", lambda error: error <= 3),),
    ),
}


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Measured:
    """Base of the kinds of measured data, checked when constructed; see `fitting.data`."""

    quantity: ClassVar[str]
    values: ClassVar[tuple]  # fields that were measured
    sigmas: ClassVar[tuple]  # fields of their absolute errors, in the same order

    relative: np.ndarray | None = None
    name: str = ""
    check_units: dataclasses.InitVar[bool] = True

    def __post_init__(self, check_units):
        kind = type(self).__name__
        if not isinstance(check_units, bool):
            raise ValueError(f"{kind}.check_units = {one_line(check_units)}: must be True or False")
        if not isinstance(self.name, str) or not self.name.isprintable():
            raise ValueError(f"{kind}.name = {one_line(self.name)}: must be text on one line")
        body = getattr(self, "body", None)
        if body is not None and not (isinstance(body, str) and body in ("lower", "upper")):
            raise ValueError(f"{kind}.body = {one_line(body)}: must be 'lower', 'upper' or None")
        arrays = self._arrays()
        self._check_errors(arrays)
        for name, array in arrays.items():
            for rule in (FIELDS[name].rule, *(FIELDS[name].range if check_units else ())):
                check_values(f"{kind}.{name}", array, rule)
        if self.logarithmic:
            advice = f"must be > 0 with relative errors or none; give {' and '.join(self.sigmas)} instead"
            for name in self.values:
                check_values(f"{kind}.{name}", arrays[name], (advice, POSITIVE[1]))
        shapes = {name: array.shape for name, array in arrays.items()}
        try:
            shape = np.broadcast_shapes(*shapes.values())
        except ValueError:
            given = ", ".join(f"{name} has {shape}" for name, shape in shapes.items())
            raise ValueError(f"{kind}: shapes differ ({given}); they must broadcast") from None
        for name, array in arrays.items():
            array = np.broadcast_to(array, shape).flatten()
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def _arrays(self):
        """Fields that are given, as float64 arrays of the shapes they came in."""
        kind = type(self).__name__
        arrays = {}
        for name, field in FIELDS.items():
            value = getattr(self, name, None)
            if value is not None:
                arrays[name] = _array(f"{kind}.{name}", value)
            elif field.needed and hasattr(self, name):
                raise ValueError(f"{kind}.{name} is missing: must be given, in {field.unit}")
        return arrays

    def _check_errors(self, arrays):
        """ValueError unless there are relative errors, absolute ones of all values, or none."""
        kind = type(self).__name__
        given = [name for name in self.sigmas if name in arrays]
        if given and "relative" in arrays:
            raise ValueError(
                f"{kind}: {' and '.join(given)} and relative are given: must be one or the other"
            )
        for name in self.sigmas:
            if given and name not in given:
                raise ValueError(f"{kind}.{name} is missing: must be given together with {given[0]}")

    def __len__(self):
        return sum(getattr(self, name).size for name in self.values)

    def __repr__(self):
        return f"<{type(self).__name__}: {self.label}>"

    @classmethod
    def unit(cls, name):
        """Unit of a field, "" if it is no number."""
        if name in cls.sigmas:
            name = cls.values[cls.sigmas.index(name)]
        return FIELDS[name].unit if name in FIELDS else ""

    @property
    def measured(self):
        """Measured values in one array, shape (n,); of a modulus, E' and then E''."""
        return np.concatenate([getattr(self, name) for name in self.values])

    @property
    def logarithmic(self):
        """Whether residuals are those of logarithms: relative errors are given, or none."""
        return all(getattr(self, name) is None for name in self.sigmas)

    @property
    def error(self):
        """Standard deviations of `measured`, or of its logarithm, shape (n,); None if unknown."""
        if not self.logarithmic:
            return np.concatenate([getattr(self, name) for name in self.sigmas])
        return None if self.relative is None else np.tile(self.relative, len(self.values))

    @property
    def label(self):
        """The name, or what was measured in a few words."""
        if self.name:
            return self.name
        points = getattr(self, self.values[0]).size
        body = getattr(self, "body", None)
        words = [
            f"{self.quantity} of the {body} body" if body else self.quantity,
            f"{points} point{'s' * (points > 1)}",
        ]
        if hasattr(self, "pressure"):
            words.append(_range(self.pressure / 1e6, "MPa"))
        if getattr(self, "temperature", None) is not None:
            words.append(_range(np.round(self.temperature - 273.15, 2) + 0.0, "°C"))
        return ", ".join(words)

    def replaced(self, measured):
        """The same data with other measured values, such as resampled or simulated ones.

        Parameters
        ----------
        measured : array_like, shape (n,), in the order and units of `measured`
            any finite values if errors are absolute, since noise may leave the range of a
            quantity; > 0 otherwise. ValueError if they are not.
        """
        kind = type(self).__name__
        array = _array(f"{kind}.measured", measured)
        if array.shape != (len(self),):
            raise ValueError(f"{kind}.measured has shape {array.shape}: must be ({len(self)},)")
        parts = zip(self.values, np.split(array, len(self.values)), strict=True)
        return dataclasses.replace(self, **dict(parts), check_units=False)

    def write(self, path):
        """Write a .csv or an .h5 file; see `fitting.data.files.write`."""
        from fitting.data.files import write  # which imports this module

        write(path, self)


def _array(name, value):
    """A float64 array of real numbers; ValueError if it is anything else, or empty."""
    try:
        array = np.asarray(value)
        # a mask would be lost without a word
        if array.dtype.kind not in "fiu" or np.ma.is_masked(value):
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {one_line(value)}: must be real numbers") from None
    if array.size == 0:
        raise ValueError(f"{name} is empty: must have at least one value")
    return array


def one_line(value):
    """How a wrong value is shown; `shown` breaks the lines of arrays."""
    return " ".join(shown(value).split())


def _range(values, unit):
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return f"{low} {unit}" if low == high else f"{low} ... {high} {unit}"
