"""Rules for numbers, and error messages that state what is wrong, where, and what is allowed."""

import difflib
import functools
import math
import sys
import warnings
from collections.abc import Callable, Collection, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

if TYPE_CHECKING:

    class HasArray(Protocol):
        """An array of NumPy or JAX, a column of pandas, and other objects that NumPy converts to an array."""

        def __array__(self) -> np.ndarray: ...

    NumberLike: TypeAlias = jax.Array | np.ndarray | np.number | float
    _Row: TypeAlias = Sequence[NumberLike]
    # Without recursion, because a text is a sequence of texts.
    ArrayLike: TypeAlias = NumberLike | HasArray | _Row | Sequence[_Row] | Sequence[Sequence[_Row]]
else:

    class NumberLike:
        """Annotation of a number, or of an array with which JAX computes.

        Type checkers see a union of types. At run time it is a class, so `help` shows its name.
        """

    class ArrayLike:
        """Annotation of real numbers of any shape: a number, an array, nested sequences, a column of pandas.

        Type checkers see a union of types. At run time it is a class, so `help` shows its name.
        """


# A rule for numbers: text of the error message, test of a NumPy array.
Rule: TypeAlias = tuple[str, Callable[[np.ndarray], Any]]
# Rule for moduli, lengths and other scales, whose logarithm is taken.
POSITIVE: Rule = ("must be > 0", lambda x: x > 0)
# Rule for terms that may be absent.
NONNEGATIVE: Rule = ("must be >= 0", lambda x: x >= 0)
# Rule for numbers of any sign.
FINITE: Rule = ("must be finite", lambda x: np.isfinite(x))

# Ranges of magnitudes in SI. Numbers outside are probably in another unit, see `objects.leaf`.
PLAUSIBLE_STRESS = (1e2, 1e13)  # [Pa]
PLAUSIBLE_TEMPERATURE = (1e2, 1e3)  # [K]
PLAUSIBLE_WAVEVECTOR = (0.1, 1e12)  # [1/m]
PLAUSIBLE_HEIGHT = (0.0, 1.0)  # [m]


class UnitWarning(UserWarning):
    """Warning that a number of a scene or a condition is probably not in SI units.

    `warnings.simplefilter("ignore", rubberfric.UnitWarning)` switches the warning off.
    """


# Packages between a caller and a warning: these two, and packages that call their functions.
_PASSED = ("rubberfric", "fitting", "jax", "functools", "contextlib", "copy", "dataclasses")


def warn_caller(text: str, category: type[Warning]) -> None:
    """Issue a warning that points to the nearest calling line outside the packages in `_PASSED`."""
    level, frame = 1, sys._getframe()
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in _PASSED:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)


def shown(value: object) -> str:
    """Return a value as text for an error message, on one line of at most 60 characters."""
    value = value.item() if isinstance(value, np.generic) else value
    text = " ".join(repr(value).split())  # a matrix has several lines
    return text if len(text) <= 60 else text[:57] + "..."


def listed(texts: Collection[str], most: int = 20) -> str:
    """Join the first texts for an error message, and state the number of texts if some are left out.

    Each text has at most 60 characters.
    """
    shortened = [text if len(text) <= 60 else text[:57] + "..." for text in list(texts)[:most]]
    more = f", ... ({len(texts)} in total)" if len(texts) > most else ""
    return ", ".join(shortened) + more


def between(low: float, high: float) -> Rule:
    """Return the rule that a value must satisfy low <= value <= high."""
    return (f"must be between {low} and {high}", lambda x: (x >= low) & (x <= high))


def shape_of(value: ArrayLike) -> tuple[int, ...]:
    """Return the shape of numbers. Raise ValueError if rows have different lengths."""
    # NumPy's own annotation refuses sequences that contain JAX arrays.
    return np.shape(value)  # pyright: ignore[reportArgumentType, reportCallIssue]


def is_concrete(value: object) -> bool:
    """Return False if a value is a JAX tracer, whose numbers are unknown while JAX traces a function."""
    return not isinstance(value, Tracer)


