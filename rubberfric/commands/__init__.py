"""The command `rubberfric`, and functions that other commands share."""

from rubberfric.base.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.base.progress import command_progress as command_progress
    from rubberfric.commands.arguments import Parser as Parser
    from rubberfric.commands.arguments import add_common as add_common
    from rubberfric.commands.arguments import add_outputs as add_outputs
    from rubberfric.commands.arguments import check_input as check_input
    from rubberfric.commands.arguments import check_no_input as check_no_input
    from rubberfric.commands.arguments import check_outputs as check_outputs
    from rubberfric.commands.arguments import write_outputs as write_outputs
    from rubberfric.commands.ending import begin_jax as begin_jax
    from rubberfric.commands.ending import complain as complain
    from rubberfric.commands.ending import ended as ended
    from rubberfric.commands.interrupts import Interrupts as Interrupts
    from rubberfric.commands.interrupts import leave_at_once as leave_at_once

lazily(__name__, __file__)
