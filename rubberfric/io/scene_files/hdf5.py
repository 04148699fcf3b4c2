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

from typing import Any

import h5py

from rubberfric.base.checks import closest
from rubberfric.base.objects.fields import Child, Leaf, Static
from rubberfric.base.objects.physical import PhysicalObject, fields_of, kinds
from rubberfric.io.hdf5 import check_names, plain, read_values, write_values

FORMAT = "rubberfric scene"


def write_object(parent: h5py.Group, name: str, value: PhysicalObject) -> None:
    """Write a physical object as the group `name`; ValueError if its constructor would refuse it."""
    cls = type(value)
    if cls not in kinds(PhysicalObject).values():
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(kinds(PhysicalObject))}")
    cls(**{field: getattr(value, field) for field in fields_of(cls)})  # what jax rebuilt was never checked
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
    """The object that a group holds; ValueError, naming what is wrong where, if it holds none."""
    where, known = group.name, kinds(PhysicalObject)
    if not isinstance(group, h5py.Group):
        raise ValueError(f"{where}: is a dataset: must be a group")
    kind = group.attrs.get("kind")
    if kind not in known:
        raise ValueError(f"{where}: kind = {kind!r}: {closest(kind, tuple(known))}")
    fields = fields_of(known[kind])
    static = [name for name, field in fields.items() if isinstance(field, Static)]
    check_names(group, [name for name in fields if name not in static], ("kind", *static))
    values = {}
    for name in static:
        if name not in group.attrs and not fields[name].choices:
            continue  # written before there was one: the default
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
