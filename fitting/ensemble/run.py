"""Ensembles: thousands of fits as one program over devices and processes, with checkpoints."""

import time
import warnings

import jax
import numpy as np
from jax.experimental import multihost_utils

from fitting.ensemble.batches import advance, blank_state, make_lanes
from fitting.ensemble.checkpoint import Progress, check_checkpoint, write_checkpoint
from fitting.ensemble.members import Members
from fitting.ensemble.result import EnsembleResult
from fitting.parameters.constraints import is_number
from fitting.parameters.layout import to_values
from fitting.solvers.status import INTERRUPTED, OUT_OF_STEPS, RUNNING


def run_ensemble(
    members,
    *,
    devices=None,
    checkpoint=None,
    every=60.0,
    resume=False,
    max_memory=2**30,
    lanes=None,
    batched=None,
    callback=None,
):
    """Run all members of an ensemble.

    Parameters
    ----------
    members : Members, from `multi_start`, `bootstrap_members` or `profile_members`
    devices : list of jax devices; None: all, of all processes
    checkpoint : path of an HDF5 file (.h5) to save the state to, or None
    every : seconds between checkpoints; 0: after every step of the lanes
    resume : go on with the checkpoint, to the same numbers as without the break; without a
        file, begin. False: refuse to overwrite one.
    max_memory : bytes of each device that a step may take [B]
    lanes : members of each device that take a step before results are looked at; None: as many
        as there is work and memory for
    batched : whether they take it as one batch, or one after the other; None: as one batch
        unless the device is a processor
    callback : called as callback(members done, members) after every step of the lanes, or None
        KeyboardInterrupt, from it or the keyboard, ends the run with the values reached, and
        a checkpoint.

    Returns
    -------
    EnsembleResult
        A member that fails (a start that is not finite, no minimum within its steps) is told
        in `status` and `failed`, and the others do not notice.

    Raises
    ------
    ValueError
        one line: a bad option, a path that cannot be written to, a checkpoint that is truncated
        or of another job or version, too little memory for one lane. All before the first step.

    Warns
    -----
    RuntimeWarning
        a checkpoint could not be written (a disk that filled up meanwhile); the run goes on,
        tries again at the next, and the last one is kept.

    Notes
    -----
    A processor's cores are devices only if JAX is told so at the start of the program, by
    ``jax.config.update("jax_num_cpu_devices", n)``. For several processes the program, the same
    in each, begins with ``jax.distributed.initialize(address, processes, id)`` (this library
    never does that), gives all of them the same members, and runs them in each; all get the
    result, the first one reads and writes the checkpoint. If a process dies all end, and a new
    start resumes.

    A member's numbers do not depend on the other members, and where lanes are not `batched` not on
    their number, to the last bit. So a resumed run ends with the bits of an uninterrupted one.
    Nor do they depend on the number of devices or processes, with one exception: XLA simplifies
    a program for one device by another sequence of passes than one for several, and may round
    the model differently. The cost of a member that converges is the same to 1e-12 then.
    """
    _check(members, every, max_memory, lanes, callback)
    devices = list(jax.devices() if devices is None else devices)
    together = _several_processes(devices)
    job = _Job(members, checkpoint, every, together)
    job.begin(resume)
    progress, state = job.progress, job.progress.state
    before, compiled, interrupted = float(progress.seconds), None, False
    try:
        while True:
            running = progress.begun & (state.status == RUNNING) & (progress.steps < members.max_steps)
            fresh = np.flatnonzero(~progress.begun)
            if callback is not None:
                callback(len(members) - int(running.sum()) - fresh.size, len(members))
            if not running.any() and not fresh.size:
                break
            if compiled is None:
                compiled = make_lanes(members, devices, lanes, batched, max_memory)
                began = time.monotonic()
            stepping = running.sum() >= compiled.count or not fresh.size
            which = (np.flatnonzero(running) if stepping else fresh)[: compiled.count]
            new = advance(compiled, compiled.step if stepping else compiled.start, members, state, which)
            job.keep(which, new, stepping, before + time.monotonic() - began)
    except KeyboardInterrupt:
        if together:  # the others wait for this process
            raise
        interrupted = True
    job.write()
    return _result(members, progress, compiled, devices, interrupted)


