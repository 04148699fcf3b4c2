"""Scene files written by hand: TOML, SI units, curves as CSV files beside it.

::

    title = "..."                       # optional
    plausible = false                   # optional: accepts what looks like another unit than SI
    gamma = 0.5                         # optional, as area_correction

    [lower]                             # solid 1
    material = { kind = "rigid" }
    [lower.spectrum]
    kind = "self_affine"                # q0, qr, q1 [1/m], hurst, and h_rms [m] or C0 [m^4]
    ...                                 # or "tabulated": file (q, C), normalisation, see
                                        # `rubberfric.roughness.normalisation`; q0, q1 within the table;
                                        # a spectrum along a line (q, C_1D) needs hurst;
                                        # or "anisotropic": ratio, angle [rad], harmonics, and
                                        # base = { kind = "self_affine", ... }; or
                                        # "tabulated_anisotropic": file (q, phi or phi_deg, C, one row
                                        # for each), normalisation, angle

    [upper]                             # solid 2, slides over solid 1
    [upper.material]
    kind = "tabulated"                  # or "elastic", "prony", "prony_shear": the fields of the class
    file = "master_curve.csv"           # omega or f, E_stor, E_loss; relative to this file; other programs'
                                        # tables as `rubberfric.io.tables.exports` has them;
                                        # columns = ["f [Hz]", ...] says what the columns are of a file
                                        # that does not
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

    [adhesion]                          # optional: work; limit = "long" and range

    [correlation]                       # optional: coherence; at velocity 0 only

    [heating]                           # optional: density, heat_capacity, conductivity, radius, ...
    ...

    [run]                               # for the commands, as [map]: see
                                        # `rubberfric.io.scene_files.conditions`

Keys are the fields of the classes, except those with a `column`, which come from a CSV file; `kind` is
the class's `file_kind`.
"""

import dataclasses
import warnings
from pathlib import Path
from typing import Any

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import UnitWarning, closest, shown
from rubberfric.base.objects.fields import Child, Leaf, Static
from rubberfric.base.objects.physical import Kind, fields_of, kinds, leaves_of
from rubberfric.io.prony_cards.cards import read_prony
from rubberfric.io.scene_files.conditions import TABLES, SceneFile, read_conditions
from rubberfric.io.scene_files.plausibility import check_plausible_conditions, check_plausible_scene
from rubberfric.io.tables.reading import read_directions, read_table
from rubberfric.io.toml import check_keys, join, number, read_toml
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.roughness.normalisation import LINES, NORMALISATION_RULE, check_normalisation, spectrum_from
from rubberfric.scene.scene import Scene


def read_scene_toml(path: StrPath, table: str = "run") -> SceneFile:
    """Scene, conditions and title of a TOML file.

    The conditions are those of `table`, "run" or "map", and without [map] those of [run].

    Raises
    ------
    ValueError
        one line naming the file, the key, its value and the rule it breaks.
    """
    path = Path(path)
    content = read_toml(path)
    if {"scene", "scenes"} & set(content) and "free" in content:
        raise ValueError(f"{path}: is a job of `rubberfric-fit`: must be a scene, with lower and upper")
    check_keys(path, "", content, ("title", "plausible", *fields_of(Scene), *TABLES))
    title = content.pop("title", "")
    if not isinstance(title, str) or not title.isprintable():
        raise ValueError(f"{path}: title = {shown(title)}: must be one line of text")
    plausible = content.pop("plausible", True)
    if not isinstance(plausible, bool):
        raise ValueError(f"{path}: plausible = {shown(plausible)}: must be true or false")
    tables = {name: content.pop(name) for name in TABLES if name in content}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnitWarning)  # below they are errors, or accepted
        scene = _build(path, "", Scene, content)
    conditions = {name: read_conditions(path, name, found, scene) for name, found in tables.items()}
    if plausible:
        check_plausible_scene(f"{path}: ", scene)
        for name, found in conditions.items():
            check_plausible_conditions(f"{path}: {name}.", found)
    return SceneFile(scene, conditions.get(table, conditions.get("run")), title)


