"""Writes heated_cases.json: the scenes of heated.py with their quantities.

    python tests/reference/oracle/make_heated_cases.py [NAME ...]

Those named are made anew, without names all; the others stay as they are.
The values come from `tests/support/oracles/oracle_heating.py`. Printed beside flash temperature and friction:
the largest relative change with coarser panels, and with other polynomials for the temperatures.
"""

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from support.cases.heated import ALL, CASES, STEP, along, difference
from support.folders import REFERENCE
from support.oracles.oracle_heating import POINTS, solve

NAMES = ("area", "viscoelastic_friction", "shear_friction", "friction", "separation", "flash_temperature")


def largest_change(a, b):
    return max(abs(a[name] / b[name] - 1) for name in NAMES if b[name])


def friction_slope(case, start):
    """Derivative of the friction along `heated.ALL`."""
    moved = {k: solve(along(case, ALL, k * STEP), 40, 12, start=start) for k in (-2, -1, 1, 2)}
    return difference({k: values["friction"] for k, values in moved.items()})


def main():
    path = REFERENCE / "heated_cases.json"
    known = {one["name"]: one for one in json.loads(path.read_text())}
    scenes = []
    for name, case in CASES.items():
        if sys.argv[1:] and name not in sys.argv[1:]:
            scenes.append(known[name])
            continue
        coarse = solve(case)
        fine = solve(case, halvings=40, order=12, start=coarse["rises"])
        other = solve(case, points=POINTS - 11)
        scenes.append({"name": name} | case | fine)
        if name == "sheared":
            scenes[-1]["friction_slope"] = friction_slope(case, fine["rises"])
        changes = f"{largest_change(coarse, fine):.0e} {largest_change(other, coarse):.0e}"
        print(f"{name:18} {fine['flash_temperature']:12.6f} {fine['friction']:.6e} {changes}", flush=True)
    text = json.dumps(scenes, indent=1, default=lambda x: np.asarray(x).tolist())
    path.write_text(text + "\n")


if __name__ == "__main__":
    main()
