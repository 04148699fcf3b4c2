"""The paper's theory and the fitted law against stored boundary-element cases.

`python -m pytest -m slow -s tests/rubberfric/theory/area/test_law_and_boundary_elements.py` prints the table
whose totals are in notebooks/how_true.md. The cases are means over surfaces in units of 1/q1 and E(0). Their
rms slope is 1; m0, mr and m1 are q0, q_r and q1 in modes of the period.
"""

import csv
import functools
import itertools
import json

import jax
import numpy as np
import pytest
from support.folders import ROOT

import rubberfric as rf

FOLDER = ROOT.parent / "shared" / "reference"
CASES = FOLDER / "sliding_boundary_elements.csv"
pytestmark = pytest.mark.skipif(not CASES.exists(), reason="needs the stored boundary elements")

NUMBERS = ("m0", "mr", "m1", "hurst", "velocity", "pressure", "area", "friction")
MODELS = {
    "paper": {},
    "paper, `area_correction`": {"area_correction": True},
    "law": {"contact_model": "boundary_elements"},
}
SETTING = rf.Quadrature(order=10, panels=8, angular_order=12)


@functools.cache
def cases():
    """Return columns of all cases; "material" as text, "period" is True where the grid's period counts."""
    with open(CASES, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    table = {name: np.array([float(row[name]) for row in rows]) for name in NUMBERS}
    table["material"] = np.array([row["material"] for row in rows])
    omega = table["velocity"] / table["m1"]  # of the longest mode of the grid
    stiff = np.zeros(omega.size)
    for name in set(table["material"]):
        at = table["material"] == name
        stiff[at] = np.abs(np.asarray(rf.complex_modulus(material(name), omega[at])))
    return table | {"period": (stiff > 2.5) & (table["area"] < 0.3)}


@functools.cache
def material(name):
    """Return a material of the cases, with E(0) = 1."""
    known = json.loads((FOLDER / "friction_law.json").read_text())["materials"]
    return rf.Elastic(1.0, 0.0) if name == "elastic" else rf.Prony(**known[name])


def scene_of(name, m0, mr, m1, hurst, options):
    road = rf.SelfAffine(m0 / m1, mr / m1, 1.0, hurst, h_rms=1.0)
    road = road.replace(h_rms=1 / float(rf.rms_slope(road)))
    return rf.Scene(rf.Body(material(name)), rf.Body(rf.Rigid(), road), **options)


@jax.jit
def computed(scene, velocity, pressure):
    found = rf.solve(scene, velocity, pressure, quadrature=SETTING, quantities=("area", "friction"))
    return found.area, found.friction


def ratios(rows, models=tuple(MODELS)):
    """Return ln(model / boundary elements) of area and friction of these rows, for every model."""
    table = cases()
    given = [table[name] for name in ("material", "m0", "mr", "m1", "hurst")]
    logs = {}
    for model in models:
        found = np.zeros((2, rows.size))
        for i, row in enumerate(rows):
            scene = scene_of(*(column[row] for column in given), MODELS[model])
            found[:, i] = computed(scene, table["velocity"][row], table["pressure"][row])
        with np.errstate(invalid="ignore", divide="ignore"):
            logs[model] = np.log(found / [table["area"][rows], table["friction"][rows]])
    return logs


def share(logs):
    """Return the share within 10 %."""
    return np.mean(np.abs(np.expm1(logs)) < 0.1)


def text(logs):
    return f"{share(logs):.0%}, {np.sqrt(np.mean(logs**2)):.3f}"


def test_one_relaxation_time():
    """A sixth of the cases; they share a compiled function."""
    rows = np.flatnonzero(np.isin(cases()["material"], ("weak", "narrow", "strong")) & ~cases()["period"])[
        ::6
    ]
    found = ratios(rows, ("paper", "law"))
    assert rows.size > 30
    assert share(found["law"][0]) > 0.85 and share(found["law"][1]) > 0.75
    assert share(found["paper"][0]) < 0.5 and share(found["paper"][1]) < 0.4


@pytest.mark.slow
def test_all_cases():
    table = cases()
    found = ratios(np.arange(table["area"].size))
    sliding = table["material"] != "elastic"
    good = ~table["period"]
    bandwidth, plateau = table["m1"] / table["m0"], table["m1"] / table["mr"]
    # The reciprocal of the time in which the longest wave passes.
    speed = table["velocity"] * table["m0"] / table["m1"]
    parts = {
        "all": np.ones(good.size, bool),
        "not affected by the period": good,
        "A/A0 > 1 %": good & (table["area"] > 0.01),
        "A/A0 < 1 %": good & (table["area"] <= 0.01),
        **{f"q1/q0 = {x:g}": good & (bandwidth == x) for x in np.unique(bandwidth)},
        **{f"q1/q_r = {x:g}": good & (plateau == x) for x in np.unique(plateau)},
        **{
            f"H = {low:g} to {high:g}": good & (table["hurst"] >= low) & (table["hurst"] < high + 1e-9)
            for low, high in ((0.5, 0.65), (0.66, 0.85), (0.86, 1.0))
        },
        **{
            f"q0 v tau = {low:g} to {high:g}": good & sliding & (speed >= low) & (speed < high)
            for low, high in itertools.pairwise((1e-4, 1e-2, 1e-1, 1.0, 10.0, 1e9))
        },
        **{f"`{name}`": good & (table["material"] == name) for name in np.unique(table["material"])},
    }
    print(
        "\n| cases | n | area: " + " | area: ".join(MODELS) + " | friction: " + " | friction: ".join(MODELS)
    )
    for name, part in parts.items():
        areas = [text(one[0][part]) for one in found.values()]
        frictions = [text(one[1][part & sliding]) if (part & sliding).any() else "" for one in found.values()]
        print(f"| {name} | {part.sum()} |", " | ".join([*areas, *frictions]), "|")
    assert share(found["law"][0][good]) > 0.9 and share(found["law"][1][good & sliding]) > 0.8
