"""SIGINT (Ctrl-C) and SIGTERM in the commands: one line, nothing half-written, exit status 130 or 143.

A command that is the process is ended by a thread that waits for signals. The main thread cannot do it:
Python's handlers run between its own instructions only, and a compiled program may run for seconds. Nor
can an exception: XLA's compiler answers a signal by raising it while its threads go on compiling, which
the interpreter then shuts down under them, and that ends in a segmentation fault. So that thread removes
what is being written and ends the process by `os._exit`, which runs no such shutdown.
"""

from __future__ import annotations

import os
import signal
import sys

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from types import FrameType
    from typing import Any, Self

LOST = "what was not yet complete is not written"
WAIT = "interrupted; ends after this step, once more ends it at once"

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def leave_at_once(program: str) -> None:
    """Have a signal end the process, of which nothing but imports has been done yet."""

    def leave(which: int, _frame: FrameType | None) -> None:
        say(program, f"interrupted; {LOST}")
        os._exit(128 + which)

    for which in SIGNALS:
        if signal.getsignal(which) != signal.SIG_IGN:
            signal.signal(which, leave)


def say(program: str, text: str) -> None:
    """A line; not by Python's streams, which the main thread may hold."""
    try:
        os.write(2, (("\r\033[K" if os.isatty(2) else "") + f"{program}: {text}\n").encode())
    except OSError:  # nowhere to say it
        return


class Interrupts:
    """Both signals while a command runs; the first one can be held back until `check`.

    So a fit ends between two steps, and a file that is being written is completed. A second
    signal is never held back.

    Parameters
    ----------
    program : what the line begins with
    process : bool
        whether the command is the process, which a signal may end. If not, it was called from Python,
        and a signal is a KeyboardInterrupt there.
    """

    def __init__(self, program: str, *, process: bool) -> None:
        self.program, self.process = program, process
        self.asked = self.stopped = False
        self.which = signal.SIGINT
        self._holding = self._seen = False
        self._before: dict[signal.Signals, Any] = {}  # handlers

    def __enter__(self) -> Self:
        import socket  # both take longer to import than a signal may need
        import threading

        if threading.current_thread() is threading.main_thread():  # others cannot
            if self.process:
                hear, self._tell = socket.socketpair()  # which, unlike a pipe, Windows takes for this
                self._tell.setblocking(False)
                signal.set_wakeup_fd(self._tell.fileno(), warn_on_full_buffer=False)
                self._thread = threading.Thread(target=self._wait, args=(hear,), daemon=True)
                self._thread.start()
            for which in SIGNALS:
                if signal.getsignal(which) != signal.SIG_IGN:  # as a script's shell has it in the background
                    self._before[which] = signal.signal(which, self._arrived)
        return self

    def __exit__(self, *error: object) -> None:
        for which, handler in self._before.items():
            # All is done, and the process about to end: there is nothing left to interrupt.
            signal.signal(which, signal.SIG_IGN if self.process else handler)
        if hasattr(self, "_thread"):
            signal.set_wakeup_fd(-1)
            self._tell.close()
            self._thread.join()  # if a signal came before, it ends the process

    def _arrived(self, which: int, _frame: FrameType | None) -> None:
        first, self.asked, self.which = not self.asked, True, which
        if not (self._holding and first) and not self.process:
            raise KeyboardInterrupt

    def _wait(self, hear: Any) -> None:
        """In its thread: end the process at the first signal that is not held back."""
        with hear:
            while which := hear.recv(1):
                if which[0] not in self._before:
                    continue
                first, self._seen = not self._seen, True
                if self._holding and first:
                    say(self.program, WAIT)
                else:
                    self._leave(which[0])

    def _leave(self, which: int) -> None:
        from rubberfric.base.atomic import remove_begun

        def leave():
            try:
                say(self.program, f"interrupted; {LOST}")
            finally:
                os._exit(128 + which)

        remove_begun(leave)

    def complain(self) -> int:
        """Say that the command was interrupted, where the process goes on; returns the exit status."""
        print(f"{self.program}: interrupted; {LOST}", file=sys.stderr)
        return self.status

    @property
    def status(self) -> int:
        """Exit status of what the last signal ended."""
        return 128 + int(self.which)

    def hold(self) -> None:
        """Hold the first signal back from now on."""
        self._holding = True

    def release(self) -> None:
        """Hold no signal back from now on."""
        self._holding = False

    def check(self) -> None:
        """KeyboardInterrupt if a signal was held back."""
        if self.asked:
            self.stopped = True
            raise KeyboardInterrupt
