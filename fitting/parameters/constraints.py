"""Which values a free parameter may take; `fitting.parameters.variables` says how a fit sees them."""

import dataclasses
import math
from collections.abc import Sequence

Start = float | Sequence[float] | None


def is_number(value: object) -> bool:
    """Whether a value is one finite real number."""
    try:
        return math.isfinite(value)  # pyright: ignore[reportArgumentType]  # tells by its TypeError
    except (TypeError, ValueError, OverflowError):
        return False


@dataclasses.dataclass(frozen=True)
class Positive:
    """A value > 0, fitted in its logarithm.

    Parameters
    ----------
    start : number, or None to start at the scene's value
        one number for all elements, or one for each.
    """

    start: Start = None


@dataclasses.dataclass(frozen=True)
class Bounded:
    """A value between two bounds, fitted in the logit of its place between them.

    Parameters
    ----------
    low, high : bounds, low < start < high
    start : as for `Positive`
    """

    low: float
    high: float
    start: Start = None

    def __post_init__(self) -> None:
        if not (is_number(self.low) and is_number(self.high) and self.low < self.high):
            raise ValueError(f"Bounded({self.low!r}, {self.high!r}): must be finite numbers, low < high")


@dataclasses.dataclass(frozen=True)
class Free:
    """Any value.

    Parameters
    ----------
    start : as for `Positive`
    scale : a change that matters; None: the size of the start value, 1 for 0
    """

    start: Start = None
    scale: float | None = None

    def __post_init__(self) -> None:
        if self.scale is not None and not (is_number(self.scale) and self.scale > 0):
            raise ValueError(f"Free: scale = {self.scale!r}: must be a number > 0")


@dataclasses.dataclass(frozen=True)
class Tied:
    """A value that follows another free parameter: ratio times it.

    Parameters
    ----------
    to : key path of a parameter that is free itself, of as many elements or of one
    ratio : number, or None to keep the ratio of the start values
    """

    to: str
    ratio: float | None = None

    def __post_init__(self) -> None:
        if self.ratio is not None and not is_number(self.ratio):
            raise ValueError(f"Tied: ratio = {self.ratio!r}: must be a finite number")


@dataclasses.dataclass(frozen=True)
class RmsSlope:
    """A cut-off wavevector q1 that follows the rms slope of the roughness up to it.

    For key paths that end in .q1. All else in the spectrum keeps its value, free or not: of a
    self-affine one the height, of a table C(q).

    Parameters
    ----------
    slope : rms slope [-], > 0
    """

    slope: float = 1.3

    def __post_init__(self) -> None:
        if not (is_number(self.slope) and self.slope > 0):
            raise ValueError(f"RmsSlope: slope = {self.slope!r}: must be a finite number > 0")


Rule = Positive | Bounded | Free | Tied | RmsSlope
RULES: dict[str, type[Rule]] = {cls.__name__: cls for cls in (Positive, Bounded, Free, Tied, RmsSlope)}
# Those without an element of their own in x: their value follows from others.
FOLLOWING = ("Tied", "RmsSlope", "Shared")
