"""Scenes in HDF5, to the last bit: groups mirror the tree of objects.

::

    /                 attributes format = "rubberfric scene", format_version = 1, rubberfric_version
    /scene            attributes kind = "Scene", area_correction
    /scene/gamma      dataset, attribute units
    /scene/upper      attribute kind = "Body"
    /scene/upper/material/E ...

Static fields are attributes; a field that is None has no group. A dataset with the
attribute `weak` is a plain number, whose precision yields to that of the other leaves.
A result file (`rubberfric.io.results`) is a scene file with more in it.
"""

import dataclasses

import h5py

from rubberfric.base.checks import closest
from rubberfric.io.hdf5 import check_names, plain, read_values, write_values
from rubberfric.materials.coating import Coating
from rubberfric.materials.elastic import Elastic, Rigid
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.materials.slab import Slab
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.roughness.anisotropy import Anisotropic, TabulatedAnisotropic
from rubberfric.roughness.spectra import SelfAffine, TabulatedSpectrum
from rubberfric.scene.heating import Heating
from rubberfric.scene.scene import Body, Scene
from rubberfric.scene.shear import ContactShear
from rubberfric.scene.softening import Softening

FORMAT = "rubberfric scene"

# Units of the leaves of every class that a scene can hold; one row makes a class storable.
UNITS = {
    Scene: {"gamma": "-"},
    Body: {},
    Rigid: {},
    Elastic: {"young": "Pa", "poisson": "-"},
    Prony: {"E_inf": "Pa", "E": "Pa", "tau": "s", "poisson": "-"},
    PronyShear: {"G_inf": "Pa", "G": "Pa", "tau": "s", "bulk": "Pa"},
    TabulatedModulus: {"omega": "rad/s", "storage": "Pa", "loss": "Pa", "poisson": "-"},
    WLF: {"C1": "-", "C2": "K", "T_ref": "K"},
    Arrhenius: {"energy": "eV", "T_ref": "K"},
    TabulatedShift: {"T": "K", "aT": "-", "T_ref": "K"},
    SelfAffine: {"q0": "1/m", "qr": "1/m", "q1": "1/m", "hurst": "-", "h_rms": "m"},
    TabulatedSpectrum: {"q": "1/m", "C": "m^4"},
    Anisotropic: {"ratio": "-", "angle": "rad"},
    TabulatedAnisotropic: {"q": "1/m", "C": "m^4", "angle": "rad"},
    Slab: {"thickness": "m"},
    Coating: {"thickness": "m"},
    ContactShear: {"tau_f0": "Pa", "c": "-", "v0": "m/s"},
    Softening: {"strain": "-", "storage": "-", "loss": "-", "factor": "-"},
    Heating: {
        "density": "kg/m^3",
        "heat_capacity": "J/(kg K)",
        "conductivity": "W/(m K)",
        "radius": "m",
        "area_fraction": "-",
        "shear_share": "-",
    },
}
CLASSES = {cls.__name__: cls for cls in UNITS}


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
        elif content is None:
            continue
        elif "child" in field.metadata:
            write_object(group, field.name, content)
        else:
            write_values(group, field.name, content, UNITS[cls][field.name])


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
        if name not in group and ("child" in field.metadata or field.metadata["optional"]):
            values[name] = None
        elif "child" in field.metadata:
            values[name] = read_object(group[name])
        else:
            values[name] = read_values(group, name, UNITS[cls][name])
    try:
        return cls(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
