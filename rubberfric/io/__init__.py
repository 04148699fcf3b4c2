"""Files: scenes, results, tables, and the formats of other programs."""

from rubberfric.io import hdf5, toml
from rubberfric.io.columns import COLUMNS, known_name, known_unit
from rubberfric.io.files import (
    load_result,
    load_scene,
    read_quadrature,
    save_result,
    save_scene,
    write_quadrature,
)
from rubberfric.io.friction_files import read_friction, write_friction
from rubberfric.io.friction_tables import FrictionTable
from rubberfric.io.hdf5 import read_object, write_object
from rubberfric.io.height_maps import HeightMap, read_heights, read_traces
from rubberfric.io.prony_cards import read_prony, write_prony
from rubberfric.io.results import Curves, Result, curves_of
from rubberfric.io.tables import column_hint, read_columns, read_names, read_table, write_table
from rubberfric.io.toml import read_conditions

__all__ = [
    "COLUMNS",
    "Curves",
    "FrictionTable",
    "HeightMap",
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
    "read_heights",
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
