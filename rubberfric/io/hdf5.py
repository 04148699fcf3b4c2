"""HDF5 files of the project: a format and its version at the top, plain numbers with units below."""

import contextlib
import importlib.metadata
from collections.abc import Collection, Iterator
from typing import Any

import h5py
import jax
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import closest


def release() -> str:
    """The version of this package."""
    return importlib.metadata.version("rubberfric")


@contextlib.contextmanager
def creating(path: Any, form: str, version: int = 1) -> Iterator[h5py.File]:
    """Open a new file of the format named `form` for writing; `path` may be a file object."""
    # Since 1.10 the file format has checksums on its structure.
    with h5py.File(path, "x", libver=("v110", "v110")) as file:
        file.attrs["format"] = form
        file.attrs["format_version"] = version
        file.attrs["rubberfric_version"] = release()
        yield file


@contextlib.contextmanager
def reading(path: Any, form: str, version: int = 1) -> Iterator[h5py.File]:
    """Open a file of the format named `form`; whatever is wrong with it becomes one ValueError naming it."""
    try:
        with open(path, "rb"):  # so that a missing file is not called a broken one
            pass
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from None
    try:
        with h5py.File(path, "r") as file:
            _check_format(file, form, version)
            yield file
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    except (OSError, KeyError, RuntimeError, TypeError) as error:
        text = str(error).strip("'\"").splitlines()[0]
        raise ValueError(f"{path}: must be a whole HDF5 file: {text}") from None


def write_values(group: h5py.Group, name: str, values: ArrayLike, units: str) -> h5py.Dataset:
    """Write numbers as a dataset with their units; the dataset."""
    weak = isinstance(values, float) or (isinstance(values, jax.Array) and values.weak_type)
    array = np.asarray(values)
    if array.dtype.kind != "f":
        raise ValueError(f"{group.name}/{name} has dtype {array.dtype}: must be float16, float32 or float64")
    data = group.create_dataset(name, data=array)
    data.attrs["units"] = units
    if weak:
        data.attrs["weak"] = True
    return data


def read_values(group: h5py.Group, name: str, units: str) -> np.ndarray | float:
    """Numbers of a dataset, in the units it must be in: a NumPy array, or a float if it is weak."""
    where, data = f"{str(group.name).rstrip('/')}/{name}", group.get(name)
    if not isinstance(data, h5py.Dataset):
        raise ValueError(f"{where}: is missing; must be a dataset")
    if data.attrs.get("units") != units:
        raise ValueError(f"{where}: units = {data.attrs.get('units')!r}: must be {units!r}")
    if data.dtype.kind != "f":
        raise ValueError(f"{where}: has type {data.dtype}: must be a floating-point number")
    array = np.asarray(data[()], data.dtype.newbyteorder("="))
    return float(array) if data.attrs.get("weak", False) and array.ndim == 0 else array


def check_names(group: h5py.Group, names: Collection[str], attributes: Collection[str]) -> None:
    """ValueError if a group holds something unknown."""
    for name in group:
        if name not in names:
            raise ValueError(
                f"{str(group.name).rstrip('/')}/{name}: unknown field; {closest(name, tuple(names))}"
            )
    for name in group.attrs:
        if name not in attributes:
            raise ValueError(f"{group.name}: attribute {name!r} is unknown; {closest(name, attributes)}")


def plain(attribute: Any) -> Any:
    """An attribute as Python has it: bool, int, float or str."""
    return attribute.item() if isinstance(attribute, np.generic) else attribute


def _check_format(file, form, version):
    if file.attrs.get("format") != form:
        raise ValueError(f"format = {file.attrs.get('format')!r}: must be {form!r}")
    found = file.attrs.get("format_version")
    if not isinstance(found, np.integer) or found != version:
        raise ValueError(f"format_version = {plain(found)!r}: must be {version}")
