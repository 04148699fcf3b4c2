"""Handling of SIGINT (Ctrl-C), SIGTERM and SIGHUP in the commands.

A signal ends a command with one line on stderr, without half-written files, and with the exit status 128 +
number of the signal.

If a command is a separate process, a thread that waits for signals ends the process. The main thread cannot
end it in time: Python runs handlers between its own instructions only, and a compiled function may run for
seconds. An exception would be unsafe: XLA's threads would continue to compile while the interpreter shuts
down, and the process would end with a segmentation fault. The thread therefore removes incomplete files and
ends the process by `os._exit`, which skips that shutdown.

If a command was called from Python, another thread raises KeyboardInterrupt in the main thread, between two
instructions of Python. A handler could also raise it, but XLA runs handlers while its threads compile, and
these threads crash an interpreter that then exits. A compilation therefore ends before the command does.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType
    from typing import Any, Self

LOST = "incomplete files are not written"
LATE = "all files are complete"
WAIT = "interrupted; stopping after this step (a second signal stops at once)"

# Windows has no SIGHUP, which a terminal sends when it closes.
SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))

# Seconds after which KeyboardInterrupt is raised again if the command still runs: Python ignores exceptions
# in callbacks of the garbage collector and of weak references.
_AGAIN = 0.2

# Seconds in which the handler of a signal returns. XLA would see an exception that reaches the handler.
_RETURN = 0.05

# Seconds after which a command called from Python says that it stops later.
_PATIENCE = 0.4


def leave_at_once(program: str) -> None:
    """Let signals end the process at once, while a command only imports modules."""

    def leave(which: int, _frame: FrameType | None) -> None:
        say(program, f"interrupted; {LOST}")
        os._exit(128 + which)

    for which in SIGNALS:
        if signal.getsignal(which) != signal.SIG_IGN:
            signal.signal(which, leave)


def say(program: str, text: str) -> None:
    """Write a line to stderr without Python's streams, which the main thread may have locked."""
    try:
        os.write(2, (("\r\033[K" if os.isatty(2) else "") + f"{program}: {text}\n").encode())
    except OSError:  # nowhere to say it
        return


