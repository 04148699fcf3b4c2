"""The command `rubberfric`, and what other commands share with it."""

from rubberfric.commands.interrupts import Interrupts
from rubberfric.commands.shared import Parser, add_outputs, check_outputs, complain, ended, progress

__all__ = ["Interrupts", "Parser", "add_outputs", "check_outputs", "complain", "ended", "progress"]
