"""Tables of numbers in text: the project's own, and those of instruments and other programs."""

from rubberfric.io.tables.columns import COLUMNS
from rubberfric.io.tables.reading import read_columns, read_directions, read_names, read_table
from rubberfric.io.tables.writing import write_table

__all__ = ["COLUMNS", "read_columns", "read_directions", "read_names", "read_table", "write_table"]
