"""Notebooks run from top to bottom, and scripts of their folder are imported."""

import functools
import importlib.util
import shutil
import sys
import time

import pytest
from support.folders import ROOT
from support.published import OUTSIDE, VARIABLE, is_missing, reason

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
OF_FITS = [path for path in NOTEBOOKS if path.name[0] in "256"]
SECONDS = 150  # for one notebook; on a quiet core each takes a part of it


@functools.cache
def script(name):
    """Import a script of the folder of notebooks."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "notebooks" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(ROOT / "notebooks"))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.pop(0)
    return module


def run(path, folder, monkeypatch):
    """In a copy of its folder and the data, with this checkout and the compiler options of `conftest`."""
    if "published" in path.name:
        for name in ("epdm", "road_profiles"):
            if is_missing(name):
                pytest.skip(reason(name))
        monkeypatch.setenv(VARIABLE, str(OUTSIDE))
    why = "notebooks need pip install 'rubberfric[notebooks]'"
    for name in ("matplotlib", "ipykernel", "numpyro", "arviz_stats"):
        pytest.importorskip(name, reason=why)
    nbformat, nbclient = (pytest.importorskip(name, reason=why) for name in ("nbformat", "nbclient"))
    notebooks = folder / "notebooks"
    notebooks.mkdir()
    shutil.copytree(ROOT / "data", folder / "data")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("JUPYTER_CONFIG_DIR", str(folder))
    notebook = nbformat.read(path, as_version=4)
    end = time.monotonic() + SECONDS
    client = nbclient.NotebookClient(
        notebook,
        kernel_name="python3",
        timeout_func=lambda _: max(1, int(end - time.monotonic())),
        resources={"metadata": {"path": str(notebooks)}},
    )
    client.execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert outputs and not [output for output in outputs if output.output_type == "error"]
