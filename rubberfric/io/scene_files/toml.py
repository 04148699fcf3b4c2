"""Scene files written by hand: TOML, SI units, curves as CSV files beside it.

::

    title = "..."                       # optional
    plausible = false                   # optional: accepts what looks like another unit than SI
    gamma = 0.5                         # optional, as area_correction

    [lower]                             # solid 1
    material = { kind = "rigid" }
    [lower.spectrum]
    kind = "self_affine"                # q0, qr, q1 [1/m], hurst, and h_rms [m] or C0 [m^4]
    ...                                 # or "tabulated": file (q, C), normalisation, see rubberfric.roughness.normalisation;
                                        # a spectrum along a line (q, C_1D) needs hurst;
                                        # or "anisotropic": ratio, angle [rad], harmonics, and
                                        # base = { kind = "self_affine", ... }; or
                                        # "tabulated_anisotropic": file (q, phi or phi_deg, C, one row
                                        # for each), normalisation, angle

    [upper]                             # solid 2, slides over solid 1
    [upper.material]
    kind = "tabulated"                  # or "elastic", "prony", "prony_shear": the fields of the class
    file = "master_curve.csv"           # omega or f, E_stor, E_loss; relative to this file; other programs'
                                        # tables as `rubberfric.io.tables.exports` has them; columns = ["f [Hz]", ...]
                                        # says what the columns are of a file that does not
    shift = { kind = "wlf", C1 = 8.86, C2 = 101.6, T_ref = 293.15 }
                                        # a "prony" or "prony_shear" may be in a file of cards (`read_prony`):
                                        # file, unit_stress, unit_temperature, poisson
    [upper.layer]                       # optional: thickness [m], base, and kind = "slab"
    kind = "coating"                    # whose base is a half-space of another material
    base = { kind = "elastic", young = 1e9, poisson = 0.3 }
    ...

    [shear]                             # optional: tau_f0 [Pa], c [-], v0 [m/s], and a shift of its own
    shift = { kind = "arrhenius", energy = 0.97, T_ref = 293.15 }
    ...

    [softening]                         # optional: strain, storage_factor, loss_factor; factor [-]
    file = "softening.csv"
    ...

    [heating]                           # optional: density, heat_capacity, conductivity, radius, ...
    ...

    [run]                               # for the commands, as [map]: see `rubberfric.io.scene_files.conditions`

Keys are the fields of the classes, except those of `CURVES`, which come from a CSV file.
"""

import dataclasses
from pathlib import Path

from rubberfric.base.checks import closest, shown
from rubberfric.io.prony_cards.cards import read_prony
from rubberfric.io.scene_files.conditions import TABLES, SceneFile, read_conditions
from rubberfric.io.scene_files.plausibility import check_plausible_conditions, check_plausible_scene
from rubberfric.io.tables.reading import read_directions, read_table
from rubberfric.io.toml import check_keys, join, number, read_toml
from rubberfric.materials.coating import Coating
from rubberfric.materials.elastic import Elastic, Rigid
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.materials.slab import Slab
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.roughness.anisotropy import Anisotropic, TabulatedAnisotropic
from rubberfric.roughness.normalisation import LINES, NORMALISATION_RULE, check_normalisation, spectrum_from
from rubberfric.roughness.spectra import SelfAffine, TabulatedSpectrum
from rubberfric.scene.heating import Heating
from rubberfric.scene.scene import Body, Scene
from rubberfric.scene.shear import ContactShear
from rubberfric.scene.softening import Softening

# Class of the object that a field holds: by its key `kind`, or without one if there is no choice.
# A field that holds another thing in one class than in the others is named with that class.
KINDS = {
    "lower": Body,
    "upper": Body,
    "material": {
        "rigid": Rigid,
        "elastic": Elastic,
        "prony": Prony,
        "prony_shear": PronyShear,
        "tabulated": TabulatedModulus,
    },
    "shift": {"wlf": WLF, "arrhenius": Arrhenius, "table": TabulatedShift},
    "spectrum": {
        "self_affine": SelfAffine,
        "tabulated": TabulatedSpectrum,
        "anisotropic": Anisotropic,
        "tabulated_anisotropic": TabulatedAnisotropic,
    },
    "layer": {"slab": Slab, "coating": Coating},
    "base": {"elastic": Elastic, "prony": Prony, "rigid": Rigid},
    (Anisotropic, "base"): {"self_affine": SelfAffine},
    "shear": ContactShear,
    "softening": Softening,
    "heating": Heating,
}

