"""Text of a file."""

import importlib
from typing import Any

from rubberfric.base.atomic import LARGEST, StrPath, as_path, check_readable, replacing

# Bytes above ASCII that exports in Latin-1 have: ° µ ¹ ² ³ ·, German vowels, French letters.
_LATIN = b"\xb0\xb5\xb9\xb2\xb3\xb7\xe4\xf6\xfc\xc4\xd6\xdc\xdf\xe9\xe8\xea\xe0\xe2\xe7\xf4\xee\xc9"


def read_text(path: StrPath, exports: bool = False) -> str:
    """Text of a file; ValueError in one line if it is missing, too large, no file at all or not UTF-8.

    `exports` says that UTF-16, signs like ° and µ in Latin-1, and Excel's .xlsx will do as well: of that the
    first sheet with numbers, as lines of cells separated by tabs; it needs openpyxl.
    """
    check_readable(as_path(path), LARGEST)
    if exports and as_path(path).suffix.lower() == ".xlsx":
        return _sheet(path)
    try:
        content = as_path(path).read_bytes()
        if exports and content[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return content.decode("utf-16")
        if exports and set(content) - set(range(128)) <= set(_LATIN):
            return content.decode("latin-1")
        return content.decode("utf-8-sig")
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # not UTF-8
        raise ValueError(f"{path}: cannot be read as text: {error}") from None


def _sheet(path: StrPath) -> str:
    """The first sheet of a workbook that has numbers, as text."""
    try:
        openpyxl: Any = importlib.import_module("openpyxl")
    except ImportError:
        raise ValueError(
            f"{path}: cannot be read without openpyxl: pip install 'rubberfric[excel]', or save it as .csv"
        ) from None
    try:
        with open(path, "rb") as file:
            book = openpyxl.load_workbook(file, read_only=True, data_only=True)
            sheets = [list(sheet.iter_rows(values_only=True)) for sheet in book.worksheets]
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except _damages() as error:
        raise ValueError(f"{path}: cannot be read as .xlsx: {error}") from None
    for rows in sheets:
        if any(isinstance(cell, int | float) for row in rows for cell in row):
            return "\n".join("\t".join(map(_cell, row)) for row in rows) + "\n"
    raise ValueError(f"{path}: cannot be read: no sheet has numbers")


def _damages() -> tuple[type[Exception], ...]:
    """What openpyxl raises for a damaged archive: of zip, its compression, XML, and missing parts."""
    import zipfile
    import zlib

    of_archive = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError)  # encrypted ones are the last
    return (*of_archive, SyntaxError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError)


def _cell(value: object) -> str:
    return "" if value is None else repr(value) if isinstance(value, float) else " ".join(str(value).split())


def write_text(path: StrPath, text: str) -> None:
    """Write a text file whole or not at all; ValueError if its folder is missing."""
    folder = as_path(path).parent
    if not folder.is_dir():
        raise ValueError(f"{path}: cannot be written: folder {str(folder)!r} must exist")
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
