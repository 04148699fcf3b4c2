"""HDF5 files: format and version at the top, numbers with units, objects and accuracy settings as groups.

::

    /                 attributes format = "rubberfric scene", format_version = 1, rubberfric_version
    /scene            attributes kind = "Scene", area_correction
    /scene/gamma      dataset, attribute units
    /scene/upper      attribute kind = "Body"
    /scene/upper/material/E ...

Static fields are attributes. A field that is None is absent. A dataset with the attribute `weak` is a weakly
typed number, which does not raise the precision of other leaves.
"""

import contextlib
import dataclasses
import io
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import jax
import numpy as np

import rubberfric.scene.scene  # noqa: F401 (defines all classes that a file can contain)
from rubberfric.base.atomic import StrPath, check_readable
from rubberfric.base.checks import ArrayLike, closest, shown
from rubberfric.base.objects.fields import Child, Leaf, Static
from rubberfric.base.objects.physical import PhysicalObject, fields_of, kinds
from rubberfric.base.quadrature import Quadrature
from rubberfric.base.release import VERSION

# Largest number of values in a dataset of an object or of conditions. A file can claim any number.
MOST_VALUES = 10**8
_VERSION = 1  # of every format


@contextlib.contextmanager
def creating(path: StrPath | io.BytesIO, form: str, *, in_place: bool = False) -> Iterator[h5py.File]:
    """Open a new HDF5 file, or a file object, of the format `form` for writing.

    HDF5 may segfault on a full disk, so the file is written in memory first, unless `in_place` is True.
    """
    place = path if in_place or isinstance(path, io.BytesIO) else io.BytesIO()
    # Since 1.10 the file format has checksums on its structure.
    with h5py.File(place, "x", libver=("v110", "v110")) as file:
        file.attrs["format"] = form
        file.attrs["format_version"] = _VERSION
        file.attrs["rubberfric_version"] = VERSION
        yield file
    if isinstance(place, io.BytesIO) and not isinstance(path, io.BytesIO):
        Path(path).write_bytes(place.getbuffer())


@contextlib.contextmanager
def reading(path: Any, form: str) -> Iterator[h5py.File]:
    """Open an HDF5 file of the format `form`; every fault raises a ValueError that names the file."""
    check_readable(path)  # names a missing file as such
    try:
        with _opened(path) as file:
            for name, value in {"format": form, "format_version": _VERSION}.items():
                stored = plain(file.attrs.get(name))
                if type(stored) is not type(value) or stored != value:
                    raise ValueError(f"{name} = {stored!r}: must be {value!r}")
            _check_own_data(file, set())
            yield file
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    except (OSError, KeyError, RuntimeError, TypeError) as error:
        text = str(error).strip("'\"").splitlines()[0]
        raise ValueError(f"{path}: must be a whole HDF5 file: {text}") from None


def _opened(path: StrPath) -> h5py.File:
    """Open an HDF5 file for reading without a lock, or raise ValueError if the file is marked as written.

    A lock would refuse complete files that another program has open, and all files on drives without locks.
    The mark is in the file. A program that writes removes the mark when it closes the file.
    """
    try:
        return h5py.File(path, "r", locking=False)
    except OSError as error:
        if "flag values don't match" in str(error):  # this process has the file open, with a lock
            return h5py.File(path, "r")
        if "already open for write" not in str(error):
            raise
    holder = _holder(path)
    if holder is None:
        raise ValueError(
            "another program writes to it, or ended without closing it: close it there, or run"
            f" h5clear -s {Path(path).name}"
        )
    raise ValueError(f"is open for writing in {holder}: close it there")


def _holder(path: StrPath) -> str | None:
    """Return the process that holds a lock on a file, as Linux lists it, or None."""
    inode = f":{os.stat(path).st_ino}"  # the device before it differs in containers
    with contextlib.suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/locks").read_text().splitlines():
            fields = line.split()  # 1: FLOCK ADVISORY WRITE process device start end
            if fields[5].endswith(inode) and int(fields[4]) != os.getpid():
                program = Path(f"/proc/{fields[4]}/comm").read_text().strip()
                return f"process {fields[4]} ({program})"
    return None


