"""Results in HDF5: what came out, at what conditions, and the whole scene that made it.

A result file is a scene file (`rubberfric.io.scene_files.hdf5`) with these datasets beside /scene,
each with the attribute units:

    velocity [m/s]  pressure [Pa]  temperature [K]      one-dimensional; temperature may be missing
    area [-]  friction [-]  separation [m]              shape [temperature, pressure, velocity]
    viscoelastic_friction [-]  shear_friction [-]       the same; what the scene has no part for is missing
    transverse_friction [-]  flash_temperature [K]
    converged [-]                                       of type bool; 1.0 or 0.0 in older files

the group /quadrature, whose attributes are the accuracy settings, the attribute title, and of a map that was
interpolated the attributes interpolated_from (points) and interpolation_error (relative).

The conditions are HDF5 dimension scales, so that `xarray.open_dataset(path, engine="h5netcdf")` has
the quantities over named coordinates. Where there is no temperature, its dimension is one without
values, as netCDF marks it.
"""

import contextlib
import dataclasses
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

import h5py
import numpy as np

from rubberfric.base.atomic import StrPath, replacing
from rubberfric.base.quadrature import Quadrature
from rubberfric.io.hdf5 import check_names, creating, plain, read_values, reading, write_values
from rubberfric.io.results import (
    CONDITIONS,
    DIMENSIONS,
    QUANTITIES,
    Interpolation,
    Result,
    result_shape,
)
from rubberfric.io.scene_files.conditions import Conditions, SceneFile, check_conditions
from rubberfric.io.scene_files.hdf5 import FORMAT, read_object, write_object
from rubberfric.scene.scene import Scene
from rubberfric.theory.quantities import Solution

# NAME of a dimension scale that is no coordinate, as netCDF writes it (with its length).
_BARE = "This is a netCDF dimension but not a netCDF variable."

# Bytes that a result file has beside its quantities, and some more.
_HEAD = 2**20
# Attributes of a map that was interpolated.
_FROM, _ERROR = "interpolated_from", "interpolation_error"


def save_result(path: StrPath, result: Result) -> None:
    """Write a result file, whole or not at all."""
    found = {name: np.asarray(x) for name, x in result.solution._asdict().items() if x is not None}
    with replacing(path) as temporary, creating(temporary, FORMAT) as file:
        _begin(file, result, {name: values.dtype for name, values in found.items()})
        for name, values in found.items():
            _dataset(file, name)[...] = values
        write_interpolation({name: _dataset(file, name) for name in found}, result.interpolation)


@contextlib.contextmanager
def filling_result(
    path: StrPath, result: Result, dtypes: Mapping[str, np.dtype]
) -> Iterator[dict[str, h5py.Dataset]]:
    """Datasets of quantities to fill in; on leaving, the file is whole and at `path`, or nowhere.

    Parameters
    ----------
    path : result file
    result : whose solution is not looked at
    dtypes : of the quantities

    Raises
    ------
    ValueError : the file cannot have the space it needs, which is taken at once.
    """
    size = math.prod(result_shape(result.conditions)) * sum(x.itemsize for x in dtypes.values())
    with replacing(path) as temporary:
        try:
            space = temporary.with_name("space")
            _allocate(space, size + _HEAD)  # HDF5 must not find out, see `creating`
            space.unlink()
            with creating(temporary, FORMAT, in_place=True) as file:
                _begin(file, result, dtypes)
            _allocate(temporary, temporary.stat().st_size)
        except OSError as error:
            raise ValueError(f"{path}: cannot be written, {size / 2**30:.3g} GiB: {error.strerror}") from None
        with h5py.File(temporary, "r+") as file:
            yield {name: _dataset(file, name) for name in dtypes}


def write_interpolation(data: Mapping[str, h5py.Dataset], interpolation: Interpolation | None) -> None:
    """How the quantities of a result file were interpolated, if they were, in the file of their datasets."""
    if data and interpolation is not None:
        attributes = next(iter(data.values())).file.attrs
        attributes[_FROM], attributes[_ERROR] = interpolation


def mapped_quantities(path: StrPath) -> dict[str, np.memmap]:
    """Quantities in a result file that `filling_result` wrote, mapped into memory to be read."""
    with reading(path, FORMAT) as file:
        found = {name: _dataset(file, name) for name in QUANTITIES if name in file}
        # A dataset without chunks lies in its file in one piece, as an array lies in memory.
        places = {name: (data.dtype, data.id.get_offset(), data.shape) for name, data in found.items()}
    return {name: np.memmap(path, at[0], "r", *at[1:]) for name, at in places.items()}


