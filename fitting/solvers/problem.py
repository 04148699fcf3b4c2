r"""A fit as a least-squares problem: residuals of data and priors over the free parameters.

.. math:: r_i = \frac{\ln(model_i / measured_i)}{relative_i} \quad\text{or}\quad
          r_i = \frac{model_i - measured_i}{sigma_i}

the first for data with relative errors. A problem is split into its structure, which is
hashable and decides what is compiled, and its numbers: a second fit of the same kind, a
bootstrap or a profile compiles nothing new.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from fitting.data.measured import one_line
from fitting.parameters.constraints import is_number
from fitting.parameters.layout import Constants, Layout, free_parameters, to_scene
from fitting.parameters.priors import PriorLayout, PriorNumbers, prior_residuals, prior_size, read_priors
from fitting.solvers.losses import WIDTHS, rho
from rubberfric.analysis.jacobian import value_and_jacobian
from rubberfric.roughness.spectra import log_power_spectrum
from rubberfric.scene.scene import cast, check_background, result_dtype, shifts, takes_temperature

BODIES = ("lower", "upper")
CURVES = ("friction", "area")  # measured over velocity, pressure and temperature

# Relative error that data without errors begin with, and keep if they are too few to say.
ASSUMED = 0.1


class Block(NamedTuple):
    """Rows that one call of the model predicts; hashable."""

    quantity: str  # "friction", "area", "modulus", "spectrum"
    body: str | None  # whose modulus or spectrum
    logarithmic: bool
    rows: tuple  # (first, last + 1)


class Structure(NamedTuple):
    """All about a problem that is not a number; hashable."""

    layout: Layout
    blocks: tuple
    prior: PriorLayout
    loss: str
    quadrature: rf.Quadrature


class Numbers(NamedTuple):
    """The numbers of a problem that every start and every resampled data set share; a pytree."""

    constants: Constants
    conditions: tuple  # of every block: (velocity, pressure, temperature or None), (omega, T), (q,)
    prior: PriorNumbers
    width: float  # of the robust loss
    leash: float  # pull on neighbouring elements of an array, 0 in the end; see `fitting.solvers.starts`


class Targets(NamedTuple):
    """What the model is compared with; a pytree, one for every resampled data set."""

    measured: jax.Array  # shape (rows,); the logarithm where the block is logarithmic
    error: jax.Array  # shape (rows,)
    held: jax.Array  # shape (size,), 0 where x is held at its start (profiles), else 1


class Problem(NamedTuple):
    """A fit to be solved."""

    structure: Structure
    numbers: Numbers
    targets: Targets
    start: np.ndarray  # x, shape (size,)
    order: tuple  # for every data set, its rows: arrays of indices


def make_problem(scene, data, free, prior=None, loss="linear", width=None, quadrature=None):
    """The problem of fitting `free` of `scene` to `data`; see `fitting.fit` for the arguments.

    Data sets without errors get the relative error `ASSUMED`.
    """
    if not isinstance(scene, rf.Scene):
        raise ValueError(f"scene is a {type(scene).__name__}: must be a Scene")
    if not isinstance(loss, str) or loss not in WIDTHS:
        raise ValueError(f"loss = {one_line(loss)}: must be one of {', '.join(WIDTHS)}")
    width = WIDTHS[loss] if width is None else width
    if not (is_number(width) and width > 0):
        raise ValueError(f"loss_width = {one_line(width)}: must be a finite number > 0")
    dtype = result_dtype(scene, 1.0)
    scene = cast(scene, dtype)
    layout, constants, start = free_parameters(scene, free)
    prior_layout, prior_numbers = read_priors(scene, layout, constants, prior)

    keys = [_block_key(scene, one) for one in data]
    blocks, conditions, order = [], [], [None] * len(data)
    first = 0
    for key in dict.fromkeys(keys):
        members = [i for i, other in enumerate(keys) if other == key]
        begin = first
        # The model gives all storage moduli of a block first, then all loss moduli.
        halves = 2 if key[0] == "modulus" else 1
        sizes = [len(data[i].measured) // halves for i in members]
        for i, size, before in zip(members, sizes, np.cumsum([0, *sizes]), strict=False):
            rows = begin + before + np.arange(size)
            order[i] = np.concatenate([rows + half * sum(sizes) for half in range(halves)])
        first = begin + halves * sum(sizes)
        quantity, body, logarithmic, _ = key
        columns = [_conditions(data[i]) for i in members]
        conditions.append(
            tuple(None if parts[0] is None else np.concatenate(parts) for parts in zip(*columns, strict=True))
        )
        blocks.append(Block(quantity, body, logarithmic, (begin, first)))
    measured, error = np.empty(first), np.empty(first)
    for one, rows in zip(data, order, strict=True):
        measured[rows] = np.log(one.measured) if one.logarithmic else one.measured
        error[rows] = ASSUMED if one.error is None else one.error
    known = prior_size(prior_layout)
    if first + known < layout.size:
        raise ValueError(
            f"{layout.size} free parameters, but only {first} measured values and {known} rows of priors:"
            " free fewer, tie some, or add a prior"
        )
    structure = Structure(layout, tuple(blocks), prior_layout, loss, quadrature or rf.Quadrature())
    numbers = Numbers(constants, tuple(conditions), prior_numbers, float(width), 0.0)
    numbers = cast(numbers, dtype)
    targets = Targets(*(a.astype(dtype) for a in (measured, error, np.ones(layout.size))))
    return Problem(structure, numbers, targets, start.astype(dtype), tuple(order))


def _block_key(scene, data):
    """What data sets must share to be predicted by one call; ValueError if the scene cannot."""
    quantity, body, temperature = (
        data.quantity,
        getattr(data, "body", None),
        getattr(data, "temperature", None),
    )
    if quantity in CURVES:
        if temperature is None:
            check_background(scene, f"data {data.label!r}: ", "have no temperature")
        else:
            if not takes_temperature(scene):
                raise ValueError(
                    f"data {data.label!r}: have a temperature, but no part of the scene has a shift:"
                    " give the scene one, or the data no temperature"
                )
            _check_temperature(data, shifts(scene))
        return quantity, None, data.logarithmic, temperature is not None
    bodies = {name: getattr(scene, name) for name in BODIES}
    if quantity == "modulus":
        bodies = {name: b for name, b in bodies.items() if b.material.relaxes}
        kind = "viscoelastic solid"
    else:
        bodies = {name: b for name, b in bodies.items() if b.spectrum is not None}
        kind = "solid with a spectrum"
    if body is None and len(bodies) == 1:
        body = next(iter(bodies))
    if body not in bodies:
        given = f"body = {body!r}" if body is not None else "no body is given"
        choice = " or ".join(repr(name) for name in bodies) or f"but the scene has no {kind}"
        raise ValueError(f"data {data.label!r}: {given}: must be a {kind}, {choice}")
    if quantity == "modulus" and temperature is not None:
        shift = bodies[body].material.shift
        if shift is None:
            raise ValueError(f"data {data.label!r}: have a temperature, but {body}.material has no shift")
        _check_temperature(data, [shift])
    return quantity, body, data.logarithmic, temperature is not None


def _check_temperature(data, shifts):
    for shift in shifts:
        try:
            shift.check_temperature(data.temperature)
        except ValueError as error:
            raise ValueError(f"data {data.label!r}: {error}") from None


def _conditions(data):
    if data.quantity in CURVES:
        return data.velocity, data.pressure, data.temperature
    return (data.omega, data.temperature) if data.quantity == "modulus" else (data.q,)


def predictions(structure, numbers, x):
    """What the model says in place of every measured value, shape (rows,), and the scene."""
    scene = to_scene(structure.layout, numbers.constants, x)
    pairs = zip(structure.blocks, numbers.conditions, strict=True)
    return jnp.concatenate([_predicted(structure, block, at, scene) for block, at in pairs]), scene


def _predicted(structure, block, conditions, scene):
    """Rows of one block; their logarithm where it is logarithmic."""
    if block.quantity in CURVES:
        heated = () if scene.heating is None else ("converged",)
        solution = rf.solve(
            scene, *conditions, quadrature=structure.quadrature, quantities=(block.quantity, *heated)
        )
        values = getattr(solution, block.quantity)
        if heated:
            # Of a last iterate nothing is learned: no step leads there, and a start there is refused.
            values = jnp.where(solution.converged, values, jnp.nan)
    elif block.quantity == "modulus":
        modulus = rf.complex_modulus(getattr(scene, block.body).material, *conditions)
        values = jnp.concatenate([modulus.real, modulus.imag])
    else:
        # Continued beyond the ends, which may move past a measured wavevector on the way.
        law = getattr(scene, block.body).spectrum.power_law()
        log_C = log_power_spectrum(law, *conditions)
        return log_C if block.logarithmic else jnp.exp(log_C)
    return jnp.log(values) if block.logarithmic else values


def residuals(structure, numbers, targets, x):
    """Rows of the data, of the priors, and of the leash, in units of their errors."""
    model, scene = predictions(structure, numbers, x)
    rows = (model - targets.measured) / targets.error
    prior = prior_residuals(structure.prior, numbers.prior, scene, x)
    return jnp.concatenate([rows, prior, numbers.leash * (_bends(structure.layout, x.dtype) @ x)])


def residuals_and_jacobian(structure, numbers, targets, x):
    """The same rows, and their derivatives with respect to x, shape (rows, size)."""

    def scene_of(x):
        return to_scene(structure.layout, numbers.constants, x)

    parts = []
    for block, conditions in zip(structure.blocks, numbers.conditions, strict=True):
        if block.quantity in CURVES:
            values, slopes = value_and_jacobian(scene_of, x, conditions, block.quantity, structure.quadrature)
            if block.logarithmic:
                values, slopes = jnp.log(values), slopes / values[:, None]
        else:
            values, slopes = forward(
                lambda x, b=block, c=conditions: _predicted(structure, b, c, scene_of(x)), x
            )
        parts.append((values, slopes))
    model, slopes = (jnp.concatenate(part) for part in zip(*parts, strict=True))
    prior, prior_slopes = forward(
        lambda x: prior_residuals(structure.prior, numbers.prior, scene_of(x), x), x
    )
    bends = numbers.leash * _bends(structure.layout, x.dtype)
    rows = [(model - targets.measured) / targets.error, prior, bends @ x]
    slopes = [slopes / targets.error[:, None], prior_slopes, bends]
    return jnp.concatenate(rows), jnp.concatenate(slopes)


def _bends(layout, dtype):
    """Second differences of x along the arrays of Positive elements, shape (rows, size)."""
    rows = [np.zeros((0, layout.size))]
    for group in layout.groups:
        first, last = group.slot
        if group.kind == "Positive" and last - first >= 3:
            rows.append(np.diff(np.eye(layout.size)[first:last], 2, axis=0))
    return np.concatenate(rows).astype(dtype)


def forward(function, x):
    """Value of a function and its derivatives with respect to x, the last axis, by forward mode."""
    jacobian, value = jax.jacfwd(lambda x: (function(x),) * 2, has_aux=True)(x)
    return value, jacobian


def data_rows(structure):
    """Number of rows that are data."""
    return structure.blocks[-1].rows[1]


def cost_of(structure, numbers, rows):
    """Half the sum of rho over the data and of squares over the priors."""
    count = data_rows(structure)
    robust = rho(structure.loss, numbers.width, rows[:count])[0]
    return 0.5 * (jnp.sum(robust) + jnp.sum(rows[count:] ** 2))


def cost_at(structure, numbers, targets, x):
    """The cost at x."""
    return cost_of(structure, numbers, residuals(structure, numbers, targets, x))


def rounding_cost(structure, targets):
    """The cost that rounding leaves when the data are met exactly: nothing below it means anything."""
    error = 100 * float(jnp.finfo(targets.measured.dtype).eps)  # of a prediction, relative
    offset = np.zeros(data_rows(structure))
    for block in structure.blocks:
        offset[slice(*block.rows)] = block.logarithmic  # ln 1 = 0 is no better known than ln 2
    scale = jnp.abs(targets.measured) + offset.astype(targets.measured.dtype)
    return 0.5 * jnp.sum((error * scale / targets.error) ** 2)
