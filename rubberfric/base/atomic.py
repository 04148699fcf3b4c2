"""Check files before reading, read text in several encodings, and write files completely or not at all."""

import contextlib
import errno
import importlib
import os
import stat
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

StrPath = str | os.PathLike[str]
Rows = list[tuple[Any, ...]]  # cells of a sheet

# Suffixes of the tables of measured data that are read.
TABLE_SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".xlsx")
# Largest size in bytes of a file that is read. Typical measured data have a hundredth of it.
LARGEST_FILE = 2**26
# Largest number of cells of a workbook. Openpyxl reads some 200 000 cells in a second.
MOST_CELLS = 1_000_000
# First bytes of a compound document: an old .xls, or any workbook with a password.
_COMPOUND_START = b"\xd0\xcf\x11\xe0"
# Start of a document type in UTF-8 and UTF-16. Its entities can expand to any size.
_DOCUMENT_TYPES = tuple("<!DOCTYPE".encode(code) for code in ("utf-8", "utf-16-le", "utf-16-be"))
# Bytes above ASCII in exports in Latin-1: ° µ ¹ ² ³ ·, German vowels, French letters.
_LATIN = b"\xb0\xb5\xb9\xb2\xb3\xb7\xe4\xf6\xfc\xc4\xd6\xdc\xdf\xe9\xe8\xea\xe0\xe2\xe7\xf4\xee\xc9"

# Errors of a full or failing disk.
_FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO)

# Folders with incomplete files of this process, which the thread that waits for signals removes.
_begun: set[Path] = set()
_lock = threading.Lock()


def as_path(path: StrPath) -> Path:
    """Convert a string or a path object to a `Path`, or raise ValueError for another type."""
    try:
        return Path(path)
    except TypeError:
        raise ValueError(f"path is a {type(path).__name__}: must be the path of a file") from None


def remove_begun(then: Callable[[], None] = lambda: None) -> None:
    """Remove all folders of `temporary_folder` that still exist, and then call `then`.

    No other thread can make such a folder before `then` has returned.
    """
    with _lock:
        try:
            for folder in _begun:
                _remove_folder(folder)
        finally:
            then()


def _remove_folder(path: Path) -> None:
    # Importing shutil, whose rmtree would do this, takes long.
    for file in path.glob("*"):
        file.unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # another thread removed it, or is about to
        path.rmdir()


@contextlib.contextmanager
def temporary_folder(parent: StrPath) -> Iterator[Path]:
    """Make a hidden folder in `parent`, and yield the path of the folder.

    The folder is removed at the end of the `with` block, or by `remove_begun` if a signal ends the process.
    """
    folder = Path(parent) / f".writing-{os.urandom(8).hex()}"
    with _lock:
        _begun.add(folder)  # first, so that a signal between the two lines leaves no folder
    try:
        folder.mkdir(0o700)
        yield folder
    finally:
        _remove_folder(folder)
        with _lock:
            _begun.discard(folder)


@contextlib.contextmanager
def replacing(path: StrPath) -> Iterator[Path]:
    """Yield a temporary path, and rename the file written there to `path` after the `with` block.

    If the block raises an exception, the temporary file is removed. The temporary file lies in a hidden
    folder in the folder of `path`, so that the rename stays on one file system. The temporary file has the
    name of `path`, so that the suffix shows the format. A file that exists keeps its permissions.
    """
    place = Path(path).resolve()  # a link is followed, not replaced
    with temporary_folder(place.parent) as folder:
        temporary = folder / place.name
        try:
            yield temporary
            with contextlib.suppress(FileNotFoundError):
                temporary.chmod(stat.S_IMODE(place.stat().st_mode))
            os.replace(temporary, place)
        except OSError as error:
            if error.errno in _FULL:  # an error of writing does not name the file
                raise OSError(error.errno, error.strerror, str(path)) from None
            raise


