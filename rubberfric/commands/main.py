"""The command `rubberfric`.

Exit status: 0 done; 2 bad input, with one line on stderr and nothing written; 1 the work failed;
130 interrupted by Ctrl-C (SIGINT), 143 by SIGTERM, within a second, with one line on stderr.
"""

import importlib.metadata
from collections.abc import Sequence

from rubberfric.commands import accuracy, map, run
from rubberfric.commands.shared import Parser, ended


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments `argv`; returns the exit status.

    None: those of the process, which a signal then ends (`rubberfric.commands.interrupts`).
    """
    parser = Parser(
        prog="rubberfric", description="Rubber friction and contact of rough viscoelastic solids."
    )
    version = importlib.metadata.version("rubberfric")
    parser.add_argument("--version", action="version", version=f"rubberfric {version}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in (run, accuracy, map):
        command.add(commands)
    arguments = parser.parse_args(argv)
    return ended("rubberfric", lambda _: arguments.run(arguments), process=argv is None)
