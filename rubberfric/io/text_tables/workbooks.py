"""Text of the exports of other programs: workbooks, UTF-16, and Latin-1 with signs such as ° and µ."""

import importlib
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from typing import Any

from rubberfric.base.atomic import (
    COMPOUND_START,
    LARGEST_FILE,
    StrPath,
    as_path,
    check_readable,
    decoded,
    is_number,
    read_bytes,
)
from rubberfric.base.checks import warn_caller
from rubberfric.io.text_tables.series import first_series

Rows = list[tuple[Any, ...]]  # cells of a sheet

# Largest number of cells of a workbook. Openpyxl reads some 200 000 cells in a second.
MOST_CELLS = 1_000_000
# Start of a document type in UTF-8 and UTF-16. Its entities can expand to any size.
_DOCUMENT_TYPES = tuple("<!DOCTYPE".encode(code) for code in ("utf-8", "utf-16-le", "utf-16-be"))
# Bytes above ASCII in exports in Latin-1: ° µ ¹ ² ³ ·, German vowels, French letters.
_LATIN = b"\xb0\xb5\xb9\xb2\xb3\xb7\xe4\xf6\xfc\xc4\xd6\xdc\xdf\xe9\xe8\xea\xe0\xe2\xe7\xf4\xee\xc9"


def read_export(path: StrPath) -> str:
    """Return the text of a table that this project or another program has written.

    The encoding is UTF-8, UTF-16, or Latin-1 with signs such as ° and µ. Excel workbooks (.xlsx) are read
    with openpyxl. The first sheet with rows of numbers becomes lines of cells separated by tabs. Sheets with
    equal titles follow, and a warning names these and the other sheets with numbers. A formula whose value is
    not stored becomes the text of the formula. Of a text with several series (`series_of`), the first one is
    returned.

    Raises
    ------
    ValueError : the file is missing, too large, not a regular file, or has an unknown encoding
        The message has one line.
    """
    check_readable(as_path(path), LARGEST_FILE)
    if as_path(path).suffix.lower() == ".xlsx":
        return _workbook_text(path)
    content = read_bytes(path)
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return decoded(path, content, "utf-16")
    latin = set(content) - set(range(128)) <= set(_LATIN)
    return first_series(path, decoded(path, content, "latin-1" if latin else "utf-8-sig"))


def _workbook_text(path: StrPath) -> str:
    """Return the sheets of a workbook with numbers and equal titles, as lines of cells separated by tabs.

    Raises
    ------
    ValueError
        The file is no workbook, is damaged, has a password, has too many cells, or has no numbers. Or
        openpyxl is not installed. The message has one line and begins with the path.
    """
    # Errors of damaged or encrypted (RuntimeError) workbooks.
    damages = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, SyntaxError, LookupError, TypeError)
    try:
        openpyxl: Any = importlib.import_module("openpyxl")
    except ImportError:
        raise ValueError(
            f"{path}: cannot be read without openpyxl: pip install 'rubberfric[excel]', or save it as .csv"
        ) from None
    try:
        with open(path, "rb") as file:
            _check_archive(file)
            file.seek(0)
            book = openpyxl.load_workbook(file, read_only=True, data_only=True)
            if not book.worksheets:
                charts = ", ".join(sheet.title for sheet in book.chartsheets[:5]) or "none"
                raise ValueError(
                    f"has no sheet with cells (charts: {charts}); must have a sheet with numbers"
                )
            sheets = _rows(book.worksheets)
            name, *others = _sheets_to_read(path, sheets)
            rows = [row for each in (name, *others) for row in sheets[each]]
            if any(cell is None for row in rows for cell in row):
                book = openpyxl.load_workbook(file, read_only=True)
                formulas = [row for each in (name, *others) for row in book[each].iter_rows(values_only=True)]
                rows = [_with_formulas(*pair) for pair in zip(rows, formulas, strict=True)]
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except (*damages, ValueError, AttributeError, ArithmeticError) as error:
        text = " ".join(str(error).split())[:300]
        raise ValueError(f"{path}: cannot be read as .xlsx: {text}") from None
    return "\n".join("\t".join(map(_cell, row)) for row in rows) + "\n"