# Kind of an object whose table says none.
DEFAULT_KIND = {"layer": "slab"}

# Fields that come from columns of a CSV file, named by the key `file`.
CURVES = {
    TabulatedModulus: {"omega": "omega", "storage": "E_stor", "loss": "E_loss"},
    TabulatedShift: {"T": "T", "aT": "aT"},
    TabulatedSpectrum: {"q": "q", "C": "C"},
    TabulatedAnisotropic: {"q": "q", "C": "C"},
    Softening: {"strain": "strain", "storage": "storage_factor", "loss": "loss_factor"},
}

# Keys that are no fields.
EXTRA = {
    SelfAffine: ("C0",),
    TabulatedModulus: ("file", "columns"),
    TabulatedShift: ("file", "columns"),
    TabulatedSpectrum: ("file", "columns", "normalisation", "hurst"),
    TabulatedAnisotropic: ("file", "normalisation"),
    Softening: ("file", "columns"),
}


def read_scene_toml(path, table="run"):
    """Scene, conditions and title of a TOML file.

    The conditions are those of `table`, "run" or "map", and without [map] those of [run].

    Raises
    ------
    ValueError
        one line naming the file, the key, its value and the rule it breaks.
    """
    path = Path(path)
    content = read_toml(path)
    check_keys(path, "", content, ("title", "plausible", *_fields(Scene), *TABLES))
    title = content.pop("title", "")
    if not isinstance(title, str) or not title.isprintable():
        raise ValueError(f"{path}: title = {shown(title)}: must be one line of text")
    plausible = content.pop("plausible", True)
    if not isinstance(plausible, bool):
        raise ValueError(f"{path}: plausible = {shown(plausible)}: must be true or false")
    tables = {name: content.pop(name) for name in TABLES if name in content}
    scene = _build(path, "", Scene, content)
    conditions = {name: read_conditions(path, name, found, scene) for name, found in tables.items()}
    if plausible:
        check_plausible_scene(f"{path}: ", scene)
        for name, found in conditions.items():
            check_plausible_conditions(f"{path}: {name}.", found)
    return SceneFile(scene, conditions.get(table, conditions.get("run")), title)


def _fields(cls):
    return {field.name: field for field in dataclasses.fields(cls)}


def _build(path, key, cls, content):
    """An object of class `cls` from the TOML table at `key`, "" being the file."""
    fields, curves, extra = _fields(cls), CURVES.get(cls, {}), EXTRA.get(cls, ())
    from_C0 = cls is SelfAffine and "C0" in content
    if from_C0 and "h_rms" in content:
        raise ValueError(f"{path}: {key}.C0 = {shown(content['C0'])}: must not stand beside h_rms")
    given = {name for name in extra if name != "C0"} | set(curves) | ({"h_rms"} if from_C0 else set())
    needed = [n for n, f in fields.items() if f.default is dataclasses.MISSING and n not in given]
    check_keys(path, key, content, (*(n for n in fields if n not in curves), *extra), needed)
    values = _read_curves(path, key, cls, content) if curves else {}
    for name, value in content.items():
        below = join(key, name)
        if name == "C0":
            values[name] = number(path, below, value)
        elif name in extra:
            continue
        elif "child" in fields[name].metadata:
            values[name] = _build_child(path, below, KINDS.get((cls, name)) or KINDS[name], value)
        elif "static" in fields[name].metadata:
            values[name] = value
        else:
            values[name] = number(path, below, value)
    try:
        return (SelfAffine.from_C0 if from_C0 else cls)(**values)
    except ValueError as error:
        raise ValueError(f"{path}: {f'{key}: ' if key else ''}{error}") from None


