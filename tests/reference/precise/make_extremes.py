"""Writes extremes.json: every case of `tests/support/cases/extremes.py`, to 25 digits or more.

    python -m pip install gmpy2 mpmath numpy
    python tests/reference/precise/make_extremes.py [--only NAME ...]        (45 minutes, one process)

Values and derivatives by the theory's three lines in 120-digit arithmetic (MPFR), sharing no code with the
library and none of its arrangements against cancellation, which 120 digits do not need:

- The angular means are sums over the poles of the stiffness in the complex plane (`solids.py`). With two
  deformable solids the poles are bracketed, then polished by Newton's method.
- The radial integrals (`contact.py`) are Gauss sums over panels between all kinks of
  both spectra, which double in width away from every place where G = 0. G, and Psi along the
  path from x = inf on, dPsi = -s'(x)/x dx, are cumulative integrals of the panels' interpolants.
- With S in G (`correction.py`), g(G) = int dG / S is integrated from node to node and
  inverted by Newton's method.
- Derivatives are differences of second order with a relative step of 1e-32: central ones, or
  one-sided ones where the parameter is at the border of what is allowed.

Every case is computed on two meshes, of different panels and orders, and stored with the
number of digits to which they agree. A row of `derivatives` is the parameter, and the
derivatives of area, friction and separation with respect to it.
"""

import argparse
import functools
import json
import sys
import time
from pathlib import Path

import gmpy2
import numpy as np
from gmpy2 import mpfr

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from contact import Contact
from support.cases.extremes import CASES, changed
from support.folders import REFERENCE

STEP = mpfr(10) ** -32
QUANTITIES = ("area", "friction", "separation")
# Order of a panel, widest panel, and width of a panel over its distance from where G = 0.
MESHES = ((18, 0.22, 0.9), (22, 0.2, 0.8))
MANY_TERMS = (0, 40, 80, 120, 160, 199)  # of 200 terms these are differentiated


def exact(value):
    """All numbers of a case as they are in binary."""
    if isinstance(value, dict):
        return {key: exact(item) for key, item in value.items()}
    if isinstance(value, list):
        return [exact(item) for item in value]
    return mpfr(value) if isinstance(value, float) else value


def parameters(value, path=()):
    """Paths of all numbers of a case."""
    if isinstance(value, float):
        yield path
    elif isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        if isinstance(value, list) and len(value) > 100:
            items = [(i, value[i]) for i in MANY_TERMS]
        for key, item in items:
            yield from parameters(item, (*path, key))


def at(case, path):
    return functools.reduce(lambda value, key: value[key], path, case)


def moved(value, path, step):
    """A case with one number moved."""
    if not path:
        return value + step
    key, *rest = path
    copy = list(value) if isinstance(value, list) else dict(value)
    copy[key] = moved(value[key], rest, step)
    return copy


def stencil(case, path):
    """(side, step): side 0 is central."""
    value, name, owner = at(case, path), path[-1], at(case, path[:-1])
    if name == "qr" and (owner["qr"] == owner["q0"] or owner["qr"] == owner["q1"]):
        return (1 if owner["qr"] == owner["q0"] else -1), STEP * value
    if name == "q0" and owner["q0"] == owner["qr"]:
        return -1, STEP * value
    if name == "q1" and owner["q1"] == owner["qr"]:
        return 1, STEP * value
    if (name, value) in (("nu", 0.5), ("H", 1.0), ("gamma", 1.0)):
        return -1, STEP * value
    if value != 0:
        return 0, STEP * abs(value)
    if name == "v":
        return 0, STEP * mpfr("1e-6")
    if path[0] in ("solid1", "solid2") and name != "nu":  # E_inf or an E_i
        solid = case[path[0]]
        return 1, STEP * max(solid["E_inf"], *solid["E"])
    return 1, STEP * (mpfr("1e-5") if name == "h_rms" else 1)


def solve(case, mesh, paths):
    """(quantities, {path: their derivatives}) of a case of exact numbers."""
    value = Contact(case, mesh)
    center = np.array(value(case), object)
    slopes = {}
    for path in paths:
        side, step = stencil(case, path)
        if side == 0:
            points = [np.array(value(moved(case, path, s * step)), object) for s in (1, -1)]
            slopes[path] = (points[0] - points[1]) / (2 * step)
        else:
            points = [np.array(value(moved(case, path, s * side * step)), object) for s in (1, 2)]
            slopes[path] = side * (4 * points[0] - points[1] - 3 * center) / (2 * step)
    return center, slopes


def digits(one, other, scale):
    """To how many digits of the scale two numbers agree."""
    difference = abs(one - other)
    return 99 if difference == 0 or scale == 0 else int(-gmpy2.log10(difference / scale))


def reference(name):
    """The entry of extremes.json of one case."""
    case = changed(*CASES[name])
    paths = list(parameters(case))
    numbers = exact(case)
    (Q, slopes), (Q2, slopes2) = (solve(numbers, mesh, paths) for mesh in MESHES)
    # A separation in full contact, of 1e-100, counts from 1e-6 of the roughness upwards.
    roughness = sum(case[psd].get("h_rms", 1e-4) for psd in ("psd1", "psd2"))
    scales = [abs(Q[0]), abs(Q[1]), abs(Q[2]) + mpfr(1e-6 * roughness)]
    agree = [digits(*pair) for pair in zip(Q, Q2, scales, strict=True)]
    slope_agree = []
    for path in paths:
        for i in range(3):
            # A derivative that is 0 by symmetry comes out as rounding errors.
            least = scales[i] / (stencil(numbers, path)[1] / STEP)
            one, other = slopes[path][i], slopes2[path][i]
            if max(abs(one), abs(other)) < mpfr("1e-40") * least:
                slopes[path][i] = mpfr(0)
            else:
                slope_agree.append(digits(one, other, max(least, abs(one))))
    return {
        **dict(zip(QUANTITIES, map(float, Q), strict=True)),
        "digits": min(agree),
        "digits_of_derivatives": min(slope_agree, default=99),
        "derivatives": {
            ".".join(map(str, path)): [at(case, path), *map(float, slopes[path])] for path in paths
        },
    }


def write(entries, path):
    """One line a case, in the order of `extremes.py`."""
    lines = [f"{json.dumps(name)}: {json.dumps(entries[name])}" for name in CASES if name in entries]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=list(CASES), help="names of cases; the others are kept")
    arguments = parser.parse_args()
    path = REFERENCE / "extremes.json"
    entries = json.loads(path.read_text()) if path.exists() else {}
    for name in arguments.only:
        start = time.monotonic()
        entry = reference(name)
        spent = time.monotonic() - start
        print(
            f"{name:34} {entry['digits']:3} {entry['digits_of_derivatives']:3} digits {spent:6.1f} s",
            *(f"{entry[quantity]:.6e}" for quantity in QUANTITIES),
            flush=True,
        )
        if entry["digits"] < 25:
            raise ArithmeticError(f"{name}: two meshes agree to {entry['digits']} digits only")
        entries[name] = entry
        write(entries, path)


if __name__ == "__main__":
    main()
