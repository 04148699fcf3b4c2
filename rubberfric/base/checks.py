"""Rules for numbers, and the wording of errors: what was wrong, where, and what it must be."""

import difflib
import functools
import sys
import warnings
from collections.abc import Callable, Collection
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike

# A rule for numbers: text for the error message, test on a NumPy array.
Rule: TypeAlias = tuple[str, Callable[[np.ndarray], Any]]
POSITIVE: Rule = ("must be > 0", lambda x: x > 0)
NONNEGATIVE: Rule = ("must be >= 0", lambda x: x >= 0)
FINITE: Rule = ("must be finite", lambda x: np.isfinite(x))

# Magnitudes of numbers in SI beyond which they are taken to be in another unit, see `objects.leaf`.
PLAUSIBLE_STRESS = (1e2, 1e13)  # [Pa]
PLAUSIBLE_TEMPERATURE = (1e2, 1e3)  # [K]


class UnitWarning(UserWarning):
    """A number of a scene or a condition is hardly in SI.

    `warnings.simplefilter("ignore", rubberfric.UnitWarning)` switches it off.
    """


# Packages between a caller and what warns: these two, and what calls their functions for them.
_PASSED = ("rubberfric", "fitting", "jax", "functools", "contextlib", "copy", "dataclasses")


def warn_caller(text: str, category: type[Warning]) -> None:
    """Warn at the line outside these packages from which they were called."""
    level, frame = 1, sys._getframe()
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in _PASSED:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)


def shown(value: object) -> str:
    """How a wrong value is shown: a number as a number, all else on one line, cut to a readable length."""
    value = value.item() if isinstance(value, np.generic) else value
    text = " ".join(repr(value).split())  # a matrix has lines
    return text if len(text) <= 60 else text[:57] + "..."


def between(low: float, high: float) -> Rule:
    """Rule: low <= value <= high."""
    return (f"must be between {low} and {high}", lambda x: (x >= low) & (x <= high))


def is_concrete(value: object) -> bool:
    """False for tracers: their values are not known while tracing."""
    return not isinstance(value, Tracer)


def check_values(name: str, value: Any, rule: Rule) -> None:
    """Raise ValueError naming the first element of a concrete value that breaks the rule."""
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


def as_leaf(name: str, value: Any, ndim: int) -> jax.Array:
    """A float array of the wanted rank; Python scalars stay weakly typed floats.

    Weak typing lets a float32 scene keep float32 although its Poisson ratio was
    left at the Python default 0.5 and x64 is on.
    """
    if isinstance(value, bool | str | bytes) or value is None:
        kind = "a number" if ndim == 0 else "a sequence of numbers"
        raise ValueError(f"{name} = {shown(value)}: must be {kind}")
    if isinstance(value, int | float) and ndim == 0:
        try:
            return float(value)  # pyright: ignore[reportReturnType] (weakly typed, all that an array does)
        except OverflowError:
            raise ValueError(f"{name} = {shown(value)}: must be within floating-point range") from None
    try:
        array = value if isinstance(value, jax.Array) else np.asarray(value)
        if not jnp.issubdtype(array.dtype, jnp.floating):
            if not jnp.issubdtype(array.dtype, jnp.integer):
                raise TypeError
            array = array.astype(float)
    except (TypeError, ValueError):
        kind = "a real number" if ndim == 0 else "a sequence of real numbers"
        raise ValueError(f"{name} = {shown(value)}: must be {kind}") from None
    if array.ndim != ndim:
        kind = ("a scalar", "one-dimensional", "two-dimensional")[ndim]
        raise ValueError(f"{name} has shape {array.shape}: must be {kind}")
    return as_array(array)


def as_array(value: ArrayLike, dtype: str | type | np.dtype | None = None) -> jax.Array:
    """What jnp.asarray(value, dtype) is, for which JAX compiles a copy at every new shape, 10 ms each."""
    if isinstance(value, jax.Array):
        return jnp.asarray(value, dtype)
    # Of a copy: JAX keeps the memory of an array it is given, which a user may write to later.
    return jax.device_put(np.array(value, dtype))


def as_arguments(tree: Any, dtype: str | type | np.dtype) -> Any:
    """A tree of one dtype, for a jitted function: NumPy's go at once, where `as_array` takes 30 us each.

    What is differentiated is converted as one operation: JAX takes a third of a millisecond for each.
    """
    leaves, structure = jax.tree.flatten(tree)
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


def no_list(value: ArrayLike | None) -> Any:
    """A list as an array, for a jitted function takes it for many; others as they are, with their type."""
    return jnp.asarray(value) if isinstance(value, list | tuple) else value


def check_lengths(owner: str, **vectors: jax.Array) -> None:
    """Raise ValueError unless all vectors of one object have the same length."""
    lengths = {name: vector.shape[0] for name, vector in vectors.items()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} has {n}" for name, n in lengths.items())
        raise ValueError(f"{owner}: lengths differ ({shown}); they must be equal")


def check_increasing(name: str, vector: Any) -> None:
    """Raise ValueError unless a concrete vector increases strictly."""
    if is_concrete(vector):
        array = np.asarray(vector)
        bad = np.flatnonzero(~(np.diff(array) > 0))
        if bad.size:
            i = int(bad[0]) + 1
            raise ValueError(
                f"{name}[{i}] = {shown(array[i])} after {shown(array[i - 1])}: must increase strictly"
            )


def either(names: Collection[str]) -> str:
    """Names as a sentence has them: "A, B or C"."""
    *first, last = names
    return f"{', '.join(first)} or {last}" if first else last


def closest(name: object, allowed: Collection[str]) -> str:
    """End of an error message on an unknown name: the nearest allowed one, and all of them."""
    near = difflib.get_close_matches(str(name), list(allowed), n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{hint}must be one of {', '.join(allowed)}" if allowed else "there must be none"
