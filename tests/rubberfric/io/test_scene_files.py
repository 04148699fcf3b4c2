"""Scene files in TOML: every key, defaults, and one line for every fault."""

import numpy as np
import pytest
from support.refusals import refused
from support.scenes import scene_files
from support.scenes.examples import same
from support.scenes.scene_files import DIRECTIONS, FULL, SCENES, put, write_scene

import rubberfric as rf
from rubberfric.io.files import read_scene_file

AFFINE = rf.SelfAffine(1e2, 1e3, 1e5, 0.8, 1e-4)
SHIFT = rf.TabulatedShift([273.15, 293.15, 313.15], [10.0, 1.0, 0.1], 293.15)
STRAIN = 1e-2 * np.array([1.0, 10.0, 100.0])
C_ISO = np.arange(1.0, 11.0).reshape(2, 5) * 1e-24 / (2 * np.pi) ** 2
# Scene: parts by their key path, as Python makes them.
PARTS = {
    "full": {
        "lower.material": rf.Prony(1e6, [1e6, 2e6], [1e-3, 1.0], 0.5, rf.WLF(8.0, 100.0, 293.15)),
        "lower.spectrum": AFFINE,
        "lower.layer": rf.Slab(1e-3, "frictionless"),
        "upper.material": rf.TabulatedModulus(
            2 * np.pi * np.array([1e-3, 1.0, 1e3]), [1e6, 2e6, 3e6], [1e5, 2e5, 1e5], 0.4, SHIFT, "hold"
        ),
        "upper.spectrum": rf.TabulatedSpectrum([1e2, 1e3], 1e-24 * np.array([1e12, 1e9])),
        "upper.layer": None,
        "gamma": 0.45,
        "area_correction": True,
        "shear": rf.ContactShear(6.5e6, 0.1, 6e-3, rf.Arrhenius(0.97, 293.15)),
        **dict.fromkeys(("softening", "heating", "adhesion", "correlation", "patch"), None),
        "contact_model": "paper",
    },
    "coated": {
        "lower.layer": rf.Coating(1e-3, rf.Prony(1e6, [1e6], [1e-3], 0.3)),
        "upper.material": rf.PronyShear(1e6, [1e8, 1e6], [1e-6, 1.0], 2e9),
    },
    "anisotropic": {
        "lower.spectrum": rf.Anisotropic(AFFINE, 2.0, 0.3, 32),
        "upper.spectrum": rf.TabulatedAnisotropic([1e2, 1e3], C_ISO, -0.2),
    },
    "heated": {
        "softening": rf.Softening(STRAIN, [1.0, 0.7, 0.4], [1.0, 1.1, 0.6]),
        "heating": rf.Heating(1.2e3, 1.6e3, 0.23, 1e-3),
    },
}


def part(scene, path):
    for name in path.split("."):
        scene = getattr(scene, name)
    return scene


@pytest.mark.parametrize("name", PARTS)
def test_a_scene_file_is_the_scene_of_its_keys(tmp_path, name):
    scene, conditions, title = read_scene_file(write_scene(tmp_path, SCENES[name]))
    for path, expected in PARTS[name].items():
        if isinstance(expected, rf.TabulatedAnisotropic):  # C_iso / (2 pi)^2, and 1/mm
            for field in ("q", "C", "angle"):
                np.testing.assert_allclose(
                    getattr(part(scene, path), field), getattr(expected, field), rtol=1e-14
                )
        elif isinstance(expected, str):
            assert part(scene, path) == expected
        else:
            same(part(scene, path), expected)
    assert title == "Everything"
    for values, expected in zip(conditions, ([1e-3, 1.0], [1e5], [283.15, 293.15]), strict=True):
        np.testing.assert_array_equal(values, expected)


@pytest.mark.parametrize("spectrum", [scene_files.SPECTRUM, DIRECTIONS], ids=lambda keys: keys["kind"])
def test_the_cut_of_a_table(tmp_path, spectrum):
    """q0 and q1 [1/m] with a file, by key path and in a notebook's table."""
    content = put(FULL, {"upper.spectrum": spectrum})
    cut = put(content, {"upper.spectrum.q0": 150, "upper.spectrum.q1": 900.5})
    scene, _, _ = read_scene_file(write_scene(tmp_path, cut))
    assert (scene.upper.spectrum.q0, scene.upper.spectrum.q1) == (150.0, 900.5)
    whole, _, _ = read_scene_file(write_scene(tmp_path, content))
    same(whole.replace({"upper.spectrum.q0": 150.0, "upper.spectrum.q1": 900.5}), scene)
    assert "upper.spectrum.q1" in scene._repr_html_() and "900.5" in scene._repr_html_()
    assert "upper.spectrum.q1" not in whole._repr_html_()


