"""Scenes in TOML files, in SI units, with curves in CSV files; strict reading of TOML files in general.

::

    title = "..."                       # optional
    plausible = false                   # optional: accept values that are probably not in SI
    gamma = 0.5                         # optional, also area_correction

    [lower]                             # solid 1
    material = { kind = "rigid" }
    spectrum = { kind = "self_affine", q0 = 1e3, qr = 1e3, q1 = 1e7, hurst = 0.8, h_rms = 1e-4 }

    [upper]                             # solid 2, slides over solid 1
    [upper.material]
    kind = "tabulated"
    file = "master_curve.csv"           # columns omega or f, E_stor, E_loss; relative to this file
    shift = { kind = "wlf", C1 = 8.86, C2 = 101.6, T_ref = 293.15 }

    [run]                               # conditions for the commands, also [map]
    velocity = { from = 1e-6, to = 1e2, points = 50 }   # [m/s]
    pressure = 0.15e6                                   # [Pa]
    temperature = [283.15, 293.15]                      # [K], optional

Keys are the fields of the classes, and `kind` is the `file_kind` of a class. notebooks/formats.md lists all
keys and kinds. Fields with a `column` are read from the CSV file that the key `file` names. The key `columns`
names the columns of this file, `poisson` converts shear moduli, and `normalisation` and `hurst` describe a
spectrum. A "prony" or "prony_shear" may be read from a `file` of material cards, with the keys `unit_stress`,
`unit_temperature`, `name` and `poisson` (see `read_prony`). A condition is a number, a list or a range. A
range includes both ends, and is spaced evenly in temperature or in the logarithm of velocity and pressure.
"""

import dataclasses
import json
import math
import tomllib
import warnings
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rubberfric.base.atomic import StrPath, read_text
from rubberfric.base.checks import UnitWarning, closest, shown
from rubberfric.base.objects.fields import Child, Leaf, Static
from rubberfric.base.objects.physical import Kind, PhysicalObject, fields_of, kinds, leaves_of
from rubberfric.io.prony_cards import read_prony
from rubberfric.io.results import CONDITION_UNITS, Conditions, SceneFile, check_conditions, check_plausible
from rubberfric.io.tables import read_density, read_directions, read_table
from rubberfric.io.text_tables.writing import table_text
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.roughness.normalisation import (
    NORMALISATION_RULE,
    check_normalisation,
    density_column,
    spectrum_from,
)
from rubberfric.scene.plausible import doubts_of_conditions, doubts_of_scene
from rubberfric.scene.scene import Scene

# Tables of a scene file that hold conditions.
TABLES = ("run", "map")


# --- TOML


def read_toml(path: StrPath) -> dict[str, Any]:
    """Read a TOML file as a dict, or raise ValueError if the file is missing or invalid."""
    text = read_text(path)
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise ValueError(f"{path}: is not TOML: {error}") from None
    except RecursionError:
        raise ValueError(f"{path}: is not TOML: nested too deeply") from None


def check_keys(
    path: StrPath, key: str, content: Any, allowed: Collection[str], needed: Collection[str] = ()
) -> None:
    """Raise ValueError unless the table at `key` has only allowed keys and all needed keys."""
    if not isinstance(content, dict):
        raise ValueError(f"{path}: {key} = {shown(content)}: must be a table")
    for name in content:
        if name not in allowed:
            raise ValueError(f"{path}: {join(key, name)}: unknown key; {closest(name, allowed)}")
    for name in needed:
        if name not in content:
            raise ValueError(f"{path}: {join(key, name)}: is missing; must be given")


def join(key: str, name: str) -> str:
    """Return the key path of `name` in the TOML table at `key`, which is "" at the top level."""
    return f"{key}.{name}" if key else name


def number(path: StrPath, key: str, value: Any) -> Any:
    """Convert a number or a list of numbers to floats; constructors check signs and NaN."""
    if isinstance(value, list):
        items = [number(path, f"{key}[{i}]", item) for i, item in enumerate(value)]
        if any(isinstance(item, list) for item in items):
            raise ValueError(f"{path}: {key} = {shown(value)}: must be a list of numbers, not of lists")
        return items
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{path}: {key} = {shown(value)}: must be a number")
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"{path}: {key} = {shown(value)}: must be finite") from None


