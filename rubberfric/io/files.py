"""Scene files (TOML or HDF5) and result files (HDF5).

A result file is a scene file (`rubberfric.io.hdf5`) with these datasets next to /scene, which have the
attribute units:

    velocity [m/s]  pressure [Pa]  temperature [K]      one-dimensional; temperature is optional
    area [-]  friction [-]  separation [m]              shape [temperature, pressure, velocity]
    viscoelastic_friction [-]  shear_friction [-]       likewise, if they were computed
    transverse_friction [-]  flash_temperature [K]
    converged [-]                                       of type bool; 1.0 or 0.0 in older files

The accuracy settings are attributes of the group /quadrature. The file has the attribute title. The file of
an interpolated map also has the attributes interpolated_from (points) and interpolation_error (relative).

The conditions are HDF5 dimension scales, so `xarray.open_dataset(path, engine="h5netcdf")` returns quantities
over named coordinates. A missing temperature is a dimension without values, marked as in netCDF.
"""

import contextlib
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

import h5py
import numpy as np

from rubberfric.base.atomic import StrPath, as_path, check_suffix, check_writable, replacing, write_text
from rubberfric.base.objects.physical import fields_of, parts_of
from rubberfric.io.hdf5 import (
    check_names,
    creating,
    plain,
    read_object,
    read_quadrature,
    read_values,
    reading,
    subgroup,
    write_object,
    write_quadrature,
    write_values,
)
from rubberfric.io.results import (
    CONDITION_UNITS,
    DIMENSIONS,
    QUANTITY_FORMATS,
    Conditions,
    Interpolation,
    Result,
    SceneFile,
    check_conditions,
    conditions_text,
    default_conditions,
    result_shape,
)
from rubberfric.io.scene_edit import scene_file_texts
from rubberfric.io.toml import read_scene_toml
from rubberfric.scene.scene import Scene
from rubberfric.theory.structure import Solution

_FORMAT = "rubberfric scene"
# NAME of a dimension scale without coordinates, as netCDF writes it before the length.
_BARE = "This is a netCDF dimension but not a netCDF variable."
# Largest number of velocities, pressures or temperatures of a command.
MOST_CONDITIONS = 100_000
# Largest number of points of the commands that keep all results in memory.
MOST_POINTS = 1_000_000
# Bytes of a result file without its quantities, rounded up.
_HEAD = 2**20
# Attribute of an interpolated map: number of points at which the model was evaluated.
_INTERPOLATED_FROM = "interpolated_from"
# Attribute of an interpolated map: largest relative difference from the model.
_INTERPOLATION_ERROR = "interpolation_error"


# --- scenes


def load_scene(path: StrPath) -> Scene:
    """Load the scene of a file and the tables of the scene.

    Parameters
    ----------
    path : a .toml file (see `rubberfric.io.toml`), or a scene or result file (.h5)

    Returns
    -------
    Scene. An .h5 file gives the saved numbers exactly and in their precision (float64 becomes float32 unless
    JAX's x64 mode is on).

    Raises
    ------
    ValueError : the file is invalid. The message names the file, the fault and the rule.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> float(scene.lower.spectrum.hurst)
    0.8
    """
    return read_scene_file(path).scene


def save_scene(path: StrPath, scene: Scene, like: StrPath | None = None) -> None:
    """Save a scene as an HDF5 file (.h5) or a TOML file (.toml), completely or not at all.

    Numbers in a TOML file have all digits. Tables are written as CSV files in the same folder, and are named
    after the TOML file. An existing CSV file that does not belong to the TOML file is not overwritten.

    Parameters
    ----------
    path : file to write
    scene : Scene
    like : scene file whose title and conditions the new file gets
        If both files are TOML, the new file also keeps comments, and the lines whose values are unchanged.
        None writes no title and no conditions, so `rubberfric run` uses default conditions.

    Raises
    ------
    ValueError : another suffix, a missing folder, a value of the scene that a constructor refuses, or
        conditions of `like` that are not valid for the scene

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> smoother = scene.replace("lower.spectrum.h_rms", 0.2e-3)
    >>> rf.save_scene("smoother.toml", smoother, like="data/tread_on_asphalt.toml")
    >>> rf.same(rf.load_scene("smoother.toml"), smoother)
    True
    """
    check_writable(path, (".h5", ".toml"))
    if not isinstance(scene, Scene):
        raise ValueError(f"{path}: scene must be a Scene, got {type(scene).__name__}")
    try:
        for _, part in parts_of(scene):  # JAX rebuilds objects without checks
            type(part)(**{name: getattr(part, name) for name in fields_of(type(part))})
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    kept = SceneFile(scene, None, "") if like is None else read_scene_file(like)._replace(scene=scene)
    try:
        if (place := as_path(path)).suffix.lower() == ".toml":
            template = None if like is None or as_path(like).suffix.lower() == ".h5" else like
            for name, text in reversed(scene_file_texts(place, kept, template).items()):
                write_text(place.parent / name, text)  # the TOML file last, when its tables exist
        else:
            _save_hdf5(path, kept)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _save_hdf5(path: StrPath, content: SceneFile) -> None:
    columns = {} if content.conditions is None else content.conditions._asdict()
    if content.conditions is not None:
        check_conditions("", content.conditions, content.scene)
    with replacing(path) as temporary, creating(temporary, _FORMAT) as file:
        if content.title:
            file.attrs["title"] = content.title
        write_object(file, "scene", content.scene)
        for name, values in columns.items():
            if values is not None:
                write_values(file, name, values, CONDITION_UNITS[name]).make_scale(name)


