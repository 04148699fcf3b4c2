"""Arrays with names, units and conditions, as data frames of pandas and data sets of xarray.

Both libraries are optional. A column of a data frame has the title "name [unit]", as in tables. A variable of
an xarray.Dataset has the unit in `attrs["units"]`.
"""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from rubberfric.base.checks import ArrayLike, is_concrete

# Name of an axis along which several conditions change.
_POINT = "point"


class Labelled(NamedTuple):
    """An array with its unit."""

    values: ArrayLike | Sequence[str]
    unit: str | None = None  # None: the elements have different units, or are texts


class LabelledArrays(NamedTuple):
    """Quantities and the conditions at which they were computed or measured.

    All arrays broadcast to the shape of the quantities.
    """

    conditions: Mapping[str, Labelled]
    quantities: Mapping[str, Labelled]
    axes: tuple[str, ...] | None = None  # names of the axes; None: from the conditions
    attributes: Mapping[str, Any] = {}

    def to_dataframe(self) -> Any:
        """Return a pandas.DataFrame with a row for each element and a column for each array.

        Raises
        ------
        ImportError : pandas is not installed
        ValueError : arrays are traced, or do not broadcast
        """
        pandas = optional_library("pandas")
        arrays, shape = self._arrays()
        every = {**self.conditions, **self.quantities}
        columns = {
            name if every[name].unit is None else f"{name} [{every[name].unit}]": np.broadcast_to(
                x, shape
            ).ravel()
            for name, x in arrays.items()
        }
        frame = pandas.DataFrame(columns)
        frame.attrs.update(self.attributes)
        return frame

    def to_xarray(self) -> Any:
        """Return an xarray.Dataset with the quantities as variables and the conditions as coordinates.

        A condition that alone changes along an axis gives the axis its name. Other axes are named "point".
        Axes of length 1 without a name are left out.

        Raises
        ------
        ImportError : xarray is not installed
        ValueError : arrays are traced, or do not broadcast
        """
        xarray = optional_library("xarray")
        arrays, shape = self._arrays()
        names = self.axes if self.axes is not None else self._axis_names(arrays, shape)
        variables = {}
        for name, values in arrays.items():
            own = values.reshape((1,) * (len(shape) - values.ndim) + values.shape)
            if name in self.quantities:
                own = np.broadcast_to(own, shape)
            kept = [
                k for k, axis in enumerate(names) if axis and (own.shape[k] > 1 or name in self.quantities)
            ]
            kept = [names.index(name)] if name in names else kept
            unit = {**self.conditions, **self.quantities}[name].unit
            attributes = {} if unit is None else {"units": unit}
            sizes = [own.shape[k] for k in kept]
            variables[name] = ([names[k] for k in kept], own.reshape(sizes), attributes)
        data = {name: variables[name] for name in self.quantities}
        coordinates = {name: variables[name] for name in self.conditions}
        return xarray.Dataset(data, coordinates, dict(self.attributes))

    def _arrays(self) -> tuple[dict[str, np.ndarray], tuple[int, ...]]:
        """Return all arrays by name, and the shape to which they broadcast."""
        every = {**self.conditions, **self.quantities}
        if not all(is_concrete(array.values) for array in every.values()):
            raise ValueError("arrays are traced: must be numbers; call to_dataframe or to_xarray outside jit")
        arrays = {name: np.asarray(array.values) for name, array in every.items()}
        try:
            shape = np.broadcast_shapes(*(x.shape for x in arrays.values()))
            quantities = np.broadcast_shapes(*(arrays[name].shape for name in self.quantities))
            if quantities != shape:
                raise ValueError
        except ValueError:
            shapes = ", ".join(f"{name} has {x.shape}" for name, x in arrays.items())
            raise ValueError(
                f"shapes differ ({shapes}): the conditions must broadcast to the quantities"
            ) from None
        return arrays, shape

    def _axis_names(self, arrays: Mapping[str, np.ndarray], shape: tuple[int, ...]) -> tuple[str, ...]:
        """Return the name of each axis, "" for one of length 1."""
        names: list[str] = []
        for k, length in enumerate(shape):
            place = k - len(shape)
            changing = [n for n in self.conditions if arrays[n].ndim >= -place and arrays[n].shape[place] > 1]
            alone = len(changing) == 1 and arrays[changing[0]].size == length
            others = f"{_POINT}_{k}" if len(shape) > 1 else _POINT
            names.append("" if length == 1 and len(shape) > 0 else changing[0] if alone else others)
        return tuple(names)


def optional_library(name: str) -> Any:
    """Return an optional library, or raise ImportError with the command that installs it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise ImportError(f"{name} is missing: must be installed, with pip install {name}") from None
