"""Write tables and workbooks as instruments and laboratories export them."""

import pytest


def put(folder, text, name="table.csv"):
    """Write text or bytes to a file; the path."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def book(folder, name, sheets):
    """Write a workbook: rows by the title of their sheet; the path."""
    openpyxl = pytest.importorskip("openpyxl", reason="writes .xlsx")
    whole = openpyxl.Workbook()
    whole.remove(whole.active)
    for title, rows in sheets.items():
        sheet = whole.create_sheet(title)
        for row in rows:
            sheet.append(row)
    whole.save(folder / name)
    return folder / name
