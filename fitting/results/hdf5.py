"""Fits in HDF5: everything needed to use or repeat a fit, as plain arrays and attributes.

::

    /                   attributes format = "rubberfric fit", format_version = 1, title, and how the
                        fit was made and ended: method, loss, loss_width, status, message, ...
    /report             the report as text
    /scene              the fitted scene, as in scene files (`rubberfric.io.hdf5`); missing if
                        the scene's constructors refuse the fitted values
    /scene_at_start     the scene that was given to the fit; with several scenes, /scene and /scene_at_start
                        have a subgroup for each scene, by name
    /data/0, 1, ...     the data sets, as in data files (`fitting.data.files`)
    /data_scenes        name of the scene of each data set, "" for a single scene
    /free/0, 1, ...     attributes path and rule, and the fields of the rule: low, high, start, to, ...
    /prior/0, 1, ...    likewise for the priors
    /quadrature         attributes: the accuracy settings
    /parameters         for every free element: names, values, start, stderr, units, withheld, and x,
                        the variables of the solver
    /uncertainty        covariance and correlation of the values, and the other fields of
                        `fitting.uncertainty.covariance.Uncertainty`
    /minima             cost, count and values of the distinct minima
    /further            attributes: further starts, `fitting.solvers.further`; may be missing
    /bounds/0, 1, ...   fits along parameters without error bars, `fitting.results.at_bounds`; may be missing
    /discrepancy        attributes amplitude, width, shared, estimated, parts, remark; may be missing
    /estimated          relative error of every data set, NaN where errors were given
    /budget             error budget, in files saved by `fitting.results.budget`
    /samples            draws from the posterior, in files saved by `fitting.results.samples`

The uncertainty is stored, not computed again: reading compiles nothing, and gives the same
numbers to the last bit on any machine.
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

import h5py
import numpy as np

from fitting.data.files import read_group
from fitting.parameters.constraints import CONSTRAINTS, Constraint
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.priors import PRIORS, Prior
from fitting.parameters.scenes import Scenes, each_scene
from fitting.results.at_bounds import AtBound
from fitting.results.record import FitRecord, Minimum
from fitting.results.report import report
from fitting.solvers.further import FurtherStarts
from fitting.solvers.objective import MESSAGES
from fitting.solvers.options import SOLVERS
from fitting.solvers.problem import ASSUMED, make_problem
from fitting.uncertainty.covariance import Uncertainty
from fitting.uncertainty.directions import Direction
from fitting.uncertainty.discrepancy import with_discrepancy
from rubberfric.base import StrPath, check_writable, closest, replacing
from rubberfric.io import hdf5, read_object, read_quadrature, write_object, write_quadrature

RuleOrPrior = TypeVar("RuleOrPrior", bound=Constraint | Prior)

# Arrays of the uncertainty, stored unchanged: the unit, and the dimension (of length size).
_ARRAYS = {
    **dict.fromkeys(("deviation", "deviations", "x", "stretch"), ("-", 1)),
    **dict.fromkeys(("correlation", "directions", "spread"), ("-", 2)),
    "covariance": ("products of /parameters/units", 2),
}
_NUMBERS = {"rank": int, "condition": float, "parameters": float, "chisqr": float}
ResultType = TypeVar("ResultType", bound=FitRecord)

FIT_FORMAT = "rubberfric fit"

# Fields of the result that are integers.
_COUNTS = ("status", "nfev", "njev")
# Fields of the result that are real numbers.
_REALS = ("cost", "seconds", "error_scale")
# Attributes of the file that are fields of the result.
FIELDS = {"method": str, **dict.fromkeys(_COUNTS, int), **dict.fromkeys(_REALS, float)}
# Attributes of the file that are settings of the problem.
OPTIONS = {"loss": str, "loss_width": float}
_TEXTS = ("format", "format_version", "rubberfric_version", "title", "message", "assumed")
GROUPS = ("scene_at_start", "data", "free", "prior", "quadrature", "parameters", "uncertainty", "minima")


def _write_scenes(parent: h5py.Group, name: str, scenes: Scenes) -> None:
    """Write a scene as the group `name`, or a dict of scenes as subgroups of the group."""
    if not isinstance(scenes, dict):
        write_object(parent, name, scenes)
        return
    group = parent.create_group(name, track_order=True)
    for own, scene in scenes.items():
        write_object(group, own, scene)


def _read_scenes(group: h5py.Group) -> Any:
    if "kind" in group.attrs:
        return read_object(group)
    return {name: read_object(subgroup) for name, subgroup in group.items()}


def _write_rules(group: h5py.Group, rules: Mapping[str, Constraint | Prior]) -> None:
    """Write rules or priors as numbered groups, because a key path cannot name a group."""
    for i, (path, rule) in enumerate(rules.items()):
        subgroup = group.create_group(str(i))
        subgroup.attrs.update(path=path, rule=type(rule).__name__)
        for field in dataclasses.fields(rule):
            value = getattr(rule, field.name)
            if np.ndim(value) == 2:  # too large for an attribute
                hdf5.write_values(subgroup, field.name, value, "-")
            elif value is not None:
                subgroup.attrs[field.name] = value if isinstance(value, str) else np.asarray(value, float)


def _read_rules(group: h5py.Group, classes: Mapping[str, type[RuleOrPrior]]) -> dict[str, RuleOrPrior]:
    """Read the rules or priors in a group as a dict by key path."""
    rules = {}
    for subgroup in _numbered(group):
        attributes = {
            k: v.tolist() if isinstance(v, np.generic | np.ndarray) else v for k, v in subgroup.attrs.items()
        }
        attributes |= {name: hdf5.read_values(subgroup, name, "-").tolist() for name in list(subgroup)}
        kind, path = attributes.pop("rule", None), attributes.pop("path", None)
        if kind not in classes:
            raise ValueError(f"{subgroup.name}: rule = {kind!r}: {closest(kind, tuple(classes))}")
        fields = tuple(field.name for field in dataclasses.fields(classes[kind]))
        hdf5.check_names(subgroup, fields, ("path", "rule", *fields))
        try:
            rules[path] = classes[kind](**attributes)
        except (ValueError, TypeError) as error:
            raise ValueError(f"{subgroup.name}: {error}") from None
    return rules


def _write_parameters(group: h5py.Group, result: FitRecord) -> None:
    hdf5.write_values(group, "x", result.x, "-")
    hdf5.write_texts(group, "names", result.names)
    hdf5.write_texts(group, "units", result.units)
    hdf5.write_texts(group, "withheld", [result.withheld.get(name, "") for name in result.names])
    for name in ("values", "start_values", "stderr"):
        hdf5.write_values(group, name, np.asarray(getattr(result, name)), "as in units")


def _write_uncertainty(group: h5py.Group, known: Uncertainty) -> None:
    """Write the uncertainty, except the reasons for withheld error bars, which are in /parameters."""
    for name, (units, _) in _ARRAYS.items():
        hdf5.write_values(group, name, getattr(known, name), units)
    for name, kind in _NUMBERS.items():
        group.attrs[name] = kind(getattr(known, name))
    below = group.create_group("unidentified")
    loadings = [direction.loadings for direction in known.unidentified]
    hdf5.write_values(below, "loadings", np.array(loadings, float).reshape(-1, known.deviation.size), "-")
    hdf5.write_values(below, "deviation", np.array([d.deviation for d in known.unidentified], float), "-")
    hdf5.write_texts(below, "text", [direction.text for direction in known.unidentified])


def _read_uncertainty(group: h5py.Group, parameters: h5py.Group, size: int) -> Uncertainty:
    hdf5.check_names(group, (*_ARRAYS, "unidentified"), tuple(_NUMBERS))
    arrays = {name: hdf5.read_array(group, name, units, (size,) * n) for name, (units, n) in _ARRAYS.items()}
    below = hdf5.subgroup(group, "unidentified")
    texts = hdf5.read_texts(below, "text")
    loadings = hdf5.read_array(below, "loadings", "-", (len(texts), size))
    deviations = hdf5.read_array(below, "deviation", "-", (len(texts),)).tolist()
    names, reasons = hdf5.read_texts(parameters, "names"), hdf5.read_texts(parameters, "withheld")
    return Uncertainty(
        **arrays,
        **hdf5.attributes(group, _NUMBERS),
        withheld={name: reason for name, reason in zip(names, reasons, strict=True) if reason},
        unidentified=tuple(map(Direction, loadings, deviations, texts)),
    )


def _write_minima(group: h5py.Group, minima: Iterable[Minimum], size: int) -> None:
    values = np.array([minimum.values for minimum in minima], float).reshape(-1, size)
    hdf5.write_values(group, "cost", np.array([minimum.cost for minimum in minima], float), "-")
    hdf5.write_values(group, "values", values, "as in units")
    group["count"] = np.array([minimum.count for minimum in minima], int)


def _read_minima(group: h5py.Group, size: int) -> tuple[Minimum, ...]:
    cost = np.asarray(hdf5.read_values(group, "cost", "-"))
    values = hdf5.read_array(group, "values", "as in units", (cost.size, size))
    count = hdf5.read_counts(group, "count", cost.size)
    return tuple(map(Minimum, cost.tolist(), count.tolist(), values))


def _write_bounds(group: h5py.Group, bounds: Iterable[AtBound]) -> None:
    for i, bound in enumerate(bounds):
        subgroup = group.create_group(str(i))
        subgroup.attrs.update(name=bound.name, where=bound.where, value=bound.value, complete=bound.complete)
        hdf5.write_values(subgroup, "held", np.array(bound.held), "as in units")
        hdf5.write_values(subgroup, "rises", np.array(bound.rises), "-")
        hdf5.write_values(subgroup, "interval", np.array(bound.interval), "as in units")
        hdf5.write_texts(subgroup, "names", list(bound.intervals))
        ends = np.array(list(bound.intervals.values()), float).reshape(-1, 2)
        hdf5.write_values(subgroup, "intervals", ends, "as in units")


def _read_bounds(group: h5py.Group) -> tuple[AtBound, ...]:
    bounds = []
    for subgroup in _numbered(group):
        names = hdf5.read_texts(subgroup, "names")
        ends = hdf5.read_array(subgroup, "intervals", "as in units", (len(names), 2)).tolist()
        kept = hdf5.attributes(subgroup, {"name": str, "where": str, "value": float, "complete": bool})
        kept |= {
            name: tuple(np.asarray(hdf5.read_values(subgroup, name, units)).tolist())
            for name, units in (("held", "as in units"), ("rises", "-"), ("interval", "as in units"))
        }
        pairs = zip(names, ends, strict=True)
        bounds.append(AtBound(**kept, intervals={name: (low, high) for name, (low, high) in pairs}))
    return tuple(bounds)


def _read_further(group: h5py.Group) -> FurtherStarts:
    kinds = {"count": int, "agreed": int, "before": float, "after": float, "seconds": float}
    hdf5.check_names(group, ("reasons",), (*kinds, "timed_out"))
    reasons = tuple(hdf5.read_texts(group, "reasons"))
    fields = hdf5.attributes(group, kinds | {"timed_out": bool})
    return FurtherStarts(reasons=reasons, **fields)


def _numbered(group: h5py.Group) -> Iterator[h5py.Group]:
    """Return the subgroups "0", "1", ... of a group in numerical order."""
    return (hdf5.subgroup(group, str(i)) for i in range(len(group)))


def save(
    path: StrPath,
    result: FitRecord,
    title: str = "",
    samples: Callable[[h5py.Group], None] | None = None,
    budget: Callable[[h5py.Group], None] | None = None,
) -> None:
    """Write a fit to an HDF5 file (.h5), completely or not at all.

    `samples` writes draws, and `budget` an error budget, into a group each.

    Raise ValueError, with one line, if the suffix is not .h5, or the folder is missing or not writable.
    """
    check_writable(path, (".h5",))
    text = report(result)
    with replacing(path) as temporary, hdf5.creating(temporary, FIT_FORMAT) as file:
        for name, kind in FIELDS.items():
            file.attrs[name] = kind(getattr(result, name))
        structure, numbers = result.problem.structure, result.problem.numbers
        file.attrs.update(message=result.message, title=title, loss=structure.loss)
        file.attrs["loss_width"], file.attrs["assumed"] = float(numbers.width), result.assumed
        file["report"] = text
        _write_scenes(file, "scene_at_start", result.scene_at_start)
        hdf5.write_texts(file, "data_scenes", result.data_scenes)
        try:
            _write_scenes(file, "scene", result.scene)
        except ValueError:  # the constructors may refuse the fitted values
            if "scene" in file:
                del file["scene"]
        group = file.create_group("data")
        for i, dataset in enumerate(result.data):
            dataset.write_group(group.create_group(str(i)))
        _write_rules(file.create_group("free"), result.free)
        _write_rules(file.create_group("prior"), result.prior)
        write_quadrature(file, structure.quadrature)
        if result.discrepancy is not None:
            own = {k: v for k, v in dataclasses.asdict(result.discrepancy).items() if v not in (None, ())}
            file.create_group("discrepancy").attrs.update(own)
        if result.further is not None:
            group = file.create_group("further")
            hdf5.write_texts(group, "reasons", result.further.reasons)
            group.attrs.update({k: v for k, v in result.further._asdict().items() if k != "reasons"})
        if result.bounds:
            _write_bounds(file.create_group("bounds"), result.bounds)
        estimated = [np.nan if scale is None else scale for scale in result.estimated]
        hdf5.write_values(file, "estimated", np.array(estimated), "-")
        _write_parameters(file.create_group("parameters"), result)
        _write_uncertainty(file.create_group("uncertainty"), result.uncertainty)
        _write_minima(file.create_group("minima"), result.minima, len(result.names))
        if samples is not None:
            samples(file.create_group("samples"))
        if budget is not None:
            budget(file.create_group("budget"))


def load(path: StrPath, cls: type[ResultType]) -> ResultType:
    """Load a fit from a file written by `save`, as an object of the class `cls`.

    Numbers are equal to the last bit if they are loaded in the precision of the fit (float64 becomes
    float32 unless JAX's x64 mode is on). If the file is invalid, a ValueError names the file, the fault and
    the rule.
    """
    with hdf5.reading(path, FIT_FORMAT) as file:
        known = (
            "report",
            "scene",
            "data_scenes",
            "estimated",
            "discrepancy",
            "further",
            "bounds",
            "budget",
            "samples",
            *GROUPS,
        )
        hdf5.check_names(file, known, (*_TEXTS, *FIELDS, *OPTIONS))
        return cls(**_read(file, {name: hdf5.subgroup(file, name) for name in GROUPS}))


def _read(file: h5py.File, groups: dict[str, h5py.Group]) -> dict[str, Any]:
    fields, options = hdf5.attributes(file, FIELDS), hdf5.attributes(file, OPTIONS)
    if fields["status"] not in MESSAGES:
        raise ValueError(f"status = {fields['status']!r}: must be one of {', '.join(map(str, MESSAGES))}")
    if fields["method"] not in SOLVERS:
        raise ValueError(f"method = {fields['method']!r}: {closest(fields['method'], tuple(SOLVERS))}")
    scene = _read_scenes(groups["scene_at_start"])
    of = hdf5.read_texts(file, "data_scenes") if "data_scenes" in file else [""] * len(groups["data"])
    data = tuple(read_group(group) for group in _numbered(groups["data"]))
    free, prior = _read_rules(groups["free"], CONSTRAINTS), _read_rules(groups["prior"], PRIORS)
    quadrature = read_quadrature(file)
    problem = make_problem(scene, data, free, prior, options["loss"], options["loss_width"], quadrature, of)
    scales = hdf5.read_array(file, "estimated", "-", (len(data),)).tolist()
    estimated = tuple(None if np.isnan(scale) else scale for scale in scales)
    error = np.array(problem.targets.error)
    for scale, rows in zip(estimated, problem.order, strict=True):
        error[rows] = error[rows] * fields["error_scale"] if scale is None else scale
    if hdf5.read_texts(groups["parameters"], "names") != list(problem.names):
        raise ValueError("/parameters/names: must list the elements that are free according to /free")
    size, discrepancy = problem.variables.size, None
    problem = problem._replace(targets=problem.targets._replace(error=error))
    if "discrepancy" in file:
        group = hdf5.subgroup(file, "discrepancy")
        hdf5.check_names(group, (), tuple(field.name for field in dataclasses.fields(Discrepancy)))
        discrepancy = Discrepancy(**{name: hdf5.plain(value) for name, value in group.attrs.items()})
        problem = with_discrepancy(problem, each_scene(scene, of), data, discrepancy)
    return {
        "scene_at_start": scene,
        "free": free,
        "prior": prior,
        "data": data,
        "data_scenes": tuple(of),
        "problem": problem,
        "discrepancy": discrepancy,
        "further": _read_further(hdf5.subgroup(file, "further")) if "further" in file else None,
        "bounds": _read_bounds(hdf5.subgroup(file, "bounds")) if "bounds" in file else (),
        "x": hdf5.read_array(groups["parameters"], "x", "-", (size,)),
        "minima": _read_minima(groups["minima"], size),
        "estimated": estimated,
        # Older files have no such attribute. There, an error equal to ASSUMED was assumed.
        "assumed": bool(file.attrs.get("assumed", ASSUMED in scales)),
        "uncertainty": _read_uncertainty(groups["uncertainty"], groups["parameters"], size),
        **fields,
    }
