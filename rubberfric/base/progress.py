"""Progress of long computations, shown in a terminal or a notebook."""

import contextlib
import html
import numbers
import sys
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any, Self, TextIO

# Seconds between two updates in a notebook. Each sends a message to its page.
_PAUSE = 0.1
_TICK = 1.0  # seconds between two updates of a clock
# Characters of a line in a terminal. A longer line would wrap and could not be replaced.
_WIDTH = 79


def progress(label: str = "") -> "Progress":
    """Return a function that shows progress, for the arguments `progress=` and `callback=`.

    ::

        rf.friction_map(scene, v, p, T, progress=rf.progress("map"))
        fitting.fit(scene, data, free, callback=rf.progress("fit"))
        result.bootstrap(callback=rf.progress("bootstrap"))

    In a terminal the function updates one line of standard error, and in a notebook it moves a bar. Elsewhere
    it does nothing, for example in a script whose output goes to a file.

    Parameters
    ----------
    label : name of the work, text on one line

    Returns
    -------
    function of (points done, all points), (step, cost) or (text,)
        `friction_map`, `fitting.fit`, bootstrap and profile of a fit, and `accuracy` call the function. The
        line in the terminal ends when the function is deleted, or at the end of its `with` block.

    Raises
    ------
    ValueError : the label is not text on one line.
    """
    from rubberfric.base.checks import shown  # it imports JAX, for which the commands do not wait

    if not isinstance(label, str) or not label.isprintable():
        raise ValueError(f"label = {shown(label)}: must be text on one line")
    return Progress(label, _place())


class Progress:
    """Function that shows progress, see `progress`. The function shows nothing if `place` is None."""

    def __init__(
        self, label: str, place: "Place | None", clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._label, self._place, self._clock = label, place, clock
        self._begin = clock()
        if place is not None:
            self._end = weakref.finalize(self, place.end)

    def __call__(self, done: int | str, of: float | None = None) -> None:
        """Show points done and all points, a step and its cost, or one text."""
        if self._place is None:
            return
        text, part = describe(done, of, self._clock() - self._begin)
        self._place.show(f"{self._label}: {text}" if self._label else text, part)

    def line(self, text: str) -> None:
        """Show a line that stays above the progress line of a command."""
        if isinstance(self._place, TerminalLine | Lines):
            self._place.line(text)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.end()

    def end(self) -> None:
        """End the progress line or bar."""
        if self._place is not None:
            self._end()


def describe(done: Any, of: float | None, seconds: float) -> tuple[str, float | None]:
    """Return the text of a progress line, and the share of the work that is done or None.

    `done` and `of` are as for `Progress`, and `seconds` is the time since the beginning.
    """
    if of is None:
        return str(done), None
    if not isinstance(of, numbers.Integral):
        return f"step {done}, cost {of:.6g}, {seconds:.0f} s", None
    part = done / max(of, 1)
    text = f"{of} points, {100 * done // max(of, 1):3d} %"
    if 0 < done < of:
        text += f", {seconds * (of - done) / done:.0f} s left"
    elif done > 0:
        text += f", {seconds:.0f} s"
    return text, part


class TerminalLine:
    """Progress line of a terminal, in which each text replaces the previous one.

    If `clock` is True, the line counts the seconds since its text appeared, and is removed at the end.
    Otherwise the last text stays.
    """

    def __init__(self, stream: TextIO, clock: bool = False) -> None:
        self._stream, self._clock, self._open = stream, clock, False
        self._lock, self._timer = threading.Lock(), threading.Timer(_TICK, self._tick)

    def show(self, text: str, part: float | None) -> None:
        """Show a text; a line has no bar for `part`."""
        del part
        with self._lock:
            self._draw(text)
            if self._clock:
                self._restart(text, time.monotonic())

    def line(self, text: str) -> None:
        """Replace the progress line by a line that stays."""
        with self._lock:
            print(f"\r\033[K{text}", file=self._stream, flush=True)

    def end(self) -> None:
        """End the progress line."""
        with self._lock, contextlib.suppress(ValueError, OSError):  # the stream may be closed before
            self._timer.cancel()
            if self._open:
                self._open = False
                print(end="\r\033[K" if self._clock else "\n", file=self._stream, flush=True)

    def _draw(self, text):
        print(f"\r\033[K{text[:_WIDTH]}", end="", file=self._stream, flush=True)
        self._open = True

    def _restart(self, text, begin):
        self._timer.cancel()
        self._timer = threading.Timer(_TICK, self._tick, (text, begin))
        self._timer.daemon = True
        self._timer.start()

    def _tick(self, text, begin):
        with self._lock:
            if self._open and self._timer is threading.current_thread():  # no newer text
                self._draw(f"{text}, {time.monotonic() - begin:.0f} s")
                self._restart(text, begin)


class Lines:
    """Progress output with a separate line for each text and the seconds since the beginning."""

    def __init__(self, stream: TextIO) -> None:
        self._stream, self._begin = stream, time.monotonic()

    def show(self, text: str, part: float | None) -> None:
        """Show a text."""
        del part
        self.line(f"{time.monotonic() - self._begin:7.1f} s  {text}")

    def line(self, text: str) -> None:
        """Show a line that stays."""
        print(text, file=self._stream, flush=True)

    def end(self) -> None:
        """Do nothing, because every line is complete."""


class _Notebook:
    """Progress bar with text in the output of a notebook cell."""

    def __init__(self, display, clock=time.monotonic):
        self._display, self._clock = display, clock
        self._handle: Any = None  # handle of the display
        self._waiting = self._last = None

    def show(self, text: str, part: float | None) -> None:
        picture = _Bar(text, part)
        if self._handle is None:
            self._handle = self._display(picture, display_id=True)
        elif part != 1 and self._clock() - self._last < _PAUSE:
            self._waiting = picture
            return
        else:
            self._handle.update(picture)
        self._waiting, self._last = None, self._clock()

    def end(self) -> None:
        if self._waiting is not None:
            self._handle.update(self._waiting)
        self._waiting = None


Place = TerminalLine | Lines | _Notebook  # where progress is shown


class _Bar:
    def __init__(self, text, part):
        self._text, self._part = text, part

    def __repr__(self):
        return self._text

    def _repr_html_(self):
        bar = "" if self._part is None else f"<progress max='1' value='{self._part:.4f}'></progress> "
        return f"<div>{bar}{html.escape(self._text)}</div>"


def _place() -> "Place | None":
    """Return a display for progress: a notebook cell, a terminal line, or None if there is neither."""
    # A kernel has imported IPython; otherwise it is not imported here.
    if "IPython" in sys.modules:
        from IPython import get_ipython

        if getattr(get_ipython(), "kernel", None) is not None:
            from IPython.display import display

            return _Notebook(display)
    if sys.stderr is not None and sys.stderr.isatty():
        return TerminalLine(sys.stderr)
    return None


def command_progress(verbose: bool) -> Progress:
    """Return a function that shows the phases of a command on stderr until the end of a `with` block.

    A terminal shows one line with a clock, because JAX may compile for a minute. If `verbose` is True, any
    output gets a line for each text; otherwise other outputs show nothing.
    """
    if verbose:
        return Progress("", Lines(sys.stderr))
    return Progress("", TerminalLine(sys.stderr, clock=True) if sys.stderr.isatty() else None)
