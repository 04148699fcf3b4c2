"""Fits in HDF5: all that it takes to use or repeat a fit, as plain arrays and attributes.

::

    /                   attributes format = "rubberfric fit", format_version = 1, title, and how the
                        fit was made and ended: method, loss, loss_width, status, message, ...
    /report             the report as text
    /scene              the fitted scene, as in scene files (`rubberfric.io.hdf5`); missing if
                        the scene's constructors refuse the fitted values
    /scene_at_start     the scene that the fit was given; like /scene of several a group of one for each,
                        by their names
    /data/0, 1, ...     the data sets, as in data files (`fitting.data.files`)
    /data_scenes        name of the scene that each is of, "" of a single one
    /free/0, 1, ...     attributes path and rule, and what the rule holds: low, high, start, to, ...
    /prior/0, 1, ...    the same of the priors
    /quadrature         attributes: the accuracy settings
    /parameters         of every free element: names, values, start, stderr, units, withheld, and x,
                        the variables of the solver
    /uncertainty        covariance and correlation of the values, and what else
                        `fitting.uncertainty.covariance.Uncertainty` holds
    /minima             cost, count and values of the distinct minima
    /discrepancy        attributes amplitude, width, shared, estimated, parts, remark; missing if
                        there is none
    /estimated          relative error of every data set, NaN where errors were given
    /samples            draws from the posterior (`fitting.results.samples`), if it was they that were saved

The uncertainty is stored, not computed again: reading compiles nothing, and gives the same
numbers to the last bit on any machine.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, TypeVar

import h5py
import numpy as np

from fitting.data.files import read_group
from fitting.parameters.constraints import RULES
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.priors import PRIORS
from fitting.parameters.scenes import each_scene
from fitting.results import hdf5_parts as parts
from fitting.results.record import FitRecord
from fitting.results.report import report
from fitting.solvers.iterate import MESSAGES
from fitting.solvers.options import SOLVERS
from fitting.solvers.problem import ASSUMED, make_problem
from fitting.uncertainty.discrepancy import with_discrepancy
from rubberfric.base import StrPath, check_writable, closest, replacing
from rubberfric.io import hdf5, read_quadrature, write_quadrature

Result = TypeVar("Result", bound=FitRecord)

FORMAT = "rubberfric fit"

# Attributes of the file that are fields of the result.
FIELDS = {
    "method": str,
    "status": int,
    "cost": float,
    "nfev": int,
    "njev": int,
    "seconds": float,
    "error_scale": float,
}
DISCREPANCY = tuple(field.name for field in dataclasses.fields(Discrepancy))
# Of its problem.
OPTIONS = {"loss": str, "loss_width": float}
ATTRIBUTES = (
    *("format", "format_version", "rubberfric_version", "title", "message", "assumed"),
    *FIELDS,
    *OPTIONS,
)
GROUPS = ("scene_at_start", "data", "free", "prior", "quadrature", "parameters", "uncertainty", "minima")


def save(
    path: StrPath,
    result: FitRecord,
    title: str = "",
    samples: Callable[[h5py.Group], None] | None = None,
) -> None:
    """Write a fit as an HDF5 file (.h5), whole or not at all; `load` reads it back.

    `samples` writes the draws from its posterior to their group.

    Raises
    ------
    ValueError
        one line: the suffix is not .h5, the folder is missing or cannot be written to.
    """
    check_writable(path, (".h5",))
    text = report(result)
    with replacing(path) as temporary, hdf5.creating(temporary, FORMAT) as file:
        for name, kind in FIELDS.items():
            file.attrs[name] = kind(getattr(result, name))
        structure, numbers = result.problem.structure, result.problem.numbers
        file.attrs.update(message=result.message, title=title, loss=structure.loss)
        file.attrs["loss_width"], file.attrs["assumed"] = float(numbers.width), result.assumed
        file["report"] = text
        parts.write_scenes(file, "scene_at_start", result.scene_at_start)
        hdf5.write_texts(file, "data_scenes", result.data_scenes)
        try:
            parts.write_scenes(file, "scene", result.scene)
        except ValueError:  # a fit may end where no constructor would
            if "scene" in file:
                del file["scene"]
        group = file.create_group("data")
        for i, one in enumerate(result.data):
            one.write_group(group.create_group(str(i)))
        parts.write_rules(file.create_group("free"), result.free)
        parts.write_rules(file.create_group("prior"), result.prior)
        write_quadrature(file, structure.quadrature)
        if result.discrepancy is not None:
            own = dataclasses.asdict(result.discrepancy)
            file.create_group("discrepancy").attrs.update(
                {k: v for k, v in own.items() if v not in (None, ())}
            )
        estimated = [np.nan if scale is None else scale for scale in result.estimated]
        hdf5.write_values(file, "estimated", np.array(estimated), "-")
        parts.write_parameters(file.create_group("parameters"), result)
        parts.write_uncertainty(file.create_group("uncertainty"), result.uncertainty)
        parts.write_minima(file.create_group("minima"), result.minima, len(result.names))
        if samples is not None:
            samples(file.create_group("samples"))


def load(path: StrPath, cls: type[Result]) -> Result:
    """The fit that `save` wrote, as a `fitting.FitResult` or another class of records.

    Numbers are equal to the last bit with the precision of the fit (what was float64 becomes
    float32 unless JAX's x64 mode is on).

    Raises
    ------
    ValueError
        one line naming the file, what in it is wrong, and the rule.
    """
    with hdf5.reading(path, FORMAT) as file:
        hdf5.check_names(
            file,
            ("report", "scene", "data_scenes", "estimated", "discrepancy", "samples", *GROUPS),
            ATTRIBUTES,
        )
        return cls(**_read(file, {name: hdf5.subgroup(file, name) for name in GROUPS}))


def _read(file: h5py.File, groups: dict[str, h5py.Group]) -> dict[str, Any]:
    """Fields of the record."""
    found, options = hdf5.attributes(file, FIELDS), hdf5.attributes(file, OPTIONS)
    if found["status"] not in MESSAGES:
        raise ValueError(f"status = {found['status']!r}: must be one of {', '.join(map(str, MESSAGES))}")
    if found["method"] not in SOLVERS:
        raise ValueError(f"method = {found['method']!r}: {closest(found['method'], tuple(SOLVERS))}")
    scene = parts.read_scenes(groups["scene_at_start"])
    of = hdf5.read_texts(file, "data_scenes") if "data_scenes" in file else [""] * len(groups["data"])
    data = tuple(read_group(group) for group in parts.numbered(groups["data"]))
    free, prior = parts.read_rules(groups["free"], RULES), parts.read_rules(groups["prior"], PRIORS)
    quadrature = read_quadrature(file)
    problem = make_problem(scene, data, free, prior, options["loss"], options["loss_width"], quadrature, of)
    scales = hdf5.read_array(file, "estimated", "-", (len(data),)).tolist()
    estimated = tuple(None if np.isnan(scale) else scale for scale in scales)
    error = np.array(problem.targets.error)
    for scale, rows in zip(estimated, problem.order, strict=True):
        error[rows] = error[rows] * found["error_scale"] if scale is None else scale
    if hdf5.read_texts(groups["parameters"], "names") != list(problem.names):
        raise ValueError("/parameters/names: must be the elements that /free names")
    size, discrepancy = problem.variables.size, None
    problem = problem._replace(targets=problem.targets._replace(error=error))
    if "discrepancy" in file:
        group = hdf5.subgroup(file, "discrepancy")
        hdf5.check_names(group, (), DISCREPANCY)
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
        "x": hdf5.read_array(groups["parameters"], "x", "-", (size,)),
        "minima": parts.read_minima(groups["minima"], size),
        "estimated": estimated,
        # Files without it are from a time when the value was the sign.
        "assumed": bool(file.attrs.get("assumed", ASSUMED in scales)),
        "uncertainty": parts.read_uncertainty(groups["uncertainty"], groups["parameters"], size),
        **found,
    }