def _check_archive(file: Any) -> None:
    """Raise ValueError unless an open file is an archive of moderate size without document types."""
    start = file.read(8)
    if start.startswith(COMPOUND_START):
        raise ValueError(
            "has a password, or is an old .xls workbook; must be saved without password as .xlsx or .csv"
        )
    if not start.startswith(b"PK"):
        raise ValueError("is no workbook; if it is a text, its suffix must be .csv or .txt")
    try:
        archive = zipfile.ZipFile(file)
    except zipfile.BadZipFile:
        raise ValueError("is incomplete or damaged; must be saved again as .xlsx or .csv") from None
    parts = archive.infolist()
    size = sum(part.file_size for part in parts)
    if size > LARGEST_FILE:
        most = LARGEST_FILE / 2**20
        raise ValueError(f"has {size / 2**20:.0f} MiB unpacked; must have at most {most:.0f} MiB")
    if any(part.flag_bits & 1 for part in parts):
        raise ValueError("has a password; must be saved without password")
    if not any("worksheets/" in part.filename for part in parts):
        charts = (
            "has charts only" if any("chartsheets/" in part.filename for part in parts) else "has no sheets"
        )
        raise ValueError(f"{charts}; must have a sheet with numbers")
    cells = sum(_cells_in(archive, part.filename) for part in parts)
    if cells > MOST_CELLS:
        raise ValueError(f"has {cells} cells; must have at most {MOST_CELLS}; save the sheet as .csv")


def _cells_in(archive: Any, name: str) -> int:
    """Return the number of cells in a part of a workbook, or raise ValueError for a document type.

    Counting texts is 100 times faster than parsing them.
    """
    if not name.endswith((".xml", ".rels", ".vml")):
        return 0
    content = archive.read(name)
    if any(text in content for text in _DOCUMENT_TYPES):
        raise ValueError(
            f"{name[:60]} has a document type, which no spreadsheet program writes; must be saved again as"
            " .xlsx or .csv"
        )
    return sum(map(content.count, (b"<c ", b"<c>", b"<c/>"))) if "worksheets/" in name else 0


def _sheets_to_read(path: StrPath, sheets: Mapping[str, Rows]) -> list[str]:
    """Return the names of the first sheet with rows of numbers, and of the sheets with equal titles."""
    starts = {name: _first_numbers(rows, 2) for name, rows in sheets.items()}
    with_numbers = [name for name, start in starts.items() if start is not None]
    if not with_numbers:
        with_numbers = [name for name, rows in sheets.items() if _first_numbers(rows, 1) is not None][:1]
    if not with_numbers:
        raise ValueError("no sheet has numbers; formulas must have stored values")
    heads = {name: _titles(sheets[name], starts[name]) for name in with_numbers}
    read = [name for name, head in heads.items() if head == heads[with_numbers[0]]]
    if len(with_numbers) > 1:
        left = [name for name in with_numbers if name not in read]
        several = f"the sheets {', '.join(read)} are read as one table"
        what = several if read[1:] else f"the sheet {read[0]} is read"
        warn_caller(
            f"{path}: {what}{', and not ' * bool(left) + ', '.join(left)}; delete sheets to change this",
            UserWarning,
        )
    return read


def _titles(rows: Rows, start: int | None) -> Rows:
    """Return the last two rows above the row `start` in which most columns have a cell."""
    return [row for row in rows[:start] if 2 * sum(cell is not None for cell in row) > len(row)][-2:]


def _first_numbers(rows: Rows, count: int) -> int | None:
    """Return the index of the first row with at least `count` numbers, or None."""
    return next((i for i, row in enumerate(rows) if sum(map(is_number, row)) >= count), None)


def _with_formulas(values: tuple[Any, ...], formulas: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return the values of a row, with the text of formulas for missing values."""
    return tuple(
        f if v is None and str(f).startswith("=") else v for v, f in zip(values, formulas, strict=True)
    )


def _rows(sheets: Iterable[Any]) -> dict[str, Rows]:
    """Return the rows of each sheet of a workbook, or raise ValueError beyond `MOST_CELLS` cells."""
    by_title, cells = {}, 0
    for sheet in sheets:
        by_title[sheet.title] = []
        for row in sheet.iter_rows(values_only=True):
            cells += len(row)
            if cells > MOST_CELLS:
                raise ValueError(
                    f"the workbook has more than {MOST_CELLS} cells up to sheet {sheet.title!r}, including "
                    "empty cells; delete distant cells, or save the sheet as .csv"
                )
            by_title[sheet.title].append(row)
    return by_title


def _cell(value: object) -> str:
    return "" if value is None else repr(value) if isinstance(value, float) else " ".join(str(value).split())
