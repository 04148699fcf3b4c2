"""The command `rubberfric`.

The exit status is 0 on success, 2 for invalid input (one line on stderr, nothing written), and 1 if the work
failed. Ctrl-C (SIGINT) gives 130, SIGTERM 143 and SIGHUP 129, within a second and with one line on stderr.

Each step imports its modules late, so that signals are handled from the start and arguments are checked
before JAX is imported.
"""

from __future__ import annotations

from rubberfric.commands.interrupts import leave_at_once

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Sequence

    from rubberfric.base.progress import Progress
    from rubberfric.commands.interrupts import Interrupts


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments `argv`, or those of the process if None, and return the exit status."""
    if argv is None:
        leave_at_once("rubberfric")
    from rubberfric.commands.ending import ended

    return ended("rubberfric", lambda interrupts: _run(argv, interrupts), process=argv is None)


def _run(argv: Sequence[str] | None, interrupts: Interrupts) -> int:
    with interrupts.loading():
        from rubberfric.base.progress import command_progress
        from rubberfric.commands.arguments import check_arguments, parser
        from rubberfric.commands.ending import begin_jax
        from rubberfric.commands.wording import reworded, use_words_of

    arguments = parser().parse_args(argv)
    use_words_of(arguments.words)
    check_arguments(arguments)
    with command_progress(arguments.verbose) as show:
        show("loading JAX")
        # `accuracy` measures compile times, so it must not use the cache.
        cache = not arguments.no_cache and arguments.command != "accuracy"
        with interrupts.loading():
            begin_jax(process=argv is None, cache=cache)
            work = _work(arguments.command)
        text, failure = work(arguments, show)
    print(reworded(text))
    if failure is not None:
        raise failure
    return 0


def _work(command: str) -> Callable[[argparse.Namespace, Progress], tuple[str, OSError | None]]:
    if command == "explore":
        from rubberfric.commands.explorer.command import run_explorer as work
    elif command == "doctor":
        from rubberfric.commands.doctor import run_doctor as work
    elif command in ("grip", "leak"):
        from rubberfric.commands import applications

        work = {"grip": applications.run_grip, "leak": applications.run_leak}[command]
    else:
        from rubberfric.commands import run

        work = {"run": run.run_scene, "map": run.run_map, "accuracy": run.run_accuracy}[command]
    return work
