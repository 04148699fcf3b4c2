"""What a sweep over accuracy settings found: rows, the cheapest of them, report and CSV table."""

import csv
import dataclasses
import math
import textwrap
from collections.abc import Iterator
from typing import NamedTuple

from rubberfric.analysis.error_and_time.reference import TRUSTED, Errors
from rubberfric.base.atomic import StrPath, check_writable, replacing
from rubberfric.base.objects.html import table
from rubberfric.base.quadrature import Quadrature

# An error this many times the disagreement of the two refinements, or less, is only bounded by it.
_KNOWN = 3.0

_KNOBS = tuple(field.name for field in dataclasses.fields(Quadrature))


class Row(NamedTuple):
    """One setting: how far off it is, and what it costs for all points."""

    method: str  # "panels" or "textbook"
    setting: Quadrature | tuple[int, int]  # (nodes in ln q, nodes in phi)
    dtype: str  # "float64" or "float32"
    nodes: int  # in q; textbook: in q and phi
    errors: Errors
    forward: float = math.nan  # median run time of all three quantities [s]
    gradient: float | None = None  # of them and the gradient of their sum [s]; None for the textbook method
    compile_forward: float | None = None  # [s]; tracing included, as far as JAX has not kept it
    compile_gradient: float | None = None  # [s]

    def told(self) -> str:
        """One line about a row whose run times are not yet known."""
        setting = short_setting(self.setting, _KNOBS)
        errors = f"values to {self.errors.value:.0e}"
        if self.errors.gradient is not None:
            errors += f", gradients to {self.errors.gradient:.0e}"
        compiled = "" if self.compile_gradient is None else f", compiled in {self.compile_gradient:.1f} s"
        return f"{self.method} {setting}, {self.dtype}, {self.nodes} nodes: {errors}{compiled}"


