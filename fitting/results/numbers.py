"""Numbers of a fit as texts: values with as many digits as their errors leave, and why some have no bar."""

from typing import Any

import jax
import numpy as np

from fitting.parameters.constraints import FOLLOWING, RmsSlope, Tied
from fitting.parameters.keypaths import owner_of
from fitting.parameters.scenes import Scenes, paths_of
from fitting.results.record import FitRecord
from rubberfric.base import unit_of

# Elements of one key path that are listed; of longer ones only the first and the last.
LISTED = 24


def unit(scene: Scenes, path: str) -> str:
    """Unit of the number of a scene, or of several, that a key path names, "" if it is dimensionless."""
    owner, name = owner_of(scene, path)
    found = unit_of(type(owner), name)
    return "" if found == "-" else found


def variable_rows(result: FitRecord) -> list[tuple[str, ...] | str]:
    """Texts of every free element: name, value, error, unit, relative error, start and a remark.

    One text stands for the elements of a long array that are left out.
    """
    values, starts, errors = result.values, result.start_values, result.stderr
    names, rows = result.names, []
    for group in result.variables.groups:
        if group.kind in FOLLOWING:
            continue
        slot, scale = list(range(*group.slot)), unit(result.scene_at_start, group.path)
        hidden = slot[LISTED // 2 : -(LISTED // 2)] if len(slot) > LISTED else []
        for i in slot:
            if i in hidden:
                if i == hidden[0]:
                    rows.append(_left_out(result, hidden))
                continue
            reason = result.withheld.get(names[i])
            error, share, remark = "?", "", f"error bar withheld: {reason}"
            if reason is None:
                error, remark = f"{errors[i]:#.2g}", _by_scatter(result, errors[i])
                share = f"{100 * abs(errors[i] / values[i]):.2f} %" if values[i] else ""
            value = _digits(values[i], np.nan if reason else errors[i])
            rows.append((names[i], value, error, scale, share, f"{starts[i]:.6g}", remark))
    return rows


def _by_scatter(result, error):
    """The error bar that the scatter would give, where the errors given cannot be all there is."""
    if result.verdict.explains is not False or result.error_scale != 1 or not result.redchi > 1:
        return ""
    return f"[{error * np.sqrt(result.redchi):#.2g}]"


def _left_out(result, elements):
    """One line for the elements of a long array that are not listed."""
    bare = sum(result.names[i] in result.withheld for i in elements)
    remark = f", {bare} of them without an error bar" if bare else ""
    return f"... {len(elements)} more, see result.values{remark}"


def _digits(value, error):
    """A value with as many digits as its error deserves: two of the error's."""
    if not (error > 0 and value and np.isfinite(value)):
        return f"{value:.6g}"
    digits = int(np.floor(np.log10(abs(value))) - np.floor(np.log10(error))) + 2
    return f"{value:#.{min(max(digits, 2), 12)}g}"


def tied_lines(result: FitRecord) -> list[str]:
    """A line for every key path that follows others: its value, and what it follows."""
    leaves, lines = jax.tree.leaves(result.scene), []
    groups = [group for group in result.variables.groups if group.kind in ("Tied", "RmsSlope")]
    rules = [
        rule
        for path, rule in result.free.items()
        if isinstance(rule, Tied | RmsSlope)
        for _ in paths_of(result.scene_at_start, path)
    ]
    for group, rule, ratio in zip(groups, rules, result.problem.numbers.constants.ratios, strict=True):
        values, ratio = np.atleast_1d(leaves[group.leaf])[list(group.elements or (0,))], np.asarray(ratio)
        scale = unit(result.scene_at_start, group.path)
        said = f"{ratio[0]:.6g} times" if np.ptp(ratio) == 0 else "in a fixed ratio to"
        if isinstance(rule, RmsSlope):
            lines.append(f"{group.path}: {values[0]:.6g} {scale}, where the rms slope is {rule.slope:.6g}")
            continue
        ends = f"{values[0]:.6g}" if values.size == 1 else f"{values[0]:.6g} ... {values[-1]:.6g}"
        lines.append(f"{group.path}: {ends}{f' {scale}' * bool(scale)}, {said} {rule.to}")
    return lines


def error_text(result: Any, name: str, value: float) -> str:
    """Error of a fitted value, why it has none, or that it was fixed.

    `result` is a FitResult or PronyFit; `name` ends a key path.
    """
    errors = dict(zip((full.rsplit(".", 1)[1] for full in result.names), result.stderr, strict=True))
    withheld = {full.rsplit(".", 1)[1]: why for full, why in result.withheld.items()}
    if name in withheld:
        return f"error bar withheld: {withheld[name]}"
    return f"+/- {errors[name]:.2g} ({errors[name] / value:.1%})" if name in errors else "(fixed)"
