"""Scenes on tabulated roughness, as dictionaries, and the same with their roughness cut at a wavevector."""

import numpy as np
import pytest
from support.cases.solids import RIGID
from support.cases.stored import scene as scene_of

RUBBER = {
    "kind": "prony",
    "E_inf": 3.6e6,
    "E": [1e9, 1e8, 1e7],
    "tau": [1e-9, 1e-6, 1e-3],
    "nu": 0.5,
    "thickness": None,
}
HARDER = {"kind": "prony", "E_inf": 2e7, "E": [5e8, 4e7], "tau": [1e-7, 1e-4], "nu": 0.4, "thickness": 2e-3}
TABLE = {
    "kind": "table",
    "omega": [1.0, 1e3, 1e6, 1e9],
    "storage": [4e6, 1e7, 1e8, 1e9],
    "loss": [3e5, 3e6, 4e7, 1e8],
    "nu": 0.5,
    "thickness": None,
}
ELASTIC = {"kind": "elastic", "E": 1e8, "nu": 0.3, "thickness": None}
ROAD = {"q": [100.0, 1000.0, 3.1e4], "C": [3e-13, 2e-13, 2e-18]}
WORN = {"q": [300.0, 4000.0, 1e5], "C": [4e-17, 3e-17, 1e-21]}


def case(solid1, solid2, psd1=None, psd2=None, v=1e-2, pressure=2e5, **options):
    conditions = {"v": v, "pressure": pressure, "gamma": 0.45}
    return {"solid1": solid1, "solid2": solid2, "psd1": psd1, "psd2": psd2, **conditions, **options}


TYRE = case(RUBBER, RIGID, psd2=ROAD)
CASES = {
    "tyre": TYRE,
    "S in G": {**TYRE, "area_correction": True},
    "static": case(ELASTIC, RIGID, psd2=ROAD),
    "two rubbers": case(RUBBER, HARDER, WORN, ROAD, v=0.3),
    "two rubbers, S in G": case(RUBBER, HARDER, WORN, ROAD, v=-0.3, area_correction=True),
    "table": case(TABLE, RIGID, psd2=ROAD, v=0.013),
    "layer": case({**RUBBER, "thickness": 5e-3}, RIGID, psd2=ROAD),
    "rough rubber on elastic": case(RUBBER, ELASTIC, WORN, WORN),
    "light": {**TYRE, "pressure": 1e-3},
    "heavy": {**TYRE, "pressure": 1e7},
}


def ordinary(*names):
    return [n if n in names else pytest.param(n, marks=pytest.mark.slow) for n in CASES]


def truncated(psd, q, keep):
    """The part of a tabulated spectrum below or above q."""
    if psd is None:
        return None
    knots, C = np.array(psd["q"]), np.array(psd["C"])
    low, high = (knots[0], min(q, knots[-1])) if keep == "below" else (max(q, knots[0]), knots[-1])
    if not high > low:
        return None
    inner = (knots > low) & (knots < high)
    at = np.concatenate([[low], knots[inner], [high]])
    at_C = np.exp(np.interp(np.log(at), np.log(knots), np.log(C)))
    return {"q": list(at), "C": list(at_C)}


def cut(known, q, keep="below"):
    return {**known, "psd1": truncated(known["psd1"], q, keep), "psd2": truncated(known["psd2"], q, keep)}


def conditions(known):
    return scene_of(known), known["v"], known["pressure"]
