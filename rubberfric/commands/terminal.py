"""A line of progress on a terminal, for commands."""

import contextlib
import sys


@contextlib.contextmanager
def progress():
    """A function that shows a line on stderr in place of the last one; nothing unless it is a terminal."""
    if not sys.stderr.isatty():
        yield lambda line: None
        return

    def show(line):
        # A longer one would wrap, and could not be replaced.
        print(f"\r\033[K{line[:79]}", end="", file=sys.stderr, flush=True)

    try:
        yield show
    finally:
        show("")
