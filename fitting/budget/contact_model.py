r"""Residuals by the law of boundary elements at the solution of a fit with the theory.

`contact_model="boundary_elements"` predicts the friction and area of the fitted scene. Where the law does not
allow the scene, the prediction of the theory is multiplied by the ratio of law and theory for the scene
without the parts that the law lacks:

.. math:: Q = Q_\mathrm{theory}(scene)\,\frac{Q_\mathrm{law}(reduced)}{Q_\mathrm{theory}(reduced)}
"""

import dataclasses
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import rubberfric as rf
from fitting.data.kinds import FrictionData
from fitting.data.measured import Measured
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.scenes import by_name
from fitting.parameters.variables import to_scene
from fitting.solvers.evaluation import evaluate_rows
from fitting.solvers.problem import CONTACT_QUANTITIES, CURVE_QUANTITIES, Problem
from fitting.solvers.residuals import curve_values, padded, slip_group
from fitting.uncertainty.discrepancy import model_covariance
from rubberfric.base import quick_jit
from rubberfric.scene import takes_temperature

_LAW = "boundary_elements"

# Amplitude of the error of the law if `theory_error` has none.
_UNKNOWN = 0.1

# Half-width of a 90 % range in standard deviations.
_NINETY = 1.645

# Parts of a scene that the law lacks.
_PARTS = ("heating", "softening", "adhesion", "correlation")

# Parts of a body that the law lacks.
_PARTS_OF_BODIES = ("softening",)


class LawScene(NamedTuple):
    """A scene with the law, and the scene by the theory that it is compared with."""

    law: rf.Scene
    theory: rf.Scene
    without: tuple[str, ...]  # parts of the original scene that both scenes lack


class NoLawError(Exception):
    """The law cannot predict the data of a fit. The message is a reason that follows "because"."""


class RowsByLaw(NamedTuple):
    """Predictions by the law in place of the theory."""

    rows: np.ndarray  # as `fitting.solvers.residuals.rows_of`, with padding
    without: tuple[str, ...]  # parts that the compared scenes lack


