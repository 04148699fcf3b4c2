"""Results in HDF5: what came out, at what conditions, and the whole scene that made it.

A result file is a scene file (`rubberfric.io.scene_files.hdf5`) with these datasets beside /scene,
each with the attribute units:

    velocity [m/s]  pressure [Pa]  temperature [K]      one-dimensional; temperature may be missing
    area [-]  friction [-]  separation [m]              shape [temperature, pressure, velocity]
    viscoelastic_friction [-]  shear_friction [-]       the same; what the scene has no part for is missing
    transverse_friction [-]  flash_temperature [K]
    converged [-]                                       of type bool; 1.0 or 0.0 in older files

the group /quadrature, whose attributes are the accuracy settings, and the attribute title.

The conditions are HDF5 dimension scales, so that `xarray.open_dataset(path, engine="h5netcdf")` has
the quantities over named coordinates. Where there is no temperature, its dimension is one without
values, as netCDF marks it.
"""

import contextlib
import dataclasses
from typing import NamedTuple

import h5py
import numpy as np

from rubberfric.base.atomic import replacing
from rubberfric.base.quadrature import Quadrature
from rubberfric.io.hdf5 import check_names, creating, plain, read_values, reading, write_values
from rubberfric.io.scene_files.conditions import Conditions, SceneFile, check_conditions
from rubberfric.io.scene_files.hdf5 import FORMAT, read_object, write_object
from rubberfric.scene.scene import Scene
from rubberfric.theory.quantities import Solution

CONDITIONS = {"velocity": "m/s", "pressure": "Pa", "temperature": "K"}
QUANTITIES = {
    "area": "-",
    "friction": "-",
    "separation": "m",
    "viscoelastic_friction": "-",
    "shear_friction": "-",
    "transverse_friction": "-",
    "flash_temperature": "K",
    "converged": "-",
}
DIMENSIONS = ("temperature", "pressure", "velocity")

# NAME of a dimension scale that is no coordinate, as netCDF writes it (with its length).
_BARE = "This is a netCDF dimension but not a netCDF variable."


class Result(NamedTuple):
    """Everything a result file holds."""

    scene: Scene
    conditions: Conditions
    solution: Solution
    quadrature: Quadrature
    title: str = ""

    def _repr_html_(self):
        """Tables for notebooks."""
        from rubberfric.base.html import result_html

        return result_html(self)


def save_result(path, result):
    """Write a result file, whole or not at all."""
    shape = result_shape(result.conditions)
    with replacing(path) as temporary, writing_result(temporary, result) as file:
        for name in QUANTITIES:
            values = getattr(result.solution, name)
            if values is not None:
                values = np.broadcast_to(values, shape)
                allocate_quantity(file, name, shape, values.dtype)[...] = values


@contextlib.contextmanager
def writing_result(path, result):
    """A new file with all of a result but its quantities: those follow."""
    with creating(path, FORMAT) as file:
        file.attrs["title"] = result.title
        write_object(file, "scene", result.scene)
        for name, units in CONDITIONS.items():
            values = getattr(result.conditions, name)
            if values is None:
                file.create_dataset(name, (1,), float).make_scale(f"{_BARE}{1:10d}")
            else:
                write_values(file, name, values, units).make_scale(name)
        write_quadrature(file, result.quadrature)
        yield file


def allocate_quantity(file, name, shape, dtype):
    """The dataset of a quantity, to be filled, in one piece and in its place from the beginning."""
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    creation.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    data = file.create_dataset(name, shape, dtype, dcpl=creation)
    data.attrs["units"] = QUANTITIES[name]
    label(data)
    return data


def label(data):
    """Name the dimensions of the dataset of a quantity, and tie them to the conditions."""
    for axis, dimension in enumerate(DIMENSIONS):
        data.dims[axis].label = dimension
        data.dims[axis].attach_scale(data.file[dimension])


def load_result(path):
    """What a result file holds: a `Result`, its arrays NumPy arrays. ValueError if it is none."""
    with reading(path, FORMAT) as file:
        scene, conditions, title = _read_scene(file)
        if conditions is None:
            raise ValueError("has a scene but no results; must be a result file")
        shape = result_shape(conditions)
        values = {name: _read_quantity(file, name) for name in QUANTITIES if name in file}
        for name, array in values.items():
            if np.shape(array) != shape:
                raise ValueError(
                    f"/{name} has shape {np.shape(array)}: must be {shape}, [{', '.join(DIMENSIONS)}]"
                )
        quadrature = read_quadrature(file)
    return Result(scene, conditions, Solution(**values), quadrature, title)


def _read_quantity(file, name):
    if name == "converged":
        data = file[name]
        if isinstance(data, h5py.Dataset) and data.dtype == bool:
            return np.asarray(data[()])
        return read_values(file, name, QUANTITIES[name]) != 0
    return read_values(file, name, QUANTITIES[name])


def read_scene_hdf5(path):
    """Scene, conditions and title of a scene file or a result file."""
    with reading(path, FORMAT) as file:
        return _read_scene(file)


def write_scene_hdf5(path, scene):
    """Write a scene file, whole or not at all."""
    with replacing(path) as temporary, creating(temporary, FORMAT) as file:
        write_object(file, "scene", scene)


def result_shape(conditions):
    """Shape of the results: [temperature, pressure, velocity], one temperature if there is none."""
    temperatures = 1 if conditions.temperature is None else conditions.temperature.size
    return temperatures, conditions.pressure.size, conditions.velocity.size


def write_quadrature(file, quadrature):
    """The accuracy settings as attributes of the group /quadrature."""
    group = file.create_group("quadrature")
    for field in dataclasses.fields(Quadrature):
        group.attrs[field.name] = getattr(quadrature, field.name)


def read_quadrature(file):
    """The Quadrature that `write_quadrature` wrote; ValueError naming what is wrong."""
    if "quadrature" not in file:
        raise ValueError("/quadrature: is missing; must be a group")
    group = file["quadrature"]
    names = [field.name for field in dataclasses.fields(Quadrature)]
    check_names(group, (), names)
    for name in names:
        if name not in group.attrs:
            raise ValueError(f"{group.name}: attribute {name} is missing; must be given")
    return Quadrature(**{name: plain(group.attrs[name]) for name in names})


def _read_scene(file):
    check_names(
        file,
        ("scene", *CONDITIONS, *QUANTITIES, "quadrature"),
        ("format", "format_version", "rubberfric_version", "title"),
    )
    if "scene" not in file:
        raise ValueError("/scene: is missing; must be a group")
    scene = read_object(file["scene"])
    if not isinstance(scene, Scene):
        raise ValueError(f"/scene: kind = {type(scene).__name__!r}: must be 'Scene'")
    title = str(file.attrs.get("title", ""))
    given = [name for name in CONDITIONS if name in file and not _is_bare(file[name])]
    if not given:
        return SceneFile(scene, None, title)
    values = {name: read_values(file, name, CONDITIONS[name]) for name in given}
    conditions = Conditions(**dict.fromkeys(CONDITIONS) | values)
    for name in ("velocity", "pressure"):
        if name not in values:
            raise ValueError(f"/{name}: is missing; must be given")
    check_conditions("/", conditions, scene)
    return SceneFile(scene, conditions, title)


def _is_bare(data):
    """Whether a dataset stands for a dimension alone."""
    name = data.attrs.get("NAME", b"")
    return (name.decode("ascii", "replace") if isinstance(name, bytes) else str(name)).startswith(_BARE)