def _allocate(path: Path, size: int) -> None:
    """Have a file its space: it may be of a size that the disk has not. OSError if there is none."""
    if hasattr(os, "posix_fallocate"):
        with open(path, "ab") as file:
            os.posix_fallocate(file.fileno(), 0, size)


def _begin(file: h5py.File, result: Result, dtypes: Mapping[str, np.dtype]) -> None:
    """A result whose quantities are to be filled in, each in one piece and in its place."""
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    creation.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    file.attrs["title"] = result.title
    write_object(file, "scene", result.scene)
    for name, units in CONDITIONS.items():
        values = getattr(result.conditions, name)
        if values is None:
            file.create_dataset(name, (1,), float).make_scale(f"{_BARE}{1:10d}")
        else:
            write_values(file, name, values, units).make_scale(name)
    write_quadrature(file, result.quadrature)
    for name, dtype in dtypes.items():
        data = file.create_dataset(name, result_shape(result.conditions), dtype, dcpl=creation)
        data.attrs["units"] = QUANTITIES[name].unit
        for axis, dimension in enumerate(DIMENSIONS):
            data.dims[axis].label = dimension
            data.dims[axis].attach_scale(file[dimension])


def load_result(path: StrPath) -> Result:
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
        interpolation = None
        if _FROM in file.attrs and _ERROR in file.attrs:
            interpolation = Interpolation(int(plain(file.attrs[_FROM])), float(plain(file.attrs[_ERROR])))
    return Result(scene, conditions, Solution(**values), quadrature, title, interpolation)


def _read_quantity(file: h5py.File, name: str) -> np.ndarray:
    data = file[name]
    if name == "converged" and isinstance(data, h5py.Dataset) and data.dtype == bool:
        return np.asarray(data[()])
    values = np.asarray(read_values(file, name, QUANTITIES[name].unit))
    return values != 0 if name == "converged" else values


def read_scene_hdf5(path: StrPath) -> SceneFile:
    """Scene, conditions and title of a scene file or a result file."""
    with reading(path, FORMAT) as file:
        return _read_scene(file)


def write_scene_hdf5(path: StrPath, scene: Scene) -> None:
    """Write a scene file, whole or not at all."""
    with replacing(path) as temporary, creating(temporary, FORMAT) as file:
        write_object(file, "scene", scene)


def write_quadrature(file: h5py.File, quadrature: Quadrature) -> None:
    """The accuracy settings as attributes of the group /quadrature."""
    group = file.create_group("quadrature")
    for field in dataclasses.fields(Quadrature):
        group.attrs[field.name] = getattr(quadrature, field.name)


def read_quadrature(file: h5py.File) -> Quadrature:
    """The Quadrature that `write_quadrature` wrote; ValueError naming what is wrong."""
    group = file.get("quadrature")
    if not isinstance(group, h5py.Group):
        raise ValueError("/quadrature: is missing; must be a group")
    names = [field.name for field in dataclasses.fields(Quadrature)]
    check_names(group, (), names)
    for name in names:
        if name not in group.attrs:
            raise ValueError(f"{group.name}: attribute {name} is missing; must be given")
    return Quadrature(**{name: plain(group.attrs[name]) for name in names})


def _read_scene(file: h5py.File) -> SceneFile:
    check_names(
        file,
        ("scene", *CONDITIONS, *QUANTITIES, "quadrature"),
        ("format", "format_version", "rubberfric_version", "title", _FROM, _ERROR),
    )
    if "scene" not in file:
        raise ValueError("/scene: is missing; must be a group")
    scene = read_object(file["scene"])
    if not isinstance(scene, Scene):
        raise ValueError(f"/scene: kind = {type(scene).__name__!r}: must be 'Scene'")
    title = str(file.attrs.get("title", ""))
    given = [name for name in CONDITIONS if name in file and not _is_bare(file, name)]
    if not given:
        return SceneFile(scene, None, title)
    values = {name: np.asarray(read_values(file, name, CONDITIONS[name])) for name in given}
    for name in ("velocity", "pressure"):
        if name not in values:
            raise ValueError(f"/{name}: is missing; must be given")
    conditions = Conditions(values["velocity"], values["pressure"], values.get("temperature"))
    check_conditions("/", conditions, scene)
    return SceneFile(scene, conditions, title)


def _is_bare(file: h5py.File, condition: str) -> bool:
    """Whether the dataset of a condition stands for a dimension alone."""
    name = file[condition].attrs.get("NAME", b"")
    return (name.decode("ascii", "replace") if isinstance(name, bytes) else str(name)).startswith(_BARE)


def _dataset(file: h5py.File, name: str) -> h5py.Dataset:
    data = file[name]
    assert isinstance(data, h5py.Dataset)
    return data
