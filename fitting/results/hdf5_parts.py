"""Parts of a fit file (`fitting.results.hdf5`): rules, parameters, uncertainty, minima."""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

import h5py
import numpy as np

from fitting.parameters.constraints import Rule
from fitting.parameters.priors import Prior
from fitting.parameters.scenes import Scenes
from fitting.results.numbers import unit
from fitting.results.record import FitRecord, Minimum
from fitting.uncertainty.covariance import Direction, Uncertainty
from rubberfric.base import closest
from rubberfric.io import hdf5, read_object, write_object

T = TypeVar("T", bound=Rule | Prior)

# Arrays and numbers of the uncertainty that are stored as they are.
ARRAYS = {
    "deviation": "-",
    "covariance": "products of /parameters/units",
    "correlation": "-",
    "directions": "-",
    "deviations": "-",
    "spread": "-",
    "x": "-",
    "stretch": "-",
}
NUMBERS = {"rank": int, "condition": float, "parameters": float, "chisqr": float}


def write_scenes(parent: h5py.Group, name: str, scenes: Scenes) -> None:
    """A scene as the group `name`, or a group that has those of several, by their names."""
    if not isinstance(scenes, dict):
        write_object(parent, name, scenes)
        return
    group = parent.create_group(name, track_order=True)
    for own, scene in scenes.items():
        write_object(group, own, scene)


def read_scenes(group: h5py.Group) -> Any:
    """What `write_scenes` wrote; whether it is a scene, or several, `make_problem` finds."""
    if "kind" in group.attrs:
        return read_object(group)
    return {name: read_object(one) for name, one in group.items()}


def write_rules(group: h5py.Group, rules: Mapping[str, Rule | Prior]) -> None:
    """Rules or priors, one numbered group each, since a key path is no name of a group."""
    for i, (path, rule) in enumerate(rules.items()):
        one = group.create_group(str(i))
        one.attrs.update(path=path, rule=type(rule).__name__)
        for field in dataclasses.fields(rule):
            value = getattr(rule, field.name)
            if np.ndim(value) == 2:  # too large for an attribute
                hdf5.write_values(one, field.name, value, "-")
            elif value is not None:
                one.attrs[field.name] = value if isinstance(value, str) else np.asarray(value, float)


def read_rules(group: h5py.Group, classes: Mapping[str, type[T]]) -> dict[str, T]:
    """dict of key path -> rule or prior that `write_rules` wrote, or ValueError naming the wrong group."""
    rules = {}
    for one in numbered(group):
        found = {name: _python(value) for name, value in one.attrs.items()}
        found |= {name: hdf5.read_values(one, name, "-").tolist() for name in list(one)}
        kind, path = found.pop("rule", None), found.pop("path", None)
        if kind not in classes:
            raise ValueError(f"{one.name}: rule = {kind!r}: {closest(kind, tuple(classes))}")
        fields = tuple(field.name for field in dataclasses.fields(classes[kind]))
        hdf5.check_names(one, fields, ("path", "rule", *fields))
        try:
            rules[path] = classes[kind](**found)
        except (ValueError, TypeError) as error:
            raise ValueError(f"{one.name}: {error}") from None
    return rules


def write_parameters(group: h5py.Group, result: FitRecord) -> None:
    """Names, values, units and x of the free elements."""
    hdf5.write_values(group, "x", result.x, "-")
    units = []
    for free in result.variables.own:
        units += [unit(result.scene_at_start, free.path) or "-"] * (free.slot[1] - free.slot[0])
    hdf5.write_texts(group, "names", result.names)
    hdf5.write_texts(group, "units", units)
    hdf5.write_texts(group, "withheld", [result.withheld.get(name, "") for name in result.names])
    for name in ("values", "start_values", "stderr"):
        hdf5.write_values(group, name, np.asarray(getattr(result, name)), "as in units")


def write_uncertainty(group: h5py.Group, known: Uncertainty) -> None:
    """All but why an error bar is withheld, which stands with the parameters."""
    for name, units in ARRAYS.items():
        hdf5.write_values(group, name, getattr(known, name), units)
    for name, kind in NUMBERS.items():
        group.attrs[name] = kind(getattr(known, name))
    below = group.create_group("unidentified")
    loadings = [direction.loadings for direction in known.unidentified]
    hdf5.write_values(below, "loadings", np.array(loadings, float).reshape(-1, known.deviation.size), "-")
    hdf5.write_values(below, "deviation", np.array([d.deviation for d in known.unidentified], float), "-")
    hdf5.write_texts(below, "text", [direction.text for direction in known.unidentified])


def read_uncertainty(group: h5py.Group, parameters: h5py.Group, size: int) -> Uncertainty:
    """The `Uncertainty` that `write_uncertainty` and `write_parameters` wrote."""
    hdf5.check_names(group, (*ARRAYS, "unidentified"), tuple(NUMBERS))
    vectors = ("deviation", "deviations", "x", "stretch")
    arrays = {
        name: hdf5.read_array(group, name, units, (size,) if name in vectors else (size, size))
        for name, units in ARRAYS.items()
    }
    below = hdf5.subgroup(group, "unidentified")
    texts = hdf5.read_texts(below, "text")
    loadings = hdf5.read_array(below, "loadings", "-", (len(texts), size))
    deviations = hdf5.read_array(below, "deviation", "-", (len(texts),)).tolist()
    names, reasons = hdf5.read_texts(parameters, "names"), hdf5.read_texts(parameters, "withheld")
    return Uncertainty(
        **arrays,
        **hdf5.attributes(group, NUMBERS),
        withheld={name: reason for name, reason in zip(names, reasons, strict=True) if reason},
        unidentified=tuple(map(Direction, loadings, deviations, texts)),
    )


def write_minima(group: h5py.Group, minima: Iterable[Minimum], size: int) -> None:
    """Cost, values and number of starts of every minimum, one row each."""
    hdf5.write_values(group, "cost", np.array([minimum.cost for minimum in minima], float), "-")
    hdf5.write_values(
        group, "values", np.array([m.values for m in minima], float).reshape(-1, size), "as in units"
    )
    group["count"] = np.array([minimum.count for minimum in minima], int)


def read_minima(group: h5py.Group, size: int) -> tuple[Minimum, ...]:
    """The tuple of `Minimum` that `write_minima` wrote."""
    cost = np.asarray(hdf5.read_values(group, "cost", "-"))
    values = hdf5.read_array(group, "values", "as in units", (cost.size, size))
    count = hdf5.read_counts(group, "count", cost.size)
    return tuple(map(Minimum, cost.tolist(), count.tolist(), values))


def numbered(group: h5py.Group) -> Iterator[h5py.Group]:
    """The groups "0", "1", ... that a group holds, in this order."""
    return (hdf5.subgroup(group, str(i)) for i in range(len(group)))


def _python(value):
    """An attribute as a string, a float or a list of floats."""
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value