def write_durably(path: StrPath, content: bytes | memoryview) -> None:
    """Write bytes to a file completely or not at all, and wait until they are on the disk.

    An OSError is raised if the bytes cannot be written.
    """
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    folder = os.open(Path(path).resolve().parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the new name, too
    finally:
        os.close(folder)


def check_suffix(path: StrPath, suffixes: tuple[str, ...]) -> None:
    """Raise ValueError unless a path ends in one of the suffixes."""
    path = as_path(path)
    if path.suffix.lower() not in suffixes:
        folder = "; it is a folder" if path.is_dir() else ""
        raise ValueError(f"{path}: suffix {path.suffix!r}: must be {' or '.join(suffixes)}{folder}")


def check_readable(path: StrPath, largest: int | None = None) -> None:
    """Raise ValueError if a file cannot be read, is too large, or is not a regular file.

    `largest` is the largest allowed size in bytes. Pipes and devices are refused because reading them could
    wait forever or fill the memory.
    """
    try:
        found = os.stat(path)
        if stat.S_ISREG(found.st_mode):
            with open(path, "rb"):
                pass
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # a path with a NUL byte
        raise ValueError(f"{path}: cannot be read: {error}") from None
    if stat.S_ISDIR(found.st_mode):
        raise ValueError(f"{path}: cannot be read: Is a directory; must be a file")
    if not stat.S_ISREG(found.st_mode):
        raise ValueError(f"{path}: cannot be read: is a pipe or a device; must be a file")
    if largest is not None and found.st_size > largest:
        raise ValueError(
            f"{path}: cannot be read: has {found.st_size / 2**20:.0f} MiB; must have at most "
            f"{largest / 2**20:.0f}"
        )


def check_writable(path: StrPath, suffixes: tuple[str, ...]) -> None:
    """Raise ValueError if a path has none of the suffixes, is not a regular file, or cannot be written."""
    check_suffix(path, suffixes)
    path = as_path(path)
    try:
        if not path.parent.is_dir():
            raise ValueError(f"{path}: folder {str(path.parent)!r} does not exist; create it first")
        if path.is_dir():
            raise ValueError(f"{path}: is a folder; must be a file")
        if path.exists() and not path.is_file():
            raise ValueError(f"{path}: is a pipe or a device; must be a file")
        place = os.path.realpath(path)  # Path.resolve raises RuntimeError for a link to itself
        if os.path.islink(place):
            raise ValueError(f"{path}: is a link to itself; must be a file")
        with temporary_folder(os.path.dirname(place)):
            pass
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error.strerror}") from None


def read_text(path: StrPath, exports: bool = False) -> str:
    """Return the text of a UTF-8 file.

    If `exports` is True, files in UTF-16, files in Latin-1 with signs such as ° and µ, and Excel workbooks
    (.xlsx) are read too. A workbook requires openpyxl. The first sheet with rows of numbers becomes lines of
    cells separated by tabs. Sheets with equal titles follow, and a warning names these and the other sheets
    with numbers. A formula whose value is not stored becomes the text of the formula.

    Raises
    ------
    ValueError : the file is missing, too large, not a regular file, or has an unknown encoding
        The message has one line.
    """
    check_readable(as_path(path), LARGEST_FILE)
    if exports and as_path(path).suffix.lower() == ".xlsx":
        return _workbook_text(path)
    try:
        content = as_path(path).read_bytes()
        if content.startswith((b"PK\x03\x04", _COMPOUND_START)):
            raise ValueError("is a workbook; its suffix must be .xlsx, or save it as .csv")
        if exports and content[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return content.decode("utf-16")
        if exports and set(content) - set(range(128)) <= set(_LATIN):
            return content.decode("latin-1")
        return content.decode("utf-8-sig")
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # not UTF-8
        raise ValueError(f"{path}: cannot be read as text: {error}") from None


def is_number(cell: object) -> bool:
    """Return True for a number, and for the text of a number with a decimal point or comma."""
    try:
        float(str(cell).replace(",", ".", 1))
    except ValueError:
        return False
    return True


def _workbook_text(path: StrPath) -> str:
    """Return the sheets of a workbook with numbers and equal titles, as lines of cells separated by tabs.

    Raises
    ------
    ValueError
        The file is no workbook, is damaged, has a password, has too many cells, or has no numbers. Or
        openpyxl is not installed. The message has one line and begins with the path.
    """
    import zipfile
    import zlib

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
    import zipfile

    start = file.read(8)
    if start.startswith(_COMPOUND_START):
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
        from rubberfric.base.checks import warn_caller  # imports JAX

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
    found, cells = {}, 0
    for sheet in sheets:
        found[sheet.title] = []
        for row in sheet.iter_rows(values_only=True):
            cells += len(row)
            if cells > MOST_CELLS:
                raise ValueError(
                    f"the workbook has more than {MOST_CELLS} cells up to sheet {sheet.title!r}, including "
                    "empty cells; delete distant cells, or save the sheet as .csv"
                )
            found[sheet.title].append(row)
    return found


def _cell(value: object) -> str:
    return "" if value is None else repr(value) if isinstance(value, float) else " ".join(str(value).split())


def write_text(path: StrPath, text: str) -> None:
    """Write text to a file completely or not at all, or raise ValueError if its folder does not exist."""
    folder = as_path(path).parent
    if not folder.is_dir():
        raise ValueError(f"{path}: cannot be written: folder {str(folder)!r} must exist")
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