class _Job:
    """The progress of an ensemble and its file."""

    def __init__(self, members, path, every, together):
        self.path, self.every, self.together = path, every, together
        self.writes = path is not None and (jax.process_index() == 0 or not together)
        self.fingerprint = members.fingerprint() if path is not None else None
        count = len(members)
        self.progress = Progress(
            np.zeros(count, bool), np.zeros(count, int), blank_state(members), np.array(0.0)
        )
        self.written, self.changed, self.pending = time.monotonic(), False, None

    def begin(self, resume):
        """Read or make the checkpoint; what is wrong with it is found here, and told in all processes."""
        error = None
        if self.writes:
            try:
                self.progress = check_checkpoint(self.path, self.fingerprint, self.progress, resume)
            except ValueError as found:
                error = found
        if self.together and self.path is not None:
            failed = multihost_utils.broadcast_one_to_all(np.array(error is not None, np.int32))
            if failed and error is None:
                raise ValueError(f"{self.path}: the first process could not use it; see its error")
            if not failed:
                self.progress = _from_first(self.progress)
        if error is not None:
            raise error

    def keep(self, which, new, stepped, seconds):
        """Take in rows after a step or a start; write them down if it is time to."""
        steps = self.progress.steps[which] + stepped
        self.pending = which, Progress(True, steps, new, seconds)
        self._take_in()
        if time.monotonic() - self.written >= self.every:
            self.write()

    def _take_in(self):
        """Rows that came; done again if an interrupt stopped it half-way."""
        if self.pending is None:
            return
        which, rows = self.pending
        progress = self.progress
        for old, new in zip(jax.tree.leaves(progress.state), jax.tree.leaves(rows.state), strict=True):
            old[which] = new
        progress.steps[which], progress.begun[which] = rows.steps, rows.begun
        progress.seconds[...] = rows.seconds
        self.pending, self.changed = None, True

    def write(self):
        """Write the checkpoint; a failure is no reason to lose the run."""
        self._take_in()
        if not (self.writes and self.changed):
            return
        try:
            write_checkpoint(self.path, self.fingerprint, self.progress)
            self.changed = False
        except OSError as error:
            text = f"{self.path}: checkpoint not written, the last one is kept: {error.strerror or error}"
            warnings.warn(text, RuntimeWarning, stacklevel=2)
        self.written = time.monotonic()


def _several_processes(devices):
    """Whether the devices belong to several processes; ValueError if only to some of all, or to others."""
    owners = {device.process_index for device in devices}
    if owners != {jax.process_index()} and owners != set(range(jax.process_count())):
        raise ValueError(
            f"devices belong to processes {sorted(owners)} of {jax.process_count()}:"
            " must be of this process, or of all"
        )
    return len(owners) > 1


def _from_first(progress):
    """The progress of the first process, in all."""
    leaves, tree = jax.tree.flatten(progress)
    # As bytes: a sum over processes, by which they are sent, would lose the bits of a NaN.
    sent = [multihost_utils.broadcast_one_to_all(_bytes(leaf)) for leaf in leaves]
    pairs = zip(sent, leaves, strict=True)
    arrays = [np.asarray(new).view(leaf.dtype).reshape(leaf.shape).copy() for new, leaf in pairs]
    return jax.tree.unflatten(tree, arrays)


def _bytes(array):
    return np.frombuffer(np.ascontiguousarray(array).tobytes(), np.uint8)


def _check(members, every, max_memory, lanes, callback):
    if not isinstance(members, Members):
        raise ValueError(f"members is a {type(members).__name__}: must be Members, such as of multi_start")
    if not (is_number(every) and every >= 0):
        raise ValueError(f"every = {every!r}: must be a number of seconds >= 0")
    if not (is_number(max_memory) and max_memory > 0):
        raise ValueError(f"max_memory = {max_memory!r}: must be a number of bytes > 0")
    if lanes is not None and (isinstance(lanes, bool) or not isinstance(lanes, int) or lanes < 1):
        raise ValueError(f"lanes = {lanes!r}: must be an integer >= 1, or None")
    if callback is not None and not callable(callback):
        raise ValueError(f"callback = {callback!r}: must be a function of (done, members), or None")


def _result(members, progress, compiled, devices, interrupted):
    state, layout = progress.state, members.problem.structure.layout
    late = INTERRUPTED if interrupted else OUT_OF_STEPS
    values = jax.vmap(lambda x: to_values(layout, members.problem.numbers.constants, x))(state.x)
    return EnsembleResult(
        kind=members.kind,
        names=members.names,
        x=state.x,
        values=np.asarray(values),
        cost=np.where(progress.begun, state.cost, np.inf),
        status=np.where(state.status == RUNNING, late, state.status),
        nfev=state.nfev,
        njev=state.njev,
        seconds=float(progress.seconds),
        devices=len(devices),
        lanes=0 if compiled is None else compiled.count,
        peak=0 if compiled is None else compiled.peak,
    )