# --- reading scenes and conditions


def read_scene_toml(path: StrPath, table: str = "run") -> SceneFile:
    """Read scene, conditions and title of a TOML file.

    The conditions are in the TOML table `table`, "run" or "map". [run] replaces a missing [map]. The message
    of a ValueError names the file, the key, its value and the rule.
    """
    path = Path(path)
    content = read_toml(path)
    if {"scene", "scenes"} & set(content) and "free" in content:
        raise ValueError(f"{path}: must be a scene with lower and upper, not a job of `rubberfric-fit`")
    check_keys(path, "", content, ("title", "plausible", *fields_of(Scene), *TABLES))
    title = content.pop("title", "")
    if not isinstance(title, str) or not title.isprintable():
        raise ValueError(f"{path}: title = {shown(title)}: must be one line of text")
    plausible = content.pop("plausible", True)
    if not isinstance(plausible, bool):
        raise ValueError(f"{path}: plausible = {shown(plausible)}: must be true or false")
    tables = {name: content.pop(name) for name in TABLES if name in content}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnitWarning)  # an error below unless accepted
        scene = _build(path, "", Scene, content)
    conditions = {name: read_conditions(path, name, values, scene) for name, values in tables.items()}
    if plausible:
        check_plausible(f"{path}: ", doubts_of_scene(scene))
        for name, values in conditions.items():
            check_plausible(f"{path}: {name}.", doubts_of_conditions(**values._asdict()))
    return SceneFile(scene, conditions.get(table, conditions.get("run")), title)


def read_conditions(path: Path, table: str, content: Any, scene: Scene) -> Conditions:
    """Read and check the conditions in the TOML table named `table` of the file `path`.

    Examples
    --------
    >>> from pathlib import Path
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> content = {"velocity": {"from": 1e-3, "to": 0.1, "points": 3}, "pressure": 0.15e6}
    >>> rf.io.read_conditions(Path("scene.toml"), "run", content, scene).velocity
    array([0.001, 0.01 , 0.1  ])
    """
    check_keys(path, table, content, Conditions._fields, needed=("velocity", "pressure"))
    values: dict[str, Any] = dict.fromkeys(Conditions._fields)
    for name, value in content.items():
        key = f"{table}.{name}"
        if isinstance(value, dict):
            values[name] = _range(path, key, value, np.linspace if name == "temperature" else np.geomspace)
        else:
            values[name] = np.atleast_1d(np.array(number(path, key, value), float))
    conditions = Conditions(**values)
    check_conditions(f"{path}: {table}.", conditions, scene)
    return conditions


def _range(path, key, content, spaced):
    """Return the values of a range { from, to, points }, which the NumPy function `spaced` computes."""
    check_keys(path, key, content, ("from", "to", "points"), needed=("from", "to", "points"))
    low, high = (number(path, f"{key}.{name}", content[name]) for name in ("from", "to"))
    points = content["points"]
    if isinstance(low, list) or not 0 < low < math.inf:
        raise ValueError(f"{path}: {key}.from = {shown(low)}: must be > 0 and finite")
    if isinstance(high, list) or not low < high < math.inf:
        raise ValueError(f"{path}: {key}.to = {shown(high)}: must be > from = {low:g} and finite")
    if not isinstance(points, int) or isinstance(points, bool) or not 2 <= points <= 100_000:
        raise ValueError(f"{path}: {key}.points = {shown(points)}: must be an integer, 2 to 100000")
    return spaced(low, high, points)


