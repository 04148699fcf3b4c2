"""What the run of an ensemble gives back, and its file.

::

    /           attributes format = "rubberfric ensemble", format_version = 1, kind, seconds,
                devices, batch, peak
    /report     as text
    /names      of the free elements
    /x, values  a row a member; likewise cost, status, nfev, njev
"""

import dataclasses
from typing import Self

import numpy as np

from fitting.solvers.iterate import MESSAGES, succeeded
from fitting.solvers.options import check_options
from rubberfric.base import StrPath, check_writable, replacing
from rubberfric.io import hdf5

FORMAT = "rubberfric ensemble"
ATTRIBUTES = {"kind": str, "seconds": float, "devices": int, "batch": int, "peak": int}
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
    cost, status, nfev, njev : shape (members,); status as of `fitting.solvers.iterate`
    seconds : wall time without compilation, of all runs that a checkpoint joins
    devices : that the (last) run used
    batch : members of each device that took a step at a time; 0 if nothing was left to do
    peak : bytes of each device that a step took, by the compiler's account
    """

    kind: str
    names: tuple[str, ...]
    x: np.ndarray
    values: np.ndarray
    cost: np.ndarray
    status: np.ndarray
    nfev: np.ndarray
    njev: np.ndarray
    seconds: float
    devices: int
    batch: int
    peak: int

    def __len__(self) -> int:
        return len(self.x)

    def __repr__(self) -> str:
        return f"<EnsembleResult: {len(self)} members of kind {self.kind!r}, {self.failed.size} failed>"

    @property
    def good(self) -> np.ndarray:
        """Which members converged, shape (members,)."""
        return succeeded(self.status)

    @property
    def failed(self) -> np.ndarray:
        """Indices of the members that did not converge."""
        return np.flatnonzero(~self.good)

    @property
    def best(self) -> int:
        """Index of the lowest finite cost."""
        if not np.isfinite(self.cost).any():
            raise ValueError("no member has a finite cost: check the start values")
        return int(np.argmin(np.where(np.isfinite(self.cost), self.cost, np.inf)))

    def interval(self, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Quantiles of the values of the members that converged."""
        check_options(level=level)
        if not self.good.any():
            raise ValueError("no member converged: there are no quantiles")
        tail = 50 * (1 - level)
        low, high = np.percentile(self.values[self.good], [tail, 100 - tail], axis=0)
        return low, high

    def report(self) -> str:
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
            f"    a step took {self.peak / 1e6:.4g} MB of each for a batch of {self.batch}",
        ]
        if self.good.any():
            width = max(map(len, self.names))
            low, middle, high = np.percentile(self.values[self.good], [2.5, 50, 97.5], axis=0)
            lines += ["[[Values: median, and 95 % between]]"]
            rows = zip(self.names, middle, low, high, strict=True)
            lines += [f"    {n:{width}s} {m:12.6g}   {a:12.6g} ... {b:.6g}" for n, m, a, b in rows]
        return "\n".join(lines) + "\n"

    def save(self, path: StrPath) -> None:
        """Write an HDF5 file (.h5), whole or not at all."""
        check_writable(path, (".h5",))
        with replacing(path) as temporary, hdf5.creating(temporary, FORMAT) as file:
            for name, kind in ATTRIBUTES.items():
                file.attrs[name] = kind(getattr(self, name))
            file["report"] = self.report()
            hdf5.write_texts(file, "names", self.names)
            for name, units in UNITS.items():
                hdf5.write_values(file, name, getattr(self, name), units)
            for name in COUNTS:
                file[name] = getattr(self, name)

    @classmethod
    def load(cls, path: StrPath) -> Self:
        """Read back what `save` wrote; ValueError, one line, for anything else."""
        with hdf5.reading(path, FORMAT) as file:
            shown = ("format", "format_version", "rubberfric_version", *ATTRIBUTES)
            hdf5.check_names(file, ("report", "names", *UNITS, *COUNTS), shown)
            names = tuple(hdf5.read_texts(file, "names"))
            count = np.size(hdf5.read_values(file, "cost", UNITS["cost"]))
            rows = {name: (count,) if name == "cost" else (count, len(names)) for name in UNITS}
            arrays = {name: hdf5.read_array(file, name, UNITS[name], shape) for name, shape in rows.items()}
            arrays |= {name: hdf5.read_counts(file, name, count) for name in COUNTS}
            if not np.isin(arrays["status"], list(MESSAGES)).all():
                raise ValueError(f"/status: must be out of {', '.join(map(str, MESSAGES))}")
            return cls(names=names, **arrays, **hdf5.attributes(file, ATTRIBUTES))
