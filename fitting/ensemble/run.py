"""Ensembles: thousands of fits over devices and processes, with checkpoints.

A checkpoint contains the state of a run, from which it continues with identical results::

    /               attributes format = "rubberfric ensemble checkpoint", format_version = 1,
                    rubberfric_version, fingerprint (of the job, `Members.fingerprint`), seconds
    /begun, steps   for every member: True if its start was evaluated, and its number of steps
    /iterate/0, 1 ... arrays of the solver's iterate, one row per member, in the order of the
                    iterate's fields

A file has its full size from the first write on. It is written under another name, synchronised with the disk
and renamed, so that one complete checkpoint exists at any moment. It is assembled in memory, so that a full
disk raises an OSError instead of an error of the HDF5 library.
"""

import io
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import h5py
import jax
import numpy as np
from jax.experimental import multihost_utils

from fitting.ensemble.members import EnsembleResult, Members
from fitting.solvers.devices import Devices, mesh_of
from fitting.solvers.options import check_options
from fitting.solvers.runs import Progress
from fitting.solvers.steps import Engine, make_engine
from rubberfric.base import VERSION, StrPath, check_writable, shown, write_durably
from rubberfric.io import hdf5

_FORMAT = "rubberfric ensemble checkpoint"

# Largest number of members in the batch of a processor, large enough to hide the work of the host.
IN_TURN = 32

# Largest number of members in the batch of an accelerator.
VECTORISED = 1024


def write_checkpoint(path: StrPath, fingerprint: str, progress: Progress) -> None:
    """Write a checkpoint completely or not at all. Raise OSError if it cannot be written."""
    image = io.BytesIO()
    with hdf5.creating(image, _FORMAT) as file:
        file.attrs.update(fingerprint=fingerprint, seconds=progress.seconds)
        file["begun"], file["steps"] = progress.begun, progress.steps
        group = file.create_group("iterate")
        for i, leaf in enumerate(jax.tree.leaves(progress.iterate)):
            group[str(i)] = leaf
    write_durably(path, image.getbuffer())


def read_checkpoint(path: StrPath, fingerprint: str, blank: Progress) -> Progress:
    """Read a checkpoint with the fingerprint of the job, and arrays of the same shapes as `blank`.

    Raise ValueError, in one line with the file, if the file is truncated, is not a checkpoint, or is from
    another job or version.
    """
    with hdf5.reading(path, _FORMAT) as file:
        version = hdf5.plain(file.attrs.get("rubberfric_version"))
        if version != VERSION:
            raise ValueError(
                f"written by version {version}, but this is version {VERSION}, whose steps may differ; resume"
                f" with version {version}, or remove the file to begin again"
            )
        if file.attrs.get("fingerprint") != fingerprint:
            held = file.get("steps")
            if isinstance(held, h5py.Dataset) and held.size != blank.steps.size:
                raise ValueError(f"has {held.size} members: must have {blank.steps.size}, like this run")
            raise ValueError("belongs to another job; scene, data, free, starts and solver must be the same")
        attributes = ("format", "format_version", "rubberfric_version", "fingerprint", "seconds")
        hdf5.check_names(file, ("begun", "steps", "iterate"), attributes)
        leaves, tree = jax.tree.flatten(blank.iterate)
        iterate = [_same(file, f"iterate/{i}", leaf) for i, leaf in enumerate(leaves)]
        begun, steps = (_same(file, name, getattr(blank, name)) for name in ("begun", "steps"))
        seconds = float(hdf5.plain(file.attrs["seconds"]))
        return Progress(begun, steps, jax.tree.unflatten(tree, iterate), seconds)


def _same(file: h5py.File, name: str, like: np.ndarray) -> np.ndarray:
    """Read an array, and raise ValueError unless the array has the shape and dtype of `like`."""
    data = file[name]
    array = np.asarray(data[()] if isinstance(data, h5py.Dataset) else None)
    if array.shape != like.shape or array.dtype != like.dtype:
        raise ValueError(f"/{name} is {array.dtype} {array.shape}: must be {like.dtype} {like.shape}")
    return array


def check_checkpoint(path: StrPath, fingerprint: str, blank: Progress, resume: bool) -> Progress:
    """Return the checkpoint in the file, or `blank` if none exists, after a test that it can be written.

    Raise ValueError, in one line, if that is impossible, or if the run cannot be continued from the file.
    """
    check_writable(path, (".h5",))
    if Path(path).exists() and not resume:
        raise ValueError(f"{path}: the file exists; continue it with resume=True, or remove it")
    progress = read_checkpoint(path, fingerprint, blank) if Path(path).exists() else blank
    try:
        # Written twice, because every later write also needs space for the old and the new file.
        write_checkpoint(path, fingerprint, progress)
        write_checkpoint(path, fingerprint, progress)
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error.strerror}") from None
    return progress


