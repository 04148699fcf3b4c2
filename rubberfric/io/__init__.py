"""Files: scenes, results, tables, and the formats of other programs."""

from rubberfric.io import hdf5, toml
from rubberfric.io.files import load_scene, save_scene
from rubberfric.io.friction_tables.files import read_friction, write_friction
from rubberfric.io.friction_tables.table import FrictionTable
from rubberfric.io.prony_cards.cards import read_prony, write_prony
from rubberfric.io.result_files import load_result, read_quadrature, save_result, write_quadrature
from rubberfric.io.results import Curves, Result, curves_of
from rubberfric.io.scene_files.conditions import read_conditions
from rubberfric.io.scene_files.hdf5 import read_object, write_object
from rubberfric.io.tables.columns import COLUMNS
from rubberfric.io.tables.reading import column_hint, read_columns, read_names, read_table
from rubberfric.io.tables.titles import known_name, known_unit
from rubberfric.io.tables.traces import read_traces
from rubberfric.io.tables.writing import write_table

__all__ = [
    "COLUMNS",
    "Curves",
    "FrictionTable",
    "Result",
    "column_hint",
    "curves_of",
    "hdf5",
    "known_name",
    "known_unit",
    "load_result",
    "load_scene",
    "read_columns",
    "read_conditions",
    "read_friction",
    "read_names",
    "read_object",
    "read_prony",
    "read_quadrature",
    "read_table",
    "read_traces",
    "save_result",
    "save_scene",
    "toml",
    "write_friction",
    "write_object",
    "write_prony",
    "write_quadrature",
    "write_table",
]
