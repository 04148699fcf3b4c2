"""Write formats.md, with every key of scene and job files and every column and unit of tables.

    python notebooks/formats.py

The keys, columns and units are taken from the code.
"""

import csv
import dataclasses
import itertools
import typing
from pathlib import Path

from fitting.commands.job import CONDITIONS, EXTRA, FILE_RULES, PRIOR_KEYS, TEXTS
from fitting.commands.work import KEYS as DESIGN
from fitting.solvers.options import FILE_OPTIONS
from rubberfric.base.objects.fields import Child, Leaf, Static
from rubberfric.base.objects.physical import Kind, fields_of, kinds
from rubberfric.io.columns import COLUMNS, generic_name
from rubberfric.io.friction_files import PROGRAMS
from rubberfric.io.prony_cards import FORMATS
from rubberfric.io.results import QUANTITY_FORMATS
from rubberfric.io.text_tables.spellings import SPELLINGS
from rubberfric.io.text_tables.units import UNIT_SPELLINGS
from rubberfric.materials.material import Material
from rubberfric.materials.shifts import Shift, VerticalShift
from rubberfric.materials.slab import Layer
from rubberfric.roughness.spectra import Spectrum
from rubberfric.scene.body import Body
from rubberfric.scene.interface import ShearLaw
from rubberfric.scene.patch import PressureShape
from rubberfric.scene.scene import Scene

HERE = Path(__file__).parent
INTRODUCTION = HERE / "formats_introduction.md"
# Formats of other programs: format, program, what is read, asserted number, test, document.
PROGRAMS_TABLE = HERE / "programs.csv"
# Parts of a scene file: heading, key, class or role.
PLACES = (
    ("The file itself", "", Scene),
    ("A body", "lower, upper", Body),
    ("Materials", "material", Material),
    ("Spectra", "spectrum", Spectrum),
    ("Layers", "layer", Layer),
    ("Contact shear", "shear", ShearLaw),
    ("Shifts with temperature", "shift", Shift),
    ("Vertical shifts", "vertical", VerticalShift),
    ("Pressures of a patch", "patch.pressure", PressureShape),
)
OTHERS = ("heating", "softening", "adhesion", "correlation", "thermal", "patch")


def document() -> str:
    """Return the page."""
    introduction = INTRODUCTION.read_text(encoding="utf-8").rstrip()
    parts = [introduction, _programs(), _columns(), _units(), _scenes(), _jobs(), _results()]
    return "\n\n".join(parts) + "\n"


def programs() -> list[dict[str, str]]:
    """Return the rows of the table of formats of other programs."""
    with open(PROGRAMS_TABLE, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _test(row):
    return _code(row["test"].split("::")[1])


def _programs():
    rows = [
        (
            row["format"],
            row["program"],
            row["read"],
            row["number"],
            _code(row["test"].split("::")[1]),
            row["document"],
        )
        for row in programs()
    ]
    headings = ("format", "program", "what is read", "asserted number", "test", "document")
    return (
        "## Files of instruments and programs\n\nA test asserts the number in the fourth column. Its files"
        " imitate the titles, units and separators of the programs; they are not files of the manufacturers."
        " The document defines the quantities or shows the format. Other files are read if their columns have"
        " a name below, or with `columns=[...]`.\n\n" + _table(headings, rows)
    )


def _table(headings, rows):
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in lines)


def _columns():
    also = dict(SPELLINGS)
    for name, generic in itertools.product(SPELLINGS, "EG"):
        meaning = generic_name(name, generic)
        if meaning != name:
            also[meaning] = (*also.get(meaning, ()), *SPELLINGS[name])
    rows = []
    for name, column in COLUMNS.items():
        titles = ", ".join(map(_code, also.get(name, ())))
        rows.append((f"`{name}`", ", ".join(column.units), titles or "log10 of the quantity" * column.log10))
    return (
        "## Columns of tables\n\nA table has a row of names and a row of units, or titles such as `name "
        "[unit]`. The first unit of each quantity below is the SI unit. The last column lists other titles "
        "that are recognised, regardless of capitals, blanks, dots and underscores. `log` before a title "
        "means the decadic logarithm.\n\n" + _table(("name", "units", "also read as"), rows)
    )


def _code(text):
    return f"``{text}``" if "`" in text else f"`{text}`"


def _units():
    rows = [
        (_code(unit), ", ".join(map(_code, filter(None, texts)))) for unit, texts in UNIT_SPELLINGS.items()
    ]
    return (
        "## Units\n\nUnits can contain µ, ², ³, ⁴, ⁻¹, · and ^, as in `µm⁻¹`, `mm·s⁻¹` and `N/mm²`.\n\n"
        + _table(("unit", "also read as"), rows)
    )


def _scenes():
    parts = [
        "## Scene files (.toml)\n\nNumbers are in SI units. A file can begin with `title = ...` and "
        "`plausible = false`. `plausible = false` accepts numbers that seem to have the wrong unit."
    ]
    for heading, key, role in PLACES:
        classes = kinds(role).values() if issubclass(role, Kind) else [role]
        where = f" (`{key}`)" if key else ""
        parts.append(f"### {heading}{where}")
        for cls in classes:
            kind = f'`kind = "{cls.file_kind}"`: ' if issubclass(cls, Kind) else ""
            parts.append(f"{kind}{_first_line(cls)}\n\n" + _keys(cls))
    for name in OTHERS:
        owner = Scene if name in fields_of(Scene) else Body
        cls = typing.cast(Child, fields_of(owner)[name]).role
        parts.append(f"### `[{name}]`\n\n{_first_line(cls)}\n\n" + _keys(cls))
    parts.append(
        "### `[run]` and `[map]`\n\nThe keys are `velocity` [m/s], `pressure` [Pa] and, if the scene depends"
        " on it, `temperature` [K]. Each value is a number, a list, or"
        " `{ from = 1e-6, to = 1e1, points = 50 }`."
    )
    return "\n\n".join(parts)


