"""The table of errors of every extreme case; off by default:

    TABLE=notebooks/stability.md python -m pytest -m benchmark -s tests/benchmarks/test_stability_table.py

Without TABLE in the environment it only prints. About five minutes, nearly all of it compilation.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from support.cases.extreme_errors import (
    REFUSED,
    conditions,
    elements,
    errors,
    names_of,
    rounded,
    slope_errors,
    slope_scale,
    value_errors,
    value_floor,
)
from support.cases.extremes import BASES, CASES, GROUPS, changed
from support.cases.stored import reverse

pytestmark = pytest.mark.benchmark

INTRODUCTION = f"""\
# Errors on stiff and extreme scenes

Every scene below is a variation of one of {len(BASES)} base scenes: rough rubber with three relaxation
times on a rough rigid solid (`one`), on a second rubber (`two`) and on an elastic solid (`on-elastic`); both
rubbers as slabs bonded to rigid bases (`slabs`), the first as a slab that slides on its base (`layer`); with
S in G (`corrected`), with WLF shifts and contact shear (`sheared`), on a tabulated spectrum (`measured`).
`tests/support/cases/extremes.py` lists them, {len(CASES)} scenes. A row gives the largest errors of its
scenes.

- **value**: the largest relative error of contact area, friction and separation. Errors of
  frictions below 1e-18 and separations below 1e-6 of the rms height are relative to these values.
- **gradient**: the largest relative error of the derivatives of the three with respect to every number of
  scene, velocity, pressure and temperature. Errors of small
  derivatives are relative to 1e-3 of the largest theta dQ/dtheta, or of Q.
- **float64** is compared with references of at least 25 digits, stored in `tests/reference/extremes.json` and
  computed by `tests/reference/precise/make_extremes.py` in 120-digit arithmetic: the theory's integrals in
  their original form, on two meshes that must agree. Derivatives are differences with a relative step of
  1e-32. Tests bound these errors by 1e-9 (values) and 1e-7 (gradients; 1e-4 and 1e-5 for Poisson's ratio of
  two incompressible films, to which Sbar is 1e16 times as sensitive).
- **float32** is compared with float64 at the same rounded numbers. The effect of rounding the numbers, up to
  1e-5 for a spectrum from 200 to 200.2 1/m, is not counted. Tests bound the error of
  values by 1e-5. If a weight E_i is 0, errors of frictions below 1e-12 are relative to 1e-12. Scenes marked
  `refused` are beyond float32, and the library refuses them. Gradients are finite and mostly have errors
  below 1e-3, except where large terms cancel (all weights zero, bands of 1e-3, thin films).

`Quadrature` is the default, except for `gamma-0-light` in float64, with `graded=16`. Made by

    TABLE=notebooks/stability.md python -m pytest -m benchmark -s tests/benchmarks/test_stability_table.py

| extreme | case | scenes | float64 value | float64 gradient | float32 value | float32 gradient |
|---|---|---|---|---|---|---|
"""


def single_precision(name):
    """Largest relative errors of values and of derivatives in float32."""
    case = changed(*CASES[name])
    single, double = rounded(case)
    found, slopes = reverse(single)
    expected, exact = reverse(double)
    expected, exact = np.asarray(expected), elements(exact)
    scale = slope_scale(case, names_of(conditions(case)), expected, exact)
    floor = value_floor(case, found.dtype)
    value = errors(np.abs(np.asarray(found, float) - expected), np.abs(expected) + floor)
    return value.max(), errors(np.abs(elements(slopes) - exact), scale).max()


def row(name, bases):
    """Largest errors over the scenes of a case: value and gradient in float64, and in float32."""
    scenes = [f"{name}-{base}" for base in bases.split()]
    double = [(value_errors(scene).max(), slope_errors(scene)[1].max()) for scene in scenes]
    single = [single_precision(scene) for scene in scenes if scene not in REFUSED]
    worst = [*np.max(double, axis=0), *np.max(single, axis=0)] if single else np.max(double, axis=0)
    return [shown(error) for error in worst] + ["refused"] * (4 - len(worst))


def shown(error):
    return "0" if error == 0 else f"{error:.0e}"


def test_table():
    lines = []
    for group, cases in GROUPS.items():
        for name, (bases, _) in cases.items():
            refused = {base for base in bases.split() if f"{name}-{base}" in REFUSED}
            scenes = ", ".join(f"{base} (refused)" if base in refused else base for base in bases.split())
            lines.append(f"| {' | '.join([group, name, scenes, *row(name, bases)])} |")
            group = ""
            print(lines[-1], flush=True)
    if os.environ.get("TABLE"):
        Path(os.environ["TABLE"]).write_text(INTRODUCTION + "\n".join(lines) + "\n")