# Changes of the full scene: values by key path, or conditions.
REMOVED = ("title", "gamma", "area_correction", "run", "upper.spectrum", "lower.layer.base", "shear")
C0 = {"lower.spectrum.h_rms": ..., "lower.spectrum.C0": float(rf.power_spectrum(AFFINE, 500.0))}
BASE_C0 = {"lower.spectrum.base.h_rms": ..., "lower.spectrum.base.C0": C0["lower.spectrum.C0"]}
HEATED = {"softening.factor": 1.2, "heating.shear_at": "background", "heating.branch": "falling"}
OTHER_WAYS = {
    "defaults": (
        "full",
        dict.fromkeys(REMOVED, ...)
        | {"upper.material": {"kind": "elastic", "young": 1_000_000, "poisson": 0}},
        {"gamma": 0.5, "area_correction": False, "lower.layer.base": "bonded", "shear": None}
        | {"upper.material.young": 1e6, "upper.spectrum": None},
    ),
    "C0 for h_rms": ("full", C0, {"lower.spectrum.h_rms": 1e-4}),
    "C0 of a base": ("anisotropic", BASE_C0, {"lower.spectrum.base.h_rms": 1e-4}),
    "C_iso for C": (
        "full",
        {"upper.spectrum.normalisation": "C_iso"},
        {"upper.spectrum.C": 1e-24 * np.array([1e12, 1e9]) / (2 * np.pi) ** 2},
    ),
    "arrhenius": (
        "full",
        {"lower.material.shift": {"kind": "arrhenius", "energy": 1.0, "T_ref": 293.15}},
        {"lower.material.shift.energy": 1.0},
    ),
    "defaults of anisotropy": (
        "anisotropic",
        {"lower.spectrum.angle": ..., "lower.spectrum.harmonics": ...},
        {"lower.spectrum.angle": 0.0, "lower.spectrum.harmonics": 16},
    ),
    "options of heat": (
        "heated",
        HEATED,
        HEATED | {"heating.area_fraction": None, "softening.storage": [1.0, 0.7, 0.4]},
    ),
}


@pytest.mark.parametrize("name", OTHER_WAYS)
def test_defaults_and_other_ways_to_say_it(tmp_path, name):
    base, changes, expected = OTHER_WAYS[name]
    scene, conditions, title = read_scene_file(write_scene(tmp_path, put(SCENES[base], changes)))
    for path, value in expected.items():
        found = part(scene, path)
        if value is None or isinstance(value, str | bool | int):
            assert found == value
        else:
            np.testing.assert_allclose(found, value, rtol=1e-12)
    if name == "defaults":
        assert (conditions, title) == (None, "")


def test_logarithmic_velocities(tmp_path):
    content = put(FULL, {"run.velocity": {"from": 1e-6, "to": 1e2, "points": 9}})
    _, conditions, _ = read_scene_file(write_scene(tmp_path, content))
    np.testing.assert_allclose(conditions.velocity, 10.0 ** np.arange(-6, 3), rtol=1e-13)


# --- faults


def key_paths(content, above=""):
    for name, value in content.items():
        yield above + name
        if isinstance(value, dict):
            yield from key_paths(value, f"{above}{name}.")


OPTIONAL = {"title", "gamma", "area_correction", "run", "poisson", "shift", "spectrum", "layer", "base"}
OPTIONAL |= {"outside", "temperature", "shear"}