def read_scene_file(path: StrPath, table: str = "run") -> SceneFile:
    """Read scene, conditions and title of a scene file or result file.

    A TOML file may have conditions in the tables "run" and "map", from which `table` selects one. An HDF5
    file has one set of conditions.
    """
    path = as_path(path)
    check_suffix(path, (".toml", ".h5"))
    if path.suffix.lower() == ".toml":
        return read_scene_toml(path, table)
    with reading(path, _FORMAT) as file:
        return _read_scene(file)


def read_computable(
    path: StrPath, table: str = "run", most: float = math.inf, default: bool = False
) -> tuple[Scene, Conditions, str]:
    """Read scene, conditions and title of a file for a computation.

    A ValueError is raised if the file has more than `most` points, or if the file has no conditions. If
    `default` is True, a file without conditions gives the `default_conditions`, and the title states these
    conditions.
    """
    content = read_scene_file(path, table)
    if content.conditions is None:
        if not default:
            raise ValueError(f"{path}: {table}: is missing; must hold velocity and pressure")
        conditions = default_conditions(content.scene)
        check_conditions(f"{path}: {table}", conditions, content.scene)
        stated = f"default conditions: {conditions_text(conditions)}"
        return content.scene, conditions, "; ".join([content.title] * bool(content.title) + [stated])
    for name, values in content.conditions._asdict().items():
        if values is not None and values.size > MOST_CONDITIONS:
            raise ValueError(f"{path}: {name} has {values.size} values: must have at most {MOST_CONDITIONS}")
    points = math.prod(result_shape(content.conditions))
    if points > most:
        raise ValueError(
            f"{path}: {table} has {points} points: must have at most {most}; see `rubberfric map`"
        )
    return content.scene, content.conditions, content.title


def _read_scene(file: h5py.File) -> SceneFile:
    check_names(
        file,
        ("scene", *CONDITION_UNITS, *QUANTITY_FORMATS, "quadrature"),
        ("format", "format_version", "rubberfric_version", "title", _INTERPOLATED_FROM, _INTERPOLATION_ERROR),
    )
    scene = read_object(subgroup(file, "scene"))
    if not isinstance(scene, Scene):
        raise ValueError(f"/scene: kind = {type(scene).__name__!r}: must be 'Scene'")
    title = str(file.attrs.get("title", ""))
    columns = [name for name in CONDITION_UNITS if name in file and not _is_bare(file, name)]
    if not columns:
        return SceneFile(scene, None, title)
    values = {name: np.asarray(read_values(file, name, CONDITION_UNITS[name])) for name in columns}
    for name in ("velocity", "pressure"):
        if name not in values:
            raise ValueError(f"/{name}: is missing; must be given")
    conditions = Conditions(values["velocity"], values["pressure"], values.get("temperature"))
    check_conditions("/", conditions, scene)
    return SceneFile(scene, conditions, title)


def _is_bare(file: h5py.File, condition: str) -> bool:
    """Return True if a condition is stored as a netCDF dimension without values."""
    name = file[condition].attrs.get("NAME", b"")
    return (name.decode("ascii", "replace") if isinstance(name, bytes) else str(name)).startswith(_BARE)


# --- results


def save_result(path: StrPath, result: Result) -> None:
    """Save a result as an HDF5 file, completely or not at all.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> result = rf.friction_map(scene, [1e-3, 1e-2], 0.15e6)
    >>> rf.io.save_result("result.h5", result)
    >>> bool(np.all(rf.io.load_result("result.h5").solution.friction == np.asarray(result.solution.friction)))
    True
    """
    columns = {name: np.asarray(x) for name, x in result.solution._asdict().items() if x is not None}
    with replacing(path) as temporary, creating(temporary, _FORMAT) as file:
        data = _begin(file, result, {name: values.dtype for name, values in columns.items()})
        for name, values in columns.items():
            data[name][...] = values
        write_interpolation(data, result.interpolation)