def _build(path, key, cls, content):
    fields, curves = fields_of(cls), _curves(cls)
    instead = {name: field for name, field in cls.alternatives.items() if name in content}
    for name, field in instead.items():
        if field in content:
            raise ValueError(f"{path}: {key}.{name} = {shown(content[name])}: must not be given with {field}")
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
            # The name of a kind without keys may stand for its table.
            named = isinstance(value, str) and value in field.names
            values[name] = _build_child(path, below, field, {"kind": value} if named else value)
        elif isinstance(field, Static):
            values[name] = value
    try:
        return getattr(cls, f"from_{next(iter(instead))}")(**values) if instead else cls(**values)
    except ValueError as error:
        raise ValueError(f"{path}: {f'{key}: ' if key else ''}{error}") from None


def _build_child(path, key, field, content):
    """Return the object of a field from the TOML table at `key`, which names one of several kinds."""
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
    """Read the Prony series in a file of cards.

    The key `shift` replaces the shift of the file, and shift = false leaves it out.
    """
    check_keys(path, key, content, ("file", "unit_stress", "unit_temperature", "name", "poisson", "shift"))
    options = {name: content[name] for name in ("unit_stress", "unit_temperature", "name") if name in content}
    if "poisson" in content:
        options["poisson"] = number(path, f"{key}.poisson", content["poisson"])
    name, shift = content["file"], None
    if not isinstance(name, str):
        raise ValueError(f"{path}: {key}.file = {shown(name)}: must be the name of a file of cards")
    if "shift" in content and content["shift"] is not False:
        shift = _build_child(path, f"{key}.shift", fields_of(cls)["shift"], content["shift"])
    material = read_prony(path.parent / name, shift="shift" not in content, **options)
    if type(material) is not cls:
        advice = 'set kind = "prony_shear" or give poisson' if cls is Prony else 'set kind = "prony"'
        held = type(material).__name__
        raise ValueError(f"{path}: {key}.file = {name!r}: must hold {cls.__name__}, not {held}; {advice}")
    return material if shift is None else material.replace(shift=shift)


def _curves(cls):
    """Return a dict from field name to CSV column for the fields that are read from a CSV file."""
    return {name: field.column for name, field in leaves_of(cls).items() if field.column is not None}


def _has_directions(cls):
    """Return True if the CSV file of a class has a row for every wavevector and direction."""
    return any(field.ndim == 2 for field in leaves_of(cls).values() if field.column is not None)


def _file_keys(cls):
    """Return the TOML keys that describe the CSV file of a class."""
    columns = _curves(cls).values()
    if _has_directions(cls):
        return ("file", "normalisation")
    return ("file", "columns", "bad_rows") * bool(columns) + ("normalisation", "hurst") * ("C" in columns)


def _read_curves(path, key, cls, content):
    curves, name = _curves(cls), content.get("file")
    if not isinstance(name, str):
        value = "is missing" if name is None else f"= {shown(name)}"
        raise ValueError(f"{path}: {key}.file {value}: must be the name of a CSV file")
    directions = _has_directions(cls)
    if directions and density_column(content.get("normalisation")) != "C":
        stated = shown(content["normalisation"])
        raise ValueError(f'{path}: {key}.normalisation = {stated}: must be "C" or "C_iso" for directions')
    normalisation = _normalisation(path, key, content) if "C" in curves.values() else None
    file = path.parent / name
    try:
        if directions:
            table: dict[str, Any] = dict(zip(("q", "C"), read_directions(file), strict=True))
        elif normalisation is not None:
            bad_rows = content.get("bad_rows", "error")
            table = read_density(file, normalisation, (), content.get("columns"), bad_rows=bad_rows)
        else:
            layout = {"columns": content.get("columns"), "poisson": content.get("poisson"), "generic": "E"}
            layout["bad_rows"] = content.get("bad_rows", "error")
            table = read_table(file, tuple(curves.values()), **layout)
    except ValueError as error:
        text = str(error) if file.is_file() else f"{path}: {key}.file = {name!r}: {error}"
        raise ValueError(text) from None
    if normalisation is not None:
        try:
            table["C"] = spectrum_from(normalisation, table["q"], table["C"], content.get("hurst"))
        except ValueError as error:
            raise ValueError(f"{path}: {key}.{error}") from None
    return {field: table[column] for field, column in curves.items()}