def run_ensemble(
    members: Members,
    *,
    devices: Sequence[jax.Device] | None = None,  # pyright: ignore[reportInvalidTypeForm]: a class
    checkpoint: StrPath | None = None,
    every: float = 60.0,
    resume: bool = False,
    max_memory: float = 2**30,
    batch: int | None = None,
    vectorised: bool | None = None,
    callback: Callable[[int, int], object] | None = None,
) -> EnsembleResult:
    """Run all members of an ensemble.

    Parameters
    ----------
    members : Members, from `multi_start`, `bootstrap_members` or `profile_members`
    devices : list of jax devices. If None, all devices of all processes are used.
    checkpoint : path of an HDF5 file (.h5) for the state of the ensemble, or None
    every : seconds between checkpoints; 0: after every step of the batch
    resume : True to continue from the checkpoint; the results are those of an uninterrupted run
        If the file does not exist, a new run begins. If False, an existing file raises a ValueError.
    max_memory : largest memory of a device for a step [B]
    batch : number of members per device that take a step before the results are examined
        If None, the number follows from the number of all members and the memory.
    vectorised : True if the members of a batch are computed simultaneously, False if one after the other
        If None, the members are computed simultaneously unless the device is a processor.
    callback : called as callback(members done, members) after every step of the batch, or None
        A KeyboardInterrupt, raised by the callback or from the keyboard, ends the run. The values reached
        are returned, and written to the checkpoint.

    Returns
    -------
    EnsembleResult
        `status` and `failed` report members that fail (a start that is not finite, or no minimum within
        `max_steps` steps). A member that fails does not affect other members.

    Raises
    ------
    ValueError
        one line, before the first step: an invalid option, a path that cannot be written to, a checkpoint
        that is truncated or of another job or version, too little memory for one member.

    Notes
    -----
    If a checkpoint cannot be written, as on a full disk, a RuntimeWarning is given, the previous checkpoint
    is kept, and the run tries again after `every` seconds.

    To use the cores of a processor as devices of JAX, begin the script with
    ``jax.config.update("jax_num_cpu_devices", n)``. To use several processes, run the same script in each.
    The script must begin with ``jax.distributed.initialize(address, processes, id)``, which this library
    never calls, and call this function with the same members. Every process gets the result; the first
    process reads and writes the checkpoint. If one process dies, all processes end, and a new run with
    `resume` continues.

    To the last bit, the results of a member do not depend on the other members and, unless `vectorised`, on
    the size of the batch. A resumed run gives the results of an uninterrupted one. XLA compiles differently
    for one device and for several, so rounding may differ; the cost of a converged member agrees to 1e-12.

    Examples
    --------
    A checkpoint holds the state of an ensemble, so that a later run continues it:

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    >>> free = {"lower.spectrum.h_rms": fitting.Positive()}
    >>> members = fitting.multi_start(scene, data, free, starts=2)
    >>> ensemble = fitting.run_ensemble(members, checkpoint="starts.h5")
    >>> again = fitting.run_ensemble(members, checkpoint="starts.h5", resume=True)
    >>> bool(np.all(again.values == ensemble.values)), again.failed.size
    (True, 0)
    """
    if not isinstance(members, Members):
        raise ValueError(f"members is a {type(members).__name__}: must be Members, as from multi_start")
    check_options(every=every, max_memory=max_memory, batch=batch)
    if callback is not None and not callable(callback):
        raise ValueError(f"callback = {shown(callback)}: must be a function of (done, members), or None")
    devices = list(jax.devices() if devices is None else devices)
    together = _several_processes(devices)
    record = _Record(members, checkpoint, every, together)
    record.begin(resume)
    progress, most = record.progress, members.max_steps
    interrupted, size, peak = False, 0, 0

    def tell() -> None:
        if callback is not None:
            callback(len(members) - int(progress.unfinished(most).sum()), len(members))

    try:
        tell()
        if progress.unfinished(most).any():
            engine, peak = largest_batch(members, devices, batch, vectorised, max_memory)
            size = engine.size
            for _ in progress.advance(engine, record.targets, most):
                record.write_if_due()
                tell()
    except KeyboardInterrupt:
        if together:  # the others wait for this process
            raise
        interrupted = True
    record.write()
    runs = progress.ends(members.problem, record.targets.moving, interrupted)
    return EnsembleResult(
        kind=members.kind,
        names=members.names,
        values=members.problem.values(runs.x),
        **runs._asdict(),
        seconds=progress.seconds,
        devices=len(devices),
        batch=size,
        peak=peak,
    )


