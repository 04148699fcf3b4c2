"""Arguments of a fit, checked before anything is computed: one line says what is wrong."""

import numbers

import jax
import numpy as np

import rubberfric as rf
from fitting.data.measured import Measured, one_line
from fitting.parameters.constraints import is_number
from fitting.uncertainty.covariance import residual_rows
from rubberfric.scene.scene import dissipates


def check_options(method, methods, starts, key, prior, callback, decades, max_steps, tolerance, quadrature):
    """ValueError naming the option that is wrong; see `fitting.fit` for what they are.

    The loss is checked where a problem is made, which a fit read from a file comes to as well.
    """
    if not isinstance(method, str) or method not in methods:
        raise ValueError(f"method = {one_line(method)}: must be one of {', '.join(methods)}")
    for name, value in {"starts": starts, "max_steps": max_steps}.items():
        if name == "max_steps" and value is None:
            continue
        if not isinstance(value, numbers.Integral) or isinstance(value, bool) or value < 1:
            raise ValueError(f"{name} = {one_line(value)}: must be an integer >= 1")
    if key is not None and not isinstance(key, jax.Array):
        raise ValueError(f"key = {one_line(key)}: must be a jax.random.key, such as jax.random.key(1)")
    if prior is not None and not isinstance(prior, dict):
        raise ValueError(
            f"prior = {one_line(prior)}: must be a dict of key path -> Gaussian or Smooth, or None"
        )
    if callback is not None and not callable(callback):
        raise ValueError(f"callback = {one_line(callback)}: must be a function of (step, cost), or None")
    for name, value in {"decades": decades, "tolerance": tolerance}.items():
        if name != "decades" and value is None:
            continue
        if not (is_number(value) and value > 0):
            raise ValueError(f"{name} = {one_line(value)}: must be a finite number > 0")
    if quadrature is not None and not isinstance(quadrature, rf.Quadrature):
        raise ValueError(f"quadrature is a {type(quadrature).__name__}: must be a Quadrature, or None")


def data_sets(data):
    """The data sets as a list; ValueError if there are none, or something else is among them."""
    kinds = "FrictionData, AreaData, ModulusData or SpectrumData"
    if isinstance(data, Measured):
        return [data]
    if not isinstance(data, list | tuple):
        raise ValueError(f"data is a {type(data).__name__}: must be {kinds}, or a list of them")
    if not data:
        raise ValueError("data is empty: must hold at least one data set")
    for i, one in enumerate(data):
        if not isinstance(one, Measured):
            raise ValueError(f"data[{i}] is a {type(one).__name__}: must be {kinds}")
    return list(data)


def not_finite(problem, data):
    """One line on what of a problem is not finite at its start."""
    rows = residual_rows(problem, problem.start)
    for one, where in zip(data, problem.order, strict=True):
        bad = np.flatnonzero(~np.isfinite(rows[where]))
        if bad.size == 0:
            continue
        index = int(bad[0])
        said = (
            f"data {one.label!r}: the model is not finite at the start at {bad.size} of {where.size} values"
        )
        at = ", ".join(
            f"{name} = {getattr(one, name)[index % getattr(one, name).size]:g} {one.unit(name)}"
            for name in ("velocity", "pressure", "temperature", "omega", "q")
            if getattr(one, name, None) is not None
        )
        advice = "check the start values of the free parameters"
        if one.logarithmic:
            advice += (
                ", and give absolute errors (sigma) where the model may be 0 or less, as at velocities <= 0"
            )
        return f"{said}, first at {at}: {advice}"
    return "a prior is not finite at the start: Smooth needs all moduli of its series > 0"


def check_friction(scene, data):
    """ValueError for measured friction that the scene cannot have: nothing could be learned from it."""
    if scene.shear is not None or dissipates(scene):
        return
    for one in data:
        if one.quantity == "friction":
            raise ValueError(
                f"data {one.label!r}: the scene has no friction: a rough solid must face a viscoelastic one,"
                " or the scene must have contact shear"
            )