def _check_own_data(group: h5py.Group, seen: set[h5py.Group]) -> None:
    """Raise ValueError if a group has links, or datasets whose data are in another file.

    A second hard link to a group, which is in `seen`, could be an endless loop.
    """
    if group in seen:
        raise ValueError(f"{group.name} is a link to another group; the data must be in this group")
    seen.add(group)
    for name in group:
        where, link = _path(group, name), group.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{where} is a link; the data must be in this file")
        member = group[name]
        if isinstance(member, h5py.Group):
            _check_own_data(member, seen)
        elif isinstance(member, h5py.Dataset) and (member.is_virtual or member.external):
            raise ValueError(f"{where} has its data in another file; the data must be in this file")


def write_values(group: h5py.Group, name: str, values: ArrayLike, units: str) -> h5py.Dataset:
    """Write numbers as a dataset with units, and return the dataset."""
    weak = isinstance(values, float) or (isinstance(values, jax.Array) and values.weak_type)
    array = np.asarray(values)
    if array.dtype.kind != "f":
        raise ValueError(f"{group.name}/{name} has dtype {array.dtype}: must be float16, float32 or float64")
    data = group.create_dataset(name, data=array)
    data.attrs["units"] = units
    if weak:
        data.attrs["weak"] = True
    return data


def read_values(group: h5py.Group, name: str, units: str, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """Read a dataset of numbers with the given units as a NumPy array, or as a float if weakly typed.

    A ValueError is raised if the dataset is missing, or has another unit, type or shape. If `shape` is None,
    a dataset may have any shape, but at most `MOST_VALUES` values.
    """
    where, data = _path(group, name), group.get(name)
    if not isinstance(data, h5py.Dataset):
        raise ValueError(f"{where}: is missing; must be a dataset")
    if data.attrs.get("units") != units:
        raise ValueError(f"{where}: units = {data.attrs.get('units')!r}: must be {units!r}")
    if data.dtype.kind != "f":
        raise ValueError(f"{where}: has type {data.dtype}: must be a floating-point number")
    if shape is not None and data.shape != shape:
        raise ValueError(f"{where} has shape {data.shape}: must be {shape}")
    if shape is None and (data.size or 0) > MOST_VALUES:
        raise ValueError(f"{where} has {data.size} values: must have at most {MOST_VALUES}")
    array = np.asarray(data[()], data.dtype.newbyteorder("="))
    if data.attrs.get("weak", False) and array.ndim == 0:
        return float(array)  # pyright: ignore[reportReturnType] (a number can replace an array)
    return array


def read_array(group: h5py.Group, name: str, units: str, shape: tuple[int, ...]) -> np.ndarray:
    """Read a dataset that must have the given units and shape as an array."""
    return np.asarray(read_values(group, name, units, shape))


def read_counts(group: h5py.Group, name: str, size: int) -> np.ndarray:
    """Read integers of shape (size,)."""
    data = group[name]
    if not isinstance(data, h5py.Dataset) or data.shape != (size,) or data.dtype.kind != "i":
        raise ValueError(f"{_path(group, name)}: must be {size} integers")
    return np.asarray(data[()])


def write_texts(group: h5py.Group, name: str, texts: Iterable[str]) -> None:
    """Write texts as a dataset."""
    group.create_dataset(name, data=np.array(list(texts), object), dtype=h5py.string_dtype())


def read_texts(group: h5py.Group, name: str) -> list[str]:
    """Read a list of texts."""
    data = group.get(name)
    if not isinstance(data, h5py.Dataset) or h5py.check_string_dtype(data.dtype) is None:
        raise ValueError(f"{_path(group, name)}: is missing; must be a dataset of texts")
    return np.asarray(data.asstr()[()]).tolist()


def attributes(owner: h5py.Group, types: Mapping[str, type]) -> dict[str, Any]:
    """Read attributes from a file or group, which must have the given names and types."""
    values = {}
    for name, kind in types.items():
        value = plain(owner.attrs.get(name))
        if type(value) is not kind:
            raise ValueError(f"{owner.name}: attribute {name} = {value!r}: must be of type {kind.__name__}")
        values[name] = value
    return values


def subgroup(group: h5py.Group, name: str) -> h5py.Group:
    """Return the group `name` in a group, or raise ValueError if this group is missing."""
    child = group.get(name)
    if not isinstance(child, h5py.Group):
        raise ValueError(f"{_path(group, name)}: is missing; must be a group")
    return child


def check_names(group: h5py.Group, names: Collection[str], attributes: Collection[str]) -> None:
    """Raise ValueError if a group has an object or an attribute with an unknown name."""
    for name in group:
        if name not in names:
            raise ValueError(f"{_path(group, name)}: unknown field; {closest(name, tuple(names))}")
    for name in group.attrs:
        if name not in attributes:
            raise ValueError(f"{group.name}: attribute {name!r} is unknown; {closest(name, attributes)}")


def write_object(parent: h5py.Group, name: str, value: PhysicalObject) -> None:
    """Write a physical object as the group `name`.

    A ValueError is raised if the constructor of the object refuses the values.

    Examples
    --------
    >>> import h5py
    >>> with h5py.File("rubber.h5", "w") as file:
    ...     rf.io.write_object(file, "rubber", rf.Prony(E_inf=1e6, E=[1e7, 2e7], tau=[1e-2, 1e-4]))
    ...     print(file["rubber/E"][:])
    [10000000. 20000000.]
    """
    cls = type(value)
    if cls not in kinds(PhysicalObject).values():
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(kinds(PhysicalObject))}")
    cls(**{field: getattr(value, field) for field in fields_of(cls)})  # JAX rebuilds objects without checks
    group = parent.create_group(name)
    group.attrs["kind"] = cls.__name__
    for key, field in fields_of(cls).items():
        content = getattr(value, key)
        if isinstance(field, Static):
            group.attrs[key] = content
        elif content is None:
            continue
        elif isinstance(field, Child):
            write_object(group, key, content)
        else:
            write_values(group, key, content, field.unit)


