"""Start and end of a command: signals, error messages on one line, and the exit status.

JAX is imported after the arguments have been checked, and uses double precision.
"""

import contextlib
import io
import os
import sys
import warnings
from collections.abc import Callable, Iterator
from typing import TextIO

from rubberfric.base.compilation import compilation_cache
from rubberfric.commands.interrupts import LATE, LOST, Interrupts
from rubberfric.commands.wording import reworded, use_words_of

try:
    import resource
except ImportError:  # Windows has none
    resource = None

# Errors not caused by the input. LinAlgError is listed because it derives from ValueError.
_FAILED = {"OSError", "FloatingPointError", "LinAlgError", "MemoryError", "JaxRuntimeError", "ImportError"}

# Address space that JAX needs, measured [B]. With less, its C++ code aborts the process.
_SPACE = 2**31


def ended(program: str, work: Callable[[Interrupts], int], *, process: bool) -> int:
    """Run the function `work` of a command and return the exit status.

    An expected error is printed on one line that begins with `program`, and so is a warning. An unexpected
    error is raised.
    `process` is explained in `Interrupts`.
    """
    if process and not _have_streams():
        return complain(program, "standard output is closed: must be open, for example as /dev/null", 1)
    use_words_of({})
    with Interrupts(program, process=process) as interrupts, _plain_warnings(program):
        try:
            status = _status_of(work, interrupts)
            interrupts.finish()
            if interrupts.asked and status == 0:  # it had to wait, and the work ended before
                return complain(program, f"interrupted; {LATE}", interrupts.status)
            return status
        except KeyboardInterrupt:
            return complain(program, f"interrupted; {LOST}", interrupts.status)
        except BrokenPipeError:  # the reader has closed the pipe (| head)
            _give_up(sys.stdout)
            return 1
        except Exception as error:
            status = _status(error)
            if status is None:
                raise
            if isinstance(error, OSError):
                _give_up(sys.stdout)  # its disk may be full
            return complain(program, _text(error), status)


def _status_of(work: Callable[[Interrupts], int], interrupts: Interrupts) -> int:
    try:
        status = work(interrupts)
    except SystemExit as stop:  # from argparse, which has printed the reason
        status = stop.code if isinstance(stop.code, int) else 1
    if sys.stdout is not None:
        sys.stdout.flush()
    return status


@contextlib.contextmanager
def _plain_warnings(program: str) -> Iterator[None]:
    """Print each warning of a command on one line of stderr, without the line of the source."""
    usual = warnings.formatwarning

    def plain(message: Warning | str, *place: object) -> str:
        del place
        return _line(program, f"warning: {message}")

    warnings.formatwarning = plain
    try:
        yield
    finally:
        warnings.formatwarning = usual


def _status(error: Exception) -> int | None:
    """Return the exit status for an error, or None for an unexpected error that needs a traceback."""
    # By name, so that numpy and JAX need not be imported.
    names = {cls.__name__ for cls in type(error).__mro__}
    if names & _FAILED:
        return 1
    return 2 if isinstance(error, ValueError) else None


def _text(error: Exception) -> str:
    text = str(error) or type(error).__name__
    if isinstance(error, MemoryError) or "RESOURCE_EXHAUSTED" in text:
        return f"there is not enough memory: {text}"
    return f"cannot be loaded: {text}" if isinstance(error, ImportError) else text


def complain(program: str, error: object, status: int) -> int:
    """Print an error on one line of stderr, and return `status`."""
    try:
        print(_line(program, error), end="", file=sys.stderr)
    except OSError:  # stderr takes no output
        _give_up(sys.stderr)
    return status


def _line(program: str, text: object) -> str:
    return f"{program}: {reworded(' '.join(str(text).split()))}\n"


def _give_up(stream: TextIO | None) -> None:
    """Redirect a broken stream to the null device, so that Python reports no error at exit."""
    if stream is None:
        return
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _have_streams() -> bool:
    """Open closed standard streams on the null device, and return False if stdout was closed.

    A newly opened file takes the lowest free descriptor. If a standard stream were closed, the file could
    take the descriptor of the stream, and libraries would write their logs into the file.
    """
    have = sys.stdout is not None
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 (open until the process ends)
    for stream in (sys.stdout, sys.stderr):
        # A locale without ° still prints the table. In the locale C Python sets surrogateescape.
        if isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape"):
            stream.reconfigure(errors="replace")
    return have


def begin_jax(*, process: bool, cache: bool) -> None:
    """Import JAX, switch double precision on, and use the compilation cache in a separate process.

    A MemoryError is raised if the limit of the address space (ulimit -v) is too low for JAX, and a ValueError
    if JAX cannot start the platform in JAX_PLATFORMS.
    """
    if resource is not None:
        space, _ = resource.getrlimit(resource.RLIMIT_AS)
        if space not in (resource.RLIM_INFINITY, -1) and space < _SPACE:
            raise MemoryError(
                f"ulimit -v allows {space / 2**20:.0f} MiB of addresses: must be {_SPACE // 2**20} or more"
            )
    if process and cache:
        # JAX itself sets 1, which processes started by a program with JAX inherit.
        if os.environ.get("TF_CPP_MIN_LOG_LEVEL", "1") == "1":
            os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"  # fatal errors only: loading an entry logs two lines
        # An entry that cannot be read or written is compiled again; the user need not know.
        warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
        compilation_cache()
    import jax

    # Only commands do this; the library leaves the precision to its caller.
    jax.config.update("jax_enable_x64", True)
    platforms = os.environ.get("JAX_PLATFORMS", "")
    if platforms and "cpu" not in platforms.split(","):  # cpu starts later; `map --devices` sets its devices
        try:
            jax.devices()
        except (RuntimeError, AssertionError):  # an unknown platform, or one without a device
            raise ValueError(
                f"JAX_PLATFORMS = {platforms!r}: JAX cannot start this platform; use cpu, or unset it"
            ) from None
