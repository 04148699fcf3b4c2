"""Reports of the errors of accuracy settings: the choice, text, CSV, table, and picture."""

import csv

import numpy as np
import pytest
from support import html_tables

import rubberfric as rf
from rubberfric.analysis.reference import Errors
from rubberfric.analysis.sweep import Accuracy, Row
from rubberfric.plot import plot_accuracy

MIDDLE = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0, angular_order=10)


def made(errors, agreement=1e-12, error=1e-6):
    """Return a result for settings of increasing work in both precisions; float32 is faster."""
    rows = tuple(
        Row("panels", MIDDLE, dtype, 100 * (i + 1), Errors(*e), (i + 1) * unit, 2 * (i + 1) * unit, 1.0, 2.0)
        for dtype, unit in (("float64", 1e-3), ("float32", 0.9e-3))
        for i, e in enumerate(errors if dtype == "float64" else [[max(x, 3e-7) for x in e] for e in errors])
    )
    textbook = Row("textbook", (200, 64), "float64", 12800, Errors(1e-3, 2e-3, 3e-3), 0.09)
    return Accuracy(error, (*rows, textbook), Errors(*[agreement] * 6), 41, 30)


RESULT = made([[1e-2] * 6, [1e-8] * 3 + [1e-7] * 3])
COARSER = Row("textbook", (100, 32), "float64", 3200, Errors(1e-2, 2e-2, 3e-2), 0.03)
RESULT = RESULT._replace(rows=(*RESULT.rows[:-1], COARSER, RESULT.rows[-1]))


def test_the_cheapest_is_chosen_for_either_use():
    fine, coarse_slopes = [1e-8] * 6, [1e-8] * 3 + [1e-3] * 3
    result = made([[1e-2] * 6, coarse_slopes, fine, fine])
    assert result.chosen_values is result.rows[5] and result.rows[5].dtype == "float32"
    assert result.chosen is result.rows[6]
    assert result._replace(error=1e-7).chosen is result.rows[2]  # too fine for single precision
    text = result.report()
    assert max(map(len, text.splitlines())) <= 110
    assert "with 200 x 64 nodes takes 50 times as long as the first, with an error of" in text
    assert "with an error of 3e-03" in text
    assert made([[1e-2] * 6]).chosen_values is None
    assert "values and gradients to 1e-06: no setting meets it" in made([[1e-2] * 6]).report()
    assert made([fine], agreement=2e-7).chosen is None
    assert "no reference" in made([fine], agreement=2e-7).report()
    # Errors below three times the disagreement of the refinements are bounds.
    assert " <3e-08" in made([fine], agreement=1e-8).report()
    assert made([fine], agreement=1e-8).known(result.rows[1]).value == pytest.approx(3e-8)


def test_csv_holds_every_row(tmp_path):
    path = tmp_path / "t.csv"
    RESULT.write(path)
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    names, units, *rows = csv.reader(lines)
    assert len(rows) == len(RESULT.rows) and set(units) == {"-", "s"}
    assert [unit for name, unit in zip(names, units, strict=True) if name == "compile_gradient"] == ["s"]
    for cells, row in zip(rows, RESULT.rows, strict=True):
        cells = dict(zip(names, cells, strict=True))
        assert (cells["method"], cells["dtype"], int(cells["nodes"])) == (row.method, row.dtype, row.nodes)
        assert float(cells["forward"]) == row.forward
        assert float(cells["error_area"]) == RESULT.known(row).area
        if row.method == "panels":
            assert float(cells["error_gradient_separation"]) == RESULT.known(row).separation_gradient
            knobs = {name: cells[name] for name in ("order", "panels", "graded", "ratio", "angular_order")}
            assert all(float(text) == getattr(row.setting, name) for name, text in knobs.items())
        else:
            assert cells["order"] == cells["gradient"] == cells["error_gradient_area"] == ""
            assert (int(cells["nodes_q"]), int(cells["nodes_phi"])) == row.setting
    with pytest.raises(ValueError, match=r"t.txt: suffix '.txt': must be .csv"):
        RESULT.write(tmp_path / "t.txt")


def test_table_in_a_notebook():
    headings, *rows = html_tables.cells(RESULT)
    assert headings[0] == "method" and headings[3] == "error of area [-]" and "time [ms]" in headings
    table = [row for row in rows if len(row) > 1]
    assert [row[0] for row in table[:3]] == ["panels, float64", "panels, float64", "panels, float32"]
    assert all(len(row) == len(headings) == 13 for row in table) and len(table) == len(RESULT.rows)
    assert table[1][2:9] == [str(RESULT.rows[1].nodes), *(f"{e:.0e}" for e in RESULT.rows[1].errors)]
    assert ["".join(row) for row in rows[len(table) :]][-1] in RESULT.report()


def test_plot_draws_every_row():
    ax = plot_accuracy(RESULT)
    lines = {line.get_label(): line.get_xydata() for line in ax.lines}
    for dtype in ("float64", "float32"):
        rows = [row for row in RESULT.rows if (row.method, row.dtype) == ("panels", dtype)]
        values = [(1e3 * row.forward, RESULT.known(row).value) for row in rows]
        gradients = [(1e3 * row.gradient, RESULT.known(row).gradient) for row in rows]
        np.testing.assert_allclose(lines[f"values, {dtype}"], values)
        np.testing.assert_allclose(lines[f"gradients, {dtype}"], gradients)
    assert lines["values, textbook method"].shape == (2, 2)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert plot_accuracy(RESULT, ax) is ax
    textbook = plot_accuracy(RESULT, unit=RESULT.rows[-1]).lines[-2]
    np.testing.assert_allclose(textbook.get_xdata(), [RESULT.rows[-2].forward / RESULT.rows[-1].forward, 1.0])
