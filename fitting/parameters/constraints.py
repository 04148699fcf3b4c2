"""Rules of free parameters: allowed values, start values, and relations to other parameters.

`fitting.parameters.variables` describes the variables x of a fit that correspond to the values.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import jax
import numpy as np

from fitting.parameters.scenes import Scenes, by_name, field_of, owner_of, paths_of
from rubberfric.base import fields_of
from rubberfric.roughness import cutoff

Start = float | Sequence[float] | None


def is_number(value: object) -> bool:
    """Return True if a value is one finite real number."""
    try:
        return math.isfinite(value)  # pyright: ignore[reportArgumentType]  # tells by its TypeError
    except (TypeError, ValueError, OverflowError):
        return False


@dataclasses.dataclass(frozen=True)
class Positive:
    """Rule of a parameter > 0, which the fit varies on a logarithmic scale.

    Parameters
    ----------
    start : number, or None to start at the scene's value
        A number for all elements, or a sequence with a number for each element.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> x, to_scene = fitting.unconstrained(scene, {"lower.spectrum.h_rms": fitting.Positive(start=1e-3)})
    >>> round(1e3 * float(to_scene(x + 1).lower.spectrum.h_rms), 3)  # e times 1 mm
    2.718
    """

    start: Start = None


@dataclasses.dataclass(frozen=True)
class Bounded:
    """Rule of a parameter between two bounds.

    The fit varies the logit of the relative position of the value between the bounds.

    Parameters
    ----------
    low, high : bounds, low < start < high
    start : as for `Positive`

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> x, to_scene = fitting.unconstrained(scene, {"gamma": fitting.Bounded(0.4, 0.6)})
    >>> round(float(x[0]), 6), round(float(to_scene(x + 100).gamma), 6)
    (0.0, 0.6)
    """

    low: float
    high: float
    start: Start = None

    def __post_init__(self) -> None:
        if not (is_number(self.low) and is_number(self.high) and self.low < self.high):
            raise ValueError(f"Bounded({self.low!r}, {self.high!r}): must be finite numbers, low < high")


@dataclasses.dataclass(frozen=True)
class Free:
    """Rule of a parameter without limits. The fit varies value / scale.

    Parameters
    ----------
    start : as for `Positive`
    scale : size of a considerable change, > 0
        None: the absolute start value, or 1 if the start value is 0.

    Examples
    --------
    >>> scene = rf.load_scene("data/grooved_road.toml")
    >>> x, to_scene = fitting.unconstrained(scene, {"lower.spectrum.angle": fitting.Free(scale=0.1)})
    >>> round(float(to_scene(x + 1).lower.spectrum.angle - scene.lower.spectrum.angle), 6)
    0.1
    """

    start: Start = None
    scale: float | None = None

    def __post_init__(self) -> None:
        if self.scale is not None and not (is_number(self.scale) and self.scale > 0):
            raise ValueError(f"Free: scale = {self.scale!r}: must be a number > 0")


@dataclasses.dataclass(frozen=True)
class Tied:
    """Rule of a value that equals a constant ratio times another free parameter.

    Parameters
    ----------
    to : key path of the other parameter
        The other parameter must not be tied, and must have one element or as many as this parameter.
    ratio : ratio of this value to the value of `to` [-]; None: the ratio of the start values

    Examples
    --------
    The lower bound q0 remains a tenth of the roll-off qr:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> qr, q0 = "lower.spectrum.qr", "lower.spectrum.q0"
    >>> free = {qr: fitting.Positive(), q0: fitting.Tied(to=qr)}
    >>> x, to_scene = fitting.unconstrained(scene, free)
    >>> road = to_scene(x + np.log(2)).lower.spectrum
    >>> round(float(road.qr), 6), round(float(road.q0), 6)
    (2000.0, 200.0)
    """

    to: str
    ratio: float | None = None

    def __post_init__(self) -> None:
        if self.ratio is not None and not is_number(self.ratio):
            raise ValueError(f"Tied: ratio = {self.ratio!r}: must be a finite number")


@dataclasses.dataclass(frozen=True)
class RmsSlope:
    """Rule of a cut-off wavevector q1 at which the roughness up to q1 has a given rms slope.

    Use the rule for key paths that end in .q1. The other parameters of the spectrum may be free or fixed.
    When q1 changes, a self-affine spectrum keeps its rms height, and a table keeps C(q).

    Parameters
    ----------
    slope : rms slope [-], > 0

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> h, q1 = "lower.spectrum.h_rms", "lower.spectrum.q1"
    >>> free = {h: fitting.Positive(), q1: fitting.RmsSlope(1.3)}
    >>> x, to_scene = fitting.unconstrained(scene, free)
    >>> rough, rougher = to_scene(x).lower.spectrum, to_scene(x + 0.5).lower.spectrum
    >>> round(float(rf.rms_slope(rougher)), 6), bool(rougher.q1 < rough.q1)
    (1.3, True)
    """

    slope: float = 1.3

    def __post_init__(self) -> None:
        if not (is_number(self.slope) and self.slope > 0):
            raise ValueError(f"RmsSlope: slope = {self.slope!r}: must be a finite number > 0")


Constraint = Positive | Bounded | Free | Tied | RmsSlope
_KINDS = Positive, Bounded, Free, Tied, RmsSlope
CONSTRAINTS: dict[str, type[Constraint]] = {kind.__name__: kind for kind in _KINDS}
# Rules without an element in x: the value follows from other parameters.
FOLLOWING = ("Tied", "RmsSlope", "Shared")


# Index of a leaf of the scene, and its elements; None: a scalar.
LeafElements = tuple[int, tuple[int, ...] | None]


def common_values(
    path: str,
    rule: Positive | Bounded | Free,
    paths: list[str],
    places: list[LeafElements],
    leaves: list[np.ndarray],
) -> np.ndarray:
    """Return the values in the scene of the elements that a key of `free` names.

    `path` stands for `paths`, one for each scene if the parameter is shared, which name the elements
    `places`. A shared element must have one value in all scenes, unless the rule gives a start value.
    """
    values = [leaves[leaf][list(elements)] if elements else leaves[leaf][None] for leaf, elements in places]
    for other_path, (_, elements), here in zip(paths, places, values, strict=True):
        if elements != places[0][1]:
            raise ValueError(
                f"free[{path!r}]: {paths[0]} has {values[0].size} elements, {other_path} has {here.size};"
                " shared parameters must have equal elements in all scenes, so free them separately or tie"
                " them"
            )
        if rule.start is None and not np.array_equal(here, values[0]):
            k = int(np.flatnonzero(here != values[0])[0])
            raise ValueError(
                f"free[{path!r}]: starts at {values[0][k]:g} in {paths[0].split('.')[0]}, at {here[k]:g} in"
                f" {other_path.split('.')[0]}; a shared parameter needs one start value: give start="
            )
    return values[0]


def start_values(path: str, rule: Positive | Bounded | Free, values: np.ndarray) -> np.ndarray:
    """Return the start value of every element of a free parameter, by default `values` of the scene."""
    if rule.start is None:
        return values
    try:
        start = np.asarray(rule.start)
        if start.dtype.kind not in "fiu":  # NumPy takes text for a number
            raise TypeError
        start = start.astype(float)
        values = np.broadcast_to(start, values.shape).copy()
    except (TypeError, ValueError):
        raise ValueError(
            f"free[{path!r}]: start = {rule.start!r}: must be one number or {values.size} numbers"
        ) from None
    if not np.isfinite(values).all():
        raise ValueError(f"free[{path!r}]: start = {rule.start!r}: must be finite")
    return values


def value_range(
    path: str, rule: Positive | Bounded | Free, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return `low` and `width` of `Constants`. Raise ValueError if a start value is outside the range."""
    zero, ones = np.zeros(values.shape), np.ones(values.shape)
    if isinstance(rule, Positive):
        if not (values > 0).all():
            raise ValueError(
                f"free[{path!r}]: starts at {values.min():g}: must start at a value > 0, because it is"
                " Positive; give start=..."
            )
        return zero, ones
    if isinstance(rule, Bounded):
        inside = np.minimum(values - rule.low, rule.high - values)
        if not (inside > 0).all():
            worst = values[np.argmin(inside)]
            raise ValueError(
                f"free[{path!r}]: starts at {worst:g}: must start inside the bounds"
                f" {rule.low:g} ... {rule.high:g}, not on them; give start=..."
            )
        return rule.low * ones, (rule.high - rule.low) * ones
    return zero, ones * (rule.scale or np.where(values != 0, np.abs(values), 1.0))


