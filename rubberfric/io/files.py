"""Scene files of either kind: TOML written by hand, HDF5 written by the library."""

from rubberfric.base.atomic import StrPath, as_path, check_suffix, check_writable
from rubberfric.io.result_files import read_scene_hdf5, write_scene_hdf5
from rubberfric.io.scene_files.conditions import Conditions, SceneFile
from rubberfric.io.scene_files.toml import read_scene_toml
from rubberfric.scene.scene import Scene

SUFFIXES = (".toml", ".h5")


def read_scene_file(path: StrPath, table: str = "run") -> SceneFile:
    """Scene, conditions and title of a scene file; see `load_scene`.

    A TOML file has conditions in the tables "run" and "map"; an HDF5 file has one set of them.
    """
    path = as_path(path)
    check_suffix(path, SUFFIXES)
    return read_scene_toml(path, table) if path.suffix.lower() == ".toml" else read_scene_hdf5(path)


def read_computable(path: StrPath, table: str = "run") -> tuple[Scene, Conditions, str]:
    """The same of a file that says at what conditions to compute, or ValueError."""
    found = read_scene_file(path, table)
    if found.conditions is None:
        raise ValueError(f"{path}: {table}: is missing; must hold velocity and pressure to compute at")
    return found.scene, found.conditions, found.title


def load_scene(path: StrPath) -> Scene:
    """Scene of a file, its curves resolved.

    Parameters
    ----------
    path : path of a .toml file (see `rubberfric.io.scene_files.toml`), or of an .h5 file that
        `save_scene` or the command wrote: a result file gives the scene that made it.

    Returns
    -------
    Scene. From .h5 to the last bit and with the precision it was saved with (float64
    becomes float32 unless JAX's x64 mode is on).

    Raises
    ------
    ValueError
        one line naming the file, what in it is wrong, and the rule.
    """
    return read_scene_file(path).scene


def save_scene(path: StrPath, scene: Scene) -> None:
    """Write a scene as an HDF5 file (.h5), whole or not at all; `load_scene` reads it back.

    Raises
    ------
    ValueError
        one line: the suffix is not .h5, the folder is missing, or the scene holds
        values that its constructors refuse.
    """
    check_writable(path, (".h5",))
    if not isinstance(scene, Scene):
        raise ValueError(f"{path}: scene is a {type(scene).__name__}: must be a Scene")
    try:
        write_scene_hdf5(path, scene)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
