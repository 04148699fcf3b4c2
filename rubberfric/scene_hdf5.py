"""Scenes in HDF5, to the last bit: groups mirror the tree of objects.

::

    /                 attributes format = "rubberfric scene", format_version = 1, rubberfric_version
    /scene            attributes kind = "Scene", area_correction
    /scene/gamma      dataset, attribute units
    /scene/upper      attribute kind = "Body"
    /scene/upper/material/E ...

Static fields are attributes; a field that is None has no group. A dataset with the
attribute `weak` is a plain number, whose precision yields to that of the other leaves.
A result file (`rubberfric.results`) is a scene file with more in it.
"""

import contextlib
import dataclasses
import importlib.metadata

import h5py
import jax
import numpy as np

from rubberfric.layers import Slab
from rubberfric.materials import Elastic, Prony, Rigid, TabulatedModulus
from rubberfric.scene import Body, Scene
from rubberfric.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.spectra import SelfAffine, TabulatedSpectrum
from rubberfric.tables import closest

FORMAT = "rubberfric scene"
FORMAT_VERSION = 1

# Units of the leaves of every class that a scene can hold; one row makes a class storable.
UNITS = {
    Scene: {"gamma": "-"},
    Body: {},
    Rigid: {},
    Elastic: {"young": "Pa", "poisson": "-"},
    Prony: {"E_inf": "Pa", "E": "Pa", "tau": "s", "poisson": "-"},
    TabulatedModulus: {"omega": "rad/s", "storage": "Pa", "loss": "Pa", "poisson": "-"},
    WLF: {"C1": "-", "C2": "K", "T_ref": "K"},
    Arrhenius: {"energy": "eV", "T_ref": "K"},
    TabulatedShift: {"T": "K", "aT": "-", "T_ref": "K"},
    SelfAffine: {"q0": "1/m", "qr": "1/m", "q1": "1/m", "hurst": "-", "h_rms": "m"},
    TabulatedSpectrum: {"q": "1/m", "C": "m^4"},
    Slab: {"thickness": "m"},
}
CLASSES = {cls.__name__: cls for cls in UNITS}


@contextlib.contextmanager
def creating(path):
    """Open a new file of this format for writing."""
    # Since 1.10 the file format has checksums on its structure.
    with h5py.File(path, "x", libver=("v110", "v110")) as file:
        file.attrs["format"] = FORMAT
        file.attrs["format_version"] = FORMAT_VERSION
        file.attrs["rubberfric_version"] = importlib.metadata.version("rubberfric")
        yield file


@contextlib.contextmanager
def reading(path):
    """Open a file of this format; whatever is wrong with it becomes one ValueError naming it."""
    try:
        with open(path, "rb"):  # so that a missing file is not called a broken one
            pass
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from None
    try:
        with h5py.File(path, "r") as file:
            _check_format(file)
            yield file
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    except (OSError, KeyError, RuntimeError, TypeError) as error:
        text = str(error).strip("'\"").splitlines()[0]
        raise ValueError(f"{path}: must be a whole HDF5 file: {text}") from None


def write_object(parent, name, value):
    """Write a physical object as the group `name`; ValueError if its constructor would refuse it."""
    cls = type(value)
    if cls not in UNITS:
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(CLASSES)}")
    fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(cls)}
    cls(**fields)  # what jit, grad and vmap rebuilt was never checked
    group = parent.create_group(name)
    group.attrs["kind"] = cls.__name__
    for field in dataclasses.fields(cls):
        content = fields[field.name]
        if "static" in field.metadata:
            group.attrs[field.name] = content
        elif "child" not in field.metadata:
            write_values(group, field.name, content, UNITS[cls][field.name])
        elif content is not None:
            write_object(group, field.name, content)


def read_object(group):
    """The object that a group holds; ValueError, naming what is wrong where, if it holds none."""
    where = group.name
    if not isinstance(group, h5py.Group):
        raise ValueError(f"{where}: is a dataset: must be a group")
    kind = group.attrs.get("kind")
    if kind not in CLASSES:
        raise ValueError(f"{where}: kind = {kind!r}: {closest(kind, tuple(CLASSES))}")
    cls = CLASSES[kind]
    static = {f.name: f for f in dataclasses.fields(cls) if "static" in f.metadata}
    stored = {f.name: f for f in dataclasses.fields(cls) if "static" not in f.metadata}
    check_names(group, stored, ("kind", *static))
    values = {}
    for name in static:
        if name not in group.attrs:
            raise ValueError(f"{where}: attribute {name} is missing; {kind} must have it")
        values[name] = plain(group.attrs[name])
    for name, field in stored.items():
        if "child" in field.metadata:
            values[name] = read_object(group[name]) if name in group else None
        else:
            values[name] = read_values(group, name, UNITS[cls][name])
    try:
        return cls(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def write_values(group, name, values, units):
    """Write numbers as a dataset with their units."""
    weak = isinstance(values, float) or (isinstance(values, jax.Array) and values.weak_type)
    array = np.asarray(values)
    if array.dtype.kind != "f":
        raise ValueError(f"{group.name}/{name} has dtype {array.dtype}: must be float16, float32 or float64")
    data = group.create_dataset(name, data=array)
    data.attrs["units"] = units
    if weak:
        data.attrs["weak"] = True
    return data


def read_values(group, name, units):
    """Numbers of a dataset, in the units it must be in: a NumPy array, or a float if it is weak."""
    where = f"{group.name.rstrip('/')}/{name}"
    if name not in group or not isinstance(group[name], h5py.Dataset):
        raise ValueError(f"{where}: is missing; must be a dataset")
    data = group[name]
    if data.attrs.get("units") != units:
        raise ValueError(f"{where}: units = {data.attrs.get('units')!r}: must be {units!r}")
    if data.dtype.kind != "f":
        raise ValueError(f"{where}: has type {data.dtype}: must be a floating-point number")
    array = np.asarray(data[()], data.dtype.newbyteorder("="))
    return float(array) if data.attrs.get("weak", False) and array.ndim == 0 else array


def check_names(group, names, attributes):
    """ValueError if a group holds something unknown."""
    for name in group:
        if name not in names:
            raise ValueError(f"{group.name.rstrip('/')}/{name}: unknown field; {closest(name, tuple(names))}")
    for name in group.attrs:
        if name not in attributes:
            raise ValueError(f"{group.name}: attribute {name!r} is unknown; {closest(name, attributes)}")


def plain(attribute):
    """An attribute as Python has it: bool, int, float or str."""
    return attribute.item() if isinstance(attribute, np.generic) else attribute


def _check_format(file):
    if file.attrs.get("format") != FORMAT:
        raise ValueError(f"format = {file.attrs.get('format')!r}: must be {FORMAT!r}")
    version = file.attrs.get("format_version")
    if not isinstance(version, np.integer) or version != FORMAT_VERSION:
        raise ValueError(f"format_version = {plain(version)!r}: must be {FORMAT_VERSION}")
