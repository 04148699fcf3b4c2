"""The page on formats equals the output of its script, and its messages occur in the code."""

import re
import shutil
import textwrap

from support.folders import ROOT
from support.processes.notebooks import script

formats = script("formats")
PAGE = (ROOT / "notebooks" / "formats.md").read_text(encoding="utf-8")


def test_the_page_is_as_its_script_writes_it():
    assert formats.document() == PAGE, "python notebooks/formats.py"


def test_every_kind_and_column_is_there():
    """By a search of the classes that does not share the script's."""
    import rubberfric as rf

    for name in rf.materials.__all__ + rf.roughness.__all__:
        kind = getattr(getattr(rf.materials, name, getattr(rf.roughness, name, None)), "file_kind", None)
        if kind is not None and getattr(rf, name, None) is not None:
            assert f'`kind = "{kind}"`' in PAGE, name
    for name in rf.io.COLUMNS:
        assert f"| `{name}` |" in PAGE


def test_messages_are_those_of_the_code():
    """Each stands in a module, perhaps over two lines of text."""
    sources = [p.read_text() for package in ("rubberfric", "fitting") for p in (ROOT / package).rglob("*.py")]
    whole = "\n".join(re.sub(r'"\s*\n\s*f?"', "", source) for source in sources)
    section = PAGE.split("## Messages")[1].split("\n## ")[0]
    messages = re.findall(r"^\| `(.+?)` \|", section, re.M)
    assert len(messages) > 20
    for message in messages:
        assert message in whole, message


def test_the_way_runs_on_what_a_laboratory_exports(tmp_path, monkeypatch):
    """The first snippet of the page, on the exports in data."""
    for name, export in (("sweeps.csv", "dma_isothermen.csv"), ("strain_sweep.txt", "strain_sweep.txt")):
        shutil.copy(ROOT / "data" / "laboratory" / export, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    snippet = re.search(r"```python\n(.*?)```", PAGE, re.S)
    assert snippet is not None
    found = {}
    exec(textwrap.dedent(snippet[1]), found)
    assert found["series"].material.shift == found["curve"].shift
    assert found["softening"].storage[-1] < 0.3


def test_every_format_of_a_program_has_a_test_and_a_document():
    rows = formats.programs()
    assert len(rows) >= 25
    for row in rows:
        path, function = row["test"].split("::")
        assert f"def {function}(" in (ROOT / path).read_text(encoding="utf-8"), row["test"]
        assert all(row.values()), row
