"""Tables of the law and boundary elements, as in notebooks/law_table.md."""

import functools
import os
from pathlib import Path

import jax
import numpy as np
from problems import CONTACT_MODELS

import rubberfric as rf

SETTING = rf.Quadrature(order=10, panels=8, angular_order=12)


@functools.partial(jax.jit, static_argnames="model")
def computed(scene, velocity, pressure, model):
    """Return area and friction; the scene is traced, so that slabs which the law refuses are computed."""
    scene = scene.replace(CONTACT_MODELS[model])
    found = rf.solve(scene, velocity, pressure, quadrature=SETTING, quantities=("area", "friction"))
    return found.area, found.friction


def share(logs):
    """Return the share within 10 %."""
    return np.mean(np.abs(np.expm1(logs)) < 0.1)


def text(logs):
    return "" if not logs.size else f"{share(logs):.0%}, {np.sqrt(np.mean(logs**2)):.3f}"


def lines_of(found, parts, sliding):
    """Yield the lines of a table with the shares within 10 % and rms errors of all models."""
    titles = [
        *("cases", "n"),
        *(f"{kind}: {model}" for kind in ("area", "friction") for model in CONTACT_MODELS),
    ]
    yield f"| {' | '.join(titles)} |"
    yield "|---" * len(titles) + "|"
    for name, part in parts.items():
        cells = [
            text(one[k][these][np.isfinite(one[k][these])])
            for k, these in enumerate((part, part & sliding))
            for one in found.values()
        ]
        yield f"| {' | '.join([name, str(part.sum()), *cells])} |"


def material_rows(known):
    """Return a row for each material with relaxation."""
    rows = []
    for name, one in known.items():
        rise = float((one.E_inf + one.E.sum()) / one.E_inf)
        rows.append(f"| `{name}` | {one.tau.size} | {one.tau.min():g} | {one.tau.max():g} | {rise:.4g} |\n")
    return "".join(rows)


def write_page(page):
    """Write the page that the environment variable TABLE names."""
    Path(os.environ["TABLE"]).write_text(page, encoding="utf-8")


INTRODUCTION = """# The law and boundary elements

This page compares the theory and the law of `contact_model="boundary_elements"` with boundary elements. [How
true is the theory?](how_true.md) explains the law. This command generates the page:

    TABLE=notebooks/law_table.md python -m pytest -m slow \\
        tests/rubberfric/theory/area/test_law_and_boundary_elements.py -k all_cases

Each cell gives the share of the cases in which the model is within 10 % of boundary elements, and the root
mean square of ln(model / boundary elements). n is the number of cases, including elastic cases, which have no
friction. Only the cases of the lines that begin with "fitted" were used for the constants of the law. The
cases of the lines that begin with "fresh" were computed after the form of the law had been chosen. The other
lines of the random cases contain them too. The law refuses two rough surfaces, slabs that are over 4 times as
stiff as a half-space at q_r, and roughness with rms slopes across the grooves over 1.9 times the slopes along
them.

## Random cases

`notebooks/law_elements.py` draws spectra, materials, velocities and loads at random: q1/q0 = 4 to 64,
q1/q_r = 2 to 64, H = 0.5 to 1, no to nine relaxation times over up to eight decades, moduli that rise by
factors of 2 to 1200, A/A0 from 0.15 %. The lines contain only cases with small errors: the standard error
over surfaces is below 3 %, the error of the grid below 4 %, and a period of twice the length changes area
and friction by less than 6 %. "E" is the modulus at 0.3 q1 v over the modulus at rest.

"""
OLDER_PART = """
## Older cases

These 685 cases are from an independent solver. Their solids are elastic, or have these Prony series:

| name | relaxation times | from [s] | to [s] | E(infinity) / E(0) |
|---|---|---|---|---|
"""
OLDER_MEANING = """
The results of the excluded cases depend on the period of the grid. q0 v tau is for tau = 1 s, the longest
relaxation time of most series.

"""


EXTRAPOLATION = """
## Beyond the cases

The table gives law over paper for the rubber of data/tread_on_asphalt.toml at 0.15 MPa, on its road with
other q1/q0. The standard errors after ± follow from the covariance of the fitted constants, with independent
errors of the cases. Two other fits show the effect of the data and of the form. The constants of the column
"up to 64" were fitted without the cases of q1/q0 = 128 to 512. In the column "ln(q1/q0)" half of ln(q1/q0)
replaces ln(alpha), and the constants were fitted again.

| q1/q0 | velocity [m/s] | friction: law | up to 64 | ln(q1/q0) | area: law | up to 64 | ln(q1/q0) |
|---|---|---|---|---|---|---|---|
"""