def _build(path, key, cls, content):
    """An object of class `cls` from the TOML table at `key`, "" being the file."""
    fields, curves = fields_of(cls), _curves(cls)
    instead = {name: field for name, field in cls.alternatives.items() if name in content}
    for name, field in instead.items():
        if field in content:
            raise ValueError(f"{path}: {key}.{name} = {shown(content[name])}: must not stand beside {field}")
    allowed = [*(name for name in fields if name not in curves), *cls.alternatives, *_file_keys(cls)]
    required = [field.name for field in dataclasses.fields(cls) if field.default is dataclasses.MISSING]
    needed = [name for name in required if name not in curves and name not in instead.values()]
    check_keys(path, key, content, allowed, needed)
    values = _read_curves(path, key, cls, content) if curves else {}
    for name, value in content.items():
        field, below = fields.get(name), join(key, name)
        if isinstance(field, Leaf) or name in instead:
            values[name] = number(path, below, value)
        elif isinstance(field, Child):
            values[name] = _build_child(path, below, field, value)
        elif isinstance(field, Static):
            values[name] = value
    try:
        return getattr(cls, f"from_{next(iter(instead))}")(**values) if instead else cls(**values)
    except ValueError as error:
        raise ValueError(f"{path}: {f'{key}: ' if key else ''}{error}") from None


def _build_child(path, key, field, content):
    """The object that a field holds: of its class, or where that is a role of the kind that it says."""
    check_keys(path, key, content, content)
    if not issubclass(field.role, Kind):
        return _build(path, key, field.role, content)
    known = {cls.file_kind: cls for cls in kinds(field.role).values()}
    check_keys(path, key, content, content, needed=() if field.unnamed else ("kind",))
    kind = content.get("kind", field.unnamed)
    if not isinstance(kind, str) or kind not in known:
        raise ValueError(f"{path}: {key}.kind = {shown(kind)}: {closest(kind, tuple(known))}{field.hint}")
    fields = {name: value for name, value in content.items() if name != "kind"}
    if known[kind] in (Prony, PronyShear) and "file" in fields:
        return _read_cards(path, key, known[kind], fields)
    return _build(path, key, known[kind], fields)


def _read_cards(path, key, cls, content):
    """The Prony series in a file of material cards; a shift beside it takes the place of the file's."""
    check_keys(path, key, content, ("file", "unit_stress", "unit_temperature", "poisson", "shift"))
    given = {name: content[name] for name in ("unit_stress", "unit_temperature") if name in content}
    if "poisson" in content:
        given["poisson"] = number(path, f"{key}.poisson", content["poisson"])
    name, shift = content["file"], None
    if not isinstance(name, str):
        raise ValueError(f"{path}: {key}.file = {shown(name)}: must be the name of a file of cards")
    if "shift" in content:
        shift = _build_child(path, f"{key}.shift", fields_of(cls)["shift"], content["shift"])
    material = read_prony(path.parent / name, shift=shift is None, **given)
    if type(material) is not cls:
        advice = 'kind = "prony_shear", or poisson be given' if cls is Prony else 'kind = "prony"'
        raise ValueError(
            f"{path}: {key}.file = {name!r}: holds a {type(material).__name__}: must be {advice}"
        )
    return material if shift is None else material.replace(shift=shift)


def _curves(cls):
    """Column of every field that comes from a CSV file."""
    return {name: field.column for name, field in leaves_of(cls).items() if field.column is not None}


def _over_directions(cls):
    """Whether the file has a row for every direction."""
    return any(field.ndim == 2 for field in leaves_of(cls).values() if field.column is not None)


def _file_keys(cls):
    """Keys of a class with curves that are no fields: the file, and what must be known to read it."""
    columns = _curves(cls).values()
    if _over_directions(cls):
        return ("file", "normalisation")
    return ("file", "columns") * bool(columns) + ("normalisation", "hurst") * ("C" in columns)


def _read_curves(path, key, cls, content):
    """Fields of a tabulated class from its CSV file."""
    curves, name = _curves(cls), content.get("file")
    if not isinstance(name, str):
        value = "is missing" if name is None else f"= {shown(name)}"
        raise ValueError(f"{path}: {key}.file {value}: must be the name of a CSV file")
    directions = _over_directions(cls)
    if directions and content.get("normalisation") in LINES:
        found = shown(content["normalisation"])
        raise ValueError(f'{path}: {key}.normalisation = {found}: is along a line; must be "C" or "C_iso"')
    normalisation = _normalisation(path, key, content) if "C" in curves.values() else None
    density = "C_1D" if normalisation in LINES else "C"  # the column
    file = path.parent / name
    try:
        if directions:
            table: dict[str, Any] = dict(zip(("q", "C"), read_directions(file), strict=True))
        else:
            layout = {"columns": content.get("columns"), "poisson": content.get("poisson"), "generic": "E"}
            names = tuple(density if column == "C" else column for column in curves.values())
            table = read_table(file, names, **layout)
    except ValueError as error:
        raise ValueError(
            str(error) if file.is_file() else f"{path}: {key}.file = {name!r}: {error}"
        ) from None
    if normalisation is not None:
        table["C"] = spectrum_from(normalisation, table["q"], table[density], content.get("hurst"))
    return {field: table[column] for field, column in curves.items()}


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
