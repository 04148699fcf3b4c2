"""A fit as a least-squares problem: measured values and their predictions over the free parameters.

A problem consists of a hashable structure, which determines the compiled functions, and of numbers. A second
fit of the same kind, a bootstrap or a profile therefore compiles nothing new.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import rubberfric as rf
from fitting.data.measured import Measured
from fitting.parameters.constraints import Constraint, with_starts
from fitting.parameters.priors import Prior, prior_size, read_priors
from fitting.parameters.scenes import as_scenes, by_name
from fitting.parameters.variables import (
    Array,
    Constants,
    Variables,
    element_names,
    free_parameters,
    to_scene,
    to_values,
)
from fitting.solvers.objective import LOSS_WIDTHS
from fitting.solvers.options import check_options
from rubberfric.scene import cast, check_background, dissipates, result_dtype, shifts, takes_temperature

CURVE_QUANTITIES = ("friction", "area")  # measured over velocity, pressure and temperature
SLIP_QUANTITIES = ("force", "moment")  # of a patch, measured over slip, speed, load and temperature
CONTACT_QUANTITIES = (*CURVE_QUANTITIES, *SLIP_QUANTITIES)  # predicted by the theory of contact

# Relative error that the first fit assumes for data without errors. It is kept if no estimate is possible.
ASSUMED = 0.1


# The quadrature of a fit suits ranges of wavevectors and moduli that are larger than at the start by this
# number of e-folds.
_MARGIN = 0.5
# E-folds outside these ranges at which a fit may end. Errors grow two- to threefold per e-fold.
_BEYOND = 1.0


class Block(NamedTuple):
    """Rows of a problem that one call of the model predicts. A block is hashable."""

    quantity: str  # of its data, such as "friction"; see `fitting.data.kinds.KINDS`
    body: str | None  # body of a modulus or spectrum
    logarithmic: bool
    rows: tuple[int, int]  # (first, last + 1)
    scene: str = ""  # name of the scene if there are several


class FitStructure(NamedTuple):
    """All parts of a problem except the numbers. A structure is hashable."""

    variables: Variables
    blocks: tuple[Block, ...]
    loss: str
    quadrature: rf.Quadrature


class Numbers(NamedTuple):
    """Numbers of a problem that all starts and all resampled data sets share, as a pytree."""

    constants: Constants
    conditions: tuple[Any, ...]  # for every block, arrays of the conditions of its kind of data, or None
    prior: tuple[Any, ...]  # `fitting.parameters.selection.Rows` of all priors
    width: Any  # of the robust loss, a scalar
    smoothing: Any  # of the rows of x along arrays, a scalar, 0 in the end; see `fitting.solvers.search`
    # Inverse Cholesky factor of the covariance of the data's rows in units of their errors, (rows, rows), or
    # None: they are independent; see `fitting.parameters.discrepancy`.
    whitening: Any = None


class Targets(NamedTuple):
    """Measured values, errors, and flags of fixed elements, as a pytree; one for each resampled data set."""

    measured: Array  # shape (rows,); the logarithm where the block is logarithmic
    error: Array  # shape (rows,)
    moving: Array  # shape (size,), 0 for elements of x that are fixed at their start (profiles), else 1
    prior: Array  # drawn errors of the priors, in units of their errors (bootstrap); otherwise 0

    def of_several(self, **own: Array) -> "Targets":
        """Return targets with a leading axis: `own` parts with a row for each fit, and shared ones."""
        return Targets(*(np.asarray(part)[None] for part in self))._replace(**own)


class Problem(NamedTuple):
    """A least-squares problem: structure, numbers, targets and start."""

    structure: FitStructure
    numbers: Numbers
    targets: Targets
    start: np.ndarray  # x, shape (size,)
    order: tuple[np.ndarray, ...]  # for every data set, its rows

    @property
    def variables(self) -> Variables:
        """Structure of the free parameters of the scene."""
        return self.structure.variables

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every element of x."""
        return tuple(element_names(self.variables))

    def values(self, x: Array) -> np.ndarray:
        """Return the values of the free elements at x. Values and x have the shape (..., size)."""
        return np.asarray(to_values(self.variables, self.numbers.constants, np.asarray(x)))

    def scene(self, x: Array) -> Any:
        """Return the scene, or a dict of scenes by name, with the free elements at x of shape (size,)."""
        return to_scene(self.variables, self.numbers.constants, x)


