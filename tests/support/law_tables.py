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
