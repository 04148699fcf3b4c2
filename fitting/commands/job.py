"""Job files: a fit written by hand, in TOML.

::

    title = "..."                       # optional
    scene = "tread.toml"                # or .h5; paths are relative to this file

    [[data]]                            # one for each data set
    file = "friction.csv"               # or .h5, see `fitting.data.files`
    pressure = 1e5                      # and temperature, relative, body, name: what the file lacks;
                                        # normalisation, hurst of a spectrum; poisson, columns, kind of a
                                        # table as other programs write it, check_units = false,
                                        # see `fitting.read`
    ...

    [free]                              # key paths in quotes
    "upper.material.E" = "positive"
    "upper.material.E_inf" = { rule = "tied", to = "upper.material.E", ratio = ... }
    "lower.spectrum.q1" = { rule = "rms_slope", slope = 1.3 }
    "lower.spectrum.hurst" = { rule = "bounded", low = 0.3, high = 1.0, start = 0.8 }
    "gamma" = { rule = "free", scale = 0.1 }

    [prior]                             # optional
    "lower.spectrum.hurst" = { mean = 0.8, sigma = 0.05 }
    "upper.material.E" = { smooth = 1.0 }

    [discrepancy]                       # optional: the theory may be off, see `fitting.Discrepancy`
    amplitude = 0.25                    # missing: estimated from the data
    width = 4.6                         # and shared = 0.8

    [fit]                               # optional: method, starts, seed, loss, loss_width, decades,
    starts = 8                          # max_steps, tolerance, scale_errors as in `fitting.fit`
    ...
"""

import dataclasses
import re
from pathlib import Path
from typing import Any, NamedTuple

import jax

import rubberfric as rf
from fitting.data.files import read
from fitting.data.measured import Measured
from fitting.parameters.constraints import RULES as CLASSES
from fitting.parameters.constraints import Rule
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.priors import Gaussian, Prior, Smooth
from fitting.solvers.options import IN_FILES, check_options
from rubberfric.base import StrPath, closest, shown
from rubberfric.io import toml

RULES = {re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower(): cls for name, cls in CLASSES.items()}
RULE_KEYS = ("rule", *dict.fromkeys(f.name for cls in RULES.values() for f in dataclasses.fields(cls)))
PRIOR_KEYS = ("mean", "sigma", "smooth")
CONDITIONS = ("pressure", "temperature", "relative", "hurst", "poisson")
TEXTS = ("body", "normalisation", "kind")
EXTRA = ("columns", "check_units", "name")
REALS = ("loss_width", "decades", "tolerance")  # which TOML may have written as integers


class Job(NamedTuple):
    """What a job file says: fitting.fit(job.scene, job.data, job.free, prior=job.prior, **job.options)."""

    scene: rf.Scene
    data: list[Measured]
    free: dict[str, Rule]
    prior: dict[str, Prior]
    options: dict[str, Any]
    title: str


def read_job(path: StrPath) -> Job:
    """The `Job` of a TOML file, its scene and data read.

    Raises
    ------
    ValueError
        one line naming the file, the key, its value and the rule it breaks, or what is wrong
        in the scene or the data.
    """
    path = Path(path)
    if path.suffix.lower() != ".toml":
        raise ValueError(f"{path}: suffix {path.suffix!r}: must be .toml")
    content = toml.read_toml(path)
    needed = ("scene", "data", "free")
    toml.check_keys(path, "", content, ("title", *needed, "prior", "discrepancy", "fit"), needed)
    title = _text(path, "title", content.get("title", ""))
    free, prior = content["free"], content.get("prior", {})
    _check_paths(path, "free", free, RULE_KEYS)
    _check_paths(path, "prior", prior, PRIOR_KEYS)
    free = {key: _rule(path, f"free.{key!r}", value) for key, value in free.items()}
    prior = {key: _prior(path, f"prior.{key!r}", value) for key, value in prior.items()}
    options = _options(path, content.get("fit", {}))
    if "discrepancy" in content:
        options["discrepancy"] = _discrepancy(path, content["discrepancy"])
    data = content["data"]
    if not isinstance(data, list) or not data:
        raise ValueError(f"{path}: data = {shown(data)}: must be tables, each headed [[data]]")
    scene = _read(path, "scene", content["scene"], rf.load_scene)
    data = [_data(path, f"data[{i}]", one) for i, one in enumerate(data)]
    return Job(scene, data, free, prior, options, title)