def _normalisation(path, key, content):
    """Check `normalisation` and `hurst` of a tabulated spectrum, and return the normalisation."""
    name, hurst = content.get("normalisation"), content.get("hurst")
    if name is None:
        raise ValueError(f"{path}: {key}.normalisation is missing: {NORMALISATION_RULE}")
    if hurst is not None and isinstance(number(path, f"{key}.hurst", hurst), list):
        raise ValueError(f"{path}: {key}.hurst = {shown(hurst)}: must be one number")
    try:
        check_normalisation(name, hurst, f"{key}.normalisation", f"{key}.hurst", table=True)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    return name


# --- writing scenes


def scene_texts(
    scene: Scene,
    conditions: Conditions | None,
    title: str = "",
    *,
    name: str = "scene.toml",
    prefix: str = "",
) -> dict[str, str]:
    """Return a dict from file name to text for a scene: first a TOML file, then a CSV file for each table.

    Parameters
    ----------
    scene : Scene with concrete values, which `read_scene_toml` restores exactly
    conditions : conditions for [run], or None
    title : one line of text
    name, prefix : name of the TOML file, and beginning of the names of the CSV files, which continue with
        the key path of the object that has the table
    """
    tables: dict[str, str] = {}
    lines = [f"title = {string(title)}"] if title else []
    columns = {} if conditions is None else conditions._asdict()
    if [*doubts_of_scene(scene), *doubts_of_conditions(**columns)]:
        lines.append("plausible = false")
    lines += [*object_lines("", scene, tables, prefix), *["", "[run]"] * bool(columns)]
    for key, values in columns.items():
        if values is not None:
            lines.append(
                f"{key} = {literal(values if values.size > 1 else values[0])}  # {CONDITION_UNITS[key]}"
            )
    return {name: "\n".join(lines) + "\n"} | tables


def object_lines(key: str, value: PhysicalObject, tables: dict[str, str], prefix: str) -> Iterator[str]:
    """Yield the TOML lines of an object and of the objects inside it, and add CSV texts to `tables`."""
    fields = fields_of(type(value))
    if isinstance(value, Kind):
        yield f"kind = {string(value.file_kind)}"
    columns = {}
    for name, field in fields.items():
        content = getattr(value, name)
        if isinstance(field, Child) or content is None:
            continue
        if isinstance(field, Leaf) and field.column is not None:
            columns[field.column] = np.asarray(content, float)
            continue
        unit = f"  # {field.unit}" if isinstance(field, Leaf) and field.unit != "-" else ""
        yield f"{name} = {literal(content)}{unit}"
    if columns:
        file = f"{prefix}{key.replace('.', '_')}.csv"
        tables[file] = _table(columns)
        yield f"file = {string(file)}"
        if "C" in columns:
            yield 'normalisation = "C"'
    for name, field in fields.items():
        content = getattr(value, name)
        if isinstance(field, Child) and content is not None:
            yield from ("", f"[{join(key, name)}]", *object_lines(join(key, name), content, tables, prefix))


def _table(columns: dict[str, np.ndarray]) -> str:
    """Return columns as CSV text, with one row for each element of a matrix over q and directions."""
    for name, values in columns.items():
        if values.ndim == 2:
            count = values.shape[1]
            grown = {other: np.repeat(x, count) for other, x in columns.items() if x.ndim == 1}
            phi = np.tile(np.arange(count) * (math.pi / count), values.shape[0])
            columns = grown | {"phi": phi, name: values.ravel()}
            break
    return table_text(columns)


def literal(value: Any) -> str:
    """Return an option, a number, an array, or a list of texts in TOML."""
    if isinstance(value, bool | int | str):  # an option
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list) and all(isinstance(item, str) for item in value):
        return f"[{', '.join(map(string, value))}]"
    return repr(np.asarray(value, float).tolist())


def string(text: str) -> str:
    """Return a text as a basic string of TOML, which has the escapes of JSON."""
    return json.dumps(text, ensure_ascii=False)
