"""Parts of a fit file (`fitting.results.hdf5`): rules, parameters, uncertainty, minima."""

import dataclasses

import h5py
import numpy as np

from fitting.results.report import unit
from fitting.results.result import Minimum
from fitting.uncertainty.covariance import Direction, Uncertainty
from rubberfric.base.checks import closest
from rubberfric.io.hdf5 import check_names, plain, read_values, write_values

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


def write_rules(group, rules):
    """Rules or priors, one numbered group each, since a key path is no name of a group."""
    for i, (path, rule) in enumerate(rules.items()):
        one = group.create_group(str(i))
        one.attrs.update(path=path, rule=type(rule).__name__)
        for field in dataclasses.fields(rule):
            value = getattr(rule, field.name)
            if value is not None:
                one.attrs[field.name] = value if isinstance(value, str) else np.asarray(value, float)


def read_rules(group, classes):
    """dict of key path -> rule or prior that `write_rules` wrote, or ValueError naming the wrong group."""
    rules = {}
    for one in numbered(group):
        found = {name: _python(value) for name, value in one.attrs.items()}
        kind, path = found.pop("rule", None), found.pop("path", None)
        if kind not in classes:
            raise ValueError(f"{one.name}: rule = {kind!r}: {closest(kind, tuple(classes))}")
        fields = tuple(field.name for field in dataclasses.fields(classes[kind]))
        check_names(one, (), ("path", "rule", *fields))
        try:
            rules[path] = classes[kind](**found)
        except (ValueError, TypeError) as error:
            raise ValueError(f"{one.name}: {error}") from None
    return rules


def write_parameters(group, result):
    """Names, values, units and x of the free elements."""
    write_values(group, "x", result.x, "-")
    units = [
        unit(result.scene_at_start, free.path) or "-" for free in result.layout.own for _ in range(*free.slot)
    ]
    write_texts(group, "names", result.names)
    write_texts(group, "units", units)
    write_texts(group, "withheld", [result.withheld.get(name, "") for name in result.names])
    for name in ("values", "start_values", "stderr"):
        write_values(group, name, np.asarray(getattr(result, name)), "as in units")


def write_uncertainty(group, known):
    """What `fitting.uncertainty.covariance` found; why an error bar is withheld stands with the parameters."""
    for name, units in ARRAYS.items():
        write_values(group, name, getattr(known, name), units)
    for name, kind in NUMBERS.items():
        group.attrs[name] = kind(getattr(known, name))
    below = group.create_group("unidentified")
    loadings = [direction.loadings for direction in known.unidentified]
    write_values(below, "loadings", np.array(loadings, float).reshape(-1, known.deviation.size), "-")
    write_values(below, "deviation", np.array([d.deviation for d in known.unidentified], float), "-")
    write_texts(below, "text", [direction.text for direction in known.unidentified])


def read_uncertainty(group, parameters, size):
    """The `Uncertainty` that `write_uncertainty` and `write_parameters` wrote."""
    check_names(group, (*ARRAYS, "unidentified"), tuple(NUMBERS))
    vectors = ("deviation", "deviations", "x", "stretch")
    arrays = {
        name: read_array(group, name, units, (size,) if name in vectors else (size, size))
        for name, units in ARRAYS.items()
    }
    if not isinstance(group.get("unidentified"), h5py.Group):
        raise ValueError(f"{group.name}/unidentified: is missing; must be a group")
    below = group["unidentified"]
    texts = read_texts(below, "text")
    loadings = read_array(below, "loadings", "-", (len(texts), size))
    deviations = read_array(below, "deviation", "-", (len(texts),)).tolist()
    names, reasons = read_texts(parameters, "names"), read_texts(parameters, "withheld")
    return Uncertainty(
        **arrays,
        **attributes(group, NUMBERS),
        withheld={name: reason for name, reason in zip(names, reasons, strict=True) if reason},
        unidentified=tuple(map(Direction, loadings, deviations, texts)),
    )


def write_minima(group, minima, size):
    """Cost, values and number of starts of every minimum, one row each."""
    write_values(group, "cost", np.array([minimum.cost for minimum in minima], float), "-")
    write_values(
        group, "values", np.array([m.values for m in minima], float).reshape(-1, size), "as in units"
    )
    group["count"] = np.array([minimum.count for minimum in minima], int)


def read_minima(group, size):
    """The tuple of `Minimum` that `write_minima` wrote."""
    cost = read_values(group, "cost", "-")
    values = read_array(group, "values", "as in units", (cost.size, size))
    count = np.asarray(group["count"][()])
    if count.shape != cost.shape or count.dtype.kind != "i":
        raise ValueError(f"{group.name}/count: must be {cost.size} integers")
    return tuple(map(Minimum, cost.tolist(), count.tolist(), values))


def read_array(group, name, units, shape):
    """Numbers of a dataset of a certain shape."""
    array = read_values(group, name, units)
    if np.shape(array) != shape:
        raise ValueError(f"{group.name.rstrip('/')}/{name} has shape {np.shape(array)}: must be {shape}")
    return array


def write_texts(group, name, texts):
    """A dataset of texts."""
    group.create_dataset(name, data=np.array(list(texts), object), dtype=h5py.string_dtype())


def read_texts(group, name):
    """A list of texts; ValueError if the dataset is none of texts."""
    if name not in group or h5py.check_string_dtype(group[name].dtype) is None:
        raise ValueError(f"{group.name}/{name}: is missing; must be a dataset of texts")
    return group[name].asstr()[()].tolist()


def attributes(owner, kinds):
    """Attributes of a file or group, of the types that `kinds` says."""
    found = {}
    for name, kind in kinds.items():
        value = plain(owner.attrs.get(name))
        if type(value) is not kind:
            raise ValueError(f"{owner.name}: attribute {name} = {value!r}: must be of type {kind.__name__}")
        found[name] = value
    return found


def numbered(group):
    """The groups "0", "1", ... that a group holds, in this order."""
    for i in range(len(group)):
        if not isinstance(group.get(str(i)), h5py.Group):
            raise ValueError(f"{group.name}/{i}: is missing; must be a group")
        yield group[str(i)]


def _python(value):
    """An attribute as a string, a float or a list of floats."""
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value