def _text(path, key, value):
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError(f"{path}: {key} = {shown(value)}: must be one line of text")
    return value


def _one(path, key, value):
    """One number, not a list of them."""
    if isinstance(value, list):
        raise ValueError(f"{path}: {key} = {shown(value)}: must be one number")
    return toml.number(path, key, value)


def _read(path, key, name, reader):
    """What `reader` makes of a file that lies relative to the job; the job's name comes before its errors."""
    file = path.parent / _text(path, key, name)
    try:
        return reader(file)
    except ValueError as error:
        raise ValueError(f"{path}: {key}: {error}") from None


def _data(path, key, content):
    toml.check_keys(path, key, content, ("file", *CONDITIONS, *TEXTS, *EXTRA), ("file",))
    given = {name: _one(path, f"{key}.{name}", content[name]) for name in CONDITIONS if name in content}
    given |= {name: _text(path, f"{key}.{name}", content[name]) for name in TEXTS if name in content}
    given |= {name: content[name] for name in ("columns", "check_units") if name in content}
    data = _read(path, f"{key}.file", content["file"], lambda file: read(file, **given))
    if "name" in content:
        name = _text(path, f"{key}.name", content["name"])
        data = dataclasses.replace(data, name=name, check_units=False)
    return data


def _check_paths(path, table, content, keys):
    """ValueError for a key path without quotes, which TOML takes for tables within tables."""
    toml.check_keys(path, table, content, content)
    if table == "free" and not content:
        raise ValueError(f"{path}: free: is empty; must name the key paths that are free")
    for key, value in content.items():
        steps = [key]
        while isinstance(value, dict) and value and not set(value) & set(keys):
            step, value = next(iter(value.items()))
            steps.append(step)
        # gamma is the one key path without a dot: what stands in it is no path.
        if len(steps) > 1 and "." not in key and key != "gamma":
            whole = ".".join(steps)
            raise ValueError(f'{path}: {table}.{whole}: put the key path in quotes: "{whole}" = ...')


def _rule(path, key, value):
    table = {"rule": value} if isinstance(value, str) else value
    if not isinstance(table, dict):
        raise ValueError(f'{path}: {key} = {shown(value)}: must be "positive" or a table with the key rule')
    toml.check_keys(path, key, table, RULE_KEYS, ("rule",))
    kind = table["rule"]
    if not isinstance(kind, str) or kind not in RULES:
        raise ValueError(f"{path}: {key}: rule = {shown(kind)}: {closest(kind, tuple(RULES))}")
    fields = dataclasses.fields(RULES[kind])
    needed = [field.name for field in fields if field.default is dataclasses.MISSING]
    toml.check_keys(path, key, table, ("rule", *(field.name for field in fields)), needed)
    readers = {"to": _text, "start": toml.number}
    values = {n: readers.get(n, _one)(path, f"{key}.{n}", v) for n, v in table.items() if n != "rule"}
    return _made(path, key, RULES[kind], values)


def _prior(path, key, value):
    toml.check_keys(path, key, value, PRIOR_KEYS)
    if "smooth" in value:
        toml.check_keys(path, key, value, ("smooth",))
        return _made(path, key, Smooth, {"sigma": _one(path, f"{key}.smooth", value["smooth"])})
    toml.check_keys(path, key, value, PRIOR_KEYS, ("mean", "sigma"))
    return _made(path, key, Gaussian, {n: _one(path, f"{key}.{n}", v) for n, v in value.items()})


def _discrepancy(path, content):
    toml.check_keys(path, "discrepancy", content, ("amplitude", "width", "shared"))
    values = {n: _one(path, f"discrepancy.{n}", v) for n, v in content.items()}
    return _made(path, "discrepancy", Discrepancy, values)


def _made(path, key, cls, values):
    try:
        return cls(**values)
    except ValueError as error:
        raise ValueError(f"{path}: {key}: {error}") from None


def _options(path, content):
    """Keyword arguments of `fitting.fit`."""
    toml.check_keys(path, "fit", content, IN_FILES)
    try:
        check_options(**content)
    except ValueError as error:
        raise ValueError(f"{path}: fit.{error}") from None
    options = {name: float(content[name]) if name in REALS else content[name] for name in content}
    if "seed" in options:
        options["key"] = jax.random.key(options.pop("seed"))
    return options
