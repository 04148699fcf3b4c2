"""Scenes as the text of TOML files: what is written is read back to the last bit."""

import numpy as np
import pytest
from support.folders import DATA
from support.scenes.examples import same

import rubberfric as rf
from rubberfric.io.files import read_computable
from rubberfric.io.results import Conditions
from rubberfric.io.toml import scene_texts

SCENES = sorted(path for path in DATA.glob("*.toml") if not path.name.endswith("_fit.toml"))
AT = Conditions(np.array([1e-3, 1.0]), np.array([1e5]), None)


def read_back(folder, scene, conditions, title=""):
    for name, text in scene_texts(scene, conditions, title).items():
        (folder / name).write_text(text, encoding="utf-8")
    return read_computable(folder / "scene.toml")


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_scenes_of_the_project(path, tmp_path):
    found = read_computable(path)
    same(read_back(tmp_path, *found)[:2], found[:2])
    assert read_computable(tmp_path / "scene.toml")[2] == found[2]


def test_kinds_that_they_have_not(tmp_path):
    wlf = rf.WLF(8.86, 101.6, 293.15, vertical=rf.Entropic(6e-4))
    directions = rf.TabulatedAnisotropic([1e2, 1e3, 1e4], 1e-20 * np.arange(1.0, 16.0).reshape(3, 5), 0.3)
    shear = rf.PronyShear(1e6, [1e8, 1e6], [1e-6, 1.0], 2e9, rf.Arrhenius(1.0, 300.0))
    smooth = rf.Body(rf.TabulatedModulus([1.0, 10.0], [1e6, 2e6], [1e5, 2e5], 0.49, wlf, "hold", 0.2))
    scene = rf.Scene(rf.Body(shear, directions), smooth, area_correction=True)
    same(read_back(tmp_path, scene, AT, 'a "b" \\ c')[0], scene)
    assert read_computable(tmp_path / "scene.toml")[2] == 'a "b" \\ c'


@pytest.mark.parametrize(
    "adhesion",
    [
        rf.Adhesion(0.0123, 0.7, criterion="stress"),
        rf.Adhesion(0.02),
        rf.Adhesion(3e-3, limit="long", range=1.7e-9),
    ],
    ids=["stress", "energy", "long"],
)
def test_adhesion_of_either_limit_in_toml_and_hdf5(adhesion, tmp_path):
    spectrum = rf.SelfAffine(1e5, 1e6, 1e8, 0.8, 2e-9)
    scene = rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(2e6, 0.5)), adhesion=adhesion)
    rf.save_scene(tmp_path / "scene.h5", scene)
    for found in (read_back(tmp_path, scene, AT)[0], rf.load_scene(tmp_path / "scene.h5")):
        same(found, scene)
        assert found.adhesion.limit == adhesion.limit


def test_what_is_hardly_in_si_is_accepted_again(tmp_path):
    spectrum = rf.SelfAffine(1e2, 1e3, 1e4, 0.8, 1e-4)
    with pytest.warns(rf.UnitWarning):
        scene = rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(10.0, 0.5)))
    same(read_back(tmp_path, scene, AT)[0], scene)
    assert "plausible = false" in (tmp_path / "scene.toml").read_text()
