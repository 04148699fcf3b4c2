"""Error against run time of one scene: accuracy settings of increasing work, and the textbook method."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.analysis.error_and_time import reference
from rubberfric.analysis.error_and_time.report import Accuracy, Row
from rubberfric.analysis.error_and_time.settings import SETTINGS, check_error, node_count
from rubberfric.analysis.error_and_time.textbook import covers
from rubberfric.analysis.error_and_time.textbook import solve as textbook_solve
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.numerics.settings import fitting_quadrature
from rubberfric.scene.scene import Scene
from rubberfric.theory.quantities import QUANTITIES

Key = TypeVar("Key")
Timed = tuple[Row, dict[str, Callable[[], Any]]]  # without its run times, and the calls to time

# Nodes of the textbook method, (ln q, phi).
TEXTBOOK = ((50, 16), (100, 32), (200, 64), (400, 128))

# Rounding in single precision adds about this error.
_ROUNDING = 1e-6

# A function that has taken this long in all [s] is not timed again.
_LONG = 2.0


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
    told: Callable[[Row, int, int], object] | None = None,
) -> Accuracy:
    """Errors and run times of a scene over accuracy settings, in double and single precision.

    Errors of area, friction and separation and of their gradients are against a reference that
    validates itself (`rubberfric.analysis.error_and_time.reference`); single precision is compared at the
    inputs it sees, rounded, and left out where it cannot hold the scene. Times are medians over
    alternating rounds of calls that were compiled before, for all three quantities at all points; the
    gradient is that of their sum with respect to every number of the scene and the conditions, and comes
    with the values.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
        the points that errors and times are for. Gradients are compared at 30 of them at most,
        equally spread; at 6 where a modulus is tabulated.
    error : wanted relative error [-], 0 ... 1
    settings : sequence of Quadrature, or None
        None: those of `rubberfric.analysis.error_and_time.settings`, from a few nodes to far more than the
        default has, and the one that calls without a quadrature take for this scene.
    textbook : sequence of (nodes in ln q, nodes in phi)
        sizes of the textbook method (`rubberfric.analysis.error_and_time.textbook`), which has no gradient;
        () for none, as for scenes that it does not cover: heated, softened or anisotropic ones.
    repeats : int, >= 1
        rounds of timing.
    progress : function of a line of text, or None
        called before every step: a sweep takes half a minute and more.
    told : function of (row, its number, number of rows), or None
        called with every row as it comes, which has no run times yet: those are measured in turns, at
        the end. The number of rows is that of the most there can be, until it is known.

    Returns
    -------
    Accuracy. `chosen` is its cheapest setting for values and gradients, `chosen_values` that for
    values alone: None where none meets `error`, and where the refinements of the reference do not
    agree to a tenth of it, for nothing is known then.

    Raises
    ------
    ValueError : as `solve`; an argument outside its range; double precision is switched off.
    """
    check_error(error)
    tell = progress or (lambda _: None)
    case = reference.case_of(scene, velocity, pressure, temperature)
    automatic = fitting_quadrature(scene, pressure)
    settings = with_automatic(scene, automatic) if settings is None else tuple(settings)
    _check(settings, textbook, repeats)
    tell("compiling the reference")
    exact = reference.reference(case)

    left_out, sizes = reference.refused(case), textbook if covers(scene) else ()
    rows = len(settings) + len(sizes) + (0 if left_out else len(settings[::2]))
    measured: list[Timed] = []

    def came(one: Timed) -> None:
        measured.append(one)
        if told is not None:
            told(one[0], len(measured), rows)

    for setting in settings:
        tell(f"row {len(measured) + 1} of {rows}: compiling float64, {setting}")
        came(_panels(case, exact.exact, setting, jnp.float64))
    if not left_out:
        tell("reference for float32")
        at_rounded = reference.outcome(exact.compiled, reference.rounded(case))
        single = in_float32(settings, [row.errors.worst for row, _ in measured])
        rows = len(measured) + len(single) + len(sizes)
        for setting in single:
            tell(f"row {len(measured) + 1} of {rows}: compiling float32, {setting}")
            came(_panels(case, at_rounded, setting, jnp.float32))
    for size in sizes:
        tell(f"row {len(measured) + 1} of {rows}: textbook, {size[0]} x {size[1]}")
        came(_textbook(case, exact.exact, size))

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
    """Settings worth trying in single precision, from their errors in double precision.

    Every second, for most of a sweep is compiling, up to the first that is lost in rounding.
    """
    tried = []
    for setting, error in zip(settings[::2], errors[::2], strict=True):
        tried.append(setting)
        if error < _ROUNDING:
            break
    return tried


def in_turns(functions: Mapping[Key, Callable[[], Any]], rounds: int) -> dict[Key, float]:
    """Median times of several functions [s], called one after the other in every round."""
    times: dict[Key, list[float]] = {name: [] for name in functions}
    for function in functions.values():
        jax.block_until_ready(function())
    for _ in range(rounds):
        for name, function in functions.items():
            if len(times[name]) > 2 and sum(times[name]) > _LONG:
                continue
            # Who came before may leave cold caches: the second call counts, unless the first
            # took too long to notice.
            for _ in range(2):
                begin = time.perf_counter()
                jax.block_until_ready(function())
                elapsed = time.perf_counter() - begin
                if elapsed > 0.02:
                    break
            times[name].append(elapsed)
    return {name: float(np.median(values)) for name, values in times.items()}


def _panels(case: reference.Case, exact: reference.Outcome, setting: Quadrature, dtype: type) -> Timed:
    """Row of a setting without its run times, and the calls to time."""
    at, ones = reference.arguments(case, dtype)
    forward, forward_seconds = reference.compiled(reference.forward_of(setting), *at)
    gradient, gradient_seconds = reference.compiled(reference.gradient_of(setting), *at, ones)
    found = reference.outcome(gradient, case, dtype)
    row = Row(
        method="panels",
        setting=setting,
        dtype=np.dtype(dtype).name,
        nodes=node_count(case.scene, setting),
        errors=reference.compare(found, exact, case),
        compile_forward=forward_seconds,
        compile_gradient=gradient_seconds,
    )
    return row, {"forward": lambda: forward(*at), "gradient": lambda: gradient(*at, ones)}


def _textbook(case: reference.Case, exact: reference.Outcome, size: tuple[int, int]) -> Timed:
    """The same for a size of the textbook method."""

    def forward() -> dict[str, np.ndarray]:
        return textbook_solve(case.scene, *case.conditions, nodes=size)

    found = forward()
    outcome = reference.Outcome(np.stack([found[name] for name in QUANTITIES]))
    errors = reference.compare(outcome, exact, case)
    return Row("textbook", (size[0], size[1]), "float64", size[0] * size[1], errors), {"forward": forward}


def with_automatic(scene: Scene, automatic: Quadrature) -> tuple[Quadrature, ...]:
    """`SETTINGS` and one more, of increasing work."""
    if automatic in SETTINGS:
        return SETTINGS
    work = node_count(scene, automatic)
    place = sum(node_count(scene, setting) < work for setting in SETTINGS)
    return (*SETTINGS[:place], automatic, *SETTINGS[place:])


def _check(settings: Sequence[Quadrature], textbook: Sequence[tuple[int, int]], repeats: int) -> None:
    for setting in settings:
        if not isinstance(setting, Quadrature):
            raise ValueError(f"settings has {setting!r}: must be Quadrature objects")
    if not settings:
        raise ValueError("settings is empty: must have at least one")
    for size in textbook:
        if np.shape(size) != (2,) or not all(isinstance(n, int) and n >= 2 for n in size):
            raise ValueError(f"textbook has {size!r}: must be pairs of integers >= 2")
    if isinstance(repeats, bool) or not isinstance(repeats, int) or repeats < 1:
        raise ValueError(f"repeats = {repeats!r}: must be an integer >= 1")
