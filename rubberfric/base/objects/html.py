"""HTML tables for notebooks, without scripts or external content.

All text is escaped, and nothing is computed. Tracers are labelled as traced. Arrays show their first and last
elements.
"""

import html
from collections.abc import Sequence
from typing import Any

import numpy as np
from jax.core import Tracer

from rubberfric.base.checks import shown

# Largest number of elements that are all shown.
_ALL = 3
_LEFT = "text-align:left"


def table(rows: Sequence[Sequence[str] | str], headings: Sequence[str] = (), caption: str = "") -> str:
    """Return an HTML table of texts, where a row that is a single string spans all columns."""
    columns = max([len(headings), *(len(row) for row in rows if not isinstance(row, str))])
    lines = [f"<caption style='{_LEFT}'><b>{html.escape(caption)}</b></caption>"] * bool(caption)
    lines += [_row("th", headings)] * bool(headings)
    for row in rows:
        if isinstance(row, str):
            text = f"<i>{html.escape(row)}</i>"
            lines.append(f"<tr><td colspan='{columns}' style='{_LEFT}'>{text}</td></tr>")
        else:
            lines.append(_row("td", row))
    return "\n".join(["<table>", *lines, "</table>"])


def folded(summary: str, content: str) -> str:
    """Return HTML that shows the content after a click on the summary."""
    return f"<details><summary>{html.escape(summary)}</summary>\n{content}\n</details>"


def preformatted(text: str) -> str:
    """Return an HTML element with preformatted text."""
    return f"<pre>{html.escape(text)}</pre>"


def short(value: Any) -> str:
    """Return a short text for a value: numbers with six digits, of a long array the ends and the shape."""
    if isinstance(value, Tracer):
        return f"traced, {value.dtype}" + f" ({count(value.shape)})" * (value.ndim > 0)
    if isinstance(value, str | bool):
        return str(value)
    array = np.asarray(value)
    if array.dtype.kind not in "biuf":  # placeholders from maps over trees
        return shown(value)
    flat = array.ravel()
    texts = [f"{float(number):.6g}" for number in (flat if flat.size <= _ALL else flat[[0, -1]])]
    if flat.size <= _ALL and array.ndim <= 1:
        return ", ".join(texts) or "empty"
    return f"{texts[0]} … {texts[-1]} ({count(array.shape)})" if texts else f"empty ({count(array.shape)})"


def with_unit(text: str, unit: str) -> str:
    """Insert a unit into the text that `short` returns for a number or an array."""
    if unit in ("", "-") or text.startswith(("traced", "empty")):
        return text
    number, bracket, count = text.partition(" (")
    return f"{number} {unit}{bracket}{count}"


def count(shape: tuple[int, ...]) -> str:
    """Return the shape of an array as text, such as "3 x 2"."""
    return " x ".join(map(str, shape))


def _row(tag, cells):
    return "<tr>" + "".join(f"<{tag} style='{_LEFT}'>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"
