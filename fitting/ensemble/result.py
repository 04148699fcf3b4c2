"""What the run of an ensemble gives back, and its file.

::

    /           attributes format = "rubberfric ensemble", format_version = 1, kind, seconds,
                devices, lanes, peak
    /report     as text
    /names      of the free elements
    /x, values  a row a member; likewise cost, status, nfev, njev
"""

import dataclasses

import numpy as np

from fitting.results.hdf5_parts import attributes, read_array, read_texts, write_texts
from fitting.solvers.status import CONVERGED, MESSAGES, PERFECT
from rubberfric.base.atomic import check_writable, replacing
from rubberfric.io.hdf5 import check_names, creating, reading, write_values

FORMAT = "rubberfric ensemble"
ATTRIBUTES = {"kind": str, "seconds": float, "devices": int, "lanes": int, "peak": int}
UNITS = {"x": "-", "values": "as of the parameters", "cost": "-"}
COUNTS = ("status", "nfev", "njev")


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class EnsembleResult:
    """Ends of all members of an ensemble, one row each.

    Attributes
    ----------
    kind : of the members
    names : of the free elements
    x, values : shape (members, size): variables of the solver, and values of the elements
    cost, status, nfev, njev : shape (members,); status as of `fitting.solvers.status`
    seconds : wall time without compilation, of all runs that a checkpoint joins
    devices, lanes : that the (last) run used; 0 lanes if nothing was left to do
    peak : bytes of each device that a step took, by the compiler's account
    """

    kind: str
    names: tuple
    x: np.ndarray
    values: np.ndarray
    cost: np.ndarray
    status: np.ndarray
    nfev: np.ndarray
    njev: np.ndarray
    seconds: float
    devices: int
    lanes: int
    peak: int

    def __len__(self):
        return len(self.x)

    def __repr__(self):
        return f"<EnsembleResult: {len(self)} members of kind {self.kind!r}, {self.failed.size} failed>"

    @property
    def good(self):
        """Which members converged, shape (members,)."""
        return np.isin(self.status, (CONVERGED, PERFECT))

    @property
    def failed(self):
        """Indices of the members that did not converge."""
        return np.flatnonzero(~self.good)

    @property
    def best(self):
        """Index of the lowest finite cost."""
        if not np.isfinite(self.cost).any():
            raise ValueError("no member has a finite cost: check the start values")
        return int(np.argmin(np.where(np.isfinite(self.cost), self.cost, np.inf)))

    def interval(self, level=0.95):
        """Quantiles of the values of the members that converged."""
        if not 0 < level < 1:
            raise ValueError(f"level = {level!r}: must be between 0 and 1")
        if not self.good.any():
            raise ValueError("no member converged: there are no quantiles")
        tail = 50 * (1 - level)
        return tuple(np.percentile(self.values[self.good], q, axis=0) for q in (tail, 100 - tail))

    def report(self):
        """How the members ended, and where, as text of several lines."""
        lines = ["[[Ensemble]]", f"    kind     = {self.kind}", f"    members  = {len(self)}"]
        lines += [
            f"    {np.sum(self.status == s):8d} {text}" for s, text in MESSAGES.items() if s in self.status
        ]
        listed = ", ".join(map(str, self.failed[:10])) + ", ..." * (self.failed.size > 10)
        lines += [f"    failed: {listed}"] if self.failed.size else []
        lines += [
            f"    {self.nfev.sum()} evaluations, {self.njev.sum()} of them with derivatives,"
            f" in {self.seconds:.4g} s on {self.devices} device{'s' * (self.devices > 1)}",
            f"    a step took {self.peak / 1e6:.4g} MB of each for {self.lanes} lanes",
        ]
        if self.good.any():
            width = max(map(len, self.names))
            low, middle, high = np.percentile(self.values[self.good], [2.5, 50, 97.5], axis=0)
            lines += ["[[Values: median, and 95 % between]]"]
            rows = zip(self.names, middle, low, high, strict=True)
            lines += [f"    {n:{width}s} {m:12.6g}   {a:12.6g} ... {b:.6g}" for n, m, a, b in rows]
        return "\n".join(lines) + "\n"

    def save(self, path):
        """Write an HDF5 file (.h5), whole or not at all."""
        check_writable(path, (".h5",))
        with replacing(path) as temporary, creating(temporary, FORMAT) as file:
            for name, kind in ATTRIBUTES.items():
                file.attrs[name] = kind(getattr(self, name))
            file["report"] = self.report()
            write_texts(file, "names", self.names)
            for name, units in UNITS.items():
                write_values(file, name, getattr(self, name), units)
            for name in COUNTS:
                file[name] = getattr(self, name)

    @classmethod
    def load(cls, path):
        """Read back what `save` wrote; ValueError, one line, for anything else."""
        with reading(path, FORMAT) as file:
            shown = ("format", "format_version", "rubberfric_version", *ATTRIBUTES)
            check_names(file, ("report", "names", *UNITS, *COUNTS), shown)
            names = tuple(read_texts(file, "names"))
            count = file["cost"].size
            rows = {name: (count,) if name == "cost" else (count, len(names)) for name in UNITS}
            arrays = {name: read_array(file, name, UNITS[name], shape) for name, shape in rows.items()}
            for name in COUNTS:
                array = arrays[name] = np.asarray(file[name][()])
                if array.shape != (count,) or array.dtype.kind != "i":
                    raise ValueError(f"/{name}: must be {count} integers")
            if not np.isin(arrays["status"], list(MESSAGES)).all():
                raise ValueError(f"/status: must be out of {', '.join(map(str, MESSAGES))}")
            return cls(names=names, **arrays, **attributes(file, ATTRIBUTES))
