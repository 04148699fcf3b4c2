"""The command `rubberfric`, and what other commands share with it."""

from rubberfric.base.process.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.commands.arguments import (
        Parser,
        add_common,
        add_outputs,
        check_input,
        check_outputs,
        write_outputs,
    )
    from rubberfric.commands.process.ending import begin_jax, complain, ended
    from rubberfric.commands.process.interrupts import Interrupts, leave_at_once
    from rubberfric.commands.process.phases import progress

__all__ = [
    "Interrupts",
    "Parser",
    "add_common",
    "add_outputs",
    "begin_jax",
    "check_input",
    "check_outputs",
    "complain",
    "ended",
    "leave_at_once",
    "progress",
    "write_outputs",
]

lazily(
    __name__,
    {
        "rubberfric.commands.arguments": (
            "Parser add_common add_outputs check_input check_outputs write_outputs"
        ),
        "rubberfric.commands.process.ending": "begin_jax complain ended",
        "rubberfric.commands.process.interrupts": "Interrupts leave_at_once",
        "rubberfric.commands.process.phases": "progress",
    },
)
