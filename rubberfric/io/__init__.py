"""Files: scenes, results, tables, and the formats of other programs."""

from rubberfric.io.files import load_scene, save_scene
from rubberfric.io.prony_cards.cards import read_prony, write_prony
from rubberfric.io.result_files import load_result, save_result
from rubberfric.io.results import Result
from rubberfric.io.tables.reading import read_columns

__all__ = [
    "Result",
    "load_result",
    "load_scene",
    "read_columns",
    "read_prony",
    "save_result",
    "save_scene",
    "write_prony",
]
