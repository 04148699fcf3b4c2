"""Heated scenes, as dictionaries of `oracle_heating`; their references are in heated_cases.json."""

import math

from support.cases.solids import ARRHENIUS, RIGID, WLF

ELASTIC = {"kind": "elastic", "E": 2.0e7, "nu": 0.3}
RUBBER = {
    "kind": "prony",
    "E_inf": 3.6e6,
    "E": [5e8, 1.4e8, 6.5e6],
    "tau": [1e-9, 1e-7, 1e-5],
    "nu": 0.5,
    "shift": WLF,
}
SOFT = {"kind": "prony", "E_inf": 8e5, "E": [2.5e8, 4e6], "tau": [3e-8, 2e-4], "nu": 0.48, "shift": ARRHENIUS}
ROAD = {"q0": 300.0, "qr": 300.0, "q1": 3e4, "H": 0.8, "h_rms": 2e-4}
WORN = {"q0": 300.0, "qr": 1e3, "q1": 3e4, "H": 0.7, "h_rms": 3e-5}
VERTICAL = {"kind": "entropic", "expansion": 6e-4}
TABLE = {"kind": "table", "T": [250.0, 300.0, 400.0, 600.0], "bT": [1.3, 1.0, 0.7, 0.4]}
HEATING = {
    "density": 1200.0,
    "heat_capacity": 1600.0,
    "conductivity": 0.23,
    "radius": 2e-3,
    "area_fraction": 0.05,
}
STONE = {"density": 2400.0, "heat_capacity": 900.0, "conductivity": 1.5}
MACRO = {**HEATING, "radius": 1.5e-3, "area_fraction": None}  # q_m = 2.1e3, inside the roughness
SHEAR = {"tau_f0": 6.5e6, "c": 0.1, "v0": 6e-3, "shift": {**ARRHENIUS, "energy": 0.5}}

BASE = {
    "solid1": RIGID,
    "solid2": RUBBER,
    "psd1": ROAD,
    "psd2": None,
    "v": 10.0,
    "pressure": 1e6,
    "gamma": 0.5,
    "temperature": 290.0,
    "heating": HEATING,
}
CASES = {
    "one": BASE,
    "slow": BASE | {"v": 1e-3, "temperature": 270.0},
    "backwards": BASE | {"v": -10.0},
    "macro": BASE | {"heating": MACRO},
    "corrected": BASE | {"heating": MACRO, "area_correction": True, "gamma": 0.45},
    "arrhenius-slab": BASE | {"solid2": {**SOFT, "thickness": 2e-3}, "v": 1.0},
    "flash-shear": BASE | {"shear": SHEAR, "v": 1.0, "pressure": 3e5},
    "background-shear": BASE
    | {
        "shear": SHEAR,
        "v": 1.0,
        "pressure": 3e5,
        "heating": {**MACRO, "shear_at": "background", "shear_share": 0.3},
    },
    "both-rough": BASE | {"psd2": WORN, "v": 2.0},
    "two-rubbers": BASE | {"solid1": SOFT, "psd2": WORN, "v": 2.0, "heating": MACRO},
    "on-elastic": BASE | {"solid1": ELASTIC, "psd2": WORN, "shear": SHEAR, "v": 2.0, "pressure": 3e5},
    "light": BASE | {"pressure": 1e4, "v": 100.0},
    "two-bodies": BASE
    | {
        "solid1": SOFT | {"thermal": STONE},
        "psd2": WORN,
        "v": 0.3,
        "pressure": 3e5,
        "shear": SHEAR | {"tau_f0": 2e6},
    },
    "on-stone": BASE
    | {
        "solid1": RIGID | {"thermal": STONE},
        "v": 1.0,
        "pressure": 3e5,
        "shear": SHEAR,
    },
    "vertical": BASE | {"solid2": RUBBER | {"shift": WLF | {"vertical": VERTICAL}}, "v": 1.0},
    "vertical-two-rubbers": BASE
    | {
        "solid1": SOFT | {"shift": ARRHENIUS | {"vertical": {"kind": "entropic", "expansion": 2e-3}}},
        "solid2": RUBBER | {"shift": WLF | {"vertical": VERTICAL}},
        "psd2": WORN,
        "v": 0.1,
        "pressure": 3e5,
        "shear": SHEAR | {"tau_f0": 2e6, "shift": {**ARRHENIUS, "energy": 0.5, "vertical": VERTICAL}},
    },
    "vertical-on-elastic": BASE
    | {"solid1": ELASTIC, "solid2": RUBBER | {"shift": WLF | {"vertical": TABLE}}, "psd2": WORN, "v": 2.0},
    "skin": BASE
    | {"solid2": {**ELASTIC, "coating": {"thickness": 1e-4, "base": RUBBER}}, "v": 1.0, "pressure": 3e5},
    "coating": BASE
    | {
        "solid2": RUBBER
        | {"shift": WLF | {"vertical": VERTICAL}, "coating": {"thickness": 2e-4, "base": SOFT}},
        "v": 1.0,
    },
    "sheared": BASE
    | {"solid2": ELASTIC, "psd1": ROAD | {"qr": 900.0}, "shear": SHEAR, "v": 0.1, "pressure": 3e5},
}

# Changes of the logarithms, all at once; "sheared" has its slope of friction along them.
HEAT = {"density": 0.3, "heat_capacity": 1.0, "conductivity": -0.7, "radius": 0.4, "area_fraction": 1.0}
ALL = {
    "v": 1.0,
    "pressure": -0.6,
    "temperature": 0.05,
    "heating": HEAT,
    "solid2": {"E": -1.0},
    "psd1": {"h_rms": 0.5, "q1": -0.4},
    "shear": {"tau_f0": 0.8, "c": 0.3, "v0": -1.0},
}
STEP = 1e-3


def along(value, step, h):
    """A case with its numbers multiplied by e^(h step)."""
    if isinstance(step, dict):
        return value | {key: along(value[key], one, h) for key, one in step.items() if value[key] is not None}
    factor = math.exp(h * step)
    return [x * factor for x in value] if isinstance(value, list) else value * factor


def difference(f):
    """Derivative from the values f[k] after k = -2, -1, 1, 2 steps."""
    return (8 * (f[1] - f[-1]) - (f[2] - f[-2])) / (12 * STEP)
