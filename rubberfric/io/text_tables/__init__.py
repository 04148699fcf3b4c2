"""Parts of the reader of text tables: units, lines, blocks of columns, and derived quantities."""
