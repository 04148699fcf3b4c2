"""Parts of the reader of text tables: lines, blocks of columns, and derived quantities."""