def largest_batch(
    members: Members,
    devices: Sequence[jax.Device],  # pyright: ignore[reportInvalidTypeForm]: a class
    size: int | None = None,
    vectorised: bool | None = None,
    max_memory: float = 2**30,
) -> tuple[Engine, int]:
    """Return the engine with the largest batch that fits into memory, and the memory of a device [B].

    See `run_ensemble` for the arguments. Raise ValueError if a step does not fit into `max_memory`.
    """
    vectorised = devices[0].platform != "cpu" if vectorised is None else vectorised
    mesh = mesh_of(devices)
    tried = size or min(VECTORISED if vectorised else IN_TURN, -(-len(members) // len(devices)))
    while True:
        on = Devices(mesh, vectorised, tried, many=True)
        engine, targets = _engine(members, tried, on)
        rows = slice(engine.count)
        peak = engine.memory(jax.tree.map(lambda a, at=rows: a[at], targets), members.starts[rows])
        if peak <= max_memory:
            return engine, peak
        if tried == 1 or size:
            raise ValueError(
                f"max_memory = {max_memory}: a step of a batch of {tried} takes {peak} bytes on each device;"
                " raise max_memory to at least this number"
            )
        tried = max(1, min(tried - 1, int(tried * max_memory / peak)))


def _engine(members, size, devices=None):
    """Return the engine for batches of `size` members on each device, and the targets of all members."""
    return make_engine(members.solver, members.problem, members.targets, len(members), size, devices)


class _Record:
    """Progress of a run, and the file to which it is written."""

    def __init__(self, members, path, every, together):
        self.path, self.every, self.together = path, every, together
        self.writes = jax.process_index() == 0 or not together
        self.fingerprint = members.fingerprint() if path is not None else ""
        engine, self.targets = _engine(members, 1)
        self.progress = Progress.blank(engine.blank(self.targets, members.starts))
        self.written, self.in_file = time.monotonic(), 0

    def begin(self, resume):
        """Read the checkpoint if the file exists. All processes raise an error if the file cannot be used."""
        error = None
        if self.path is not None and self.writes:
            try:
                self.progress = check_checkpoint(self.path, self.fingerprint, self.progress, resume)
                self.in_file = self._taken()
            except ValueError as failure:
                error = failure
        if self.together and self.path is not None:
            failed = multihost_utils.broadcast_one_to_all(np.array(error is not None, np.int32))
            if failed and error is None:
                raise ValueError(f"{self.path}: cannot be used by the first process; see its error message")
            if not failed:
                self.progress = _from_first(self.progress)
        if error is not None:
            raise error

    def _taken(self):
        """Return the number of steps of all members, including their starts."""
        return int(self.progress.begun.sum() + self.progress.steps.sum())

    def write_if_due(self):
        """Write the file if `every` seconds have passed."""
        if time.monotonic() - self.written >= self.every:
            self.write()

    def write(self):
        """Write the checkpoint to the file. If this fails, give a warning and let the run continue."""
        self.progress.take_in()
        if self.path is None or not self.writes or self._taken() == self.in_file:
            return
        try:
            write_checkpoint(self.path, self.fingerprint, self.progress)
            self.in_file = self._taken()
        except OSError as error:
            text = f"{self.path}: checkpoint not written, the previous one is kept: {error.strerror or error}"
            warnings.warn(text, RuntimeWarning, stacklevel=2)
        self.written = time.monotonic()


def _several_processes(devices):
    """Return True if the devices belong to all of several processes, False if only to this process."""
    owners = {device.process_index for device in devices}
    if owners != {jax.process_index()} and owners != set(range(jax.process_count())):
        raise ValueError(
            f"devices belong to processes {sorted(owners)} of {jax.process_count()}:"
            " must belong to this process only, or to all processes"
        )
    return len(owners) > 1


def _from_first(progress):
    """Broadcast the progress of the first process to all processes, and return this progress."""

    def sent(array):
        # Sent as bytes, because a sum over processes would change the bits of a NaN.
        own = np.frombuffer(np.ascontiguousarray(array).tobytes(), np.uint8)
        received = np.asarray(multihost_utils.broadcast_one_to_all(own))
        return received.view(array.dtype).reshape(array.shape).copy()

    parts = progress.begun, progress.steps, progress.iterate, np.array(progress.seconds)
    begun, steps, iterate, seconds = jax.tree.map(sent, parts)
    return Progress(begun, steps, iterate, float(seconds))