def make_problem(
    scene: rf.Scene | Mapping[str, rf.Scene],
    data: Sequence[Measured],
    free: Mapping[str, Constraint],
    prior: Mapping[str, Prior] | None = None,
    loss: str = "linear",
    width: float | None = None,
    quadrature: rf.Quadrature | None = None,
    of: Sequence[str] | None = None,
) -> Problem:
    """Return the problem of fitting `free` of `scene` to `data`. See `fitting.fit` for the arguments.

    `of` names the scene of each data set, if there are several. Data sets without errors get `ASSUMED`.
    """
    scene = as_scenes(scene)
    if quadrature is not None and not isinstance(quadrature, rf.Quadrature):
        raise ValueError(f"quadrature is a {type(quadrature).__name__}: must be a Quadrature, or None")
    check_options(loss=loss, loss_width=width)
    width = LOSS_WIDTHS[loss] if width is None else width
    dtype = result_dtype(scene, 1.0)
    scene = cast(scene, dtype)
    scene = with_starts(scene, free) if isinstance(free, dict) else scene
    variables, constants, start = free_parameters(scene, free)
    priors = read_priors(scene, variables, constants, prior)
    blocks, conditions, order = _blocks(by_name(scene), data, of or [""] * len(data))
    size = blocks[-1].rows[1]
    measured, error = np.empty(size), np.empty(size)
    for dataset, rows in zip(data, order, strict=True):
        measured[rows] = np.log(dataset.measured) if dataset.logarithmic else dataset.measured
        error[rows] = ASSUMED if dataset.error is None else dataset.error
    known = prior_size(priors)
    if size + known < variables.size:
        raise ValueError(
            f"{variables.size} free parameters, but only {size} measured values and {known} rows of priors;"
            " free fewer, tie some, or add a prior"
        )
    structure = FitStructure(variables, blocks, loss, quadrature or _fitting(scene, data))
    numbers = cast(Numbers(constants, conditions, priors, float(width), 0.0), dtype)
    parts = measured, error, np.ones(variables.size), np.zeros(known)
    targets = Targets(*(part.astype(dtype) for part in parts))
    return Problem(structure, numbers, targets, start.astype(dtype), order)


