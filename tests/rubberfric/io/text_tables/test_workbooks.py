"""Workbooks and wide tables that are too large, damaged, locked or hostile: short messages, quickly."""

import io
import time
import zipfile

import numpy as np
import pytest
from support import exports
from support.refusals import refused

import fitting
import rubberfric as rf

openpyxl = pytest.importorskip("openpyxl", reason="reads .xlsx")
MAIN = b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>%s</sheetData></worksheet>'


def book(folder):
    return exports.book(folder, "book.xlsx", {"friction": [["v [mm/s]", "mu"], [1, 0.5], [2, 0.6]]})


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


def test_values_and_damaged_parts_of_a_workbook(tmp_path, monkeypatch):
    rows = [
        ["Sample", "tread"],
        [],
        ["v [mm/s]", "Reibwert [-]", "Remark"],
        [0.5, 0.61, "run in"],
        [5, 0.75, None],
    ]
    path = exports.book(tmp_path, "friction.xlsx", {"Notes": [["Notes"]], "run 1": rows})
    data = fitting.read(path, pressure=1e5)
    np.testing.assert_allclose([data.velocity, data.friction], [[5e-4, 5e-3], [0.61, 0.75]], rtol=1e-14)
    whole = path.read_bytes()
    path.write_bytes(b"PK")
    assert "cannot be read as .xlsx" in refused(path, lambda: fitting.read(path))
    random = np.random.default_rng(0)
    said = []
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        for name in archive.namelist():
            for _ in range(3):  # one part of it is damaged, or cut off
                with zipfile.ZipFile(path, "w") as damaged:
                    for part in archive.namelist():
                        content = np.frombuffer(archive.read(part), np.uint8).copy()
                        if part == name:
                            content[random.integers(content.size, size=9)] = random.integers(256, size=9)
                            content = content[: random.integers(content.size // 2, content.size)]
                        damaged.writestr(part, content.tobytes())
                try:
                    fitting.read(path, pressure=1e5)
                except ValueError as error:
                    said.append(str(error))
    assert len(said) > 5 and all(str(path) in one and "\n" not in one for one in said)

    def wrong(*_, **__):
        raise AssertionError("a mistake of the program")

    monkeypatch.setattr(openpyxl, "load_workbook", wrong)
    with pytest.raises(AssertionError, match="a mistake"):  # and none of the file
        fitting.read(path)


def test_a_distant_cell_of_a_workbook_is_refused(tmp_path):
    whole = openpyxl.Workbook()
    whole.active["A1"], whole.active["XFD60000"] = "v [mm/s]", 1.0
    path = tmp_path / "distant.xlsx"
    whole.save(path)
    assert "more than 1000000 cells" in refused(path, lambda: fitting.read(path))


def test_a_workbook_that_unpacks_to_much_is_refused(tmp_path):
    path = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", b" " * (2**26 + 1))
    assert path.stat().st_size < 1e5
    assert "has 64 MiB unpacked" in refused(path, lambda: fitting.read(path))