def load_result(path: StrPath) -> Result:
    """Load a result file, with the quantities as NumPy arrays.

    A ValueError is raised if the file is not a result file.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> rf.io.save_result("result.h5", rf.friction_map(scene, [1e-3, 1e-2], 0.15e6))
    >>> result = rf.io.load_result("result.h5")
    >>> result.conditions.velocity, rf.same(result.scene, scene)
    (array([0.001, 0.01 ]), True)
    """
    with reading(path, _FORMAT) as file:
        scene, conditions, title = _read_scene(file)
        if conditions is None:
            raise ValueError("has a scene but no results; must be a result file")
        shape = result_shape(conditions)
        values = {name: _read_quantity(file, name, shape) for name in QUANTITY_FORMATS if name in file}
        quadrature = read_quadrature(file)
        interpolation = None
        if _INTERPOLATED_FROM in file.attrs and _INTERPOLATION_ERROR in file.attrs:
            interpolation = Interpolation(
                int(plain(file.attrs[_INTERPOLATED_FROM])), float(plain(file.attrs[_INTERPOLATION_ERROR]))
            )
    return Result(scene, conditions, Solution(**values), quadrature, title, interpolation)


def _read_quantity(file: h5py.File, name: str, shape: tuple[int, ...]) -> np.ndarray:
    data = file[name]
    if name == "converged" and isinstance(data, h5py.Dataset) and (data.dtype, data.shape) == (bool, shape):
        return np.asarray(data[()])
    values = np.asarray(read_values(file, name, QUANTITY_FORMATS[name].unit, shape))
    return values != 0 if name == "converged" else values


@contextlib.contextmanager
def filling_result(
    path: StrPath, result: Result, dtypes: Mapping[str, np.dtype]
) -> Iterator[dict[str, h5py.Dataset]]:
    """Yield the datasets of a new result file, which the caller fills in.

    After the `with` block the file is moved to `path`. If the block raises an exception, the file is removed.

    Parameters
    ----------
    path : result file
    result : Result, whose solution is ignored
    dtypes : dtype of each quantity that the file contains, by name

    Raises
    ------
    ValueError : the disk space, which is allocated first, is not available
    """
    size = math.prod(result_shape(result.conditions)) * sum(x.itemsize for x in dtypes.values())
    with replacing(path) as temporary:
        try:
            space = temporary.with_name("space")
            _allocate(space, size + _HEAD)  # HDF5 may segfault on a full disk, see `creating`
            space.unlink()
            with creating(temporary, _FORMAT, in_place=True) as file:
                _begin(file, result, dtypes)
            _allocate(temporary, temporary.stat().st_size)
        except OSError as error:
            raise ValueError(f"{path}: cannot be written, {size / 2**30:.3g} GiB: {error.strerror}") from None
        with h5py.File(temporary, "r+") as file:
            yield {name: _dataset(file, name) for name in dtypes}


def mapped_quantities(path: StrPath) -> dict[str, np.memmap]:
    """Return read-only memory maps of the quantities in a file that `filling_result` wrote."""
    with reading(path, _FORMAT) as file:
        datasets = {name: _dataset(file, name) for name in QUANTITY_FORMATS if name in file}
        # A dataset without chunks is contiguous.
        places = {name: (data.dtype, data.id.get_offset(), data.shape) for name, data in datasets.items()}
    return {name: np.memmap(path, at[0], "r", *at[1:]) for name, at in places.items()}


def write_interpolation(data: Mapping[str, h5py.Dataset], interpolation: Interpolation | None) -> None:
    """Write the number of points and the error of an interpolation as attributes of a result file.

    `data` are datasets of the file.
    """
    if data and interpolation is not None:
        attributes = next(iter(data.values())).file.attrs
        attributes[_INTERPOLATED_FROM], attributes[_INTERPOLATION_ERROR] = interpolation


def _allocate(path: Path, size: int) -> None:
    """Allocate `size` bytes of disk space for a file, which could otherwise be sparse.

    An OSError is raised if there is not enough space.
    """
    if hasattr(os, "posix_fallocate"):
        with open(path, "ab") as file:
            os.posix_fallocate(file.fileno(), 0, size)


def _begin(file: h5py.File, result: Result, dtypes: Mapping[str, np.dtype]) -> dict[str, h5py.Dataset]:
    """Write a result without its quantities, and return empty datasets for the quantities.

    The data of each dataset are contiguous in the file.
    """
    creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    creation.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    creation.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    file.attrs["title"] = result.title
    write_object(file, "scene", result.scene)
    for name, units in CONDITION_UNITS.items():
        values = getattr(result.conditions, name)
        if values is None:
            file.create_dataset(name, (1,), float).make_scale(f"{_BARE}{1:10d}")
        else:
            write_values(file, name, values, units).make_scale(name)
    write_quadrature(file, result.quadrature)
    for name, dtype in dtypes.items():
        data = file.create_dataset(name, result_shape(result.conditions), dtype, dcpl=creation)
        data.attrs["units"] = QUANTITY_FORMATS[name].unit
        for axis, dimension in enumerate(DIMENSIONS):
            data.dims[axis].label = dimension
            data.dims[axis].attach_scale(file[dimension])
    return {name: _dataset(file, name) for name in dtypes}


def _dataset(file: h5py.File, name: str) -> h5py.Dataset:
    data = file[name]
    assert isinstance(data, h5py.Dataset)
    return data
