"""Scenes on tabulated roughness, and the same with their roughness cut at a wavevector."""

import jax
import numpy as np
import pytest
from problems import RIGID, scene
from problems import TREAD as RUBBER

import rubberfric as rf
from rubberfric.theory import paper

HARDER = rf.Prony(2e7, [5e8, 4e7], [1e-7, 1e-4], 0.4)
TABLE = rf.TabulatedModulus([1.0, 1e3, 1e6, 1e9], [4e6, 1e7, 1e8, 1e9], [3e5, 3e6, 4e7, 1e8])
ELASTIC = rf.Elastic(1e8, 0.3)
ROAD = rf.TabulatedSpectrum([100.0, 1000.0, 3.1e4], [3e-13, 2e-13, 2e-18])
WORN = rf.TabulatedSpectrum([300.0, 4000.0, 1e5], [4e-17, 3e-17, 1e-21])


def case(lower, upper=(RIGID, ROAD), v=1e-2, pressure=2e5, **options):
    """Return a scene, a velocity and a pressure."""
    return scene(lower, upper, gamma=0.45, **options), v, pressure


TYRE = case((RUBBER,))
SMOOTH = scene((rf.Elastic(1e6, 0.5),), (RIGID,))
TWO = (RUBBER, WORN), (HARDER, ROAD, rf.Slab(2e-3))
CASES = {
    "tyre": TYRE,
    "S in G": case((RUBBER,), area_correction=True),
    "static": case((ELASTIC,)),
    "two rubbers": case(*TWO, v=0.3),
    "two rubbers, S in G": case(*TWO, v=-0.3, area_correction=True),
    "table": case((TABLE,), v=0.013),
    "layer": case((RUBBER, None, rf.Slab(5e-3))),
    "rough rubber on elastic": case((RUBBER, WORN), (ELASTIC, WORN)),
    "light": case((RUBBER,), pressure=1e-3),
    "heavy": case((RUBBER,), pressure=1e7),
}


def ordinary(*names):
    return [n if n in names else pytest.param(n, marks=pytest.mark.slow) for n in CASES]


def cut(whole, q, keep="below"):
    """Return the scene with the part of its roughness below or above q."""

    def part(body):
        if body.spectrum is None:
            return body
        first, last = np.asarray(body.spectrum.q)[[0, -1]]
        low, high = (first, min(q, last)) if keep == "below" else (max(q, first), last)
        return body.replace(spectrum=body.spectrum.replace(q0=low, q1=high) if high > low else None)

    return whole.replace(lower=part(whole.lower), upper=part(whole.upper))


by_paper = jax.jit(lambda *at: paper.solve(*at, nodes=paper.gauss_nodes(step=0.05, panels=12)))
