"""Checkpoints of ensembles in HDF5: what it takes to go on to the same numbers.

::

    /               attributes format = "rubberfric ensemble checkpoint", format_version = 1,
                    rubberfric_version, fingerprint (of the job, `Members.fingerprint`), seconds
    /begun, steps   of every member: whether its start was evaluated, and its steps since
    /iterate/0, 1 ... arrays of the solver's iterate, a row a member, in the order of its fields

A file has its full size from the first write on, and is written under another name, synchronised
with the disk and renamed: at any moment there is one whole checkpoint. It is put together in
memory, so that a full disk is an error of the system, told as such, and not one of the format.
"""

import io
from pathlib import Path
from typing import NamedTuple

import h5py
import jax
import numpy as np

from fitting.solvers.iterate import Iterate
from rubberfric.base import VERSION, StrPath, check_writable, write_durably
from rubberfric.io import hdf5

FORMAT = "rubberfric ensemble checkpoint"


class Checkpoint(NamedTuple):
    """How far an ensemble is: arrays over its members, changed in place."""

    begun: np.ndarray  # bool: whether `iterate` is one
    steps: np.ndarray  # taken since
    iterate: Iterate
    seconds: np.ndarray  # spent, shape ()


def write_checkpoint(path: StrPath, fingerprint: str, checkpoint: Checkpoint) -> None:
    """Write a checkpoint, whole or not at all; OSError says why it could not be."""
    image = io.BytesIO()
    with hdf5.creating(image, FORMAT) as file:
        file.attrs.update(fingerprint=fingerprint, seconds=float(checkpoint.seconds))
        file["begun"], file["steps"] = checkpoint.begun, checkpoint.steps
        group = file.create_group("iterate")
        for i, leaf in enumerate(jax.tree.leaves(checkpoint.iterate)):
            group[str(i)] = leaf
    write_durably(path, image.getbuffer())


def read_checkpoint(path: StrPath, fingerprint: str, blank: Checkpoint) -> Checkpoint:
    """The checkpoint that a file holds.

    Parameters
    ----------
    fingerprint : of the job that is to go on
    blank : of that job before its first step, for the shapes

    Raises
    ------
    ValueError
        one line naming the file: it is truncated or no checkpoint, or one of another job or version.
    """
    with hdf5.reading(path, FORMAT) as file:
        found = hdf5.plain(file.attrs.get("rubberfric_version"))
        if found != VERSION:
            raise ValueError(
                f"written by version {found}: this is {VERSION}, whose steps may differ; must be the same"
            )
        if file.attrs.get("fingerprint") != fingerprint:
            raise ValueError(
                "belongs to another job: scene, data, what is free, starts and solver must be the same"
            )
        hdf5.check_names(
            file,
            ("begun", "steps", "iterate"),
            ("format", "format_version", "rubberfric_version", "fingerprint", "seconds"),
        )
        leaves, tree = jax.tree.flatten(blank.iterate)
        iterate = [_same(file, f"iterate/{i}", leaf) for i, leaf in enumerate(leaves)]
        begun, steps = (_same(file, name, getattr(blank, name)) for name in ("begun", "steps"))
        seconds = np.array(float(hdf5.plain(file.attrs["seconds"])))
        return Checkpoint(begun, steps, jax.tree.unflatten(tree, iterate), seconds)


def _same(file: h5py.File, name: str, like: np.ndarray) -> np.ndarray:
    """An array of the file, of the shape and dtype of another."""
    data = file[name]
    array = np.asarray(data[()] if isinstance(data, h5py.Dataset) else None)
    if array.shape != like.shape or array.dtype != like.dtype:
        raise ValueError(
            f"/{name} is {array.dtype} of shape {array.shape}: must be {like.dtype} of shape {like.shape}"
        )
    return array


def check_checkpoint(path: StrPath, fingerprint: str, blank: Checkpoint, resume: bool) -> Checkpoint:
    """The checkpoint to begin with, once it is certain that checkpoints can be written.

    Raises
    ------
    ValueError
        one line: the path cannot be written to, or what lies there is not to be gone on with.
    """
    check_writable(path, (".h5",))
    if Path(path).exists() and not resume:
        raise ValueError(
            f"{path}: there is a file already; must be gone on with (resume=True), or removed first"
        )
    checkpoint = read_checkpoint(path, fingerprint, blank) if Path(path).exists() else blank
    try:
        # Twice: the second lies beside the first for a moment, as all later ones will.
        write_checkpoint(path, fingerprint, checkpoint)
        write_checkpoint(path, fingerprint, checkpoint)
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error.strerror}") from None
    return checkpoint