class Accuracy(NamedTuple):
    """Result of `rubberfric.analysis.accuracy`."""

    error: float  # wanted
    rows: tuple[Row, ...]
    agreement: Errors  # of the two refinements that the reference is made of
    points: int
    gradient_points: int  # points at which gradients are compared
    left_out: str = ""  # why single precision is
    automatic: Quadrature | None = None  # what calls without a quadrature take

    @property
    def chosen(self) -> Row | None:
        """The row of the cheapest setting that meets the error with values and gradients, or None.

        That of fewest nodes, in the precision that was quicker: what a setting costs grows with its
        nodes, and run times scatter.
        """
        return self._cheapest(lambda errors: errors.worst, lambda row: row.gradient)

    @property
    def chosen_values(self) -> Row | None:
        """The row of the cheapest setting that meets the error with its values, or None."""
        return self._cheapest(lambda errors: errors.value, lambda row: row.forward)

    def known(self, row: Row) -> Errors:
        """Errors of a row, those that the reference cannot tell from less raised to what it can."""
        bounds = {name: _KNOWN * a for name, a in self.agreement._asdict().items() if a is not None}
        errors = row.errors._asdict()
        return row.errors._replace(
            **{name: max(errors[name], b) for name, b in bounds.items() if errors[name] is not None}
        )

    def report(self) -> str:
        """The table and the cheapest settings, as lines of at most 110 characters in one text."""
        return "\n".join(self._lines())

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        knobs = self._varied()
        names = ("area", "mu", "u_bar")
        headings = ("method", "/".join(knobs), "nodes", *(f"error of {name} [-]" for name in names))
        headings += (*(f"of its gradient: {name} [-]" for name in names), "time [ms]", "with gradient [ms]")
        headings += ("compile [s]", "with gradient [s]")
        rows = [(f"{row.method}, {row.dtype}", *self._cells(row, knobs)) for row in self.rows]
        return table([*rows, *self._about_reference(), *self._choices()], headings, self._about())

    def write(self, path: StrPath) -> None:
        """Write the rows as a CSV table with two header rows, names and units, whole or not at all.

        An error that the reference cannot tell from less is written as what it can.
        ValueError if the file cannot be written.
        """
        check_writable(path, (".csv",))
        quantities = ("area", "friction", "separation")
        errors = [f"error_{name}" for name in quantities] + [f"error_gradient_{name}" for name in quantities]
        times = ("forward", "gradient", "compile_forward", "compile_gradient")
        names = ["method", "dtype", *_KNOBS, "nodes_q", "nodes_phi", "nodes", *errors, *times]
        with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
            file.write("# Relative errors and median run times; " + self._about() + "\n")
            for line in self._about_reference():
                file.write(f"# {line}\n")
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(names)
            writer.writerow(["s" if name in times else "-" for name in names])
            for row in self.rows:
                knobs = [getattr(row.setting, knob, "") for knob in _KNOBS]
                sizes = ("", "") if isinstance(row.setting, Quadrature) else row.setting
                numbers = [*knobs, *sizes, row.nodes, *self.known(row), *(getattr(row, t) for t in times)]
                writer.writerow([row.method, row.dtype, *("" if x is None else x for x in numbers)])

    def _cheapest(self, error, seconds):
        if error(self.agreement) > TRUSTED * self.error:
            return None
        rows = [row for row in self.rows if row.method == "panels" and error(row.errors) <= self.error]
        return min(rows, key=lambda row: (row.nodes, seconds(row)), default=None)

    def _about(self) -> str:
        return f"{self.points} points, gradients at {self.gradient_points} of them"

    def _about_reference(self) -> Iterator[str]:
        yield (
            "reference: two refinements, which agree to "
            f"{self.agreement.value:.1e} (values) and {self.agreement.gradient:.1e} (gradients)"
        )
        if self.left_out:
            yield f"float32 is left out: {self.left_out}"
        else:
            yield "float32 is compared at the inputs that it sees, rounded to it"

    def _lines(self) -> Iterator[str]:
        yield self._about()
        for text in self._about_reference():
            yield from textwrap.wrap(text, 110)
        knobs = self._varied()
        yield f"settings: {'/'.join(knobs)}"
        yield ""
        yield f"{'':27s}{'relative error':>21s}{'of the gradient':>21s}{'time [ms]':>16s}{'compile [s]':>16s}"
        errors = "".join(f"{name:>7s}" for name in 2 * ("area", "mu", "u_bar"))
        yield f"{'':20s}{'nodes':>7s}{errors}" + 2 * f"{'value':>8s}{'grad':>8s}"
        group = None
        for row in self.rows:
            if group != (row.method, row.dtype):
                group = (row.method, row.dtype)
                yield row.dtype if row.method == "panels" else "textbook method, NumPy: ln q x phi"
            setting, nodes, *cells = self._cells(row, knobs)
            texts = [*(f"{error:>7s}" for error in cells[:6]), *(f"{time:>8s}" for time in cells[6:])]
            yield f"  {setting:18s}{nodes:>7s}" + "".join(texts)
        yield ""
        yield from self._choices()

    def _varied(self) -> tuple[str, ...]:
        """The knobs of the settings; without those of parts that few scenes have where none changes them."""
        settings = [row.setting for row in self.rows if row.method == "panels"]
        same = {knob for knob in ("heat",) if len({getattr(one, knob) for one in settings}) < 2}
        return tuple(knob for knob in _KNOBS if knob not in same)

    def _cells(self, row: Row, knobs: tuple[str, ...]) -> tuple[str, ...]:
        """Texts of a row: setting, nodes, six errors, two run times [ms], two times of compiling [s]."""
        errors = (
            "-" if error is None or known is None else "<" * (known > error) + f"{known:.0e}"
            for error, known in zip(row.errors, self.known(row), strict=True)
        )
        times = (None if t is None else 1e3 * t for t in (row.forward, row.gradient))
        seconds = (*times, row.compile_forward, row.compile_gradient)
        texts = ("-" if t is None else f"{t:.3g}" for t in seconds)
        return (short_setting(row.setting, knobs), f"{row.nodes}", *errors, *texts)

    def _choices(self) -> Iterator[str]:
        """Lines about the cheapest settings: one for both uses where it is the same."""
        values, both = self.chosen_values, self.chosen
        if values is None or values is not both:
            yield from self._choice("values", values, self.agreement.value)
        yield from self._choice("values and gradients", both, self.agreement.worst)
        for row in self.rows:
            if row.setting == self.automatic and row.dtype == "float64":
                yield f"without a quadrature: {self._written(row)}"
                errors = self.known(row)
                yield f"  {self._times(row)}, errors {errors.value:.0e} and {errors.gradient:.0e} or less"
        textbook = [row for row in self.rows if row.method == "textbook"]
        if textbook and values is not None:
            last, size = textbook[-1], short_setting(textbook[-1].setting, ())
            longer = last.forward / values.forward
            yield (
                f"the textbook method with {size} nodes takes {longer:.0f} times as long as the "
                f"{'first' if values is not both else 'values'}, and is {last.errors.value:.0e} off"
            )

    def _choice(self, what: str, row: Row | None, agreement: float) -> Iterator[str]:
        aim = f"{what} to {self.error:g}"
        if agreement > TRUSTED * self.error:
            yield f"{aim}: no reference, for its refinements agree to {agreement:.0e} only; none chosen"
        elif row is None:
            yield f"{aim}: no setting meets it"
        else:
            yield f"{aim}: {self._written(row)}, {row.dtype}"
            yield f"  {self._times(row)}"

    def _written(self, row: Row) -> str:
        return f"Quadrature({', '.join(f'{knob}={getattr(row.setting, knob)}' for knob in self._varied())})"

    def _times(self, row: Row) -> str:
        assert row.gradient is not None  # as all but the textbook method have it
        return f"{1e3 * row.forward:.3g} ms, with the gradient {1e3 * row.gradient:.3g} ms"


def short_setting(setting: Quadrature | tuple[int, int], knobs: tuple[str, ...]) -> str:
    """A setting in a few characters: its values of the knobs, or the sizes of the textbook method."""
    if not isinstance(setting, Quadrature):
        return f"{setting[0]} x {setting[1]}"
    return "/".join(f"{getattr(setting, knob):g}" for knob in knobs)
