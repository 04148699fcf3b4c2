"""How time and memory grow with the work; off by default:

    python -m pytest -m benchmark -s tests/benchmarks/test_growth_benchmarks.py

Repeats all measurements (some minutes) and writes notebooks/growth.md and its figure: time is linear in
the velocities and in the Prony terms, memory does not grow, and a million points take seconds.
"""

import importlib.util
import json

import pytest
from support.folders import ROOT

SCRIPT = ROOT / "notebooks" / "growth.py"


@pytest.fixture(scope="module")
def growth():
    spec = importlib.util.spec_from_file_location("growth", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.benchmark
def test_growth(growth):
    store = growth.main()
    found = store[growth.apart("machine")]
    rows = {count: row for (count,), row in found["velocities"]}
    assert rows[10_000_000]["seconds"] < 1.5 * 100 * rows[100_000]["seconds"]
    # Seven arrays of the length of the velocities.
    assert max(row["added"] - 56e-6 * count for count, row in rows.items()) < 100
    assert max(row["peak"] for row in rows.values()) < 1000
    rows = {count: row for (count,), row in found["terms"]}
    assert rows[300]["seconds"] < 1.5 * 10 * rows[30]["seconds"]
    assert rows[300]["program"] < 64  # [MB]
    rows = {count: row for (count,), row in found["members"]}
    assert rows[100_000]["seconds"] < 1.5 * 100 * rows[1000]["seconds"]
    assert not any(row["failed"] for row in rows.values())
    for (shape, setting), row in found["maps"]:
        assert row["error"] < 1e-8, (shape, setting)
        assert row["peak"] < 2000


def test_page_and_figure_of_what_was_measured(growth, tmp_path):
    """The committed page belongs to the committed figures; another device adds lines."""
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
