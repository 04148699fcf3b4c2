"""Workbooks and wide tables that are too large, damaged, locked or hostile: short messages, quickly."""

import io
import time
import zipfile

import pytest
from support.refusals import refused

import fitting
import rubberfric as rf

openpyxl = pytest.importorskip("openpyxl", reason="reads .xlsx")
MAIN = b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>%s</sheetData></worksheet>'


def book(folder):
    whole = openpyxl.Workbook()
    for row in (["v [mm/s]", "mu"], [1, 0.5], [2, 0.6]):
        whole.active.append(row)
    whole.save(folder / "book.xlsx")
    return folder / "book.xlsx"


def with_sheet(folder, sheet):
    """Write a workbook whose sheet has the given XML."""
    path = book(folder)
    source = zipfile.ZipFile(io.BytesIO(path.read_bytes()))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in source.namelist():
            archive.writestr(name, sheet if name.endswith("sheet1.xml") else source.read(name))
    return path


@pytest.mark.parametrize("cell", [b"<c><v>1</v></c>", b'<c t="n"><v>1</v></c>', b"<c/>"])
def test_many_cells_in_a_small_file(tmp_path, cell):
    path = with_sheet(tmp_path, MAIN % (250 * (b"<row>" + 8000 * cell + b"</row>")))
    assert path.stat().st_size < 2e5
    start = time.process_time()
    message = refused(path, lambda: fitting.read(path))
    assert "has 2000000 cells; must have at most 1000000; save the sheet as .csv" in message
    assert time.process_time() - start < 3.0


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_entities_of_a_document_type(tmp_path, encoding):
    entities = '<!ENTITY a "aaaaaaaaaa">' + "".join(
        f'<!ENTITY {new} "{10 * f"&{old};"}">' for old, new in zip("abcdefgh", "bcdefghi", strict=True)
    )
    row = b'<row><c t="str"><v>&i;</v></c></row>'
    text = f'<?xml version="1.0" encoding="{encoding}"?><!DOCTYPE x [{entities}]>' + (MAIN % row).decode()
    path = with_sheet(tmp_path, text.encode(encoding))
    message = refused(path, lambda: fitting.read(path))
    assert "sheet1.xml has a document type, which no spreadsheet program writes" in message


def test_a_workbook_with_charts_only(tmp_path):
    whole = openpyxl.Workbook()
    whole.create_chartsheet("Diagramm")
    whole.remove(whole.active)
    path = tmp_path / "charts.xlsx"
    whole.save(path)
    assert "has charts only; must have a sheet with numbers" in refused(path, lambda: fitting.read(path))


COMPOUND = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(2000)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.xlsx", COMPOUND, "has a password, or is an old .xls workbook; must be saved without password"),
        ("a.csv", COMPOUND, "is a workbook; its suffix must be .xlsx, or save it as .csv"),
        ("a.txt", None, "is a workbook; its suffix must be .xlsx, or save it as .csv"),
        ("a.xlsx", b"v,mu\nm/s,-\n1,2\n", "is no workbook; if it is a text, its suffix must be .csv or .txt"),
        ("a.xlsx", b"", "is no workbook"),
        ("a.xlsx", slice(2000), "is incomplete or damaged; must be saved again as .xlsx or .csv"),
    ],
)
def test_files_that_are_not_what_their_suffix_says(tmp_path, name, content, message):
    whole = book(tmp_path).read_bytes()
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else whole[content or slice(None)])
    assert message in refused(path, lambda: fitting.read(path))


MANY = [f"column_{i}" for i in range(20_000)]


@pytest.mark.parametrize("rows", [[["1"]], [["-"], ["1"]]], ids=["export", "own"])
@pytest.mark.parametrize("read", [fitting.read, rf.io.read_columns])
def test_messages_about_many_columns_are_short(tmp_path, rows, read):
    path = tmp_path / "wide.csv"
    path.write_text("\n".join(",".join(row) for row in (MANY, *(20_000 * row for row in rows))) + "\n")
    message = refused(path, lambda: read(path))
    assert len(message) < 2000


def test_messages_about_frames_and_titles_are_short(tmp_path):
    with pytest.raises(
        ValueError, match=r"column_0, column_1, .*\(20000 in total\)\. Rename a column"
    ) as caught:
        fitting.FrictionData.from_frame({name: [1.0] for name in MANY})
    assert len(str(caught.value)) < 2000
    path = tmp_path / "long.csv"
    path.write_text(f"v,mu,{100_000 * 'x'}\nm/s,-,-\n1,0.5,1\n")
    assert len(refused(path, lambda: fitting.read(path))) < 2000
