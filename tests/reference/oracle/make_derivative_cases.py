"""Writes derivative_cases.json: derivatives of the oracle's values with respect to every parameter.

    python tests/reference/oracle/make_derivative_cases.py      (about five minutes)

Each is d quantity / d ln parameter, by central differences of the sixth order of values
that `tests/support/oracles/oracle.py` computes to rounding: good to about 1e-10 of the value. Parameters
are named as in the scene's dictionary, with the index of a vector's element.
"""

import json

import numpy as np
from make_option_cases import STIFF, case
from support.cases.solids import HARD, MEASURED_ROAD, RIGID, ROAD, SOFT, TREAD, WLF
from support.folders import REFERENCE
from support.oracles.oracle import solve

STEP = 0.01
OFFSETS = np.array([1, 2, 3])
WEIGHTS = np.array([3 / 4, -3 / 20, 1 / 60])
FIXED = ("T_ref", "T", "aT", "omega", "storage", "loss")

SCENES = [
    case("one-rubber", SOFT, RIGID, TREAD, ROAD, 0.02, 2e5),
    case("rigid-on-rubber", RIGID, SOFT, TREAD, None, 0.02, 2e6),
    case("rubber-on-elastic", SOFT, STIFF, TREAD, ROAD, 3.0, 4e5),
    case("two-rubbers", SOFT, HARD, TREAD, ROAD, 1e-3, 3e5),
    case("slab", SOFT | {"nu": 0.4, "thickness": 1e-3}, RIGID, None, ROAD, 0.1, 1e5),
    case("two-slabs", SOFT | {"thickness": 1e-3}, HARD | {"thickness": 3e-4}, TREAD, ROAD, 0.1, 3e5),
    case("light", SOFT, RIGID, None, ROAD, 0.02, 1.0),
    case("corrected", SOFT, RIGID, TREAD, ROAD, 0.1, 4e5, 0.3, area_correction=True),
    case(
        "frictionless-slab", SOFT | {"thickness": 2e-3, "base": "frictionless"}, RIGID, None, ROAD, 0.1, 1e5
    ),
    case("table-spectrum", SOFT, STIFF, TREAD, MEASURED_ROAD, 3e-3, 4e5),
    case("wlf-hot", SOFT | {"shift": WLF}, RIGID, None, ROAD, 0.1, 2e5, temperature=353.15),
]


def parameters(scene):
    """Every number of the scene with a derivative, as (names of nested keys)."""
    for key, value in scene.items():
        if isinstance(value, dict):
            yield from ((key, *rest) for rest in parameters(value))
        elif isinstance(value, list) and key not in FIXED:
            yield from ((key, i) for i in range(len(value)))
        elif isinstance(value, float) and key not in FIXED:
            yield (key,)


def scaled(scene, path, factor):
    key, *rest = path
    if isinstance(scene, list):
        return [x * factor if i == key else x for i, x in enumerate(scene)]
    return scene | {key: scaled(scene[key], rest, factor) if rest else scene[key] * factor}


def derivative(scene, path):
    total = dict.fromkeys(("area", "friction", "separation"), 0.0)
    # Road and tread scenes have q1/q0 > 100, and Poisson ratios may pass 1/2 in the formula.
    step = STEP if path[-1] not in ("nu", "T_ref", "temperature", "H") else 0.2 * STEP
    for offset, weight in zip(OFFSETS, WEIGHTS, strict=True):
        above, below = (solve(scaled(scene, path, np.exp(sign * offset * step)), 90) for sign in (1, -1))
        for quantity in total:
            total[quantity] += weight / step * (above[quantity] - below[quantity])
    return total


def main():
    out = []
    for scene in SCENES:
        slopes = {".".join(map(str, path)): derivative(scene, path) for path in parameters(scene)}
        out.append(scene | solve(scene) | {"derivatives": slopes})
        print(scene["name"], len(slopes), flush=True)
    (REFERENCE / "derivative_cases.json").write_text(json.dumps(out, indent=1) + "\n")


if __name__ == "__main__":
    main()
