"""Limits of single precision: scenes that are refused in float32 but not in float64.

Within these limits, tested on extreme scenes, float32 has errors below 1e-5. Values that are known only at
run time (under jit) are not checked.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import is_concrete
from rubberfric.materials.shifts import largest_log_factor
from rubberfric.scene.scene import Scene, relaxes

# Sbar^2 must not overflow.
STIFFEST_LAYER = 1e18
# Limit between neighbouring relaxation times if both solids deform; see
# `rubberfric.materials.solids_in_series`.
DECADES = 30


def check_single(scene: Scene, temperature: ArrayLike | None) -> None:
    """Raise ValueError naming a number of a float32 scene that requires float64."""
    for name in ("lower", "upper"):
        body = getattr(scene, name)
        if body.spectrum is not None:
            _check_table(f"{name}.spectrum.C", body.spectrum.entries())
        if body.material.deforms:
            _check_body(name, body, scene)
    if _two_deform(scene) and all(body.material.is_liquid() for body in (scene.lower, scene.upper)):
        raise ValueError(
            "lower.material and upper.material are liquids, with an E_inf or G_inf of 0: one must be > 0 "
            "in float32; use float64"
        )
    if temperature is not None:
        for name in ("lower.material", "upper.material", "lower.layer", "upper.layer", "shear"):
            shift = getattr(_part(scene, name), "shift", None)
            if shift is not None:
                _check_shift(name, shift, temperature)


def _check_body(name, body, scene):
    in_series, below = _two_deform(scene), None
    if body.layer is not None:
        spectra = [one.spectrum for one in (scene.lower, scene.upper) if one.spectrum is not None]
        _check_layer(f"{name}.layer", body, [spectrum.power_law().q[0] for spectrum in spectra])
        below = body.layer.below
    if below is not None and relaxes(body):
        in_series = True  # two solids of one body
        _check_times(f"{name}.layer.base.tau", below.relaxation_times())
        if body.material.is_liquid() and below.is_liquid():
            raise ValueError(
                f"{name}.material.E_inf and {name}.layer.base.E_inf are 0: one must be > 0 in float32; "
                "use float64"
            )
    # A relaxing shear modulus is always in series with the bulk modulus.
    if in_series or body.material.always_in_series:
        _check_times(f"{name}.material.tau", body.material.relaxation_times())


def _part(scene, name):
    first, _, second = name.partition(".")
    return getattr(getattr(scene, first), second) if second else getattr(scene, first)


def _two_deform(scene):
    return scene.lower.material.deforms and scene.upper.material.deforms


def _check_layer(name, body, wavevectors):
    for q in wavevectors:
        if not all(map(is_concrete, jax.tree.leaves((q, body.layer, body.material)))):
            continue
        stiffer = float(jnp.max(body.layer.glassy_stiffening(body.material, q)))
        if not stiffer < STIFFEST_LAYER:
            raise ValueError(
                f"{name}.thickness = {float(body.layer.thickness):g}: the thin layer is {stiffer:.2g} times "
                f"as stiff as a half-space at q = {float(q):g} 1/m, and float32 allows less than "
                f"{STIFFEST_LAYER:g} times; use float64"
            )


def _check_table(name, C):
    smallest = float(jnp.finfo(jnp.float32).tiny)
    if C is not None and is_concrete(C) and np.min(C) < smallest:
        raise ValueError(
            f"{name} has values below {smallest:.2g} m^4, the smallest number of float32; use float64"
        )


def _check_times(name, tau):
    if tau is None or not is_concrete(tau):
        return
    gaps = np.diff(np.sort(np.log10(np.asarray(tau, float))))
    if gaps.size and gaps.max() > DECADES:
        raise ValueError(
            f"{name} has neighbouring values {gaps.max():.3g} decades apart: must be at most {DECADES} in "
            "float32 for a solid in series with another stiffness; use float64"
        )


def _check_shift(name, shift, temperature):
    log_factor = shift.log_factor(temperature)
    limit = largest_log_factor(log_factor.dtype)
    if not is_concrete(log_factor):
        return
    saturated = np.abs(np.asarray(log_factor)) >= limit
    if saturated.any():
        T = np.broadcast_to(np.asarray(temperature), saturated.shape)[saturated].flat[0]
        raise ValueError(
            f"temperature = {float(T):g} K: ln a_T of {name}.shift must be within {limit:.3g} in float32; "
            "use float64"
        )