def _first_line(cls):
    return (cls.__doc__ or "").strip().splitlines()[0]


def _keys(cls):
    rows = []
    defaults = {field.name: field.default for field in dataclasses.fields(cls)}
    for name, field in fields_of(cls).items():
        default = defaults[name]
        optional = "" if default is dataclasses.MISSING else "none" if default is None else f"{default!r}"
        if isinstance(field, Leaf):
            what = "a number" if field.ndim == 0 else "a list of numbers"
            what = f"column `{field.column}` of `file`" if field.column else what
            rows.append((f"`{name}`", what, field.unit, field.rule[0], optional))
        elif isinstance(field, Static):
            choice = ", ".join(f"`{str(c).lower() if isinstance(c, bool) else c}`" for c in field.choices)
            rows.append((f"`{name}`", choice or "a number", "", "", optional.lower()))
        else:
            rows.append((f"`{name}`", f"a table: {_role(field.role)}", "", "", optional))
    rows += [(f"`{key}`", f"instead of `{name}`", "", "", "") for key, name in cls.alternatives.items()]
    return _table(("key", "value", "unit", "rule", "default"), rows) if rows else "It has no keys."


def _role(role):
    found = [cls.file_kind for cls in kinds(role).values()] if issubclass(role, Kind) else []
    return ", ".join(map(_code, found)) or role.__name__


def _jobs():
    rules = []
    for name, cls in FILE_RULES.items():
        keys = ", ".join(_code(field.name) for field in dataclasses.fields(cls))
        rules.append((f'`"{name}"`' if name == "positive" else f'`rule = "{name}"`', keys))
    lists = {
        "`[[data]]`": ("file", *CONDITIONS, *TEXTS, *EXTRA),
        "`[prior]`": PRIOR_KEYS,
        "`[fit]`": FILE_OPTIONS,
        "`[design]`": DESIGN,
    }
    parts = [
        "## Job files of `rubberfric-fit` (.toml)\n\n`scene` is the path of a scene file. Each `[[data]]`"
        " section describes one measurement. `[free]` lists the free parameters as key paths in quotes, each"
        " with a rule. `title`, `[prior]`, `[fit]` and `[design]` (for `rubberfric-fit design`) are optional."
        " `rubberfric-fit calibration JOB.toml` simulates data with parameters drawn from the priors, fits"
        " them, and reports the coverage of the error bars.",
        "### `[free]`\n\n" + _table(("rule", "keys"), rules),
    ]
    parts += [f"### {name}\n\n{', '.join(map(_code, keys))}." for name, keys in lists.items()]
    return "\n\n".join(parts)


def _results():
    rows = [(f"`{name}`", about.unit) for name, about in QUANTITY_FORMATS.items()]
    cards, tables = (", ".join(f"`{name}`" for name in names) for names in (FORMATS, PROGRAMS))
    return (
        "## Result files (.h5)\n\nA file contains `velocity` [m/s], `pressure` [Pa], `temperature` [K], the "
        "scene in `/scene`, and the computed quantities. Each quantity has the shape [temperature, pressure, "
        "velocity]:\n\n"
        + _table(("quantity", "unit"), rows)
        + "\n\n## Files of other programs\n\n"
        + f"`rf.io.read_prony` and `rf.io.write_prony` support these formats of Prony cards: {cards}.\n\n"
        + "- A file may contain several materials. If several have a Prony series, `name` chooses one by its"
        " name or number. In scene files, the keys are `file`, `unit_stress`, `unit_temperature`, `name`,"
        " `poisson` and `shift`.\n"
        "- Moduli at several temperatures become the vertical shift of the WLF shift. The material is then"
        " defined between the temperatures of the cards. Without a WLF shift, these cards are refused.\n"
        "- Hyperelastic cards are read with their moduli at small strain. `hyperelastic=True` writes"
        " neo-Hookean cards for Abaqus and ANSYS.\n"
        "- `write_prony` writes a vertical shift as rows over temperature for Abaqus and ANSYS; `temperature`"
        " is their range. With `shift=False`, `temperature` is the temperature of the cards. `rubberfric-fit"
        " cards` writes cards of a scene, a fit or a table.\n"
        "- Cards that would change the modulus and are not read are refused: anisotropic moduli, field"
        " variables, parameters, included files, damping. Units in /BEGIN and in the comments of"
        " `write_prony` must agree with `unit_stress`. Times are in s.\n"
        "- With `bulk`, `write_prony` keeps E of the material at every frequency. The shear modulus of the"
        " cards is G = 3 B E / (9 B - E). It is a Prony series with the same number of terms. Reading the"
        " cards returns a `PronyShear` with this E.\n\n"
        + "`rf.io.read_friction` and `rf.io.write_friction` support these formats of friction tables: "
        + f"{tables}."
    )


if __name__ == "__main__":
    (HERE / "formats.md").write_text(document(), encoding="utf-8", newline="\n")
