"""Lines of text tables: separators, fields, numbers, comments, and lines that lose data.

A line below the titles of a table is a row, a note, or a bad row. A note holds no data: it is blank, a
comment, a text without numbers, or a text with one number and empty cells, such as `Samples; 3`. Every other
line is a row, or a bad row if it cannot be read. The caller reports bad rows, so no
measurement is lost silently.
"""

import csv
import re
from collections.abc import Callable, Collection, Sequence

from rubberfric.base.atomic import StrPath, is_number

TextRows = list[tuple[int, list[str]]]  # (line, fields)
TextLines = list[tuple[int, str]]  # (line, text)
BadRows = list[tuple[int, str]]  # (line, reason)
# Several blanks separate columns of a fixed width.
SEPARATORS = ("\t", ";", ",", "  ")

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
# Error values of spreadsheets, also in German and French. A cell that is too narrow is saved as ####.
_ERROR = r"#(?:N/?A|NV|[^\W\d_]+(?:/0)?\s?[!?])"
_ERROR_CELL = re.compile(rf"{_ERROR}|#{{3,}}", re.IGNORECASE)
_ERROR_LINE = re.compile(
    rf'\s*"?(?:{_ERROR}"?\s*(?:[\t;,|]|[\s"]+[-+.\d]|$)|#{{3,}}"?[\t;,|])', re.IGNORECASE
)
# Words of instruments in place of a missing number.
_HOLES = {"", "n/a", "na", "null", "none", "-", "--", "---", "***", "****", "bad", "no data", "error", "err"}
_HOLES |= {"fehler", "overload", "overflow", "ol", "invalid", "ungültig"}
_NUMBER = re.compile(r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?")
_DATE = re.compile(r"\b\d{1,4}[./-]\d{1,2}[./-]\d{2,4}\b|\b\d{1,2}:\d{2}(?::\d{2})?\b")
_LETTER = re.compile(r"[^\W\d_]")
_BETWEEN_NUMBERS = re.compile(r"""[\s;,|"']+""")


def has_fields(line: str) -> bool:
    """Return True unless a line is blank or a comment.

    A line that begins with an error value of a spreadsheet, such as #N/A, is no comment.
    """
    text = line.lstrip()
    return bool(text) and (not text.startswith("#") or _ERROR_LINE.match(line) is not None)


def text_above_numbers(text: str) -> str:
    """Return the lines of a text, also comments, above its first row of two or more numbers."""
    lines = text.splitlines()
    for i, line in enumerate(lines):
        rows = [split_fields(line, separator) for separator in ("\t", ";", ",", None)]
        if has_fields(line) and any(len(row) > 1 and all(map(is_number, row)) for row in rows):
            return "\n".join(lines[:i])
    return text


def split_fields(line: str, separator: str | None) -> list[str]:
    """Return the fields of a line. None stands for blanks, and two blanks for columns of a fixed width."""
    if separator is None:
        return line.split()
    if separator == "  ":
        fields = line.split()
        return fields if all(map(is_number, fields)) else re.split(r"\s{2,}", line.strip())
    quotes = csv.QUOTE_NONE if separator == "\t" else csv.QUOTE_MINIMAL  # with tabs E" means E''
    reader = csv.reader([line.strip("\r\n")], delimiter=separator, quoting=quotes, skipinitialspace=True)
    try:
        fields = [field.strip() for field in next(reader)]
    except (csv.Error, StopIteration):  # such as a field of more than 131072 characters
        fields = [field.strip() for field in line.split(separator)]
    return [f[1:-1] if len(f) > 2 and f[0] == f[-1] == '"' else f for f in fields]


def any_number(fields: list[str]) -> bool:
    """Return True if a field is a number."""
    return any(map(is_number, fields))


def is_error_cell(field: str) -> bool:
    """Return True for an error value of a spreadsheet, such as #DIV/0!."""
    return _ERROR_CELL.fullmatch(field) is not None


def is_hole(field: str) -> bool:
    """Return True for an empty field, and for a word or error value in place of a number."""
    return field.lower() in _HOLES or is_error_cell(field)


def holds_data(fields: list[str], places: Sequence[int]) -> bool:
    """Return True if the fields of a line belong to a row of a table, which may be a bad row.

    Parameters
    ----------
    fields : fields of the line
    places : places of the columns that are known

    Notes
    -----
    A line with one number and empty cells is a note if its first known cell is a text. A mean or a sum below
    a table has several numbers, so it counts as a row.
    """
    cells = [fields[place] for place in places if place < len(fields)]
    if fields and is_number(fields[0]):
        return True
    if not cells or not (numbers := sum(map(is_number, cells))):
        return any(map(is_error_cell, [*fields[:1], *cells]))
    complete = len(cells) == len(places) and all(cells)
    return numbers > 1 or complete or is_number(cells[0]) or is_hole(cells[0])


def is_misshapen(text: str, separator: str | None, width: int) -> bool:
    """Return True if a line without data in its fields is a row with other separators or quotes.

    Such a line has several numbers and no letters, or `width` fields between other separators. Dates and
    times are no numbers.
    """
    without_dates = _DATE.sub(" ", text)
    if len(_NUMBER.findall(without_dates)) > 1 and not _LETTER.search(_NUMBER.sub(" ", without_dates)):
        return True
    words = [word for word in _BETWEEN_NUMBERS.split(text) if word]
    if len(words) > 1 and any_number(words) and all(is_number(word) or is_hole(word) for word in words):
        return True
    if len(words) == width and sum(map(is_number, words)) >= max(width - 1, 2):
        return True
    plain = text.replace('"', "").replace("'", "")
    for other in ("\t", ";", ",", "|"):
        if other != separator or plain != text:
            fields = split_fields(plain, other)
            if len(fields) >= max(width, 2) and any_number(fields):
                return True
    return False


def checked_rows(
    path: StrPath, count: int, rows: TextRows, unread: Collection[int] = ()
) -> tuple[TextRows, BadRows]:
    """Convert decimal commas to points, and separate bad rows.

    A bad row does not have `count` fields, or has another decimal sign than most rows. The columns `unread`
    may lack fields at the end of a row.
    """
    with_commas = sum(any(map(_DECIMAL_COMMA.fullmatch, fields)) for _, fields in rows)
    with_points = sum(any(map(_has_point, fields)) for _, fields in rows) if with_commas else 0
    commas = with_commas > 0 and with_commas >= with_points
    good, bad = [], []
    for line, fields in rows:
        fields = trimmed(fields, count)
        if all(place in unread for place in range(len(fields), count)):
            fields = [*fields, *[""] * (count - len(fields))]
        if len(fields) != count:
            bad.append((line, f"{path}: line {line}: has {len(fields)} fields: must have {count}"))
            continue
        wrong = [f for f in fields if (_has_point(f) if commas else _DECIMAL_COMMA.fullmatch(f))]
        if with_commas and wrong:
            comma, point = "has a decimal comma, others a point", "has a decimal point, others a comma"
            fault = f"{point if commas else comma}: must all have the same decimal sign"
            bad.append((line, f"{path}: line {line}: {wrong[0]!r}: {fault}"))
            continue
        good.append((line, [f.replace(",", ".") if _DECIMAL_COMMA.fullmatch(f) else f for f in fields]))
    return good, bad


def trimmed(fields: list[str], count: int) -> list[str]:
    """Return fields without empty ones at the end, but at least `count` fields."""
    while len(fields) > count and not fields[-1]:
        fields = fields[:-1]
    return fields


def without_trailing_separators(
    rows: list[list[str]], are_values: Callable[[list[str]], bool]
) -> list[list[str]]:
    """Drop the last columns that are empty in every row of values. Lines of a text end with separators there.

    Parameters
    ----------
    rows : fields of all lines
    are_values : returns True for the fields of a row of values, without empty fields at the end
    """
    ends = []
    for row in rows:
        fields = trimmed(row, 0)
        if are_values(fields):
            ends.append(len(row) - len(fields))
    return [trimmed(row, len(row) - min(ends)) for row in rows] if ends and min(ends) else rows


def _has_point(field: str) -> bool:
    return "." in field and is_number(field.replace(",", ""))


def above_numbers(
    text: str, are_numbers: Callable[[list[str]], bool] = lambda cells: all(map(is_number, cells))
) -> tuple[list[list[str]], list[str]] | None:
    """Return the rows of titles and the widest row of numbers of a text, or None without numbers.

    The rows of titles are the last two rows, or fewer, that precede the numbers and have as many fields as
    the first row of numbers.
    """
    lines = [line.removeprefix("##") for line in text.splitlines() if has_fields(line) or line[:2] == "##"]
    for separator in ("\t", ";", ",", None):
        rows = [split_fields(line, separator) for line in lines]
        rows = without_trailing_separators(rows, lambda row: len(row) > 1 and are_numbers(row))
        numbers = [i for i, row in enumerate(rows) if len(row) > 1 and are_numbers(row)]
        if numbers:
            first = numbers[0]
            width = len(rows[first])
            titles = [row for row in (trimmed(row, width) for row in rows[:first]) if len(row) == width][-2:]
            return titles, max((rows[i] for i in numbers), key=len)
    return None
