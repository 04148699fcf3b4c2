"""The command `rubberfric-fit`.

The exit status is 0 for a good fit, 1 if the fit did not converge or an error occurred, 2 for bad input, and
3 if the scene does not explain the data (`fitting.uncertainty.verdict`). Bad input gives one line on stderr,
and no file is written. An interrupt by Ctrl-C (SIGINT), SIGTERM or SIGHUP gives the exit status 130, 143 or
129.

An interrupt after the first step of a fit gives a message at once. The best values so far are reported and
written, as for a fit that did not converge. An interrupt before the first step, or a second interrupt, ends
the process within a second. A bootstrap that was interrupted or killed continues with --resume.
"""

from __future__ import annotations

from rubberfric.commands import leave_at_once

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubberfric.commands import Interrupts


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments `argv`, and return the exit status.

    If `argv` is None, use the arguments of the process. Signals can then end the process
    (`rubberfric.commands.interrupts`).
    """
    if argv is None:
        leave_at_once("rubberfric-fit")
    import sys

    from fitting.commands.arguments import COMMANDS, PROGRAM
    from rubberfric.commands import ended

    command_line = sys.argv[1:] if argv is None else list(argv)
    program = f"{PROGRAM} {command_line[0]}" if command_line and command_line[0] in COMMANDS else PROGRAM
    return ended(
        program, lambda interrupts: _run(command_line, interrupts, argv is None), process=argv is None
    )


def _run(command_line: Sequence[str], interrupts: Interrupts, process: bool) -> int:
    with interrupts.loading():
        from importlib import import_module

        from fitting.commands.arguments import COMMANDS
        from rubberfric.commands import begin_jax, command_progress, use_words_of

    kind, rest = (
        (command_line[0], command_line[1:])
        if command_line and command_line[0] in COMMANDS
        else ("fit", command_line)
    )
    command = COMMANDS[kind]
    arguments = command.parser().parse_args(rest)
    use_words_of(arguments.words)
    command.check(arguments)
    with command_progress(arguments.verbose) as show:
        show("loading JAX")
        with interrupts.loading():
            begin_jax(process=process, cache=not arguments.no_cache)
            module = import_module(f"fitting.commands.{command.module}")
        return getattr(module, f"run_{kind}")(arguments, interrupts, show)
