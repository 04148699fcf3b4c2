"""What a command is doing, on stderr: in a terminal one line and its seconds, with --verbose many lines.

JAX compiles for seconds, sometimes a minute, without a word; the clock of the line goes on meanwhile.
"""

import sys
import threading
import time
from typing import TextIO

from rubberfric.base.progress import Progress, TerminalLine

_SECOND = 1.0  # between two pictures of the clock [s]


class Phases(Progress):
    """What a command is doing, and lines that stay."""

    def __init__(self, place: "ClockLine | Lines | None") -> None:
        super().__init__("", place)
        self._lines = place

    def line(self, text: str) -> None:
        """Show a line that stays, above that of what is being done."""
        if self._lines is not None:
            self._lines.line(text)


def progress(verbose: bool = False) -> Phases:
    """A function of a text, as of `rubberfric.progress`; its line is gone at the end of a `with` block.

    Parameters
    ----------
    verbose : whether a line is written for each text, to whatever stderr is; else nothing but to a terminal
    """
    if verbose:
        return Phases(Lines(sys.stderr))
    return Phases(ClockLine(sys.stderr) if sys.stderr.isatty() else None)


class Lines(TerminalLine):
    """A line for each text, with the seconds since the first."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream)
        self._begin = time.monotonic()

    def show(self, text: str, part: float | None) -> None:
        """Show a text."""
        del part
        self.line(f"{time.monotonic() - self._begin:7.1f} s  {text}")

    def line(self, text: str) -> None:
        """Show a line that stays."""
        print(text, file=self._stream, flush=True)


class ClockLine(TerminalLine):
    """A line of a terminal that says, from the first second on, how long its text has been there."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(stream, stays=False)
        self._lock, self._news, self._text = threading.Lock(), threading.Event(), None
        self._thread: threading.Thread | None = None

    def show(self, text: str, part: float | None) -> None:
        """Show a text."""
        with self._lock:
            self._text, self._begin = text, time.monotonic()
            super().show(text, part)
        self._news.set()
        if self._thread is None:
            self._thread = threading.Thread(target=self._tick, daemon=True)
            self._thread.start()

    def line(self, text: str) -> None:
        """Show a line that stays, in place of the one of what is being done."""
        with self._lock:
            print(f"\r\033[K{text}", file=self._stream, flush=True)

    def end(self) -> None:
        """Remove the line."""
        with self._lock:
            self._text = None
            super().end()
        self._news.set()

    def _tick(self) -> None:
        while self._text is not None:
            self._news.clear()
            while not self._news.wait(_SECOND):
                with self._lock:
                    if self._text is not None:
                        super().show(f"{self._text}, {time.monotonic() - self._begin:.0f} s", None)
        self._thread = None