def read_object(group: Any) -> PhysicalObject:
    """Read the physical object in a group. The message of a ValueError names the group and the fault.

    Examples
    --------
    >>> import h5py
    >>> with h5py.File("shift.h5", "w") as file:
    ...     rf.io.write_object(file, "shift", rf.WLF(C1=8.86, C2=101.6, T_ref=293.15))
    ...     print(float(rf.io.read_object(file["shift"]).C2))
    101.6
    """
    where, known = group.name, kinds(PhysicalObject)
    if not isinstance(group, h5py.Group):
        raise ValueError(f"{where}: must be a group, not a dataset")
    kind = group.attrs.get("kind")
    if not isinstance(kind, str) or kind not in known:
        raise ValueError(f"{where}: kind = {shown(kind)}: {closest(kind, tuple(known))}")
    fields = fields_of(known[kind])
    static = [name for name, field in fields.items() if isinstance(field, Static)]
    check_names(group, [name for name in fields if name not in static], ("kind", *static))
    values = {}
    for name in static:
        if name not in group.attrs:
            raise ValueError(f"{where}: attribute {name} is missing; {kind} must have it")
        values[name] = plain(group.attrs[name])
    for name, field in fields.items():
        if isinstance(field, Static):
            continue
        if name not in group and (isinstance(field, Child) or field.optional):
            values[name] = None
        elif isinstance(field, Leaf):
            values[name] = read_values(group, name, field.unit)
        else:
            values[name] = read_object(group[name])
    try:
        return known[kind](**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def write_quadrature(file: h5py.File, quadrature: Quadrature) -> None:
    """Write the accuracy settings as attributes of the group /quadrature.

    Examples
    --------
    >>> import h5py
    >>> with h5py.File("settings.h5", "w") as file:
    ...     rf.io.write_quadrature(file, rf.Quadrature(order=9))
    ...     print(int(file["quadrature"].attrs["order"]))
    9
    """
    group = file.create_group("quadrature")
    for field in dataclasses.fields(Quadrature):
        group.attrs[field.name] = getattr(quadrature, field.name)


def read_quadrature(file: h5py.File) -> Quadrature:
    """Read the accuracy settings that `write_quadrature` wrote.

    Examples
    --------
    >>> import h5py
    >>> with h5py.File("settings.h5", "w") as file:
    ...     rf.io.write_quadrature(file, rf.Quadrature(order=9))
    ...     print(rf.io.read_quadrature(file) == rf.Quadrature(order=9))
    True
    """
    group = subgroup(file, "quadrature")
    names = [field.name for field in dataclasses.fields(Quadrature)]
    check_names(group, (), names)
    for name in names:
        if name not in group.attrs:
            raise ValueError(f"{group.name}: attribute {name} is missing; must be given")
    return Quadrature(**{name: plain(group.attrs[name]) for name in names})


def plain(attribute: Any) -> Any:
    """Convert a NumPy scalar to bool, int, float or str, and return other values unchanged."""
    return attribute.item() if isinstance(attribute, np.generic) else attribute


def _path(group: h5py.Group, name: object) -> str:
    return f"{(group.name or '').rstrip('/')}/{name}"
