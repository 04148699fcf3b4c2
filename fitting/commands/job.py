"""Job files in TOML: scene, data, free parameters and options of a fit.

::

    title = "..."                       # optional
    scene = "tread.toml"                # or .h5; paths are relative to this file

    [[data]]                            # one for each data set
    file = "friction.csv"               # or .h5, see `fitting.data.files`
    pressure = 1e5                      # and temperature, relative, body, name, if the file lacks them;
                                        # normalisation, hurst of a spectrum; poisson, columns, kind of a
                                        # table as other programs write it, area, frequency, block,
                                        # check_units = false, bad_rows, see `fitting.read`;
                                        # zero, discard, fold, stroke, average of runs; with average = true,
                                        # file may be a list of files with a run each
    ...

    [scenes.R20]                        # instead of scene and data: several scenes, which share parameters
    file = "R20.toml"
    [[scenes.R20.data]]                 # as above
    ...                                 # key paths are "R20.gamma", or "*.gamma" for a shared parameter

    [free]                              # key paths in quotes
    "upper.material.E" = "positive"
    "upper.material.E_inf" = { rule = "tied", to = "upper.material.E", ratio = ... }
    "lower.spectrum.q1" = { rule = "rms_slope", slope = 1.3 }
    "lower.spectrum.hurst" = { rule = "bounded", low = 0.3, high = 1.0, start = 0.8 }
    "gamma" = { rule = "free", scale = 0.1 }

    [prior]                             # optional
    "lower.spectrum.hurst" = { mean = 0.8, sigma = 0.05 }
    "upper.material.E" = { smooth = 1.0 }
    "upper.material.E_inf + upper.material.E" = { high = 2e9 }    # a sum, optionally low, sigma
    fit = { file = "moduli.h5", body = "upper" }    # posterior of another fit, optionally widen; or a list

    [discrepancy]                       # optional: error of the theory, see `fitting.Discrepancy`
    amplitude = 0.25                    # or "estimated" from the data (default)
    width = 4.6                         # likewise; and shared = 0.8 (default 0.6)

    [fit]                               # optional: method, starts, seed, loss, loss_width, decades,
    starts = 8                          # max_steps, tolerance, scale_errors as in `fitting.fit`
    ...

    [budget]                            # optional: errors of inputs for --budget, temperature [K], velocity,
    temperature = 2.0                   # pressure, moduli, roughness, gamma, as in `FitResult.budget`

    [design]                            # optional, for `rubberfric-fit design`: `fitting.commands.work`
    ...
"""

import dataclasses
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import numpy as np

import rubberfric as rf
from fitting.budget.changes import Sizes
from fitting.data.averages import average
from fitting.data.files import read
from fitting.data.measured import Measured
from fitting.parameters.constraints import CONSTRAINTS, Constraint
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.priors import Gaussian, Prior, Smooth, Sum
from fitting.results.result import FitResult
from fitting.solvers.options import FILE_OPTIONS, check_options
from rubberfric.base import StrPath, closest, shown
from rubberfric.io import toml

FILE_RULES = {re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower(): cls for name, cls in CONSTRAINTS.items()}
RULE_KEYS = ("rule", *dict.fromkeys(f.name for cls in FILE_RULES.values() for f in dataclasses.fields(cls)))
PRIOR_KEYS = ("mean", "sigma", "smooth", "low", "high")
FIT_KEYS = ("file", "body", "widen")
CONDITIONS = ("pressure", "temperature", "relative", "hurst", "poisson", "area", "frequency", "stroke")
TEXTS = ("body", "normalisation", "kind", "bad_rows", "discard")
AS_THEY_ARE = ("columns", "check_units", "block", "zero", "fold", "average")  # `fitting.read` checks them
EXTRA = (*AS_THEY_ARE, "name")
REALS = ("loss_width", "decades", "tolerance", "further_time")  # may be integers in TOML


class Job(NamedTuple):
    """Content of a job file.

    The fit is `fitting.fit(job.scene, job.data, job.free, prior=job.prior, **job.options)`.
    """

    scene: rf.Scene | dict[str, rf.Scene]
    data: list[Measured] | dict[str, list[Measured]]
    free: dict[str, Constraint]
    prior: dict[str, Prior]
    options: dict[str, Any]
    title: str
    design: Any = None  # the table [design], see `fitting.commands.work`
    budget: Mapping[str, float] = MappingProxyType({})  # arguments of `FitResult.budget`