@pytest.mark.parametrize("key", list(key_paths(FULL)))
def test_every_key_refuses_wrong_values(tmp_path, key):
    last = key.split(".")[-1]
    wrong = [{"x": 1}, [[1.0]], [], "nonsense", float("nan"), -1.0, float("inf"), -1, [1.0, float("nan")]]
    if last == "title":
        wrong = [1.0, True, [], {}, "two\\nlines"]
    elif last == "velocity":
        wrong.remove(-1.0)
        wrong.remove(-1)
    if last != "area_correction":
        wrong += [True, [True, False]]
    for value in wrong:
        path = write_scene(tmp_path, put(FULL, {key: value}))
        message = refused(path, lambda path=path: rf.load_scene(path))
        assert last in message, (value, message)
    # an unknown key, and a missing key
    path = write_scene(tmp_path, put(FULL, {key + "x": 1.0}))
    assert f"{key}x: unknown key; " in refused(path, lambda: rf.load_scene(path))
    path = write_scene(tmp_path, put(FULL, {key: ...}))
    if last in OPTIONAL:
        rf.load_scene(path)
    else:
        assert f"{key}" in refused(path, lambda: rf.load_scene(path))


# Scene: a key, a wrong value, and the message, which names the file, the key, the value and the rule.
# Rules of constructors are in tests/rubberfric/base/test_objects.py; here one of each depth shows its key.
FAULTS = {
    "full": [
        ("lower.materail", {}, "lower.materail: unknown key; did you mean 'material'? must be one of"),
        ("lower.spectrum.q1", 500.0, "lower.spectrum: SelfAffine.q1 = 500.0: must be >= qr = 1000.0"),
        ("lower.spectrum.C0", 1e-9, "lower.spectrum.C0 = 1e-09: must not be given with h_rms"),
        ("lower.material.E", [1e6, -1.0], "lower.material: Prony.E[1] = -1.0: must be >= 0"),
        ("lower.material.E", [1e6, "2"], "lower.material.E[1] = '2': must be a number"),
        ("lower.material.E_inf", 10**400, "lower.material.E_inf"),
        ("lower.material.kind", "pronny", "lower.material.kind = 'pronny': did you mean 'prony'? must be"),
        ("lower.spectrum", "rough", "lower.spectrum = 'rough': must be a table"),
        ("upper.spectrum.normalisation", "psd", 'must be "C" (h_rms^2 = 2 pi int q C dq), "C_iso"'),
        ("upper.spectrum.hurst", 0.8, "upper.spectrum.hurst = 0.8: must be absent; "),
        ("upper.spectrum.normalisation", ..., "upper.spectrum.normalisation is missing: must be"),
        ("upper.spectrum.file", "no.csv", "upper.spectrum.file = 'no.csv': "),
        ("upper.material.shift.T_ref", 500.0, "upper.material.shift: TabulatedShift.T_ref = 500.0: must be"),
        ("shear", {}, "shear.tau_f0: is missing; must be given"),
        ("shear.kind", "bell", "shear.kind = 'bell': must be one of contact_shear"),
        ("run.velocity", {"from": 0, "to": 1, "points": 2}, "run.velocity.from = 0.0: must be > 0"),
        ("run.velocity", {"from": 1, "to": 1, "points": 2}, "run.velocity.to = 1.0: must be > from = 1"),
        ("run.velocity", {"from": 1, "to": 2, "points": 1}, "run.velocity.points = 1: must be an integer"),
        ("run.velocity", {"from": 1, "to": 2}, "run.velocity.points: is missing; must be given"),
        ("run.velocity", {"from": [1], "to": 2, "points": 2}, "run.velocity.from = [1.0]: must be"),
        ("run.pressure", [1e5, 0], "run.pressure[1] = 0.0: must be > 0"),
        ("run.temperature", 150.0, "run.temperature[0] = 150.0: must be > 193.15 K, the pole of the WLF law"),
        ("run.temperature", 320.0, "run.temperature[0] = 320.0: must be inside the table"),
        ("upper.spectrum.q1", 1000.5, "upper.spectrum: TabulatedSpectrum.q1 = 1000.5: must lie within the"),
    ],
    "coated": [
        ("lower.layer.base", "bonded", "lower.layer.base = 'bonded': must be a table"),
        ("lower.layer.base", {"kind": "rigid"}, "use Slab"),
        ("lower.layer.base.tau", [-1.0], "lower.layer.base: Prony.tau[0] = -1.0: must be > 0"),
        ("lower.layer.kind", "slap", "lower.layer.kind = 'slap': did you mean 'slab'?"),
        ("lower.layer.thickness", ..., "lower.layer.thickness: is missing"),
    ],
    "anisotropic": [
        ("lower.spectrum.base", ..., "lower.spectrum.base: is missing; must be given"),
        ("lower.spectrum.base", "road", "lower.spectrum.base = 'road': must be a table"),
        ("lower.spectrum.base.kind", ..., "lower.spectrum.base.kind: is missing; must be given"),
        ("lower.spectrum.base.kind", "elastic", "lower.spectrum.base.kind = 'elastic': must be one of"),
        ("lower.spectrum.base.h", 1.0, "lower.spectrum.base.h: unknown key"),
        ("lower.spectrum.ratio", ..., "lower.spectrum.ratio: is missing"),
        ("lower.spectrum.angle", "x", "lower.spectrum.angle = 'x': must be a number"),
        ("upper.spectrum.file", ..., "upper.spectrum.file is missing: must be the name of a CSV file"),
        ("upper.spectrum.normalisation", ..., "upper.spectrum.normalisation is missing: must be"),
        ("upper.spectrum.normalisation", "C_1D", 'normalisation = \'C_1D\': must be "C" or "C_iso" for'),
        (
            "upper.spectrum.q1",
            1000.5,
            "upper.spectrum: TabulatedAnisotropic.q1 = 1000.5: must lie within the",
        ),
        ("upper.spectrum.hurst", 0.8, "upper.spectrum.hurst: unknown key; must be one of"),
        ("upper.spectrum.C", 0.8, "upper.spectrum.C: unknown key; must be one of"),
        ("softening", {"file": "softening.csv"}, "Scene.softening: not together with anisotropic roughness"),
    ],
    "heated": [
        ("softening.file", ..., "softening.file is missing: must be the name of a CSV file"),
        ("softening.strain", [0.1], "softening.strain: unknown key; "),
        ("softening.kind", "payne", "softening.kind: unknown key; "),
        ("heating.density", ..., "heating.density: is missing; must be given"),
    ],
}


