"""Errors and run times over accuracy settings: the sweep, its report, and its CSV table."""

import csv
import dataclasses
import math
import textwrap
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.analysis import reference
from rubberfric.analysis.reference import TRUSTED, Errors, check_error, node_count, with_automatic
from rubberfric.base.atomic import StrPath, check_writable, replacing
from rubberfric.base.checks import ArrayLike
from rubberfric.base.objects.html import table
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.scene import Scene, rough_surfaces
from rubberfric.scene.settings import default_quadrature
from rubberfric.theory import paper
from rubberfric.theory.structure import QUANTITIES, Solution

_KNOWN = 3.0  # errors below this multiple of the disagreement of the refinements are only bounded
_KNOBS = tuple(field.name for field in dataclasses.fields(Quadrature))


class Row(NamedTuple):
    """Errors of one setting, and its cost for all points."""

    method: str  # "panels" or "textbook"
    setting: Quadrature | tuple[int, int]  # (nodes in ln q, nodes in phi)
    dtype: str  # "float64" or "float32"
    nodes: int  # in q; textbook: in q and phi
    errors: Errors
    forward: float = math.nan  # median run time of all three quantities [s]
    gradient: float | None = None  # values and gradient of their sum [s]; None for the textbook method
    compile_forward: float | None = None  # [s], including tracing that JAX has not cached
    compile_gradient: float | None = None  # [s]

    def summary(self) -> str:
        """Return the setting and its errors as one line of text, without run times."""
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
    left_out: str = ""  # reason for omitting single precision
    automatic: Quadrature | None = None  # setting of calls without a quadrature

    @property
    def chosen(self) -> Row | None:
        """Row of the setting with the fewest nodes whose values and gradients meet the error, or None.

        Run times scatter, so they decide only between equal numbers of nodes.
        """
        return self._cheapest(lambda errors: errors.worst, lambda row: row.gradient)

    @property
    def chosen_values(self) -> Row | None:
        """Row of the cheapest setting whose values meet the error, or None."""
        return self._cheapest(lambda errors: errors.value, lambda row: row.forward)

    def known(self, row: Row) -> Errors:
        """Return the errors of a row, where no error is below the resolution of the reference."""
        bounds = {name: _KNOWN * a for name, a in self.agreement._asdict().items() if a is not None}
        errors = row.errors._asdict()
        return row.errors._replace(
            **{name: max(errors[name], b) for name, b in bounds.items() if errors[name] is not None}
        )

    def report(self) -> str:
        """Return the table and the cheapest settings as text, with lines of at most 110 characters."""
        return "\n".join(self._lines())

    def _repr_html_(self) -> str:
        knobs = self._varied()
        names = ("area", "mu", "u_bar")
        headings = ("method", "/".join(knobs), "nodes", *(f"error of {name} [-]" for name in names))
        headings += (*(f"of its gradient: {name} [-]" for name in names), "time [ms]", "with gradient [ms]")
        headings += ("compile [s]", "with gradient [s]")
        rows = [(f"{row.method}, {row.dtype}", *self._cells(row, knobs)) for row in self.rows]
        return table([*rows, *self._about_reference(), *self._choices()], headings, self._about())

    def write(self, path: StrPath) -> None:
        """Write the rows as a CSV table with two header rows, completely or not at all.

        Errors below the resolution of the reference are written as that resolution. A ValueError is raised if
        the file cannot be written.
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
            "reference: two refinements that agree to "
            f"{self.agreement.value:.1e} (values) and {self.agreement.gradient:.1e} (gradients)"
        )
        if self.left_out:
            yield f"float32 is left out: {self.left_out}"
        else:
            yield "float32 is compared at inputs rounded to float32"

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
                yield row.dtype if row.method == "panels" else "textbook method, trapezoids: ln q x phi"
            setting, nodes, *cells = self._cells(row, knobs)
            texts = [*(f"{error:>7s}" for error in cells[:6]), *(f"{time:>8s}" for time in cells[6:])]
            yield f"  {setting:18s}{nodes:>7s}" + "".join(texts)
        yield ""
        yield from self._choices()

    def _varied(self) -> tuple[str, ...]:
        """Return the shown fields of `Quadrature`: all, or all but `heat` if no row varies it."""
        settings = [row.setting for row in self.rows if row.method == "panels"]
        same = {knob for knob in ("heat",) if len({getattr(setting, knob) for setting in settings}) < 2}
        return tuple(knob for knob in _KNOBS if knob not in same)

    def _cells(self, row: Row, knobs: tuple[str, ...]) -> tuple[str, ...]:
        """Return setting, nodes, six errors, two run times [ms] and two compile times [s] as texts."""
        errors = (
            "-" if error is None or known is None else "<" * (known > error) + f"{known:.0e}"
            for error, known in zip(row.errors, self.known(row), strict=True)
        )
        times = (None if t is None else 1e3 * t for t in (row.forward, row.gradient))
        seconds = (*times, row.compile_forward, row.compile_gradient)
        texts = ("-" if t is None else f"{t:.3g}" for t in seconds)
        return (short_setting(row.setting, knobs), f"{row.nodes}", *errors, *texts)

    def _choices(self) -> Iterator[str]:
        values, both = self.chosen_values, self.chosen
        if values is None or values is not both:
            yield from self._choice("values", values, self.agreement.value)
        yield from self._choice("values and gradients", both, self.agreement.worst)
        for row in self.rows:
            if row.setting == self.automatic and row.dtype == "float64":
                errors = self.known(row)
                yield f"without a quadrature: {self._written(row)}"
                yield f"  {self._times(row)}, errors {errors.value:.0e} and {errors.gradient:.0e} or less"
        textbook = [row for row in self.rows if row.method == "textbook"]
        if textbook and values is not None:
            last, size = textbook[-1], short_setting(textbook[-1].setting, ())
            longer = last.forward / values.forward
            yield (
                f"the textbook method with {size} nodes takes {longer:.0f} times as long as the "
                f"{'first' if values is not both else 'values'}, with an error of {last.errors.value:.0e}"
            )

    def _choice(self, what: str, row: Row | None, agreement: float) -> Iterator[str]:
        aim = f"{what} to {self.error:g}"
        if agreement > TRUSTED * self.error:
            yield f"{aim}: no reference, because its refinements agree to {agreement:.0e} only; none chosen"
        elif row is None:
            yield f"{aim}: no setting meets it"
        else:
            yield f"{aim}: {self._written(row)}, {row.dtype}"
            yield f"  {self._times(row)}"

    def _written(self, row: Row) -> str:
        return f"Quadrature({', '.join(f'{knob}={getattr(row.setting, knob)}' for knob in self._varied())})"

    def _times(self, row: Row) -> str:
        assert row.gradient is not None  # only the textbook method has none
        return f"{1e3 * row.forward:.3g} ms, with the gradient {1e3 * row.gradient:.3g} ms"


def short_setting(setting: Quadrature | tuple[int, int], knobs: tuple[str, ...]) -> str:
    """Format a setting as its values of `knobs`, "8/5/1", or a size of the textbook, "100 x 32"."""
    if not isinstance(setting, Quadrature):
        return f"{setting[0]} x {setting[1]}"
    return "/".join(f"{getattr(setting, knob):g}" for knob in knobs)


Key = TypeVar("Key")
Timed = tuple[Row, dict[str, Callable[[], Any]]]  # a row without run times, and the functions to time

# Nodes of the textbook method, (ln q, phi).
TEXTBOOK = ((50, 16), (100, 32), (200, 64), (400, 128))

_ROUNDING = 1e-6  # about the error of single precision
_LONG = 2.0  # a function is not timed again after this total time [s]


def accuracy(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    error: float = 1e-6,
    settings: Sequence[Quadrature] | None = None,
    textbook: Sequence[tuple[int, int]] = TEXTBOOK,
    repeats: int = 25,
    progress: Callable[[str], object] | None = None,
    report: Callable[[Row, int, int], object] | None = None,
) -> Accuracy:
    """Measure errors and run times of accuracy settings on a scene, in double and single precision.

    Errors of area, friction and separation and of their gradients are relative to a reference that validates
    itself (`rubberfric.analysis.reference`). Settings in single precision are compared at inputs rounded to
    single precision, unless it cannot represent the scene. Times are medians over alternating rounds of
    compiled calls for all three quantities at all points, without and with the gradient of their sum with
    respect to every number of the scene and the conditions.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
        Gradients are compared at up to 30 of these points, equally spread; at 6 if a modulus is tabulated.
    error : wanted relative error [-], 0 ... 1
    settings : sequence of Quadrature, or None for `rubberfric.analysis.reference.SETTINGS`, from a few nodes
        to far more than the default, and the automatic setting of this scene
    textbook : sequence of (nodes in ln q, nodes in phi)
        sizes of the textbook method: the equations of `rubberfric.theory.paper` with trapezoids, without
        gradients here. It is omitted for scenes beyond the paper (`paper.covers`).
    repeats : rounds of timing, an int >= 1
    progress : function of a line of text, called before every step, or None
    report : function of (row, its number, number of rows), or None
        called with every new row, still without run times. The number of rows is an upper bound at first.

    Returns
    -------
    Accuracy. `chosen` is the cheapest setting for values and gradients, `chosen_values` for values alone;
    None if no setting meets `error`, or if the refinements of the reference do not agree to a tenth of it.

    Raises
    ------
    ValueError : as `solve`; an argument outside its range; double precision is switched off.

    Examples
    --------
    >>> road = rf.Body(rf.Rigid(), rf.SelfAffine(q0=1e3, qr=1e3, q1=1e4, hurst=0.8, h_rms=20e-6))
    >>> scene = rf.Scene(road, rf.Body(rf.Prony(E_inf=3e6, E=[3e6], tau=[1e-3])))
    >>> options = {"settings": [rf.Quadrature()], "textbook": (), "repeats": 1}
    >>> sweep = rf.analysis.accuracy(scene, 0.1, 1e5, error=1e-6, **options)
    >>> sweep.chosen.setting == rf.Quadrature(), rf.plot.plot_accuracy(sweep).get_xlabel()
    (True, 'run time [ms]')
    """
    check_error(error)
    tell = progress or (lambda _: None)
    case = reference.case_of(scene, velocity, pressure, temperature)
    automatic = default_quadrature(scene, pressure)
    settings = with_automatic(scene, automatic) if settings is None else tuple(settings)
    _check(settings, textbook, repeats)
    tell("compiling the reference")
    exact = reference.reference(case)

    left_out = reference.refused(case)
    sizes = textbook if rough_surfaces(scene) and paper.covers(scene) else ()
    rows = len(settings) + len(sizes) + (0 if left_out else len(settings[::2]))
    measured: list[Timed] = []

    def measure(what: str, function: Callable[..., Timed], *arguments: Any) -> None:
        tell(f"row {len(measured) + 1} of {rows}: {what}")
        measured.append(function(case, *arguments))
        if report is not None:
            report(measured[-1][0], len(measured), rows)

    for setting in settings:
        measure(f"compiling float64, {setting}", _panels, exact.exact, setting, jnp.float64)
    if not left_out:
        tell("reference for float32")
        at_rounded = reference.outcome(exact.compiled, reference.rounded(case))
        single = in_float32(settings, [row.errors.worst for row, _ in measured])
        rows = len(measured) + len(single) + len(sizes)
        for setting in single:
            measure(f"compiling float32, {setting}", _panels, at_rounded, setting, jnp.float32)
    for size in sizes:
        measure(f"textbook, {size[0]} x {size[1]}", _textbook, exact.exact, size)

    tell("run times")
    functions = {(i, name): f for i, (_, calls) in enumerate(measured) for name, f in calls.items()}
    medians = in_turns(functions, repeats)
    timed = tuple(
        row._replace(forward=medians[i, "forward"], gradient=medians.get((i, "gradient")))
        for i, (row, _) in enumerate(measured)
    )
    count = case.conditions[0].size
    return Accuracy(error, timed, exact.agreement, count, case.differentiated.size, left_out, automatic)


def in_float32(settings: Sequence[Quadrature], errors: Sequence[float]) -> list[Quadrature]:
    """Return every second setting, to save compile time, up to the first with an error below rounding."""
    tried = []
    for setting, error in zip(settings[::2], errors[::2], strict=True):
        tried.append(setting)
        if error < _ROUNDING:
            break
    return tried


def in_turns(functions: Mapping[Key, Callable[[], Any]], rounds: int) -> dict[Key, float]:
    """Return the median run time of each function [s], which are called alternately in every round."""
    times: dict[Key, list[float]] = {name: [] for name in functions}
    for function in functions.values():
        jax.block_until_ready(function())
    for _ in range(rounds):
        for name, function in functions.items():
            if len(times[name]) > 2 and sum(times[name]) > _LONG:
                continue
            # Other functions leave cold caches. The second call counts, unless the first took long.
            for _ in range(2):
                begin = time.perf_counter()
                jax.block_until_ready(function())
                elapsed = time.perf_counter() - begin
                if elapsed > 0.02:
                    break
            times[name].append(elapsed)
    return {name: float(np.median(values)) for name, values in times.items()}


def _panels(case: reference.Case, exact: reference.Outcome, setting: Quadrature, dtype: type) -> Timed:
    """Compile and evaluate a setting; return the `Row` without run times, and the functions to time."""
    at, ones = reference.arguments(case, dtype)
    forward, forward_seconds = reference.compiled(reference.forward_of(setting), *at)
    gradient, gradient_seconds = reference.compiled(reference.gradient_of(setting), *at, ones)
    coarse = reference.outcome(gradient, case, dtype)
    errors = reference.compare_outcomes(coarse, exact, case)
    row = Row("panels", setting, np.dtype(dtype).name, node_count(case.scene, setting), errors)
    row = row._replace(compile_forward=forward_seconds, compile_gradient=gradient_seconds)
    return row, {"forward": lambda: forward(*at), "gradient": lambda: gradient(*at, ones)}


def _textbook(case: reference.Case, exact: reference.Outcome, size: tuple[int, int]) -> Timed:
    """Evaluate a size of the textbook method; return the `Row` without run time, and the function to time."""
    spectra = [body.spectrum for body in (case.scene.lower, case.scene.upper) if body.spectrum is not None]
    pieces = sum(spectrum.power_law().q.size for spectrum in spectra) - 1
    nodes = paper.trapezoid_nodes(max(2, round(size[0] / pieces)), size[1])
    at = case.scene, *case.conditions
    solve = jax.jit(lambda *at: paper.solve(*at, nodes=nodes)).lower(*at).compile()

    def forward() -> Solution:
        return solve(*at)

    textbook = forward()
    outcome = reference.Outcome(np.stack([np.asarray(getattr(textbook, name)) for name in QUANTITIES]))
    errors = reference.compare_outcomes(outcome, exact, case)
    return Row("textbook", (size[0], size[1]), "float64", size[0] * size[1], errors), {"forward": forward}


def _check(settings: Sequence[Quadrature], textbook: Sequence[tuple[int, int]], repeats: int) -> None:
    for setting in settings:
        if not isinstance(setting, Quadrature):
            raise ValueError(f"settings has {setting!r}: every setting must be a Quadrature")
    if not settings:
        raise ValueError("settings is empty; give at least one")
    for size in textbook:
        if np.shape(size) != (2,) or not all(isinstance(n, int) and n >= 2 for n in size):
            raise ValueError(f"textbook has {size!r}: every size must be a pair of integers >= 2")
    if isinstance(repeats, bool) or not isinstance(repeats, int) or repeats < 1:
        raise ValueError(f"repeats = {repeats!r}: must be an integer >= 1")
