"""Notebooks of fits, from top to bottom; the others: tests/project/test_notebooks.py."""

import pytest
from support.processes.notebooks import OF_FITS, run


@pytest.mark.slow  # half a minute and more, each; a laboratory's way is in `test_stranger`, too
@pytest.mark.parametrize("path", OF_FITS, ids=lambda path: path.stem)
def test_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    run(path, tmp_path, monkeypatch)
