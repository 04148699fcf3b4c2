"""Boundary-element cases that the law was fitted to, and others, with the models' results for them."""

import csv
import functools
import json

import numpy as np
from problems import CONTACT_MODELS
from support.cases.law_tables import computed
from support.folders import BOUNDARY_ELEMENTS
from support.processes.notebooks import script

import rubberfric as rf

OLDER = BOUNDARY_ELEMENTS / "sliding_boundary_elements.csv"


@functools.cache
def cases():
    """Return the cases of notebooks/law_elements.csv, with relative errors, and `sure` if these are small.

    A third of the change with the grid is subtracted from area and friction, because the error is of second
    order in the grid.
    """
    found = script("law_elements").read()
    for case in found:
        case["material"] = _class_of(case)
        case["sure"] = case["converged"] == "True"
        for name in ("area", "friction"):
            size = abs(case[name]) if name == "area" or case["terms"] else np.inf
            errors = [case[f"{name}_{end}"] / size for end in ("scatter", "resolution", "period")]
            errors = errors[0] / np.sqrt(case["surfaces"]), errors[1] / 3, errors[2]
            case["sure"] &= bool(np.all(np.abs(errors) < (0.03, 0.04, 0.06)))
            case[f"{name}_error"] = np.hypot(errors[0], 1.5 * errors[1])
            case[name] -= case[f"{name}_resolution"] / 3
    return found


def _class_of(case):
    if not case["terms"]:
        return "elastic"
    if case["terms"] == 1:
        return "one relaxation time"
    return "one per decade" if case["terms"] == case["decades"] + 1 else "two or three"


@functools.cache
def older():
    """Return the cases of the older table; "material" is a name, "period" is True where the period counts."""
    with open(OLDER, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = ("m0", "mr", "m1", "hurst", "velocity", "pressure", "area", "friction")
    found = [{name: float(row[name]) for name in names} | {"material": row["material"]} for row in rows]
    kinds = [tuple(case[name] for name in ("material", "m0", "mr", "m1", "hurst")) for case in found]
    for case in found:
        case |= {"ratio": case["m1"] / case["m0"], "rolloff": case["mr"] / case["m0"]}
        series = older_material(case["material"])
        stiff = abs(complex(rf.complex_modulus(series, case["velocity"] / case["m1"])))  # longest mode
        case["period"] = stiff > 2.5 and case["area"] < 0.3
        case |= {
            "area_error": 0.02,
            "friction_error": 0.03,
            "terms": 0 if case["material"] == "elastic" else 1,
        }
    chosen = set(sorted({kind for kind, case in zip(kinds, found, strict=True) if not case["period"]})[::2])
    for kind, case in zip(kinds, found, strict=True):
        case["part"] = "fit" if kind in chosen and not case["period"] else "test"
    return found


@functools.cache
def older_material(name):
    """Return a material of the older cases, with E(0) = 1."""
    known = json.loads((BOUNDARY_ELEMENTS / "friction_law.json").read_text())["materials"]
    return rf.Elastic(1.0, 0.0) if name == "elastic" else rf.Prony(**known[name])


def material_of(case):
    return older_material(case["material"]) if "m0" in case else script("law_elements").material_of(case)


def scene_of(case):
    if "m0" not in case:
        return script("law_elements").scene_of(case)
    road = rf.SelfAffine(case["m0"] / case["m1"], case["mr"] / case["m1"], 1.0, case["hurst"], h_rms=1.0)
    road = road.replace(h_rms=1 / float(rf.rms_slope(road)))
    return rf.Scene(rf.Body(material_of(case)), rf.Body(rf.Rigid(), road))


def column(chosen, name):
    return np.array([case.get(name, np.nan) for case in chosen])


def padded(material):
    """Return E and tau with 17 terms, so that all cases share compiled functions; E = 0 in added terms."""
    E, tau = np.zeros(17), np.ones(17)
    if isinstance(material, rf.Prony):
        E[: material.tau.size], tau[: material.tau.size] = material.E, material.tau
    return E, tau


def padded_body(body):
    if not isinstance(body.material, rf.Prony):
        return body
    E, tau = padded(body.material)
    return body.replace(material=body.material.replace(E=E, tau=tau))


def ratios(chosen, models=tuple(CONTACT_MODELS)):
    """Return ln(model / boundary elements) of area and friction of these cases, for every model.

    For two rough surfaces, the result of the law is NaN.
    """
    scenes = [scene_of(case) for case in chosen]
    scenes = [one.replace(lower=padded_body(one.lower), upper=padded_body(one.upper)) for one in scenes]
    measured, logs = np.array([[case["area"], case["friction"]] for case in chosen]).T, {}
    for model in models:
        found = np.full((2, len(chosen)), np.nan)
        for i, (scene, case) in enumerate(zip(scenes, chosen, strict=True)):
            if model != "law" or case.get("kind") != "two rough":
                found[:, i] = computed(scene, case["velocity"], case["pressure"], model)
        with np.errstate(invalid="ignore", divide="ignore"):
            logs[model] = np.log(found / measured)
    return logs


def fitted():
    """Return the cases to which the constants are fitted: half-spaces with small errors, of both tables."""
    new = [case for case in cases() if case["part"] == "fit" and case["kind"] in ("half-space", "large")]
    return [case for case in new if case["sure"]] + [case for case in older() if case["part"] == "fit"]
