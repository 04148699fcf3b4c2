"""Checkpoints of ensembles in HDF5: what it takes to go on to the same numbers.

::

    /               attributes format = "rubberfric ensemble checkpoint", format_version = 1,
                    rubberfric_version, fingerprint (of the job, `Members.fingerprint`), seconds
    /begun, steps   of every member: whether its start was evaluated, and its steps since
    /state/0, 1 ... arrays of the solver's state, a row a member, in the order of its fields

A file has its full size from the first write on, and is written under another name, synchronised
with the disk and renamed: at any moment there is one whole checkpoint. It is put together in
memory, so that a full disk is an error of the system, told as such, and not one of the format.
"""

import io
import os
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

from rubberfric.base.atomic import begin, check_writable, finish
from rubberfric.io.hdf5 import check_names, creating, plain, reading, release

FORMAT = "rubberfric ensemble checkpoint"


class Progress(NamedTuple):
    """How far an ensemble is: arrays over its members, changed in place."""

    begun: np.ndarray  # bool: whether `state` is one
    steps: np.ndarray  # taken since
    state: object  # of the solver
    seconds: np.ndarray  # spent, shape ()


def write_checkpoint(path, fingerprint, progress):
    """Write a checkpoint, whole or not at all; OSError says why it could not be."""
    path = Path(path).resolve()  # a link is followed, not replaced
    image = io.BytesIO()
    with creating(image, FORMAT) as file:
        file.attrs.update(fingerprint=fingerprint, seconds=float(progress.seconds))
        file["begun"], file["steps"] = progress.begun, progress.steps
        group = file.create_group("state")
        for i, leaf in enumerate(jax.tree.leaves(progress.state)):
            group[str(i)] = leaf
    # Always the same name: what a killed run leaves behind is overwritten by the next.
    temporary = path.with_name(f".{path.name}.writing")
    begin(temporary)
    try:
        with open(temporary, "wb") as file:
            file.write(image.getbuffer())
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
    finally:
        finish(temporary)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the new name, too
    finally:
        os.close(folder)


def read_checkpoint(path, fingerprint, blank):
    """The `Progress` that a checkpoint holds.

    Parameters
    ----------
    fingerprint : of the job that is to go on
    blank : Progress of that job before its first step, for the shapes

    Raises
    ------
    ValueError
        one line naming the file: it is truncated or no checkpoint, or one of another job or version.
    """
    with reading(path, FORMAT) as file:
        found = plain(file.attrs.get("rubberfric_version"))
        if found != release():
            raise ValueError(
                f"written by version {found}: this is {release()}, whose steps may differ; must be the same"
            )
        if file.attrs.get("fingerprint") != fingerprint:
            raise ValueError(
                "belongs to another job: scene, data, what is free, starts and solver must be the same"
            )
        check_names(
            file,
            ("begun", "steps", "state"),
            ("format", "format_version", "rubberfric_version", "fingerprint", "seconds"),
        )
        leaves, tree = jax.tree.flatten(blank.state)
        state = [_same(file, f"state/{i}", leaf) for i, leaf in enumerate(leaves)]
        begun, steps = (_same(file, name, getattr(blank, name)) for name in ("begun", "steps"))
        seconds = np.array(float(file.attrs["seconds"]))
        return Progress(begun, steps, jax.tree.unflatten(tree, state), seconds)


def _same(file, name, like):
    """An array of the file, of the shape and dtype of another."""
    array = np.asarray(file[name][()])
    if array.shape != like.shape or array.dtype != like.dtype:
        raise ValueError(
            f"/{name} is {array.dtype} of shape {array.shape}: must be {like.dtype} of shape {like.shape}"
        )
    return array


def check_checkpoint(path, fingerprint, blank, resume):
    """The progress to begin with, once it is certain that checkpoints can be written.

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
    progress = read_checkpoint(path, fingerprint, blank) if Path(path).exists() else blank
    try:
        # Twice: the second lies beside the first for a moment, as all later ones will.
        write_checkpoint(path, fingerprint, progress)
        write_checkpoint(path, fingerprint, progress)
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error.strerror}") from None
    return progress