def check_kind(name: str, value: object, kind: type) -> None:
    """Raise ValueError unless a value is an object of a class."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} is a {type(value).__name__}: must be a {kind.__name__}")


def check_values(name: str, value: Any, rule: Rule) -> None:
    """Raise ValueError if a number or an element of an array is not finite or breaks a rule.

    The message names the first such element. Tracers are not checked.
    """
    if not is_concrete(value):
        return
    array = np.asarray(value)
    text, test = rule
    with np.errstate(invalid="ignore"):
        good = np.isfinite(array) & test(array)
    if not good.all():
        where = np.unravel_index(np.argmin(good), good.shape)
        index = "".join(f"[{i}]" for i in where)
        if not np.isfinite(array[where]) and text != FINITE[0]:
            text = f"must be finite, and {text}"
        raise ValueError(f"{name}{index} = {shown(array[where])}: {text}")


def check_unmasked(name: str, value: object) -> None:
    """Raise ValueError if an array of NumPy has masked entries, whose mask would be lost without an error."""
    if np.ma.is_masked(value):
        raise ValueError(f"{name} has masked entries: must have none; leave them out, x[~x.mask]")


def as_leaf(name: str, value: Any, ndim: int) -> jax.Array:
    """Convert a value to a float array with `ndim` dimensions, or raise ValueError.

    A Python number stays a Python float, which JAX treats as weakly typed. A float32 scene therefore stays
    float32 in JAX's x64 mode, although the default of Poisson's ratio is the Python number 0.5.
    """
    if isinstance(value, bool | str | bytes) or value is None:
        kind = "a number" if ndim == 0 else "a sequence of numbers"
        raise ValueError(f"{name} = {shown(value)}: must be {kind}")
    if isinstance(value, int | float) and ndim == 0:
        try:
            return float(value)  # pyright: ignore[reportReturnType] (weakly typed, all that an array does)
        except OverflowError:
            raise ValueError(f"{name} = {shown(value)}: must be within floating-point range") from None
    check_unmasked(name, value)
    try:
        array = value if isinstance(value, jax.Array) else np.asarray(value)
        if array.dtype == object:
            array = _from_objects(array)
        if not jnp.issubdtype(array.dtype, jnp.floating):
            if not jnp.issubdtype(array.dtype, jnp.integer):
                raise TypeError
            array = array.astype(float)
    except (TypeError, ValueError, OverflowError):
        kind = "a real number" if ndim == 0 else "a sequence of real numbers"
        raise ValueError(f"{name} = {shown(value)}: must be {kind}") from None
    if array.ndim != ndim:
        kind = ("a scalar", "one-dimensional", "two-dimensional")[ndim]
        raise ValueError(f"{name} has shape {array.shape}: must be {kind}")
    return as_array(array)


def _from_objects(array):
    """Convert an array of Python numbers, such as a column of pandas; raise TypeError for other objects."""
    numbers = []
    for x in array.flat:
        missing = type(x).__name__ == "NAType"  # of pandas
        if isinstance(x, bool) or not (missing or isinstance(x, Real)):
            raise TypeError
        numbers.append(math.nan if missing else float(x))
    return np.array(numbers, float).reshape(array.shape)


def as_numbers(name: str, value: Any, rule: Rule | None = None) -> Any:
    """Convert numbers of any shape to a float array, or raise ValueError.

    Python numbers become Python floats. `rule` is a rule for `check_values`, or None.
    """
    number = value
    if not isinstance(value, float):
        try:
            ndim = np.ndim(value)
        except ValueError:  # rows of different lengths, which `as_leaf` refuses
            ndim = 1
        number = as_leaf(name, value, ndim)
    if rule is not None:
        # Messages show a Python integer as it was given.
        check_values(name, value if isinstance(value, int) else number, rule)
    return number


def as_array(value: ArrayLike, dtype: str | type | np.dtype | None = None) -> jax.Array:
    """Return the same array as `jnp.asarray(value, dtype)`, without compiling for every new shape.

    `jnp.asarray` needs 10 ms to compile a copy for each new shape.
    """
    if isinstance(value, jax.Array):
        return jnp.asarray(value, dtype)
    # A copy, because JAX keeps the memory of an array, which a user may change later.
    return jax.device_put(np.array(value, dtype))


def as_arguments(tree: Any, dtype: str | type | np.dtype) -> Any:
    """Convert all leaves of a tree, the arguments of a jitted function, to one dtype.

    Leaves that are not JAX arrays become NumPy arrays, because `as_array` would take 30 us for each of them.
    So do known numbers that are weakly typed: they were given as Python numbers. Other JAX arrays may be
    differentiated, so they remain JAX arrays. One jitted function converts all of them, because each separate
    operation would take a third of a millisecond.
    """
    leaves, structure = jax.tree.flatten(tree)
    leaves = [np.asarray(x) if is_concrete(x) and getattr(x, "weak_type", False) else x for x in leaves]
    others = {
        i: x for i, x in enumerate(leaves) if isinstance(x, jax.Array) and (x.dtype != dtype or x.weak_type)
    }
    converted = _converted(others, np.dtype(dtype)) if others else {}
    return structure.unflatten(
        converted[i] if i in converted else x if isinstance(x, jax.Array) else np.array(x, dtype)
        for i, x in enumerate(leaves)
    )


@functools.partial(jax.jit, static_argnums=1)
def _converted(values, dtype):
    return jax.tree.map(lambda x: jnp.asarray(x, dtype), values)


def check_lengths(owner: str, **vectors: jax.Array) -> None:
    """Raise ValueError unless all vectors of one object have the same length."""
    lengths = {name: vector.shape[0] for name, vector in vectors.items()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} has {n}" for name, n in lengths.items())
        raise ValueError(f"{owner}: lengths differ ({shown}); they must be equal")


def check_table(owner: str, **vectors: jax.Array) -> None:
    """Raise ValueError unless vectors have one length >= 2, and the first vector increases strictly."""
    check_lengths(owner, **vectors)
    name, first = next(iter(vectors.items()))
    if first.shape[0] < 2:
        raise ValueError(f"{owner}.{name} has {first.shape[0]} entries: must have at least 2")
    check_increasing(f"{owner}.{name}", first)


def check_increasing(name: str, vector: Any) -> None:
    """Raise ValueError unless a vector increases strictly; tracers are not checked."""
    if is_concrete(vector):
        array = np.asarray(vector)
        bad = np.flatnonzero(~(np.diff(array) > 0))
        if bad.size:
            i = int(bad[0]) + 1
            raise ValueError(
                f"{name}[{i}] = {shown(array[i])} after {shown(array[i - 1])}: must increase strictly"
            )


def either(names: Collection[str]) -> str:
    """Join names to a text such as "A, B or C"."""
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last


def check_choice(name: str, value: object, allowed: Collection[str]) -> str:
    """Return a value, or raise ValueError unless it is one of the allowed texts."""
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name} = {shown(value)}: {closest(value, allowed)}")
    return value


def closest(name: object, allowed: Collection[str]) -> str:
    """Return the end of an error message about an unknown name.

    The text lists the allowed names. If one of them is similar to the unknown name, the text suggests it
    first.
    """
    near = difflib.get_close_matches(str(name)[:200], list(allowed), n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{hint}must be one of {listed(allowed, 100)}" if allowed else "no name is allowed here"