def read_job(path: StrPath) -> Job:
    """Read a job file with its scene and data.

    If the job, a scene or data are invalid, a ValueError names the file, the key, the value and the rule.
    """
    path = Path(path)
    if path.suffix.lower() != ".toml":
        raise ValueError(f"{path}: suffix {path.suffix!r}: must be .toml")
    content = toml.read_toml(path)
    if {"lower", "upper"} & set(content):
        raise ValueError(
            f'{path}: is a scene file, for `rubberfric run`; a job has scene = "{path.name}", data and free'
        )
    several = "scenes" in content
    needed = ("scenes", "free") if several else ("scene", "data", "free")
    toml.check_keys(
        path, "", content, ("title", *needed, "prior", "discrepancy", "fit", "budget", "design"), needed
    )
    title = _text(path, "title", content.get("title", ""))
    free, prior = content["free"], content.get("prior", {})
    _check_paths(path, "free", free, RULE_KEYS)
    toml.check_keys(path, "prior", prior, prior)
    prior = dict(prior)
    fits = prior.pop("fit", [])
    _check_paths(path, "prior", prior, PRIOR_KEYS)
    free = {key: _rule(path, f"free.{key!r}", value) for key, value in free.items()}
    prior: dict[str, Prior] = {key: _prior(path, f"prior.{key!r}", value) for key, value in prior.items()}
    for table in fits if isinstance(fits, list) else [fits]:
        prior |= _known(path, table)
    options, budget = _options(path, content.get("fit", {})), _budget(path, content.get("budget", {}))
    if "discrepancy" in content:
        options["discrepancy"] = _discrepancy(path, content["discrepancy"])
    if not several:
        scene, data = _scene(path, "scene", content["scene"], "data", content["data"])
        return Job(scene, data, free, prior, options, title, content.get("design"), budget)
    tables = content["scenes"]
    toml.check_keys(path, "scenes", tables, tables)
    scenes: dict[str, rf.Scene] = {}
    sets: dict[str, list[Measured]] = {}
    for name, table in tables.items():
        where = f"scenes.{name}"
        toml.check_keys(path, where, table, ("file", "data"), ("file", "data"))
        file, data = table["file"], table["data"]
        scenes[name], sets[name] = _scene(path, f"{where}.file", file, f"{where}.data", data)
    return Job(scenes, sets, free, prior, options, title, content.get("design"), budget)


def _scene(path, key, file, of_data, data):
    """Return the scene in `file`, and the data sets that the tables `data` of the job describe."""
    if not isinstance(data, list) or not data:
        raise ValueError(f"{path}: {of_data} = {shown(data)}: must be tables with the header [[{of_data}]]")
    scene = _read(path, key, file, rf.load_scene)
    return scene, [_data(path, f"{of_data}[{i}]", table) for i, table in enumerate(data)]


def _text(path, key, value):
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError(f"{path}: {key} = {shown(value)}: must be one line of text")
    return value


def _one(path, key, value):
    if isinstance(value, list):
        raise ValueError(f"{path}: {key} = {shown(value)}: must be one number")
    return toml.number(path, key, value)


def _read(path, key, name, reader):
    """Return `reader(file)` for the file `name`, whose path is relative to the folder of the job file."""
    file = path.parent / _text(path, key, name)
    with about(f"{path}: {key}"):
        return reader(file)


def _data(path, key, content):
    toml.check_keys(path, key, content, ("file", *CONDITIONS, *TEXTS, *EXTRA), ("file",))
    options = {name: _one(path, f"{key}.{name}", content[name]) for name in CONDITIONS if name in content}
    options |= {name: _text(path, f"{key}.{name}", content[name]) for name in TEXTS if name in content}
    options |= {name: content[name] for name in AS_THEY_ARE if name in content}
    files = content["file"]
    if isinstance(files, list):
        data = _mean_of_files(path, key, files, options)
    else:
        data = _read(path, f"{key}.file", files, lambda file: read(file, **options))
    if "name" in content:
        name = _text(path, f"{key}.name", content["name"])
        data = dataclasses.replace(data, name=name, check_units=False)
    return data


def _mean_of_files(path, key, files, options) -> Measured:
    """Return the mean of the runs in several files, which are read with `options` of `fitting.read`."""
    if options.get("average") is not True:
        raise ValueError(f"{path}: {key}.file = {shown(files)}: must be one file, or average = true")
    runs: Any = [_read(path, f"{key}.file", file, lambda file: read(file, **options)) for file in files]
    with about(f"{path}: {key}.file"):
        return average(runs)


