"""Notebooks: each runs from top to bottom, and its stored form is complete, clean and small."""

import base64
import json
import os
import re

import pytest
from support.folders import ROOT
from support.processes.notebooks import NOTEBOOKS, OF_FITS, run, script

# Largest size of a notebook [bytes], because every clone of the repository contains all its versions.
LARGEST = 350_000
# Largest size of all ten notebooks [bytes].
ALL = 1_500_000
MACHINE = re.compile(r"(?<![\w.])/(home|tmp|work|root|usr|opt)\b|site-packages|[A-Z]:\\\\Users")

each = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def code_of(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def outputs_of(notebook):
    return [output for cell in code_of(notebook) for output in cell.outputs]


def texts_of(notebook):
    """Yield all text of a notebook without its pictures."""
    yield str(dict(notebook.metadata))
    for cell in notebook.cells:
        yield cell.source
        for output in cell.get("outputs", ()):
            yield output.get("text", "")
            yield from (str(data) for kind, data in output.get("data", {}).items() if "image" not in kind)


# A quarter of a minute and more. The ordinary run has the snippets of README, which are similar.
@pytest.mark.slow
@pytest.mark.parametrize(
    "path", [path for path in NOTEBOOKS if path not in OF_FITS], ids=lambda path: path.stem
)
def test_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    """Notebooks with fits run in `tests/fitting/whole_fits`."""
    run(path, tmp_path, monkeypatch)


@each
def test_is_stored_executed_and_clean(path):
    # Imported here: it takes seconds, of every process that collects this test.
    nbformat = pytest.importorskip("nbformat", reason="notebooks need pip install 'rubberfric[notebooks]'")
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert path.stat().st_size < LARGEST
    code = code_of(notebook)
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    kinds = {(output.output_type, output.get("name")) for output in outputs_of(notebook)}
    assert kinds and not {("error", None), ("stream", "stderr")} & kinds
    assert {key for cell in notebook.cells for key in cell.metadata} == set()
    assert notebook.metadata.kernelspec.name == "python3"
    for text in texts_of(notebook):
        assert not MACHINE.search(text), MACHINE.search(text)
    assert 'jax.config.update("jax_enable_x64", True)' in code[0].source
    pictures = [output.get("data", {}).get("image/png") for output in outputs_of(notebook)]
    assert any(pictures)
    for picture in filter(None, pictures):
        assert base64.b64decode(picture).startswith(b"\x89PNG")


def test_together_they_are_small():
    assert len(NOTEBOOKS) == 10
    assert sum(os.path.getsize(path) for path in NOTEBOOKS) < ALL


def test_the_page_on_growth_has_the_stored_measurements(tmp_path):
    """The page belongs to the stored figures, and another device adds lines."""
    growth = script("growth")
    store = json.loads(growth.STORE.read_text())
    lines = list(growth.page(store))
    assert growth.PAGE.read_text(encoding="utf-8") == "\n".join(lines) + "\n"
    assert not any("Not measured." in line for line in lines)
    processors = {device: parts for device, parts in store.items() if "processor" in device}
    assert any("Not measured." in line for line in growth.page(processors))
    both = store | {"Another GPU": {k: v for parts in store.values() for k, v in parts.items()}}
    count = sum("throughput" in parts for parts in both.values())
    assert sum("| float64 | values |" in x for x in growth.page(both)) == count
    growth.draw(both, tmp_path / "growth.png")
    assert (tmp_path / "growth.png").read_bytes().startswith(b"\x89PNG")


def test_measure_runs_every_command_that_pages_quote():
    """Each test and script that a page names as the source of its figures."""
    measure = script("measure")
    pages = {*(ROOT / "notebooks").glob("*.md"), ROOT / "README.md"} - {measure.PAGE}
    texts = "".join(page.read_text(encoding="utf-8") for page in pages)
    # Four scripts measure nothing.
    quoted = set(re.findall(r"(?:tests/[\w/]+/test_\w+|python notebooks/[\w/]+)\.py", texts))
    quoted -= {f"python notebooks/{name}.py" for name in ("measure", "formats", "execute", "gallery")}
    # Boundary elements take hours.
    quoted -= {f"python notebooks/{name}.py" for name in ("boundary_elements", "law_elements")}
    assert len(quoted) > 10
    assert [name for name in sorted(quoted) if name not in str(measure.MEASUREMENTS)] == []
