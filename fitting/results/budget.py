"""Error budget of a fit: table, picture and file of the contributions to the errors of all parameters.

`fitting.budget.contributions` describes the method, and `fitting.budget.changes` the default sizes.
"""

import dataclasses
from typing import Any, Self

import h5py
import numpy as np

from fitting.budget.changes import Sizes
from fitting.budget.contributions import Contribution, contributions
from fitting.parameters.constraints import is_number
from fitting.parameters.scenes import unit
from fitting.results import hdf5 as fit_files
from fitting.results.record import FitRecord, solved_fit
from fitting.results.report import aligned_table
from rubberfric.base import StrPath, html, optional_library
from rubberfric.io import hdf5
from rubberfric.plot import style

# Shares below this part of the standard error are printed as 0.
_LITTLE = 0.005


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Budget:
    r"""Error budget of a fit, from `FitResult.budget`.

    Attributes
    ----------
    fit : FitRecord, the fit
    contributions : tuple of contributions, one for each source except the noise
        Each has `source`, `text`, `signed`, `stated`, and `shift`, an array of shape (parameters,) in the
        units of the parameters.
    notes : reasons for missing contributions
    sizes : sizes of the changes
    """

    fit: FitRecord
    contributions: tuple[Contribution, ...]
    notes: tuple[str, ...]
    sizes: Sizes

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every free element."""
        return self.fit.names

    @property
    def noise(self) -> np.ndarray:
        """Standard errors from the noise of the data, NaN where the error bar is withheld."""
        return self.fit.stderr

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the sources except the noise."""
        return tuple(part.source for part in self.contributions)

    def __getitem__(self, source: str) -> Contribution:
        """Return the part of a source, such as budget["temperature"]. Raise KeyError without one."""
        for part in self.contributions:
            if part.source == source:
                return part
        raise KeyError(f"{source!r}: must be one of {', '.join(self.sources)}")

    @property
    def total(self) -> np.ndarray:
        """Root of the sum of squares of noise and all contributions, in the units of the parameters."""
        parts = [np.nan_to_num(part.shift) ** 2 for part in self.contributions]
        return np.sqrt(self.noise**2 + np.sum(parts, 0)) if parts else self.noise

    @property
    def share(self) -> np.ndarray:
        """Contributions in standard errors, shape (parameters, sources)."""
        return np.stack([part.shift / self.noise for part in self.contributions], 1)

    @property
    def largest(self) -> str:
        """Sentence on the largest part above the noise, or "" if all are smaller.

        The difference between theory and law counts, and stated errors. Default sizes do not count, because
        nothing is known about such errors.
        """
        return self.fit.sentence_on(self.contributions)

    def report(self) -> str:
        """Return the budget as text of several lines: two tables, and a description of each source."""
        lines = ["[[Budget]]", "    standard errors, and shifts if an input changes:"]
        lines += [f"      {line}" for line in aligned_table([self._headings(), *self._rows(False)])]
        lines += ["    in standard errors:"]
        lines += [f"      {line}" for line in aligned_table([self._headings(), *self._rows(True)])]
        lines += [f"    {line}" for line in self._texts()]
        return "\n".join(lines) + "\n"

    def _headings(self):
        return ("", "noise", *self.sources, "total")

    def _rows(self, shares):
        scale = self.noise if shares else np.ones_like(self.noise)
        columns = [self.noise, *(part.shift for part in self.contributions), self.total]
        marks = [False, *(part.signed for part in self.contributions), False]
        for i, name in enumerate(self.names):
            pairs = zip(columns, marks, strict=True)
            cells = [_cell(values[i] / scale[i], sign, shares) for values, sign in pairs]
            yield (self._title(i, name, shares), *cells)

    def _title(self, i, name, shares):
        if shares:
            return name
        return f"{name} = {self.fit.values[i]:.4g} {unit(self.fit.scene_at_start, name)}".rstrip()

    def _texts(self):
        for part in self.contributions:
            default = "" if part.stated or part.source not in Sizes._fields else " (default)"
            yield f"{part.source}: {part.text}{default}"
        yield from self.notes
        yield "a shift is the change of the fitted value if the input changes as stated"
        yield "sources without a sign add several changes as squares; so does the total, with the noise"
        if self.largest:
            yield f"largest: {self.largest}"

    def plot(self, ax: style.Axes | None = None) -> style.Axes:
        """Draw the shares of the sources in the squared total of every parameter, as stacked bars.

        The largest source is at the bottom. The number above a bar is total / standard error. Needs
        matplotlib.

        Parameters
        ----------
        ax : matplotlib axes, or None
            If None, the axes belong to a new figure, `ax.figure`.
        """
        known = np.flatnonzero(np.isfinite(self.noise))
        names = [self.names[i].removeprefix("lower.").removeprefix("upper.") for i in known]
        axes = style.one_axes(ax, (max(6.4, 1.5 + 0.6 * len(names)), 4.6))
        squares = np.stack([self.noise, *(part.shift for part in self.contributions)], 1)[known] ** 2
        shares = np.nan_to_num(squares) / self.total[known, None] ** 2
        order = np.argsort(-shares.sum(0), kind="stable")
        labels, bottom = ("noise", *self.sources), np.zeros(len(names))
        for k, colour in zip(order, style.colours(len(labels)), strict=True):
            axes.bar(names, shares[:, k], bottom=bottom, color=colour, label=labels[k], edgecolor="white")
            bottom = bottom + shares[:, k]
        for i, times in enumerate(self.total[known] / self.noise[known]):
            axes.text(i, 1.01, f"{times:.2g}", ha="center", va="bottom", fontsize="small")
        axes.tick_params(axis="x", labelrotation=90)
        axes.set_ylabel("share of the squared error [-]")
        axes.set_ylim(0, 1.1)
        style.legend(axes)
        return axes

    def to_dataframe(self) -> Any:
        """Return shifts as a pandas.DataFrame, a row for each parameter. Pandas must be installed."""
        columns = {"value": self.fit.values, "noise": self.noise}
        columns |= {part.source: part.shift for part in self.contributions} | {"total": self.total}
        return optional_library("pandas").DataFrame(columns, index=list(self.names))

    def save(self, path: StrPath) -> None:
        """Write the fit and the budget to an HDF5 file (.h5), completely or not at all.

        `Budget.load` reads both, and `FitResult.load` only the fit.
        """
        fit_files.save(path, self.fit, budget=self.write_group)

    def write_group(self, group: h5py.Group) -> None:
        """Write the budget to an open, empty HDF5 group."""
        hdf5.write_texts(group, "sources", self.sources)
        for name in ("text", "without"):
            values = [getattr(part, name) for part in self.contributions]
            hdf5.write_texts(group, name, [v if isinstance(v, str) else ", ".join(v) for v in values])
        for name in ("signed", "stated"):
            group[name] = np.array([getattr(part, name) for part in self.contributions], int)
        shifts = np.array([part.shift for part in self.contributions], float).reshape(-1, len(self.names))
        hdf5.write_values(group, "shift", shifts, "as in /parameters/units")
        hdf5.write_values(group, "total", np.asarray(self.total), "as in /parameters/units")
        hdf5.write_texts(group, "notes", self.notes)
        group.attrs.update(self.sizes._asdict(), largest=self.largest)

    @classmethod
    def load(cls, path: StrPath) -> Self:
        """Load a fit and its budget from a file written by `save`, or raise ValueError with the fault."""
        fit = fit_files.load(path, FitRecord)
        with hdf5.reading(path, fit_files.FIT_FORMAT) as file:
            group = hdf5.subgroup(file, "budget")
            known = ("sources", "text", "without", "signed", "stated", "shift", "total", "notes")
            hdf5.check_names(group, known, (*Sizes._fields, "largest"))
            sources, count = hdf5.read_texts(group, "sources"), len(hdf5.read_texts(group, "sources"))
            shape = (count, len(fit.names))
            columns = zip(
                sources,
                hdf5.read_texts(group, "text"),
                hdf5.read_array(group, "shift", "as in /parameters/units", shape),
                hdf5.read_counts(group, "signed", count).astype(bool).tolist(),
                hdf5.read_counts(group, "stated", count).astype(bool).tolist(),
                (tuple(filter(None, text.split(", "))) for text in hdf5.read_texts(group, "without")),
                strict=True,
            )
            sizes = Sizes(**hdf5.attributes(group, dict.fromkeys(Sizes._fields, float)))
            notes = tuple(hdf5.read_texts(group, "notes"))
        return cls(fit=fit, contributions=tuple(Contribution(*c) for c in columns), notes=notes, sizes=sizes)

    def _repr_html_(self) -> str:
        rows = [*self._rows(False), "in standard errors:", *self._rows(True), *self._texts()]
        return html.table(rows, ("parameter", *self._headings()[1:]), self.largest)

    def __repr__(self) -> str:
        return f"<Budget: {len(self.names)} parameters, noise, {', '.join(self.sources)}>"


def budget_of(fit: FitRecord, stated_or_none: dict[str, float | None]) -> Budget:
    """Return the budget of a fit. See `fitting.FitResult.budget`."""
    stated = {name: value for name, value in stated_or_none.items() if value is not None}
    for name, value in stated.items():
        if not (is_number(value) and value >= 0):
            raise ValueError(f"{name} = {value!r}: must be a finite number >= 0")
    sizes = Sizes(**{name: float(value) for name, value in stated.items()})
    rows, notes = contributions(solved_fit(fit), sizes, tuple(stated))
    return Budget(fit=fit, contributions=tuple(rows), notes=tuple(notes), sizes=sizes)


def _cell(value, signed, shares):
    if not np.isfinite(value):
        return "?"
    if shares:
        return "0" if abs(value) < _LITTLE else f"{value:{'+' if signed else ''}.2f}"
    return f"{value:{'+' if signed else ''}.2g}"