class Interrupts:
    """Handle signals while a command runs.

    After `hold`, the first signal takes effect at the next `check`. A fit then ends between two steps, and an
    open file is completed. A second signal is never held back.

    Parameters
    ----------
    program : beginning of the message
    process : bool
        True if the command is a separate process, which a signal may end. Otherwise it was called from
        Python, and a signal raises KeyboardInterrupt after the current instruction of Python. A second
        signal raises it at once. If that happens while XLA compiles and the interpreter then exits, threads
        of XLA can end it with a segmentation fault, as in programs with JAX alone.

    Attributes
    ----------
    asked : True if a signal arrived
    stopped : True if `check` ended the work
    holding : True after `hold`, until `release`
    """

    def __init__(self, program: str, *, process: bool) -> None:
        self.program, self.process = program, process
        self.asked = self.stopped = self.holding = False
        self.which = signal.SIGINT
        self._seen = self._loads = False
        self._thread: Any = None  # waits for signals, or raises KeyboardInterrupt in the main thread
        self._ended: Any = None  # event
        self._lock: Any = contextlib.nullcontext()
        self._before: dict[signal.Signals, Any] = {}  # handlers
        self._report: Any = None  # hook for exceptions that Python ignores

    def __enter__(self) -> Self:
        import socket  # imported late: a signal must be answered before
        import threading

        if threading.current_thread() is threading.main_thread():  # others cannot set handlers
            if self.process:
                hear, self._tell = socket.socketpair()  # Windows does not accept a pipe here
                self._tell.setblocking(False)
                signal.set_wakeup_fd(self._tell.fileno(), warn_on_full_buffer=False)
                self._thread = threading.Thread(target=self._wait, args=(hear,), daemon=True)
                self._thread.start()
            else:
                self._ended, self._lock = threading.Event(), threading.Lock()
                self._report, sys.unraisablehook = sys.unraisablehook, self._ignored
            for which in SIGNALS:
                if signal.getsignal(which) != signal.SIG_IGN:  # set by shells for background jobs
                    self._before[which] = signal.signal(which, self._arrived)
        return self

    def __exit__(self, *error: object) -> None:
        if self._report is not None:
            self.finish()
            sys.unraisablehook = self._report
        for which, handler in self._before.items():
            # The work is done and the process is about to end.
            signal.signal(which, signal.SIG_IGN if self.process else handler)
        if self.process and self._thread is not None:
            signal.set_wakeup_fd(-1)
            self._tell.close()
            self._thread.join()  # if a signal came before, it ends the process

    def _arrived(self, which: int, _frame: FrameType | None) -> None:
        first, self.asked, self.which = not self.asked, True, which
        if self.process or (self.holding and first):
            if self._loads:
                say(self.program, WAIT)
            return
        if self._thread is not None:
            raise KeyboardInterrupt
        import threading

        arguments = (threading.get_ident(), time.monotonic())
        self._thread = threading.Thread(target=self._raise_again, args=arguments, daemon=True)
        self._thread.start()

    def _raise_again(self, main: int, arrival: float) -> None:
        """Raise KeyboardInterrupt in the main thread until the command ends.

        This method runs in a separate thread.
        """
        said, wait = False, _RETURN
        while not self._ended.wait(wait):
            with self._lock:
                if not self._loads:  # `loading` raises at its end
                    _raise_in(main)
            wait = _AGAIN
            if not said and time.monotonic() > arrival + _PATIENCE:
                say(self.program, WAIT)
                said = True

    def _wait(self, hear: Any) -> None:
        """End the process at the first signal that is not held back.

        This method runs in a separate thread.
        """
        with hear:
            while which := hear.recv(1):
                if which[0] not in self._before:
                    continue
                first, self._seen = not self._seen, True
                if self.holding and first:
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

    def _ignored(self, event: Any) -> None:
        """Report an exception that Python ignores, but no interrupt, which is raised again."""
        if not (self.asked and event.exc_type is KeyboardInterrupt):
            self._report(event)

    @contextlib.contextmanager
    def loading(self) -> Iterator[None]:
        """Hold back the first signal while a command called from Python imports modules.

        An exception in the import of a compiled module can crash Python. A process is not affected.
        """
        if self.process:
            yield
            return
        with self._lock:  # an exception of `_raise_again` arrives before, or not at all
            self._loads = self.holding = True
        try:
            yield
        finally:
            self._loads = self.holding = False
        self.check()

    @property
    def status(self) -> int:
        """Exit status for the last signal that arrived."""
        return 128 + int(self.which)

    def hold(self) -> None:
        """Hold back the first signal from now on. A signal that arrived before is not held back."""
        if self.asked and not self.holding:
            self.check()
        self.holding = True

    def release(self) -> None:
        """Stop holding signals back."""
        self.holding = False

    def finish(self) -> None:
        """Raise no exception from now on, because the work is done."""
        if self._ended is None:
            return
        stopped = False
        while not stopped:
            with contextlib.suppress(KeyboardInterrupt):
                self._ended.set()
                if self._thread is not None:
                    self._thread.join()
                    # Python raises what waits after a call. Dropping it instead leaves a mark in Python 3.11,
                    # with which a debugger waits forever.
                    time.sleep(0)
                stopped = True

    def check(self) -> None:
        """Raise KeyboardInterrupt if a signal arrived."""
        if self.asked:
            self.stopped = True
            raise KeyboardInterrupt


def _raise_in(thread: int) -> None:
    """Raise KeyboardInterrupt before the next instruction of a thread."""
    import ctypes

    interrupt = ctypes.py_object(KeyboardInterrupt)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), interrupt)
