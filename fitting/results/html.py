"""What notebooks show of a fit."""

import numpy as np

from fitting.results.record import FitRecord
from fitting.results.report import report, tied_lines, variable_rows
from rubberfric.base import html, object_html


def fit_html(result: FitRecord) -> str:
    """The values of a fit as a table for notebooks, and its report and scene folded below."""
    rows = []
    for row in variable_rows(result):
        if isinstance(row, tuple):
            name, value, error, unit, share, start, remark = row
            row = (name, f"{value} +/- {error} {unit}", share, f"{start} {unit}", remark)
        rows.append(row)
    rows += tied_lines(result)
    rows += [f"not identified, {i}: {d.text}" for i, d in enumerate(result.unidentified, 1)]
    redchi = f"{result.redchi:.4g}" if np.isfinite(result.redchi) else "none"
    count = result.problem.targets.measured.size
    rows.append(f"measured values: {count}; reduced chi-square [-]: {redchi}; cost [-]: {result.cost:.6g}")
    caption = result.message if result.success else f"THE FIT DID NOT SUCCEED: {result.message}"
    headings = ("parameter", "value", "relative error", "start", "")
    below = (
        html.folded("report", html.preformatted(report(result))),
        html.folded("scene", object_html(result.scene)),
    )
    return "\n".join([html.table(rows, headings, caption), *below])