def _build_child(path, key, kinds, content):
    """The object that a field holds, of the class out of `kinds` that its `kind` says."""
    if not isinstance(kinds, dict):
        check_keys(path, key, content, content)
        return _build(path, key, kinds, content)
    default = DEFAULT_KIND.get(key.rpartition(".")[2])
    check_keys(path, key, content, content, needed=() if default else ("kind",))
    kind = content.get("kind", default)
    if not isinstance(kind, str) or kind not in kinds:
        raise ValueError(f"{path}: {key}.kind = {shown(kind)}: {closest(kind, tuple(kinds))}")
    rest = {name: value for name, value in content.items() if name != "kind"}
    if kinds[kind] in (Prony, PronyShear) and "file" in rest:
        return _read_cards(path, key, kinds[kind], rest)
    return _build(path, key, kinds[kind], rest)


def _read_cards(path, key, cls, content):
    """The Prony series in a file of material cards; a shift beside it takes the place of the file's."""
    check_keys(path, key, content, ("file", "unit_stress", "unit_temperature", "poisson", "shift"))
    given = {name: content[name] for name in ("unit_stress", "unit_temperature") if name in content}
    if "poisson" in content:
        given["poisson"] = number(path, f"{key}.poisson", content["poisson"])
    name = content["file"]
    if not isinstance(name, str):
        raise ValueError(f"{path}: {key}.file = {shown(name)}: must be the name of a file of cards")
    shift = (
        _build_child(path, f"{key}.shift", KINDS["shift"], content["shift"]) if "shift" in content else None
    )
    material = read_prony(path.parent / name, shift=shift is None, **given)
    if type(material) is not cls:
        advice = 'kind = "prony_shear", or poisson be given' if cls is Prony else 'kind = "prony"'
        raise ValueError(
            f"{path}: {key}.file = {name!r}: holds a {type(material).__name__}: must be {advice}"
        )
    return material if shift is None else dataclasses.replace(material, shift=shift)


def _read_curves(path, key, cls, content):
    """Fields of a tabulated class from its CSV file."""
    curves, name = CURVES[cls], content.get("file")
    if not isinstance(name, str):
        value = "is missing" if name is None else f"= {shown(name)}"
        raise ValueError(f"{path}: {key}.file {value}: must be the name of a CSV file")
    directions = cls is TabulatedAnisotropic
    if directions and content.get("normalisation") in LINES:
        found = shown(content["normalisation"])
        raise ValueError(f'{path}: {key}.normalisation = {found}: is along a line; must be "C" or "C_iso"')
    normalisation = _normalisation(path, key, content) if "C" in curves else None
    if normalisation in LINES:
        curves = curves | {"C": "C_1D"}
    file = path.parent / name
    try:
        if directions:
            table = dict(zip(("q", "C"), read_directions(file), strict=True))
        else:
            layout = {"columns": content.get("columns"), "poisson": content.get("poisson"), "generic": "E"}
            table = read_table(file, tuple(curves.values()), **layout)
    except ValueError as error:
        raise ValueError(
            str(error) if file.is_file() else f"{path}: {key}.file = {name!r}: {error}"
        ) from None
    values = {field: table[column] for field, column in curves.items()}
    if normalisation is not None:
        values["C"] = spectrum_from(normalisation, values["q"], values["C"], content.get("hurst"))
    return values


def _normalisation(path, key, content):
    """Which one a tabulated spectrum has, checked together with its key `hurst`."""
    name, hurst = content.get("normalisation"), content.get("hurst")
    if name is None:
        raise ValueError(f"{path}: {key}.normalisation is missing: {NORMALISATION_RULE}")
    if hurst is not None and isinstance(number(path, f"{key}.hurst", hurst), list):
        raise ValueError(f"{path}: {key}.hurst = {shown(hurst)}: must be one number")
    try:
        check_normalisation(name, hurst, f"{key}.normalisation", f"{key}.hurst")
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return name