def with_starts(scene: Scenes, free: Mapping[str, Constraint]) -> Scenes:
    """Return the scene with start values for free numbers that are None in the scene, such as q1 of a table.

    The start value follows from the rule, or is the end of the table.
    """
    for path, rule in ((path, rule) for key, rule in free.items() for path in paths_of(scene, key)):
        owner, name = owner_of(scene, path)
        field = field_of(owner, name)
        if field is None or not field.optional or getattr(owner, name) is not None or isinstance(rule, Tied):
            continue
        if isinstance(rule, RmsSlope):
            value = cutoff_of(scene, path, rule.slope)
        elif isinstance(rule.start, int | float):
            value = rule.start
        elif name == "q1" and (power_law := getattr(owner, "power_law", None)):
            value = power_law().q[-1]  # a table without a cut-off ends with its last entry
        else:
            continue
        if isinstance(scene, dict):
            body, _, below = path.partition(".")
            scene = scene | {body: scene[body].replace({below: value})}
        else:
            scene = scene.replace({path: value})
    return scene


def cutoff_of(scene: Scenes, path: str, slope: float | jax.Array) -> jax.Array:
    """Return the q1 at which the rms slope of a spectrum is `slope`, or raise ValueError if none exists."""
    owner, name = owner_of(scene, path)
    if name != "q1" or not (hasattr(owner, "power_law") and name in fields_of(type(owner))):
        raise ValueError(f"free[{path!r}]: RmsSlope is for the q1 of a spectrum; must end in .q1")
    try:
        return cutoff(owner, slope, keep="h_rms")
    except ValueError as error:
        raise ValueError(f"free[{path!r}]: {error}") from None


def cutoff_path(scene: Scenes, path: str | None) -> str:
    """Return `path`, which must be the q1 of a spectrum, or the path of the only q1 if `path` is None."""
    known = [
        f"{name}.{side}.spectrum.q1".lstrip(".")
        for name, own_scene in by_name(scene).items()
        for side in ("lower", "upper")
        if hasattr(getattr(own_scene, side).spectrum, "q1")
    ]
    if path is None and len(known) == 1:
        return known[0]
    if path is None or any(scene_path not in known for scene_path in paths_of(scene, path)):
        raise ValueError(f"path = {path!r}: must be the q1 of a spectrum: {', '.join(known) or 'none'}")
    return path


def last_wavevector(scene: Scenes, path: str) -> float:
    """Return the largest possible q1 [1/m], the last wavevector of a table, or inf for other spectra."""
    ends = [getattr(owner_of(scene, below)[0], "q", None) for below in paths_of(scene, path)]
    return min((float(q[-1]) for q in ends if q is not None), default=float("inf"))
