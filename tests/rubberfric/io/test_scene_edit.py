"""A scene that replaces the scene in an existing scene file: the other lines of the file stay."""

import difflib

import pytest
from support.folders import DATA
from support.scenes.examples import same

import rubberfric as rf
from rubberfric.io.files import read_scene_file

FILES = sorted(path.name for path in DATA.glob("*.toml") if not path.stem.endswith("_fit"))
SPECTRUM = rf.SelfAffine(50.0, 500.0, 2e4, 0.7, 1e-4)
TABLE = rf.TabulatedSpectrum([1e2, 1e3, 1e4], [1e-10, 1e-12, 1e-16])
ROAD = """# from the test track
title = "a road" # of 2019

[lower] # the road
material = { kind = "rigid" }
# stylus, six traces
spectrum = { kind = "self_affine", q0 = 1e2,\\
 qr = 1e3, q1 = 1e5, hurst = 0.8, h_rms = 1e-4 }

[upper.material] # the tread
kind = "elastic"
young = 1e7 # Pa, from a catalogue
poisson = 0.5

[run]
velocity = [1e-3,
            1e-2] # m/s, slow # and fast
pressure = 2e5
""".replace("\\\n", "")


def without_spectrum(text):
    """Return the lines of a scene file that are not in the table lower.spectrum or in tables inside it."""
    lines, here = [], ""
    for line in text.splitlines():
        here = line.strip().split("]")[0][1:] if line.startswith("[") else here
        lines += [line] * (not f"{here}.".startswith("lower.spectrum."))
    return lines


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("spectrum", [SPECTRUM, TABLE], ids=["formula", "table"])
def test_only_the_lines_of_the_spectrum_change(tmp_path, name, spectrum):
    for path in DATA.glob("*.*"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    before = read_scene_file(tmp_path / name, "map")
    scene = before.scene.replace("lower.spectrum", spectrum)
    rf.save_scene(tmp_path / "new.toml", scene, like=tmp_path / name)
    after = read_scene_file(tmp_path / "new.toml", "map")
    same(after.scene, scene)
    assert after.title == before.title
    assert str(after.conditions) == str(before.conditions)
    old, new = (without_spectrum((tmp_path / each).read_text("utf-8")) for each in (name, "new.toml"))
    changed = [line for line in difflib.ndiff(old, new) if line[0] in "+-" and line[1:].strip()]
    assert all("spectrum" in line for line in changed), changed
    assert len(changed) <= 2


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_inline_tables_comments_and_lists_over_lines(tmp_path, line_end):
    (tmp_path / "old.toml").write_bytes(ROAD.replace("\n", line_end).encode())
    scene = rf.load_scene(tmp_path / "old.toml").replace("lower.spectrum.q1", 2e5)
    rf.save_scene(tmp_path / "new.toml", scene, like=tmp_path / "old.toml")
    text = (tmp_path / "new.toml").read_bytes().decode()
    old = ROAD.replace("\n", line_end).splitlines(keepends=True)
    new = text.splitlines(keepends=True)
    assert next(line for line in new if line not in old).startswith("spectrum = { kind =")
    assert sum(line not in old for line in new) == 1 and len(new) == len(old)
    same(rf.load_scene(tmp_path / "new.toml"), scene)


@pytest.mark.parametrize(
    "text",
    [
        'lower.material.kind = "rigid"\nlower.spectrum.kind = "self_affine"\nlower.spectrum.q0 = 1e2\n'
        "lower.spectrum.qr = 1e3\nlower.spectrum.q1 = 1e5\nlower.spectrum.hurst = 0.8\n"
        "lower.spectrum.h_rms = 1e-4\n"
        'upper = { material = { kind = "elastic", young = 1e7, poisson = 0.5 } }',
        '[upper]\n"material" = { kind = "elastic", young = 1e7, poisson = 0.5 }\n'
        '[lower]\nmaterial.kind = "rigid"',
        'lower = { material = { kind = "rigid" } }\n[ upper . "material" ]\nkind = "elastic"\n'
        "young = 1e7\npoisson = 0.5",
        '[lower.spectrum]\nkind = "self_affine"\nq0 = 1e2\nqr = 1e3\nq1 = 1e5\nhurst = 0.8\nC0 = 1e-14\n'
        '[upper.material]\nkind = "elastic"\nyoung = 1e7\npoisson = 0.5\n[lower.material]\nkind = "rigid"',
    ],
)
def test_every_way_to_write_a_table(tmp_path, text):
    (tmp_path / "old.toml").write_text(
        f'# first\ntitle = "t"\n{text}\n# last\n[run]\nvelocity = 1\npressure = 2e5\n'
    )
    old = rf.load_scene(tmp_path / "old.toml")
    changes = [
        {"lower.spectrum": SPECTRUM},
        {"lower.spectrum": TABLE},
        {"upper.material.young": 2e7},
        {"upper.material": rf.Prony(1e6, [1e7], [1e-3], 0.5)},
        {"gamma": 0.6, "upper.softening": None, "lower.spectrum": SPECTRUM},
        {"lower.material": rf.Elastic(2e9, 0.4), "lower.spectrum": SPECTRUM},
    ]
    if old.lower.spectrum is not None:
        changes += [{"lower.spectrum.q1": 2e5}, {"lower.spectrum": None, "upper.spectrum": SPECTRUM}]
    for change in changes:
        scene = old.replace(change)
        rf.save_scene(tmp_path / "new.toml", scene, like=tmp_path / "old.toml")
        after = read_scene_file(tmp_path / "new.toml")
        same(after.scene, scene)
        assert after.title == "t" and after.conditions.velocity == 1
        kept = (tmp_path / "new.toml").read_text().splitlines()
        assert {"# first", "# last", "[run]"} <= set(kept)


def test_temperature_follows_the_scene(tmp_path):
    (tmp_path / "old.toml").write_text(ROAD)
    scene = rf.load_scene(tmp_path / "old.toml").replace(heating=rf.Heating(1.2e3, 1.6e3, 0.23, 1e-3))
    with pytest.warns(UserWarning, match=r"run.temperature = 293.15 K is added"):
        rf.save_scene(tmp_path / "hot.toml", scene, like=tmp_path / "old.toml")
    assert read_scene_file(tmp_path / "hot.toml").conditions.temperature == 293.15
    with pytest.warns(UserWarning, match=r"run.temperature is left out"):
        rf.save_scene(tmp_path / "cold.toml", scene.replace(heating=None), like=tmp_path / "hot.toml")
    assert read_scene_file(tmp_path / "cold.toml").conditions.temperature is None


def test_tables_of_others_are_not_overwritten(tmp_path):
    (tmp_path / "road.toml").write_text(ROAD)
    (tmp_path / "new_lower_spectrum.csv").write_text("measured")
    scene = rf.load_scene(tmp_path / "road.toml").replace("lower.spectrum", TABLE)
    for _ in range(2):  # the second time the table belongs to new.toml
        rf.save_scene(tmp_path / "new.toml", scene, like=tmp_path / "road.toml")
        assert (tmp_path / "new_lower_spectrum.csv").read_text() == "measured"
        same(rf.load_scene(tmp_path / "new.toml"), scene)
    assert {path.name for path in tmp_path.glob("*.csv")} == {
        "new_lower_spectrum.csv",
        "new_2_lower_spectrum.csv",
    }


def test_another_folder_and_hdf5(tmp_path):
    (tmp_path / "road.toml").write_text(ROAD)
    (tmp_path / "there").mkdir()
    scene = rf.load_scene(tmp_path / "road.toml").replace("lower.spectrum", TABLE)
    rf.save_scene(tmp_path / "table.toml", scene, like=tmp_path / "road.toml")
    changed = scene.replace("upper.material.young", 2e7)
    for name in ("there/new.toml", "there/new.h5", "there/back.toml"):
        like = "there/new.h5" if "back" in name else "table.toml"
        rf.save_scene(tmp_path / name, changed, like=tmp_path / like)
        found = read_scene_file(tmp_path / name)
        same(found.scene, changed)
        assert found.title == "a road"
        assert found.conditions.velocity.tolist() == [1e-3, 1e-2]
