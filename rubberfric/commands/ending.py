"""How commands begin and end: signals from the first moment on, one line for whatever goes wrong, a status.

Nothing here waits for JAX: that is imported, in double precision, when the arguments are known to be right.
"""

import io
import os
import sys
import warnings
from collections.abc import Callable
from typing import TextIO

from rubberfric.base.compilation import compilation_cache
from rubberfric.commands.interrupts import Interrupts

try:
    import resource
except ImportError:  # Windows has none
    resource = None

# What is no fault of the input; a LinAlgError is a ValueError all the same.
_FAILED = {"OSError", "FloatingPointError", "LinAlgError", "MemoryError", "JaxRuntimeError", "ImportError"}

# Address space that JAX takes with its threads and programs, measured [B]; with less, C++ ends the process.
_SPACE = 2**31


def ended(program: str, work: Callable[[Interrupts], int], *, process: bool) -> int:
    """Do the work of a command; returns its exit status, or that of how it failed.

    Parameters
    ----------
    program : what the line of a complaint begins with
    work : function of the signals that arrive meanwhile, returns the exit status
    process : as of `Interrupts`
    """
    if process and not _have_streams():
        return complain(program, "standard output is closed: must be open, such as to /dev/null", 1)
    with Interrupts(program, process=process) as interrupts:
        try:
            status = work(interrupts)
            if sys.stdout is not None:
                sys.stdout.flush()
            return status
        except SystemExit as stop:  # of argparse, which has said why
            return _flushed(stop.code if isinstance(stop.code, int) else 1)
        except KeyboardInterrupt:
            return interrupts.complain()
        except BrokenPipeError:  # the reader went away (| head)
            _give_up(sys.stdout)
            return 1
        except Exception as error:
            status = _status(error)
            if status is None:
                raise
            if isinstance(error, OSError):
                _give_up(sys.stdout)  # it may be what is full
            return complain(program, _text(error), status)


def _status(error: Exception) -> int | None:
    """Exit status of an error that has a line of its own; None for one that needs a traceback."""
    # By name: numpy and JAX are not imported for that.
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
    """Say on one line what was wrong; returns the exit status."""
    try:
        print(f"{program}: {' '.join(str(error).split())}", file=sys.stderr)
    except OSError:  # nowhere to say it
        _give_up(sys.stderr)
    return status


def _flushed(status: int) -> int:
    """A status, or 1 if what was printed does not reach its reader."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError:
        _give_up(sys.stdout)
        return 1
    return status


def _give_up(stream: TextIO | None) -> None:
    """Lead a stream that takes no more to nowhere: at its end Python would complain of what waits in it."""
    if stream is None:
        return
    try:
        stream.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _have_streams() -> bool:
    """Make the standard streams safe to use; False if there is no output.

    A file that is opened takes the lowest number that is free: were that of a closed stream free, what
    libraries log would go into that file.
    """
    have = sys.stdout is not None
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 (for as long as the process)
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="replace")  # a ° that the locale has not must not cost the table
    return have


def begin_jax(*, process: bool, cache: bool) -> None:
    """Import JAX, in double precision.

    Parameters
    ----------
    process : as of `Interrupts`
    cache : whether a command that is the process keeps compiled programs for the next one

    Raises
    ------
    MemoryError : the process may not have the address space that JAX needs.
    """
    _check_space()
    if process and cache:
        # 1 is what JAX itself sets it to, and what a program with JAX hands on to those that it starts.
        if os.environ.get("TF_CPP_MIN_LOG_LEVEL", "1") == "1":
            os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"  # fatal errors only: loading a program logs two lines
        # That an entry could not be read or written is no news to a user: it is compiled.
        warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
        compilation_cache()
    import jax

    # The library never does this: the precision of a program is its own choice.
    jax.config.update("jax_enable_x64", True)


def _check_space() -> None:
    if resource is None:
        return
    space, _ = resource.getrlimit(resource.RLIMIT_AS)
    if space not in (resource.RLIM_INFINITY, -1) and space < _SPACE:
        raise MemoryError(
            f"ulimit -v allows {space / 2**20:.0f} MiB of addresses: must be {_SPACE // 2**20} or more"
        )
