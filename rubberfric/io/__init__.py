"""Files: scenes, results, tables, and the formats of other programs."""

from rubberfric.base.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.io import hdf5 as hdf5
    from rubberfric.io import toml as toml
    from rubberfric.io.columns import COLUMNS as COLUMNS
    from rubberfric.io.columns import known_name as known_name
    from rubberfric.io.columns import known_unit as known_unit
    from rubberfric.io.files import load_result as load_result
    from rubberfric.io.files import load_scene as load_scene
    from rubberfric.io.files import save_result as save_result
    from rubberfric.io.files import save_scene as save_scene
    from rubberfric.io.friction_files import read_friction as read_friction
    from rubberfric.io.friction_files import write_friction as write_friction
    from rubberfric.io.hdf5 import read_object as read_object
    from rubberfric.io.hdf5 import read_quadrature as read_quadrature
    from rubberfric.io.hdf5 import write_object as write_object
    from rubberfric.io.hdf5 import write_quadrature as write_quadrature
    from rubberfric.io.height_files.height_maps import HeightMap as HeightMap
    from rubberfric.io.height_files.height_maps import read_heights as read_heights
    from rubberfric.io.height_files.traces import read_traces as read_traces
    from rubberfric.io.prony_cards import read_prony as read_prony
    from rubberfric.io.prony_cards import write_prony as write_prony
    from rubberfric.io.results import Curves as Curves
    from rubberfric.io.results import FrictionTable as FrictionTable
    from rubberfric.io.results import Result as Result
    from rubberfric.io.results import curves_of as curves_of
    from rubberfric.io.tables import column_hint as column_hint
    from rubberfric.io.tables import read_columns as read_columns
    from rubberfric.io.tables import read_density as read_density
    from rubberfric.io.tables import read_names as read_names
    from rubberfric.io.tables import read_normalisation as read_normalisation
    from rubberfric.io.tables import read_table as read_table
    from rubberfric.io.text_tables.frames import Frame as Frame
    from rubberfric.io.text_tables.frames import as_frame as as_frame
    from rubberfric.io.text_tables.frames import as_source as as_source
    from rubberfric.io.text_tables.preamble import stated_frequency as stated_frequency
    from rubberfric.io.text_tables.preamble import stated_stroke as stated_stroke
    from rubberfric.io.text_tables.writing import write_table as write_table
    from rubberfric.io.toml import read_conditions as read_conditions

lazily(__name__, __file__)
