"""Compute the errors of every extreme case of the tests, and write stability.md.

    python notebooks/stability.py

It takes about five minutes, nearly all of it compilation.
"""

import sys
import warnings
from pathlib import Path

import jax
import numpy as np

import rubberfric as rf

jax.config.update("jax_enable_x64", True)

FOLDER = Path(__file__).resolve().parent
PAGE = FOLDER / "stability.md"
sys.path.insert(0, str(FOLDER.parent / "tests"))

from support.cases.extreme_errors import (  # noqa: E402
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
from support.cases.extremes import BASES, CASES, GROUPS, changed  # noqa: E402
from support.cases.stored import reverse  # noqa: E402

INTRODUCTION = f"""\
# Errors on stiff and extreme scenes

Every scene below is a variation of one of {len(BASES)} base scenes:

- `one`: rough rubber with three relaxation times on a rough rigid solid.
- `two`: the same rubber on a second rubber.
- `on-elastic`: the same rubber on an elastic solid.
- `slabs`: both rubbers as slabs that are bonded to rigid bases.
- `layer`: the first rubber as a slab that slides on its base without friction.
- `corrected`: as `one`, with S in G.
- `sheared`: as `one`, with WLF shifts and contact shear.
- `measured`: as `one`, with a tabulated spectrum.

`tests/support/cases/extremes.py` defines the {len(CASES)} scenes. Each row of the table gives the largest
errors of its scenes.

- **value**: the largest relative error of contact area, friction and separation. For frictions below 1e-18
  and separations below 1e-6 of the rms height, errors are divided by these limits instead of the value.
- **gradient**: the largest relative error of the derivatives of area, friction and separation with respect to
  every number of the scene, velocity, pressure and temperature. Errors of small derivatives are divided by
  1e-3 of the largest theta dQ/dtheta, or of Q.
- **float64** results are compared with references of at least 25 digits, which are stored in
  `tests/reference/extremes.json`. `tests/reference/precise/make_extremes.py` computes them in 120-digit
  arithmetic, from the theory's integrals in their original form, on two meshes that must agree. Derivatives
  of the references are differences with a relative step of 1e-32. Tests bound the errors of values by 1e-9,
  and the errors of gradients by 1e-7. The bounds are 1e-4 and 1e-5 for Poisson's ratio in two cases of
  incompressible films, because Sbar is 1e16 times as sensitive to it there.
- **float32** results are compared with float64 results for the same rounded inputs. The effect of rounding
  the inputs is not counted. It is up to 1e-5, for a spectrum from 200 to 200.2 1/m. Tests bound the errors of
  values by 1e-5. If a weight E_i is 0, errors of frictions below 1e-12 are divided by 1e-12. The library
  refuses scenes that float32 cannot represent; they are marked `refused`. Gradients are finite. Their errors
  are at most 2e-3 with three exceptions: bands of 1e-3, a spectrum beside one that is 1e20 larger, and areas
  A/A0 below 2e-13, whose derivatives underflow to 0.

The default `Quadrature` is used, except for `gamma-0-light` in float64, which has `graded=16`. This command
generates the page:

    python notebooks/stability.py

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
    assert (worst[:3:2] <= np.array([1e-9, 1e-5][: len(worst) // 2])).all()  # values
    return [shown(error) for error in worst] + ["refused"] * (4 - len(worst))


def shown(error):
    return "0" if error == 0 else f"{error:.0e}"


def main():
    """Compute and print the rows, and write the page."""
    warnings.simplefilter("ignore", rf.UnitWarning)  # the scenes are extreme on purpose
    lines = []
    for group, cases in GROUPS.items():
        for name, (bases, _) in cases.items():
            refused = {base for base in bases.split() if f"{name}-{base}" in REFUSED}
            scenes = ", ".join(f"{base} (refused)" if base in refused else base for base in bases.split())
            lines.append(f"| {' | '.join([group, name, scenes, *row(name, bases)])} |")
            group = ""
            print(lines[-1], flush=True)
    PAGE.write_text(INTRODUCTION + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
