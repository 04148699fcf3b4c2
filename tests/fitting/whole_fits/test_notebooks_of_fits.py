"""Notebooks of fits, from top to bottom; the others: tests/project/test_notebooks.py."""

import pytest
from support.processes.notebooks import OF_FITS, run

# The sixth draws samples of posteriors for half a minute; what the second does, the fifth does with a
# laboratory's tables.
SHORT = [
    pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * path.name.startswith(("2", "6")))
    for path in OF_FITS
]


@pytest.mark.parametrize("path", SHORT)
def test_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    run(path, tmp_path, monkeypatch)
