"""Warnings stand at the line that called the library, whichever of its functions was called."""

import dataclasses
import warnings

import numpy as np
import pytest
from problems import RIGID, ROAD, TREAD, scene

import fitting
import rubberfric as rf
from rubberfric.theory.arguments import warn_of_last_iterates

SCENE = scene((RIGID, ROAD), (TREAD,))
STICKY = dataclasses.replace(SCENE, adhesion=rf.Adhesion(0.05))
POINT = {"velocity": 1000.0, "pressure": 3e5}  # no rubber slides at 1 km/s
SOFT = rf.Body(rf.Elastic(3.6, 0.5))  # a modulus in MPa


class SeenError(Exception):
    """Raised in place of the warning, so that nothing is computed."""


def load(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rf.save_scene(tmp_path / "soft.h5", rf.Scene(SCENE.lower, SOFT))
    return rf.load_scene(tmp_path / "soft.h5")


CALLS = {
    "Scene": lambda _: rf.Scene(SCENE.lower, SOFT),
    "replace": lambda _: SCENE.replace("upper.material.E_inf", 3.6),
    "dataclasses.replace": lambda _: dataclasses.replace(SCENE, upper=SOFT),
    "load_scene": load,
    "friction": lambda _: rf.friction(SCENE, **POINT),
    "contact_area": lambda _: rf.contact_area(SCENE, **POINT),
    "separation": lambda _: rf.separation(SCENE, **POINT),
    "solve": lambda _: rf.solve(SCENE, **POINT),
    "profile": lambda _: rf.analysis.profile(SCENE, **POINT),
    "separation_profile": lambda _: rf.analysis.separation_profile(SCENE, **POINT),
    "stress_distribution": lambda _: rf.analysis.stress_distribution(SCENE, [0.0, 1e6], **POINT),
    "contact_stiffness": lambda _: rf.analysis.contact_stiffness(SCENE, **POINT),
    "dissipated_power": lambda _: rf.analysis.dissipated_power(SCENE, **POINT),
    "accuracy": lambda _: rf.analysis.accuracy(SCENE, **POINT),
    "quadrature_for": lambda _: rf.analysis.quadrature_for(SCENE, 1e-4, **POINT),
    "plot.auto": lambda _: rf.plot.auto(SCENE, **POINT),
    "sensitivity": lambda _: fitting.sensitivity(SCENE, **POINT, parameters=["upper.material.E_inf"]),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_unit_warning_points_here(name, tmp_path, monkeypatch):
    def seen(*given):
        raise SeenError(*given[1:3])

    monkeypatch.setattr(warnings, "showwarning", seen)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        with pytest.raises(SeenError) as found:
            CALLS[name](tmp_path)
    assert found.value.args == (rf.UnitWarning, __file__)


def test_every_line_warns():
    """By default once a line: not once a process, for all lines."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("default")
        for _ in range(2):
            rf.Scene(SCENE.lower, SOFT)
            rf.Scene(SCENE.lower, SOFT)
    assert len(found) == 2 and {one.filename for one in found} == {__file__}


def test_last_iterates_point_here():
    with pytest.warns(RuntimeWarning, match="did not converge") as found:
        warn_of_last_iterates(STICKY, np.array([False]), [np.array([1.0]), np.array([3e5]), None])
    assert found[0].filename == __file__


def test_lengths_in_micrometres_are_noticed():
    """Heights and spacing in micrometres as numbers, which agree with each other."""
    with pytest.warns(rf.UnitWarning, match=r"q0 = 0.0006.* must be 0.1 ... 1e\+12 1/m; is it in 1/mm"):
        rf.Scene(rf.Body(rf.Rigid(), rf.SelfAffine(6e-4, 1e-3, 1.0, 0.8, 34.0)), rf.Body(TREAD))
    with pytest.warns(rf.UnitWarning, match="h_rms = 3.4 m: must be at most 1 m; is it in mm or um"):
        rf.Scene(rf.Body(rf.Rigid(), rf.SelfAffine(0.2, 0.2, 1.0, 0.8, 3.4)), rf.Body(TREAD))
