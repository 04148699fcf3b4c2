"""Refusals: one line with place, problem and remedy."""

import pytest


def refused(path, call):
    """The message of the ValueError that `call` raises: one line that begins with the file's path."""
    with pytest.raises(ValueError, match=r"must|is not|no column|unknown|cannot|create") as caught:
        call()
    message = str(caught.value)
    assert message.startswith(f"{path}: "), message
    assert "\n" not in message
    return message


def one_line(call):
    """The message, one line, of the ValueError that `call` raises."""
    with pytest.raises(ValueError, match=r"must|already|give|add|tie|is a") as caught:
        call()
    assert "\n" not in str(caught.value)
    return str(caught.value)