def _check_paths(path, table, content, keys):
    """Raise ValueError if a key path in a table of the job has no quotes, or if the table "free" is empty.

    TOML reads a key path without quotes as nested tables. The innermost table has the given keys.
    """
    toml.check_keys(path, table, content, content)
    if table == "free" and not content:
        raise ValueError(f"{path}: free: is empty; must contain the key paths of free parameters")
    for key, value in content.items():
        steps = [key]
        while isinstance(value, dict) and value and not set(value) & set(keys):
            step, value = next(iter(value.items()))
            steps.append(step)
        # gamma is the only key path without a dot: the content of its table is not a path.
        if len(steps) > 1 and "." not in key and key != "gamma":
            whole = ".".join(steps)
            raise ValueError(f'{path}: {table}.{whole}: put the key path in quotes: "{whole}" = ...')


def _rule(path, key, value):
    table = {"rule": value} if isinstance(value, str) else value
    if not isinstance(table, dict):
        raise ValueError(f'{path}: {key} = {shown(value)}: must be "positive" or a table with the key rule')
    toml.check_keys(path, key, table, RULE_KEYS, ("rule",))
    kind = table["rule"]
    if not isinstance(kind, str) or kind not in FILE_RULES:
        raise ValueError(f"{path}: {key}: rule = {shown(kind)}: {closest(kind, tuple(FILE_RULES))}")
    fields = dataclasses.fields(FILE_RULES[kind])
    needed = [field.name for field in fields if field.default is dataclasses.MISSING]
    toml.check_keys(path, key, table, ("rule", *(field.name for field in fields)), needed)
    readers = {"to": _text, "start": toml.number}
    values = {n: readers.get(n, _one)(path, f"{key}.{n}", v) for n, v in table.items() if n != "rule"}
    return _made(path, key, FILE_RULES[kind], values)


def _known(path, value):
    """Return the priors that follow from a file with the result of another fit."""
    toml.check_keys(path, "prior.fit", value, FIT_KEYS, ("file",))
    options: dict[str, Any] = {}
    if "body" in value:
        options["body"] = _text(path, "prior.fit.body", value["body"])
    if "widen" in value:
        options["widen"] = _one(path, "prior.fit.widen", value["widen"])
    return _read(path, "prior.fit", value["file"], lambda file: FitResult.load(file).as_prior(**options))


def _prior(path, key, value):
    toml.check_keys(path, key, value, PRIOR_KEYS)
    if "smooth" in value:
        toml.check_keys(path, key, value, ("smooth",))
        return _made(path, key, Smooth, {"sigma": _one(path, f"{key}.smooth", value["smooth"])})
    of_sum = bool({"low", "high"} & set(value))
    keys = ("low", "high", "sigma") if of_sum else ("mean", "sigma")
    toml.check_keys(path, key, value, keys, () if of_sum else keys)
    values = {n: _one(path, f"{key}.{n}", v) for n, v in value.items()}
    return _made(path, key, Sum if of_sum else Gaussian, values)


def _discrepancy(path, content):
    toml.check_keys(path, "discrepancy", content, ("amplitude", "width", "shared"))
    # There is no None in TOML.
    numbers = {n: v for n, v in content.items() if v != "estimated" or n == "shared"}
    values = {n: _one(path, f"discrepancy.{n}", v) for n, v in numbers.items()}
    values |= {n: None for n in content if n not in numbers}
    return _made(path, "discrepancy", Discrepancy, values)


def _budget(path, content):
    toml.check_keys(path, "budget", content, Sizes._fields)
    values = {name: _one(path, f"budget.{name}", value) for name, value in content.items()}
    for name, value in values.items():
        if not 0 <= value < math.inf:
            raise ValueError(f"{path}: budget.{name} = {value:g}: must be a finite number >= 0")
    return values


def _made(path, key, cls, values):
    with about(f"{path}: {key}"):
        return cls(**values)


def _options(path, content):
    toml.check_keys(path, "fit", content, FILE_OPTIONS)
    try:
        check_options(**content)
    except ValueError as error:
        raise ValueError(f"{path}: fit.{error}") from None
    options = {name: float(content[name]) if name in REALS else content[name] for name in content}
    if "seed" in options:
        options["key"] = jax.random.key(options.pop("seed"))
    return options


@contextmanager
def about(what: StrPath) -> Iterator[None]:
    """Put the path of a job file, or a key in it, before the message of a ValueError, in a `with` block."""
    try:
        yield
    except np.linalg.LinAlgError:  # a ValueError, but not about the input
        raise
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None
