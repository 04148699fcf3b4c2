"""Base of the kinds of measured data: checks, the quantities that a fit uses, and files."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

import h5py
import numpy as np

from fitting.data.fields import (
    Field,
    GivenArray,
    OptionalArray,
    array,
    measurement,
    numbers,
    unit_rule,
)
from rubberfric.base import (
    POSITIVE,
    ArrayLike,
    Labelled,
    LabelledArrays,
    StrPath,
    check_values,
    check_writable,
    closest,
    html,
    replacing,
    shown,
)
from rubberfric.io import as_frame, hdf5, read_table, write_table

DATA_FORMAT = "rubberfric data"

_RELATIVE = Field(
    "relative_sigma",
    "-",
    POSITIVE,
    (unit_rule("must be <= 1; is it in percent? 3 % is 0.03", lambda error: error <= 1),),
)


@measurement
class Measured:
    """Base class of the kinds of measured data in `fitting.data.kinds`.

    The constructor checks all values. A subclass has a field for every array. The class variable `values`
    lists the fields that were measured.
    """

    quantity: ClassVar[str]
    conditions: ClassVar[tuple[str, ...]]  # fields of the conditions, possible abscissae of curves first
    values: ClassVar[tuple[str, ...]]  # fields that were measured
    sigmas: ClassVar[tuple[str, ...]]  # fields of the absolute errors of `values`, in order
    others: ClassVar[tuple[str, ...]] = ()  # columns of a table that give the first value, too
    remark: ClassVar[str] = ""  # comment of a CSV file that `fitting.read` uses

    relative: OptionalArray = array(_RELATIVE, default=None, kw_only=True)
    name: str = dataclasses.field(default="", kw_only=True)
    history: tuple[str, ...] = dataclasses.field(default=(), kw_only=True)
    check_units: dataclasses.InitVar[bool] = dataclasses.field(default=True, kw_only=True)

    def __post_init__(self, check_units: bool) -> None:
        kind = type(self).__name__
        if not isinstance(check_units, bool):
            raise ValueError(f"{kind}.check_units = {shown(check_units)}: must be True or False")
        if not isinstance(self.name, str) or not self.name.isprintable():
            raise ValueError(f"{kind}.name = {shown(self.name)}: must be text on one line")
        object.__setattr__(self, "history", _checked_history(f"{kind}.history", self.history))
        body = getattr(self, "body", None)
        if body is not None and not (isinstance(body, str) and body in ("lower", "upper")):
            raise ValueError(f"{kind}.body = {shown(body)}: must be 'lower', 'upper' or None")
        arrays = self._arrays()
        self._check_errors(arrays)
        for name, values in arrays.items():
            about = self.fields()[name]
            for rule in (about.rule, *(about.plausible if check_units else ())):
                check_values(f"{kind}.{name}", values, rule)
        if self.logarithmic:
            names, columns = (
                " and ".join(words)
                for words in (self.sigmas, [self.fields()[name].column for name in self.sigmas])
            )
            column = f" (column {columns})" * (columns != names)
            advice = f"must be > 0 with relative errors or none; give {names} instead{column}"
            for name in self.values:
                check_values(f"{kind}.{name}", arrays[name], (advice, POSITIVE[1]))
        shape = self._checked_shape(arrays)
        for name, values in arrays.items():
            own = np.broadcast_to(values, shape).flatten()
            own.flags.writeable = False
            object.__setattr__(self, name, own)

    def _arrays(self) -> dict[str, np.ndarray]:
        """Return a dict of name -> float64 array for the fields that are not None.

        Arrays keep the shape that was given. Raise ValueError if a required field is None.
        """
        arrays = {}
        for name, about in self.fields().items():
            value = getattr(self, name)
            if value is None and name in self.needed():
                raise ValueError(f"{type(self).__name__}.{name} is missing: must be given, in {about.unit}")
            if value is not None:
                arrays[name] = numbers(f"{type(self).__name__}.{name}", value)
        return arrays

    def _checked_shape(self, arrays: dict[str, np.ndarray]) -> tuple[int, ...]:
        """Return the shape to which the arrays broadcast.

        Raise ValueError if they do not broadcast, or if broadcasting would repeat measured values or a list
        of one number.
        """
        kind = type(self).__name__
        try:
            shape = np.broadcast_shapes(*(values.shape for values in arrays.values()))
        except ValueError:
            shapes = ", ".join(f"{name} has {values.shape}" for name, values in arrays.items())
            raise ValueError(f"{kind}: shapes differ ({shapes}); they must broadcast") from None
        for name, values in arrays.items():
            measured = name in self.values
            if values.shape == shape or not (measured or values.shape == (1,)) or math.prod(shape) == 1:
                continue
            rule = (
                "must have one value for each point"
                if measured
                else "must be a number, or one for each point"
            )
            raise ValueError(f"{kind}.{name} has shape {values.shape} for {math.prod(shape)} points: {rule}")
        return shape

    def _check_errors(self, arrays: dict[str, np.ndarray]) -> None:
        """Raise ValueError if relative and absolute errors are given, or only some absolute errors."""
        kind = type(self).__name__
        present = [name for name in self.sigmas if name in arrays]
        if present and "relative" in arrays:
            raise ValueError(f"{kind}: {' and '.join(present)} and relative are given: must be one of them")
        for name in self.sigmas:
            if present and name not in present:
                raise ValueError(f"{kind}.{name} is missing: must be given together with {present[0]}")

    def __len__(self) -> int:
        return sum(getattr(self, name).size for name in self.values)

    def __repr__(self) -> str:
        done = f"; {'; '.join(self.history)}" if self.history else ""
        return f"<{type(self).__name__}: {self.label}{done}>"

    def _repr_html_(self) -> str:
        rows: list[str | tuple[str, str]] = []
        for name, about in self.fields().items():
            if (values := getattr(self, name)) is not None:
                rows.append((name, _range(values, about.unit)))
        return html.table([*rows, *self.history], caption=f"{type(self).__name__}: {self.label}")

    @classmethod
    def fields(cls) -> dict[str, Field]:
        """Return a dict of name -> `Field` for the fields that hold arrays, with `relative` last."""
        fields = sorted(dataclasses.fields(cls), key=lambda field: bool(field.kw_only))
        return {field.name: field.metadata["about"] for field in fields if "about" in field.metadata}

    @classmethod
    def needed(cls) -> list[str]:
        """Return the names of the arrays that must be given."""
        return [field.name for field in dataclasses.fields(cls) if field.type is GivenArray]

    @property
    def measured(self) -> np.ndarray:
        """Measured values in one array of shape (n,).

        For moduli, the array contains all E' and then all E''.
        """
        return np.concatenate([getattr(self, name) for name in self.values])

    @property
    def abscissa(self) -> np.ndarray:
        """The first condition that is given, the abscissa of curves."""
        return next(values for name in self.conditions if (values := getattr(self, name)) is not None)

    @property
    def logarithmic(self) -> bool:
        """True if residuals are differences of logarithms, because errors are relative or unknown."""
        return all(getattr(self, name) is None for name in self.sigmas)

    @property
    def error(self) -> np.ndarray | None:
        """Standard deviations in one array of shape (n,), or None if unknown.

        The array refers to ln(measured) if `logarithmic` is True, otherwise to `measured`.
        """
        if not self.logarithmic:
            return np.concatenate([getattr(self, name) for name in self.sigmas])
        return None if self.relative is None else np.tile(self.relative, len(self.values))

    @property
    def label(self) -> str:
        """The name, or a short description of the data."""
        if self.name:
            return self.name
        points = getattr(self, self.values[0]).size
        body = getattr(self, "body", None)
        texts = [
            f"{self.quantity} of the {body} body" if body else self.quantity,
            f"{points} point{'s' * (points > 1)}",
        ]
        if (pressure := getattr(self, "pressure", None)) is not None:
            texts.append(_range(pressure / 1e6, "MPa"))
        if (temperature := getattr(self, "temperature", None)) is not None:
            texts.append(_range(np.round(temperature - 273.15, 2) + 0.0, "°C"))
        return ", ".join(texts)

    def place(self, k: int) -> str:
        """Return the conditions of `measured[k]` as text.

        An example is "velocity = 0.1 m/s, pressure = 1e+05 Pa".
        """
        conditions = {
            name: getattr(self, name) for name in self.conditions if getattr(self, name) is not None
        }
        fields = self.fields()
        return ", ".join(
            f"{name} = {values[k % values.size]:g} {fields[name].unit}" for name, values in conditions.items()
        )

    def replaced(self, measured: ArrayLike) -> Self:
        """Return data with other measured values, for example resampled or simulated values.

        Parameters
        ----------
        measured : array_like, shape (n,), in the order and units of `measured`
            Data with absolute errors allow any finite value, because noise may exceed the range of a
            quantity. Other data need values > 0.

        Raises
        ------
        ValueError : `measured` has another shape, or a value that is not allowed.
        """
        kind = type(self).__name__
        values = numbers(f"{kind}.measured", measured)
        if values.shape != (len(self),):
            raise ValueError(f"{kind}.measured has shape {values.shape}: must be ({len(self)},)")
        parts = zip(self.values, np.split(values, len(self.values)), strict=True)
        return dataclasses.replace(self, **dict(parts), check_units=False)

    def selected(self, **ranges: tuple[float | None, float | None]) -> Self:
        """Return the points whose conditions are in given ranges.

        Parameters
        ----------
        ranges : (lowest, highest) for each condition, in SI units; both ends are included
            None stands for no limit. An example is temperature=(283.15, None), omega=(1.0, 100.0).

        Raises
        ------
        ValueError : the data lack the condition, a range is invalid, or no point is left.
        """
        kind = type(self).__name__
        known = [name for name in self.conditions if getattr(self, name) is not None]
        keep = np.ones(getattr(self, self.values[0]).shape, bool)
        for name, limits in ranges.items():
            if name not in known:
                raise ValueError(f"{kind} has no {name}: {closest(name, known)}")
            try:
                low, high = (
                    float(default if x is None else x)
                    for x, default in zip(limits, (-np.inf, np.inf), strict=True)
                )
                if not low <= high:
                    raise ValueError
            except (TypeError, ValueError):
                raise ValueError(
                    f"{name} = {shown(limits)}: must be (lowest, highest), with lowest <= highest"
                ) from None
            values = getattr(self, name)
            keep &= (values >= low) & (values <= high)
        if not keep.any():
            own = ", ".join(f"{x} {getattr(self, x).min():g} ... {getattr(self, x).max():g}" for x in ranges)
            raise ValueError(f"{kind}: no point is in these ranges; must overlap with {own}")
        arrays = {name: getattr(self, name) for name in self.fields()}
        own = {name: values[keep] for name, values in arrays.items() if values is not None}
        texts = [f"{name} = {shown(limits)}" for name, limits in ranges.items()]
        history = (*self.history, f"{keep.sum()} of {keep.size} points selected: {', '.join(texts)}")
        return dataclasses.replace(self, **own, history=history, check_units=False)

    @classmethod
    def from_frame(cls, frame: Any, units: Mapping[str, str] | None = None, **arguments: Any) -> Self:
        """Create data from the columns of a data frame, or of a mapping of titles to numbers.

        Parameters
        ----------
        frame, units : as in `rubberfric.io.as_frame`
            Columns with other titles are ignored. A warning names one of standard errors, such as "std mu".
        arguments : arguments of the constructor that the frame lacks, or that replace columns of the frame
            An example is pressure=3e5.

        Raises
        ------
        ValueError
            A column is missing, occurs twice, or does not hold numbers. A unit is unknown. The constructor
            raises ValueError. The message is one line.
        """
        columns = {name: about.column for name, about in cls.fields().items() if name not in arguments}
        needed = tuple(columns[name] for name in cls.needed() if name in columns)
        optional = tuple(column for column in columns.values() if column not in needed)
        table = read_table(as_frame(frame, units), needed, optional, increasing=False, bad_rows=None)
        columns_there: dict[str, Any] = {name: table[c] for name, c in columns.items() if c in table}
        return cls(**columns_there | arguments)

    def to_dataframe(self) -> Any:
        """Return the data as a pandas.DataFrame with titles "name [unit]", for `fitting.read`.

        `attrs` contains name and history. Raise ImportError if pandas is not installed.
        """
        return self._labelled().to_dataframe()

    def to_xarray(self) -> Any:
        """Return the data as an xarray.Dataset over "point", with units in `attrs`, for `fitting.read`.

        Raise ImportError if xarray is not installed.
        """
        return self._labelled().to_xarray()

    def _labelled(self) -> LabelledArrays:
        known = {n: about for n, about in self.fields().items() if getattr(self, n) is not None}
        arrays = {n: (about.column, Labelled(getattr(self, n), about.unit)) for n, about in known.items()}
        texts = {"name": self.name, "body": getattr(self, "body", None), "history": "\n".join(self.history)}
        return LabelledArrays(
            dict(arrays[n] for n in known if n in self.conditions),
            dict(arrays[n] for n in known if n not in self.conditions),
            ("point",),
            {key: text for key, text in texts.items() if text},
        )

    def write(self, path: StrPath) -> None:
        """Write a .csv or .h5 file completely or not at all, for `fitting.read`.

        A CSV file contains `name`, `body` and `history` only as comments, so `read` needs the body as an
        argument.

        Raises
        ------
        ValueError
            The suffix is neither .csv nor .h5, the folder is missing, or a CSV file would contain
            values <= 0, which noise may cause. The message is one line.
        """
        check_writable(path, (".csv", ".h5"))
        if Path(path).suffix.lower() == ".h5":
            with replacing(path) as temporary, hdf5.creating(temporary, DATA_FORMAT) as file:
                self.write_group(file.create_group("data"))
            return
        body = getattr(self, "body", None)
        comment = [self.name, f"of the {body} body" if body else "", self.remark, *self.history]
        columns = {about.column: getattr(self, name) for name, about in self.fields().items()}
        columns = {column: values for column, values in columns.items() if values is not None}
        write_table(path, columns, "\n".join(filter(None, comment)))

    def write_group(self, group: h5py.Group) -> None:
        """Store the data in an open, empty HDF5 group. `fitting.data.files.read_group` reads the group."""
        group.attrs["kind"] = self.quantity
        group.attrs["name"] = self.name
        if (body := getattr(self, "body", None)) is not None:
            group.attrs["body"] = body
        if self.history:
            hdf5.write_texts(group, "history", self.history)
        for name, about in self.fields().items():
            if getattr(self, name) is not None:
                hdf5.write_values(group, name, getattr(self, name), about.unit)


def _checked_history(where: str, history: object) -> tuple[str, ...]:
    """Return the history as a tuple, or raise ValueError unless all entries are texts on one line."""
    if not isinstance(history, tuple | list) or not all(isinstance(x, str) for x in history):
        raise ValueError(f"{where} = {shown(history)}: must be a tuple of texts")
    if not all(text.isprintable() for text in history):
        raise ValueError(f"{where} = {shown(history)}: must be texts on one line each")
    return tuple(history)


def _range(values: np.ndarray, unit: str) -> str:
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return f"{low} {unit}" if low == high else f"{low} ... {high} {unit}"
