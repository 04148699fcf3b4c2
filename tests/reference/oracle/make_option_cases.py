"""Writes option_cases.json: scenes for every option that the other reference files leave out.

    python tests/reference/oracle/make_option_cases.py

The values come from `tests/support/oracles/oracle.py`.
"""

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from support.cases.solids import ARRHENIUS, MEASURED_ROAD, RIGID, ROAD, SOFT, TREAD, WLF
from support.folders import REFERENCE
from support.oracles.oracle import solve

STIFF = {"kind": "elastic", "E": 4.0e7, "nu": 0.3}
RUBBER = {
    "kind": "prony",
    "E_inf": 3.6e6,
    "E": [7.6e8, 1.43e8, 1.55e7, 6.5e6, 2.2e6, 9.0e5],
    "tau": [1e-9, 1e-8, 1e-6, 1e-5, 1e-3, 1.0],
    "nu": 0.5,
}
MASTER_CURVE = {
    "kind": "table",
    "omega": [1e-3, 3e-2, 1.0, 40.0, 1e3, 3e4, 1e6, 5e7, 1e9, 1e11],
    "storage": [3.7e6, 4.1e6, 4.8e6, 5.6e6, 7.3e6, 1.3e7, 3.0e7, 1.6e8, 9.0e8, 1.9e9],
    "loss": [2.2e5, 3.4e5, 5.1e5, 7.0e5, 1.5e6, 4.3e6, 1.5e7, 1.2e8, 4.5e8, 1.1e8],
    "nu": 0.49,
}
SHIFT_TABLE = {
    "kind": "table",
    "T": [263.15, 283.15, 303.15, 333.15],
    "aT": [3e3, 20.0, 0.2, 4e-3],
    "T_ref": 293.15,
}


def case(name, solid1, solid2, psd1, psd2, v, pressure, gamma=0.5, **options):
    scene = {"name": name, "solid1": solid1, "solid2": solid2, "psd1": psd1, "psd2": psd2}
    return scene | {"v": v, "pressure": pressure, "gamma": gamma} | options


CASES = [
    case("correction-light", RUBBER, RIGID, None, ROAD, 0.1, 50.0, 0.45, area_correction=True),
    case("correction-middle", RUBBER, RIGID, TREAD, ROAD, 0.1, 4e5, 0.3, area_correction=True),
    case("correction-heavy", RUBBER, RIGID, None, ROAD, 1e-3, 6e6, 0.5, area_correction=True),
    case("correction-gamma-one", RUBBER, RIGID, None, ROAD, 1e-3, 3e5, 1.0, area_correction=True),
    case("correction-two-rubbers", SOFT, RUBBER, TREAD, ROAD, 0.02, 2e5, 0.7, area_correction=True),
    case(
        "frictionless-slab", RUBBER | {"thickness": 2e-3, "base": "frictionless"}, RIGID, None, ROAD, 0.1, 1e5
    ),
    case(
        "frictionless-and-bonded-slab",
        SOFT | {"thickness": 3e-4, "base": "frictionless"},
        RUBBER | {"thickness": 8e-4, "base": "bonded"},
        TREAD,
        ROAD,
        0.1,
        3e5,
    ),
    case("table-spectrum", RUBBER, RIGID, None, MEASURED_ROAD, 0.1, 1e5),
    case("table-spectrum-starts-inside", RUBBER, STIFF, TREAD, MEASURED_ROAD, 3e-3, 4e5),
    case("table-modulus", MASTER_CURVE, RIGID, None, ROAD, 0.1, 2e5),
    case("table-modulus-below-its-range", MASTER_CURVE, RIGID, None, ROAD, 1e-7, 2e5),
    case("table-modulus-above-its-range", MASTER_CURVE, RIGID, None, ROAD, 1e8, 2e7),
    case("table-modulus-hold", MASTER_CURVE | {"outside": "hold"}, RIGID, None, ROAD, 1e-6, 2e5),
    case("table-modulus-on-elastic", MASTER_CURVE, STIFF, TREAD, ROAD, 0.1, 2e5),
    case("table-modulus-on-rubber", MASTER_CURVE, SOFT, TREAD, ROAD, 0.1, 2e5),
    case("table-modulus-slab", MASTER_CURVE | {"thickness": 1e-3}, RIGID, None, ROAD, 0.1, 2e5),
    case(
        "table-modulus-two-slabs",
        MASTER_CURVE | {"thickness": 1e-3},
        SOFT | {"thickness": 2e-4},
        TREAD,
        ROAD,
        0.1,
        2e5,
    ),
    case("wlf-hot", RUBBER | {"shift": WLF}, RIGID, TREAD, ROAD, 0.1, 2e5, temperature=353.15),
    case(
        "wlf-and-arrhenius",
        SOFT | {"shift": ARRHENIUS},
        RUBBER | {"shift": WLF},
        TREAD,
        ROAD,
        0.1,
        2e5,
        temperature=273.15,
    ),
    case("table-shift", RUBBER | {"shift": SHIFT_TABLE}, RIGID, None, ROAD, 0.1, 2e5, temperature=290.0),
    case("table-modulus-wlf", MASTER_CURVE | {"shift": WLF}, RIGID, None, ROAD, 0.1, 2e5, temperature=313.15),
]


def main():
    scenes = [scene | solve(scene) for scene in CASES]
    text = json.dumps(scenes, indent=1, default=lambda x: np.asarray(x).tolist())
    (REFERENCE / "option_cases.json").write_text(text + "\n")
    for scene in scenes:
        print(f"{scene['name']:32}", *(f"{scene[k]:.6e}" for k in ("area", "friction", "separation")))


if __name__ == "__main__":
    main()
