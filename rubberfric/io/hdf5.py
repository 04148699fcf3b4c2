"""HDF5 files of the project: a format and its version at the top, plain numbers with units below."""

import contextlib
import io
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import jax
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.atomic import StrPath, check_readable
from rubberfric.base.checks import closest
from rubberfric.base.process.release import VERSION


@contextlib.contextmanager
def creating(
    path: StrPath | io.BytesIO, form: str, version: int = 1, *, in_place: bool = False
) -> Iterator[h5py.File]:
    """Open a new file of the format named `form` for writing; `path` may be a file object.

    It is put together in memory, so that a full disk is an error of the system: the HDF5 library's own is
    told in 25 lines, and ends in a segmentation fault. `in_place` is for what is too large for that.
    """
    place = path if in_place or isinstance(path, io.BytesIO) else io.BytesIO()
    # Since 1.10 the file format has checksums on its structure.
    with h5py.File(place, "x", libver=("v110", "v110")) as file:
        file.attrs["format"] = form
        file.attrs["format_version"] = version
        file.attrs["rubberfric_version"] = VERSION
        yield file
    if isinstance(place, io.BytesIO) and not isinstance(path, io.BytesIO):
        Path(path).write_bytes(place.getbuffer())


@contextlib.contextmanager
def reading(path: Any, form: str, version: int = 1) -> Iterator[h5py.File]:
    """Open a file of the format named `form`; whatever is wrong with it becomes one ValueError naming it."""
    check_readable(path)  # so that a missing file is not called a broken one
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


def read_values(group: h5py.Group, name: str, units: str) -> np.ndarray:
    """Numbers of a dataset, in the units it must be in: a NumPy array, or a float if it is weak."""
    where, data = _path(group, name), group.get(name)
    if not isinstance(data, h5py.Dataset):
        raise ValueError(f"{where}: is missing; must be a dataset")
    if data.attrs.get("units") != units:
        raise ValueError(f"{where}: units = {data.attrs.get('units')!r}: must be {units!r}")
    if data.dtype.kind != "f":
        raise ValueError(f"{where}: has type {data.dtype}: must be a floating-point number")
    array = np.asarray(data[()], data.dtype.newbyteorder("="))
    if data.attrs.get("weak", False) and array.ndim == 0:
        return float(array)  # pyright: ignore[reportReturnType] (a number does all that an array does)
    return array


def read_array(group: h5py.Group, name: str, units: str, shape: tuple[int, ...]) -> np.ndarray:
    """Numbers of a dataset of a certain shape."""
    array = np.asarray(read_values(group, name, units))
    if array.shape != shape:
        raise ValueError(f"{_path(group, name)} has shape {array.shape}: must be {shape}")
    return array


def read_counts(group: h5py.Group, name: str, size: int) -> np.ndarray:
    """Integers of a dataset, shape (size,)."""
    data = group[name]
    if not isinstance(data, h5py.Dataset) or data.shape != (size,) or data.dtype.kind != "i":
        raise ValueError(f"{_path(group, name)}: must be {size} integers")
    return np.asarray(data[()])


def write_texts(group: h5py.Group, name: str, texts: Iterable[str]) -> None:
    """A dataset of texts."""
    group.create_dataset(name, data=np.array(list(texts), object), dtype=h5py.string_dtype())


def read_texts(group: h5py.Group, name: str) -> list[str]:
    """A list of texts; ValueError if the dataset is none of texts."""
    data = group.get(name)
    if not isinstance(data, h5py.Dataset) or h5py.check_string_dtype(data.dtype) is None:
        raise ValueError(f"{_path(group, name)}: is missing; must be a dataset of texts")
    return np.asarray(data.asstr()[()]).tolist()


def attributes(owner: h5py.Group, kinds: Mapping[str, type]) -> dict[str, Any]:
    """Attributes of a file or group, of the types that `kinds` says."""
    found = {}
    for name, kind in kinds.items():
        value = plain(owner.attrs.get(name))
        if type(value) is not kind:
            raise ValueError(f"{owner.name}: attribute {name} = {value!r}: must be of type {kind.__name__}")
        found[name] = value
    return found


def subgroup(group: h5py.Group, name: str) -> h5py.Group:
    """The group of that name in another; ValueError if there is none."""
    found = group.get(name)
    if not isinstance(found, h5py.Group):
        raise ValueError(f"{_path(group, name)}: is missing; must be a group")
    return found


def check_names(group: h5py.Group, names: Collection[str], attributes: Collection[str]) -> None:
    """ValueError if a group holds something unknown."""
    for name in group:
        if name not in names:
            raise ValueError(f"{_path(group, name)}: unknown field; {closest(name, tuple(names))}")
    for name in group.attrs:
        if name not in attributes:
            raise ValueError(f"{group.name}: attribute {name!r} is unknown; {closest(name, attributes)}")


def plain(attribute: Any) -> Any:
    """An attribute as Python has it: bool, int, float or str."""
    return attribute.item() if isinstance(attribute, np.generic) else attribute


def _path(group: h5py.Group, name: object) -> str:
    return f"{(group.name or '').rstrip('/')}/{name}"


def _check_format(file, form, version):
    if file.attrs.get("format") != form:
        raise ValueError(f"format = {file.attrs.get('format')!r}: must be {form!r}")
    found = file.attrs.get("format_version")
    if not isinstance(found, np.integer) or found != version:
        raise ValueError(f"format_version = {plain(found)!r}: must be {version}")