def _blocks(scenes, data, of):
    """Return the blocks, the conditions of each block, and the rows of each data set."""
    keys = [(_block_key(scenes[name], dataset), name) for dataset, name in zip(data, of, strict=True)]
    blocks, conditions, order = [], [], {}
    first = 0
    for key in dict.fromkeys(keys):
        members = [i for i, other in enumerate(keys) if other == key]
        # The model gives all storage moduli of a block first, then all loss moduli.
        parts = len(data[members[0]].values)
        sizes = [len(data[i]) // parts for i in members]
        for i, size, before in zip(members, sizes, np.cumsum([0, *sizes[:-1]]), strict=True):
            rows = first + before + np.arange(size)
            order[i] = np.concatenate([rows + part * sum(sizes) for part in range(parts)])
        columns = ([getattr(data[i], name) for i in members] for name in data[members[0]].conditions)
        conditions.append(tuple(None if c[0] is None else np.concatenate(c) for c in columns))
        last = first + parts * sum(sizes)
        (quantity, body, logarithmic, _), name = key
        blocks.append(Block(quantity, body, logarithmic, (first, last), name))
        first = last
    return tuple(blocks), tuple(conditions), tuple(order[i] for i in range(len(data)))


def _block_key(scene, data):
    """Return the key of the block of a data set. Raise ValueError if the scene cannot predict the data."""
    temperature = getattr(data, "temperature", None)
    present = tuple(getattr(data, name) is not None for name in data.conditions)
    if data.quantity in CONTACT_QUANTITIES:
        _check_contact(scene, data)
        return data.quantity, None, data.logarithmic, present
    body = _body(scene, data)
    if temperature is not None:
        shift = getattr(scene, body).material.shift
        if shift is None:
            raise ValueError(f"data {data.label!r}: have a temperature, but {body}.material has no shift")
        _check_temperature(data, [shift])
    return data.quantity, body, data.logarithmic, present


def _check_contact(scene, data):
    """Raise ValueError unless the scene can predict the data at their temperatures."""
    if data.quantity in SLIP_QUANTITIES and scene.patch is None:
        raise ValueError(
            f"data {data.label!r}: the scene has no patch; add the table [patch] to its file,"
            " or scene.replace(patch=rubberfric.Patch(length, width, stiffness))"
        )
    if data.quantity != "area" and scene.shear is None and not dissipates(scene):
        raise ValueError(  # friction would not depend on any parameter
            f"data {data.label!r}: the scene has no friction; a rough solid must face a viscoelastic one,"
            " or the scene must have contact shear"
        )
    if data.temperature is None:
        check_background(scene, f"data {data.label!r}: ", "have no temperature")
    elif not takes_temperature(scene):
        raise ValueError(
            f"data {data.label!r}: have a temperature, but no part of the scene has a shift:"
            " add a shift to the scene, or remove the temperature"
        )
    else:
        _check_temperature(data, shifts(scene))


def _body(scene, data):
    bodies = {"lower": scene.lower, "upper": scene.upper}
    if data.quantity == "modulus":
        kind, able = "viscoelastic solid", [name for name, body in bodies.items() if body.material.relaxes]
    else:
        kind = "solid with a spectrum"
        able = [name for name, body in bodies.items() if body.spectrum is not None]
    if data.body is None and len(able) == 1:
        return able[0]
    if data.body not in able:
        if not able:
            raise ValueError(f"data {data.label!r}: the scene has no {kind}; {data.quantity} data need one")
        stated = f"body = {data.body!r}" if data.body is not None else "no body is given"
        raise ValueError(
            f"data {data.label!r}: {stated}; body must be {' or '.join(map(repr, able))}, a {kind}"
        )
    return data.body


def _check_temperature(data, shifts):
    for shift in shifts:
        try:
            shift.check_temperature(data.temperature)
        except ValueError as error:
            raise ValueError(f"data {data.label!r}: {error}") from None


def finer(problem: Problem, x: Array, data: Sequence[Measured]) -> Problem | None:
    """Return the problem with a finer quadrature if the scene at x needs one, otherwise None."""
    needed = _fitting(problem.scene(x), data, -_BEYOND)
    structure = problem.structure
    if _work(needed) <= _work(structure.quadrature):
        return None
    return problem._replace(structure=structure._replace(quadrature=needed))


def _fitting(scene, data, margin=_MARGIN):
    """Return a quadrature for a scene, or all scenes of a dict, and ranges larger by `margin` e-folds."""
    pressures = [np.min(d.pressure) for d in data if hasattr(d, "pressure")]
    loads = [np.min(d.load) for d in data if hasattr(d, "load")]
    areas = [
        float(own_scene.patch.area) for own_scene in by_name(scene).values() if own_scene.patch is not None
    ]
    lowest = min([*pressures, *(load / max(areas) for load in loads)], default=1.0)
    settings = [
        rf.analysis.default_quadrature(own_scene, lowest, margin=margin, separation=False)
        for own_scene in by_name(scene).values()
    ]
    return max(settings, key=_work)


def _work(quadrature):
    return quadrature.panels, quadrature.order, quadrature.graded
