"""Material cards of other programs: their text, and a reader and a writer for each program."""