@pytest.mark.parametrize(
    ("scene", "key", "value", "message"),
    [(scene, *fault) for scene, faults in FAULTS.items() for fault in faults],
)
def test_message_names_file_key_value_and_rule(tmp_path, scene, key, value, message):
    path = write_scene(tmp_path, put(SCENES[scene], {key: value}))
    assert message in refused(path, lambda: rf.load_scene(path))


RIGID = {"material": {"kind": "rigid"}}
TOGETHER = [
    ({"upper.material": {"kind": "rigid"}, "lower": RIGID}, "both Rigid; one of the solids must deform"),
    (
        {"upper": RIGID, "lower.material.shift": ..., "shear.shift": ...},
        "run.temperature = 283.15: must be absent",
    ),
]


@pytest.mark.parametrize(("changes", "message"), TOGETHER)
def test_keys_that_contradict_each_other(tmp_path, changes, message):
    path = write_scene(tmp_path, put(FULL, changes))
    assert message in refused(path, lambda: rf.load_scene(path))


MODULUS = "f,E_stor,E_loss\nHz,MPa,kPa\n1e-3,1,100\n"
# A curve, its text, the file that the message names, and the message.
FAULTY_CURVES = [
    ("modulus", MODULUS + "1,2,-200\n", "modulus.csv", "line 4: E_loss = '-200'"),
    ("modulus", MODULUS, "scene.toml", "must have at least 2"),
    (
        "softening",
        scene_files.CURVES["softening.csv"].replace("10,0.7", "0.1,0.7"),
        "softening.csv",
        "line 4: strain = 0.1 after 1: must increase",
    ),
]


@pytest.mark.parametrize(("curve", "text", "named", "message"), FAULTY_CURVES)
def test_faulty_curves_are_named_themselves(tmp_path, curve, text, named, message):
    path = write_scene(tmp_path, SCENES["heated"], **{curve: text})
    assert message in refused(tmp_path / named, lambda: rf.load_scene(path))


def test_files_that_are_no_scenes(tmp_path):
    path = tmp_path / "scene.toml"
    assert "No such file" in refused(path, lambda: rf.load_scene(path))
    for content in (b"gamma = ", b"\xff", b"gamma = 1" + b"0" * 5000, b"x = " + b"[" * 100_000):
        path.write_bytes(content)
        refused(path, lambda: rf.load_scene(path))
    path.write_bytes(b"")
    assert "lower: is missing" in refused(path, lambda: rf.load_scene(path))
    assert "must be .toml or .h5" in refused(tmp_path / "x.json", lambda: rf.load_scene(tmp_path / "x.json"))
    assert "suffix ''" in refused(tmp_path, lambda: rf.load_scene(str(tmp_path)))