def law_scene(scene: rf.Scene) -> LawScene:
    """Return the scene with the law, reduced as far as necessary, or raise `NoLawError`.

    `scene` must have the contact model "paper".
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rf.UnitWarning)  # the fit has given them
        without = [name for name in _PARTS if getattr(scene, name) is not None]
        bodies = {"lower": scene.lower, "upper": scene.upper}
        own = {
            f"{name}.{part}": part
            for name, body in bodies.items()
            for part in _PARTS_OF_BODIES
            if getattr(body, part) is not None
        }
        spectra = {name: body.spectrum for name, body in bodies.items() if body.spectrum is not None}
        smoother = []
        if len(spectra) == 2:
            slopes = {name: float(rf.rms_slope(spectrum)) for name, spectrum in spectra.items()}
            smoother = [f"{min(slopes, key=slopes.__getitem__)}.spectrum"]
        plain = scene.replace(dict.fromkeys([*without, *own, *smoother]))
        without += [*own.values(), *smoother]
        for reduced, parts in _reduced(plain):
            try:
                law = dataclasses.replace(reduced, contact_model=_LAW, area_correction=False)
            except ValueError as error:
                why = str(error)
                continue
            return LawScene(law, reduced, tuple(dict.fromkeys([*without, *parts])))
    raise NoLawError(why)


def _reduced(scene):
    """Yield the scene, the scene without layers, and the scene without layers and grooves."""
    yield scene, []
    bodies = {"lower": scene.lower, "upper": scene.upper}
    parts = [f"{name}.layer" for name, body in bodies.items() if not body.half_space]
    half_spaces = scene.replace(dict.fromkeys(parts))
    if parts:
        yield half_spaces, parts
    for name, body in bodies.items():
        base = getattr(body.spectrum, "base", None)
        if base is not None:
            grooves = f"{name}.spectrum.ratio"
            yield scene.replace(f"{name}.spectrum", base), [grooves]
            yield half_spaces.replace(f"{name}.spectrum", base), [*parts, grooves]


def rows_by_law(problem: Problem, x: np.ndarray) -> RowsByLaw:
    """Return the predictions at x with the law instead of the theory, or raise `NoLawError`."""
    of = padded(problem)
    rows = np.array(evaluate_rows(of.structure, of.numbers, np.asarray(x)[None])[0][0])
    scenes, without = by_name(to_scene(of.structure.variables, of.numbers.constants, np.asarray(x))), []
    blocks = [block for block in of.structure.blocks if block.quantity in CONTACT_QUANTITIES]
    if not blocks:
        raise NoLawError("no quantity of the contact is fitted")
    if any(scenes[block.scene].contact_model == _LAW for block in blocks):
        raise NoLawError("a scene already uses the law")
    try:
        laws = {name: law_scene(scenes[name]) for name in dict.fromkeys(block.scene for block in blocks)}
    except ValueError as error:  # a fit may end at numbers that the constructors refuse
        raise NoLawError(str(error)) from None
    for block, conditions in zip(of.structure.blocks, of.numbers.conditions, strict=True):
        if block.quantity not in CONTACT_QUANTITIES:
            continue
        law = laws[block.scene]
        where, options = slice(*block.rows), (block.quantity, of.structure.quadrature)
        value = _values(*options, law.law, _at(law.law, conditions))
        if law.without:
            ratio = value / _values(*options, law.theory, _at(law.theory, conditions))
            rows[where] = rows[where] + np.log(ratio) if block.logarithmic else rows[where] * ratio
            without += law.without
        else:
            rows[where] = np.log(value) if block.logarithmic else value
    if not np.isfinite(rows).all():
        raise NoLawError("the law gives no finite value at some data")
    return RowsByLaw(rows, tuple(dict.fromkeys(without)))


def log_ratio_to_law(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Return ln(law / theory) at x of all values of contact, 0 for other data, shape (data rows,).

    Raise `NoLawError` if the law cannot be compared.
    """
    of = padded(problem)
    law = rows_by_law(problem, x).rows
    theory = evaluate_rows(of.structure, of.numbers, np.asarray(x)[None])[0][0]
    log_ratio = np.zeros(law.size)
    for block in of.structure.blocks:
        if block.quantity in CONTACT_QUANTITIES:
            rows = slice(*block.rows)
            log_ratio[rows] = (
                law[rows] - theory[rows] if block.logarithmic else np.log(law[rows] / theory[rows])
            )
    return log_ratio[of.data]


def _at(scene, conditions):
    """Return the conditions without temperatures if no part of the scene depends on them."""
    return conditions if takes_temperature(scene) else (*conditions[:-1], None)


def _values(quantity, quadrature, scene, conditions):
    """Return a quantity of `CONTACT_QUANTITIES` under the conditions of its kind of data."""
    with np.errstate(invalid="ignore", divide="ignore"):
        if quantity in CURVE_QUANTITIES:
            return np.asarray(_curve_values(quantity, quadrature, scene, conditions))
        # Forces and moments share the compiled friction.
        group = slip_group("", {0: (quantity, conditions)})
        mu = _curve_values("friction", quadrature, scene, group.points(scene))
        return np.asarray(group.rows(scene, mu))


_curve_values = quick_jit(static_argnums=(0, 1))(curve_values)


def covariance_of_law(
    problem: Problem, scenes: Sequence[rf.Scene], data: Sequence[Measured]
) -> tuple[np.ndarray, float] | None:
    """Return the covariance of the error of the law, in units of the errors, and its amplitude.

    The covariance has the shape (data rows, data rows). The amplitude is half of the logarithmic range of
    `rubberfric.analysis.theory_error`, as a standard deviation, or 0.1 without a range. The error changes
    within a decade of the velocity, as in `fitting.Discrepancy`. The result is None without friction data.
    """
    friction = [dataset for dataset in data if isinstance(dataset, FrictionData)]
    if not friction or not all(np.all(dataset.velocity) for dataset in friction):
        return None
    amplitude = max(map(_amplitude, scenes))
    asked = Discrepancy(amplitude, np.log(10))
    return model_covariance(problem, scenes, data, asked), amplitude


def _amplitude(scene):
    ranges = rf.analysis.theory_error(scene)
    return (
        _UNKNOWN if ranges is None else float(np.log(ranges.friction[1] / ranges.friction[0]) / 2 / _NINETY)
    )
