"""One scene of every kind, whose operations are counted and whose first calls are timed."""

import numpy as np
from support.folders import DATA

import rubberfric as rf
from rubberfric.io.files import read_scene_file

VELOCITY = np.logspace(-6, 1, 50)  # [m/s]
PRESSURE = 2e5  # [Pa]


def scenes():
    """Kinds of scenes by name: (scene, temperature or None)."""
    found = {}
    for name, file in {
        "smooth rubber on a rigid road": "tread_on_asphalt",
        "rough rubber on a rigid road": "rough_tread_on_asphalt",
        "two rough rubbers": "two_rubbers",
        "a rubber layer on a rigid road": "thin_layer",
        "with contact shear": "sheared_tread_on_asphalt",
        "tabulated modulus and spectrum": "tabulated_tread",
    }.items():
        read = read_scene_file(DATA / f"{file}.toml")
        T = read.conditions.temperature
        found[name] = read.scene, None if T is None else float(T[0])
    plain = found["smooth rubber on a rigid road"][0]
    road, rubber = sorted((plain.lower, plain.upper), key=lambda body: body.spectrum is None)
    rigid = rf.Body(rf.Rigid())
    found["smooth on smooth"] = rf.Scene(rubber, rigid), None
    worn = rf.Body(rubber.material, road.spectrum)
    found["rough rubber on a smooth rigid solid (case II)"] = rf.Scene(worn, rigid), None
    found["elastic block on a rigid road"] = rf.Scene(rf.Body(rf.Elastic(1e7, 0.4)), road), None
    found["S in G"] = rf.Scene(rubber, road, area_correction=True), None
    return found
