"""Options of fits and ensembles in Python and in job files, with a rule for each."""

import numbers
from collections.abc import Callable, Collection
from typing import Any

import jax

from fitting.parameters.constraints import is_number
from fitting.solvers.first_order import LBFGS, Adam
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import LOSS_WIDTHS
from rubberfric.base import closest, shown

Solver = LevenbergMarquardt | LBFGS | Adam
SOLVERS = {"lm": LevenbergMarquardt, "lbfgs": LBFGS, "adam": Adam}

OptionRule = Callable[[Any], str]  # function of a value that returns an error text, "" if the value is right


def _choice(names: Collection[str]) -> OptionRule:
    def rule(value):
        text = value if isinstance(value, str) else ""
        return "" if text in names else closest(text, tuple(names))

    return rule


def _rule(text: str, test: Callable[[Any], bool]) -> OptionRule:
    return lambda value: "" if test(value) else f"must be {text}"


def _integer(smallest: int, largest: int = 1_000_000) -> OptionRule:
    def test(value):
        whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
        return whole and smallest <= int(value) <= largest

    return _rule(f"an integer, {smallest} to {largest}", test)


def _or_none(rule: OptionRule) -> OptionRule:
    return lambda value: "" if value is None else rule(value)


_POSITIVE = _rule(
    "a finite number > 0", lambda value: not isinstance(value, bool) and is_number(value) and value > 0
)
# Options that a job file may contain.
FILE_OPTIONS: dict[str, OptionRule] = {
    "method": _choice(SOLVERS),
    "starts": _integer(1, 10_000),
    "seed": _integer(0, 2**31 - 1),  # of job files, for key
    "loss": _choice(LOSS_WIDTHS),
    "loss_width": _or_none(_POSITIVE),
    "decades": _POSITIVE,
    "max_steps": _or_none(_integer(1)),
    "tolerance": _or_none(_POSITIVE),
    "further_time": _rule("a number of seconds >= 0", lambda value: is_number(value) and value >= 0),
    "scale_errors": _rule('"auto", True or False', lambda value: isinstance(value, bool) or value == "auto"),
}
OPTION_RULES: dict[str, OptionRule] = FILE_OPTIONS | {
    "key": _or_none(
        _rule("a jax.random.key, such as jax.random.key(1)", lambda value: isinstance(value, jax.Array))
    ),
    "prior": _or_none(
        _rule(
            "a dict of key path -> Gaussian, Smooth, Sum or Correlated, or None; for a fit, fit.as_prior()",
            lambda value: isinstance(value, dict),
        )
    ),
    "callback": _or_none(_rule("a function of (step, cost), or None", callable)),
    "flat": _choice(("x", "values")),  # variables in which parameters without a prior have a flat density
    "widen": _rule("a number > 0", lambda value: is_number(value) and value > 0),
    "level": _rule("between 0 and 1", lambda value: is_number(value) and 0 < value < 1),
    "points": _integer(1),
    "count": _integer(1),
    "n": _integer(1),
    "warmup": _integer(1),
    "chains": _integer(1, 1000),
    "every": _rule("a number of seconds >= 0", lambda value: is_number(value) and value >= 0),
    "max_memory": _rule("a number of bytes > 0", lambda value: is_number(value) and value > 0),
    "batch": _rule("an integer >= 1, or None", lambda value: value is None or not _integer(1)(value)),
}


def check_options(**options: object) -> None:
    """Raise a ValueError that names the first invalid option. `fitting.fit` describes the options."""
    for name, value in options.items():
        if wrong := OPTION_RULES[name](value):
            raise ValueError(f"{name} = {shown(value)}: {wrong}")


def make_solver(method: str, tolerance: float | None = None, max_steps: int | None = None) -> Solver:
    """Return the solver of a method. The learning rate of Adam falls to zero at step `max_steps`."""
    options: dict[str, Any] = {} if tolerance is None else {"tolerance": tolerance}
    if method == "adam" and max_steps is not None:
        options["max_steps"] = max_steps
    return SOLVERS[method](**options)
