"""Texts of the library in the words of a command.

Messages and reports of the library recommend keyword arguments of Python, such as bad_rows="drop". A user of
a command needs the option --bad-rows or the line of a TOML file instead:

======================  =========================  ======================
library                 option of the command      otherwise, in its file
======================  =========================  ======================
bad_rows="drop"         --bad-rows drop            bad_rows = "drop"
columns=["v", "?"]      --columns "v" "?"          columns = ["v", "?"]
check_units=False       --no-check-units           check_units = false
pressure=...            --pressure ...             pressure = ...
: hurst = 3: must be    : --hurst 3: must be       unchanged
======================  =========================  ======================
"""

from __future__ import annotations

import re
from contextvars import ContextVar

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

# The first alternative is an object such as Quadrature(order=10), which has no place on a command line.
_KEYWORD = re.compile(
    r"""\b[A-Z]\w*\([^()]*\)|(?<![\w.`-])([a-z][a-z0-9_]*)=(\[(?:"[^"]*"|[^\]"])*\]|"[^"]*"|'[^']*'|\.\.\.|[-+]?\w+(?:\.\w+)?|(?=[\s,;)]|$))"""
)
# A keyword argument at the beginning of a message or behind the name of a file.
_VALUE = re.compile(r"(^|: )([a-z][a-z0-9_]*)( = | is missing)")
# Commands that replace calls of functions.
CALLS = {
    "rubberfric.io.read_traces": "`rubberfric-fit spectrum`",
    'rubberfric.io.read_table(path, ["strain", "E_stor", "E_loss"])': "`rubberfric-fit mastercurve --strain`",
    "fitting.Discrepancy()": "a table [discrepancy] to the job",
    ' warnings.simplefilter("ignore", rubberfric.UnitWarning) silences this warning': "",
}
_TOML = {"True": "true", "False": "false"}

# Options of the command that runs, by their names in Python.
_options: ContextVar[Mapping[str, argparse.Action]] = ContextVar("options")


def use_words_of(options: Mapping[str, argparse.Action]) -> None:
    """Let `reworded` use these options, see `Parser.options`; {} leaves texts unchanged."""
    _options.set(options)


def reworded(text: str) -> str:
    """Return a text of the library in the words of the command that runs."""
    options = _options.get({})
    if not options:
        return text

    for call, command in CALLS.items():
        text = text.replace(call, command)

    def value(match):
        before, name, then = match.groups()
        if name not in options:
            return match[0]
        return before + _flag(options[name]) + (" " if then == " = " else then)

    return _KEYWORD.sub(lambda match: _option_or_line(match, options), _VALUE.sub(value, text))


def _option_or_line(match, options):
    name, content = match.groups()
    if name is None:
        return match[0]
    if name not in options:
        return f"{name} = {_TOML.get(content, content)}".rstrip().replace("'", '"')
    option = options[name]
    if option.nargs == 0 or not content or (option.const is True and content == "True"):
        return _flag(option)
    if content.startswith("["):
        content = re.sub(r"\s*,\s*", " ", content[1:-1])
    elif isinstance(option.nargs, str) or " " not in content:
        content = content.strip("\"'")
    return f"{_flag(option)} {content}"


def _flag(option):
    return option.option_strings[-1]
