"""Writes heated_cases.json: the scenes of heated.py with their quantities.

    python tests/reference/make_heated_cases.py

The values come from `tests/oracle_heating.py`. Printed beside the temperature: by how much the largest of
the relative changes is, if the panels are coarser and if the temperatures are other polynomials.
"""

import json
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from heated import CASES  # noqa: E402
from oracle_heating import POINTS, solve  # noqa: E402

NAMES = ("area", "viscoelastic_friction", "shear_friction", "friction", "separation", "flash_temperature")


def difference(a, b):
    return max(abs(a[name] / b[name] - 1) for name in NAMES if b[name])


def main():
    scenes = []
    for name, case in CASES.items():
        coarse = solve(case)
        fine = solve(case, halvings=40, order=12, start=coarse["rises"])
        other = solve(case, points=POINTS - 11)
        scenes.append({"name": name} | case | fine)
        changes = f"{difference(coarse, fine):.0e} {difference(other, coarse):.0e}"
        print(f"{name:18} {fine['flash_temperature']:12.6f} {fine['friction']:.6e} {changes}", flush=True)
    text = json.dumps(scenes, indent=1, default=lambda x: np.asarray(x).tolist())
    (HERE / "heated_cases.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
