"""Wrong files, options and calls that once gave silent nonsense or a riddle, and their messages."""

import h5py
import numpy as np
import pytest
from support.scenes.fits import SCENE

import fitting
import rubberfric as rf

SHEAR = "f [Hz];G' [MPa];G'' [MPa]\n1;5;1\n"
KIND = np.array(["Prony", "x"], h5py.string_dtype())


def text(content, call):
    """Return a function of a folder that writes a file and calls `call` with its path."""

    def run(folder):
        (folder / "table.csv").write_text(content, encoding="utf-8")
        return call(folder / "table.csv")

    return run


def scene(change):
    """Return a function of a folder that changes a scene file and loads the scene."""

    def run(folder):
        rf.save_scene(folder / "scene.h5", SCENE)
        with h5py.File(folder / "scene.h5", "r+") as file:
            change(file["scene/upper"])
        return rf.load_scene(folder / "scene.h5")

    return run


def friction(content, **options):
    return text(content, lambda path: fitting.read(path, **options))


def heights(spacing):
    return text("1,2\n3,4\n", lambda path: rf.io.read_heights(path, spacing, "um"))


def call(function, *arguments):
    return lambda _: function(*arguments)


CASES = {
    "Poisson's ratio in percent": (friction(SHEAR, poisson=50), "poisson = 50.0: must be between 0.0 and"),
    "Poisson's ratio nan": (friction(SHEAR, poisson=np.nan), "poisson = nan: must be finite"),
    "Poisson's ratio as text": (friction(SHEAR, poisson="0.5"), "poisson = '0.5': must be a number"),
    "spacing True": (heights(True), "spacing = True: must be one or two numbers > 0"),
    "three spacings": (heights((1, 1, 1)), "must be one or two numbers > 0"),
    "a masked velocity": (
        call(rf.friction, SCENE, np.ma.masked_array([1.0, 2.0], [0, 1]), 1e5),
        "velocity = masked_array",
    ),
    "a masked modulus": (
        call(rf.Prony, 1e6, np.ma.masked_array([1e6, 1e7], [0, 1]), [1.0, 2.0]),
        "Prony.E = masked_array",
    ),
    "ragged velocities": (
        call(rf.friction, SCENE, [[1.0], [1.0, 2.0]], 1e5),
        "velocity = [[1.0], [1.0, 2.0]]",
    ),
    "velocity True": (call(rf.friction, SCENE, True, 1e5), "velocity = True: must be a number"),
    "several kinds": (
        scene(lambda upper: upper["material"].attrs.__setitem__("kind", KIND)),
        "/scene/upper/material: kind = array(['Prony', 'x'], dtype=object): must be one of",
    ),
    "a loop of groups": (
        scene(lambda upper: upper.__setitem__("shift", upper.parent)),
        "/scene/upper/shift is a link to another group; the data must be in this group",
    ),
    "text as numbers": (
        lambda folder: rf.io.write_table(folder / "t.csv", {"v": ["a"], "mu": ["b"]}),
        "t.csv: column 'v' = ['a']: must be numbers",
    ),
    "one name in place of a list": (
        text(SHEAR, lambda path: rf.io.read_table(path, "omega")),
        "needed, optional = ('omega', ()): must be lists of names",
    ),
    "a label below 0 K": (
        friction("v [mm/s];mu -300 °C;mu 20 °C\n1;.5;.6\n", pressure=1e5),
        "line 2: label [K] = '-26.85': must be > 0 K",
    ),
    "equal labels": (friction("v [mm/s];mu 20 °C;mu 20 °C\n1;.5;.6\n", pressure=1e5), "both hold mu"),
    "a preamble above an empty title": (
        friction("Temperature;20 °C;;\n;f;E';E''\n;Hz;MPa;MPa\n1;1;5;1\n"),
        "column Temperature: unit '-': must be one of K",
    ),
    "a thousands separator": (friction("v [mm/s];mu;p [bar]\n1.000,5;0,5;2\n"), "has a decimal point"),
}


@pytest.mark.parametrize("name", CASES)
def test_answers(tmp_path, name):
    wrong, expected = CASES[name]
    with pytest.raises(ValueError, match=r"must|data") as caught:
        wrong(tmp_path)
    message = str(caught.value)
    assert expected in message and "\n" not in message
