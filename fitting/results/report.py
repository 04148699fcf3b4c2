"""Report of a fit as text, in the layout of lmfit's fit_report; values are rounded to their errors."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.constraints import RmsSlope
from fitting.parameters.correlated import Correlated
from fitting.parameters.discrepancy import text_of
from fitting.parameters.plausible import implausible
from fitting.parameters.priors import Smooth, Sum
from fitting.parameters.scenes import each_scene, leaf_names, paths_of, unit
from fitting.parameters.selection import PriorContext
from fitting.results.record import FitRecord
from fitting.solvers.options import SOLVERS
from fitting.solvers.problem import ASSUMED, CONTACT_QUANTITIES
from fitting.uncertainty.intervals import LEVEL
from rubberfric.analysis import contact_model_name, theory_error

# Largest number of elements listed for a key path. Longer arrays show the first and the last.
LISTED = 24
# Correlation above which a pair is reported. A weaker one widens error bars by less than 16 %.
_CORRELATED = 0.5
# Most pairs that are reported, the most correlated ones first.
_PAIRS = 20
# Largest number of names without an error bar in the headlines.
_BARE = 4


def variable_rows(result: FitRecord) -> list[tuple[str, ...] | str]:
    """Return texts for every free element: name, value, error, unit, relative error, start, remark.

    One line of text replaces the middle of a long array.
    """
    values, starts, errors = result.values, result.start_values, result.stderr
    names, rows = result.names, []
    for group in result.variables.own:
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
    """Return the error times sqrt(reduced chi-square) in brackets if the verdict rejects the scene."""
    if result.verdict.explains is not False or result.error_scale != 1 or not result.redchi > 1:
        return ""
    return f"[{error * np.sqrt(result.redchi):#.2g}]"


def _left_out(result, elements):
    bare = sum(result.names[i] in result.withheld for i in elements)
    remark = f", {bare} of them without an error bar" if bare else ""
    return f"... {len(elements)} more, see result.values{remark}"


def _digits(value, error):
    """Format a value so that the last digit is the second significant digit of the error."""
    if not (error > 0 and value and np.isfinite(value)):
        return f"{value:.6g}"
    digits = int(np.floor(np.log10(abs(value))) - np.floor(np.log10(error))) + 2
    return f"{value:#.{min(max(digits, 2), 12)}g}"


def tied_lines(result: FitRecord) -> list[str]:
    """Return a line with the value and the rule for every key path that is tied to another key path."""
    leaves, lines = jax.tree.leaves(result.scene), []
    groups = [group for group in result.variables.groups if group.kind in ("Tied", "RmsSlope")]
    rules: dict[str, Any] = {}
    for path, rule in result.free.items():
        rules |= dict.fromkeys(paths_of(result.scene_at_start, path), rule)
    for group, ratio in zip(groups, result.problem.numbers.constants.ratios, strict=True):
        rule = rules[group.path]
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
    """Return the error of a value as text, or why it has none. `name` is the last step of a key path."""
    errors = dict(zip((full.rsplit(".", 1)[1] for full in result.names), result.stderr, strict=True))
    withheld = {full.rsplit(".", 1)[1]: why for full, why in result.withheld.items()}
    if name in withheld:
        return f"error bar withheld: {withheld[name]}"
    return f"+/- {errors[name]:.2g} ({errors[name] / value:.1%})" if name in errors else "(fixed)"


def report(result: FitRecord) -> str:
    """Return the report of a `fitting.FitResult` as text of several lines.

    Empty sections are left out. [[Not identified]] numbers the directions that the data do not determine, to
    which the reasons for missing error bars refer. The first line states if the fit did not converge, or if
    the scene does not explain the data. If an array has more free elements than `LISTED`, only the first and
    the last elements are listed.
    """
    lines = [line for line in headlines(result) for line in (line, "")]
    sections = {
        "Verdict": _verdict(result),
        "Fit": _fit(result),
        "Data": _data(result),
        "Statistics": _statistics(result),
        "Variables": _variables(result),
        "Tied": tied_lines(result),
        "Priors": _priors(result),
        "Bounds": _bounds(result),
        "Not identified": [f"{i}: {d.text}" for i, d in enumerate(result.unidentified, 1)],
        "Minima": _minima(result),
        "Correlations": _correlations(result),
    }
    for title, content in sections.items():
        if content:
            lines += [f"[[{title}]]", *(f"    {line}" for line in content)]
    return "\n".join(lines) + "\n"


def headlines(result: FitRecord) -> list[str]:
    """Return a list with a headline if the fit did not succeed or the verdict rejects the scene."""
    if not result.success:
        return [f"THE FIT DID NOT SUCCEED: {result.message}"]
    verdict = result.verdict
    return [f"{verdict.text}: {verdict.reasons[0]}"] if verdict.explains is False else []


def _verdict(result):
    verdict = result.verdict
    reached = "reached; " if result.success else "NOT REACHED; "
    lines = {"minimum": reached + result.message, "scene": verdict.text}
    further = [] if result.further is None else _further(result.further)
    open_, bare = len(result.unidentified), len(result.withheld)
    lines["left open"] = "nothing"
    if open_ or bare:
        names = ", ".join(list(result.withheld)[:_BARE]) + ", ..." * (bare > _BARE)
        lines["left open"] = f"{_count(open_, 'direction')}; without an error bar: {names or 'none'}"
    if result.discrepancy is not None:
        lines["theory"] = text_of(result.discrepancy)
    if result.largest_error:
        lines["budget"] = result.largest_error
    rows = _aligned(lines)
    if result.discrepancy is not None and result.discrepancy.remark:
        rows += [f"  {remark}" for remark in result.discrepancy.remark.split("; ")]
    reasons = [f"  {reason}" for reason in verdict.reasons]
    if verdict.explains is False and result.error_scale == 1 and np.isfinite(result.redchi):
        reasons.append(
            "  the error bars below are valid if the scene explains the data; error bars in brackets are"
            " scaled by the scatter (scale_errors)"
        )
    once = result.further is None and sum(minimum.count for minimum in result.minima) == 1
    if verdict.explains is False and result.success and once:
        reasons.append("  reached from one start; starts=8 looks for a lower minimum")
    several = len(result.verdicts) > 1
    scenes = [f"  {name}: {own.text}" for name, own in result.verdicts.items() if several]
    bent = [f"  {valley.text}" for valley in result.valleys if not valley.holds] if result.success else []
    return [rows[0], *further, rows[1], *reasons, *_implausible(result), *scenes, rows[2], *bent, *rows[3:]]


def _further(further):
    """Return lines on further starts: their result, and the reason for them."""
    agreed = f", which {_count(further.agreed, 'start')} reached"
    text = f"  {_count(further.count, 'further start')} found no lower minimum{agreed * (further.agreed > 0)}"
    if further.after < further.before:
        text = (
            f"  {_count(further.count, 'further start')} lowered the cost from {further.before:.4g} to"
            f" {further.after:.4g}{agreed}"
        )
    text += "; time ended (further_time)" * further.timed_out
    first, more = further.reasons[0], len(further.reasons) - 1
    why = f"  tried because at first {first}" + f" (and {_count(more, 'further reason')})" * (more > 0)
    return [text, why]


def _implausible(result):
    """Return a line for each fitted value outside its plausible range."""
    values = dict(zip(result.names, result.values, strict=True))
    lines = []
    for name, (low, high) in implausible(result.names, result.values).items():
        scale = unit(result.scene_at_start, name.split("[")[0])
        lines.append(
            f"  IMPLAUSIBLE: {name} = {values[name]:.3g} {scale}".rstrip() + f", outside {low:g} ... {high:g}"
        )
    return lines


def _bounds(result):
    """Return lines on parameters without error bars that were followed, and the intervals of the others."""
    threshold = result.quantile(LEVEL) ** 2 if result.bounds else 0.0
    lines, joint = [], {}
    for bound in result.bounds:
        text = f"{bound.name} = {bound.value:.4g}, {bound.where}: "
        if np.isfinite(bound.interval[0]):
            low, high = bound.interval
            text += f"chi-square rises by less than {threshold:.3g} from {low:.4g} to {high:.4g}"
            if not bound.complete:
                text += ", as far as time allowed"
            elif high == bound.held[-1] and bound.where.startswith("driven"):
                text += ", the largest value tried"
        else:
            text += "not followed, so correlated error bars are withheld"
        lines.append(text)
        for name, (low, high) in bound.intervals.items():
            before = joint.get(name, (low, high))
            joint[name] = min(low, before[0]), max(high, before[1])
    known = {name: ends for name, ends in joint.items() if np.isfinite(ends[0])}
    if known:
        lines.append(f"{100 * LEVEL:.0f} % intervals by profile likelihood, with these parameters free:")
        lines += [f"  {name}: {low:.4g} ... {high:.4g}" for name, (low, high) in known.items()]
    return lines


def _fit(result):
    values = result.problem.targets.measured.size
    return _aligned(
        {
            "method": f"{result.method} ({SOLVERS[result.method].title})",
            "message": result.message,
            "data": f"{_count(len(result.data), 'set')}, {_count(values, 'value')}",
            **_contact_model(result),
            "evaluations": f"{result.nfev} of the residuals, {result.njev} of their derivatives",
            "time": f"{result.seconds:.3g} s",
        }
    )


def _contact_model(result):
    pairs = zip(result.data, each_scene(result.scene, result.data_scenes), strict=True)
    texts = [_contact_text(scene) for dataset, scene in pairs if dataset.quantity in CONTACT_QUANTITIES]
    return {"contact": "; ".join(dict.fromkeys(texts))} if texts else {}


def _contact_text(scene):
    ranges = theory_error(scene)
    if ranges is None:
        return f"{contact_model_name(scene)}, of unknown error in such scenes"
    low, high = (100 * ratio - 100 for ratio in ranges.friction)
    return f"{contact_model_name(scene)}, mu within {low:+.0f} ... {high:+.0f} % of boundary elements"


def _data(result):
    lines = []
    sets = zip(result.data, result.residuals, result.estimated, strict=True)
    for i, (dataset, rows, scale) in enumerate(sets, 1):
        lines.append(
            f"{i}: {dataset.label}: {_count(len(dataset), 'value')}, {_errors(dataset, scale, result)}"
        )
        lines += [f"   {text}" for text in dataset.history]
        lines.append(f"   chi-square per value = {np.mean(rows**2):.4g}")
    return lines


def _errors(data, scale, result):
    if scale is not None:
        if result.assumed:
            why = "too few values to estimate" if result.freedom < 0.5 else "not estimated, as was asked for"
            why = why if result.success else "not estimated without success"
            return f"no errors given: {100 * scale:g} % assumed, {why}"
        return f"no errors given: {100 * scale:.3g} % estimated from the scatter"
    scaled = f", times {result.error_scale:.4g} by the scatter" * (result.error_scale != 1)
    if data.relative is None:
        return f"errors given{scaled}"
    low, high = (f"{100 * end:.3g}" for end in (data.relative.min(), data.relative.max()))
    return f"errors given (relative {low if low == high else f'{low} ... {high}'} %){scaled}"


def _statistics(result):
    structure, known = result.problem.structure, result.uncertainty
    redchi = f"{result.redchi:.5g}" if np.isfinite(result.redchi) else "none: no degrees of freedom"
    size = len(result.names)
    rows = {
        "chi-square": f"{result.chisqr:.6g}",
        "reduced chi-square": redchi,
        "degrees of freedom": f"{result.freedom:.5g}",
        "cost": f"{result.cost:.6g}",
        "identified": f"{size - len(result.unidentified)} of {_count(size, 'direction')}",
        "condition": f"{known.condition:.3g}",
    }
    if structure.loss != "linear":
        width = float(result.problem.numbers.width)
        rows["loss"] = f"{structure.loss}, width {width:g} standard error{'s' * (width != 1)}"
    return _aligned(rows)


def _variables(result):
    rows = []
    for row in variable_rows(result):
        if isinstance(row, tuple):
            name, value, error, scale, share, start, remark = row
            share = f"({share})" if share else ""
            row = (f"{name}:", value, f"+/- {error}", scale, share, f"(start = {start})", remark)
        rows.append(row)
    cells = [row for row in rows if isinstance(row, tuple)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    layout = "  ".join(f"{{:{'>' if k in (1, 4) else '<'}{width}}}" for k, width in enumerate(widths))
    return [
        layout.format(*row).rstrip().replace("  +/-", " +/-", 1) if isinstance(row, tuple) else row
        for row in rows
    ]


def _priors(result):
    fitted = dict(zip(result.names, result.values, strict=True))
    groups = {group.path: group for group in result.variables.groups}
    lines = []
    for path, prior in result.prior.items():
        if isinstance(prior, Smooth):
            lines.append(f"{path}: smooth, slopes change by about {prior.sigma:g} from term to term")
            continue
        if isinstance(prior, Sum | Correlated):
            lines.append(_of_several(result, path, prior))
            continue
        if path not in groups:
            lines.append(f"{path}: fixed, its error enters the budget (FitResult.budget)")
            continue
        names = leaf_names(path, groups[path].elements)
        scale = unit(result.scene_at_start, path)
        away = max((abs(fitted[name] - prior.mean) / prior.sigma for name in names), default=0.0)
        what = "fitted value" if len(names) == 1 else "farthest fitted value"
        said = f"{prior.mean:g} +/- {prior.sigma:g}{f' {scale}' * bool(scale)}"
        lines.append(f"{path}: {said}, {what} {away:.2g} of these errors away")
    return lines


def _of_several(result, key, prior):
    """Describe a `Sum` or `Correlated` prior, and compare the fitted values with the prior."""
    place = PriorContext("", key, result.scene, result.variables, result.problem.numbers.constants)
    [rows] = prior.read(place)
    leaves = jax.tree.leaves(result.scene)
    if isinstance(prior, Sum):
        value = np.sum(np.asarray(rows.chosen.of(leaves)))
        scale = unit(result.scene_at_start, rows.chosen.paths[0])
        limits = [("above", prior.low), ("below", prior.high)]
        said = " and ".join(f"{word} {limit:g}" for word, limit in limits if limit is not None)
        return f"{key}: {said}{f' {scale}' * bool(scale)} within {prior.sigma:.2g}, fitted {value:.4g}"
    squares = float(np.sum(np.asarray(rows.rows(leaves, jnp.asarray(result.x))) ** 2))
    away = np.sqrt(squares / rows.size)
    return f"{key}: known from another fit, fitted values {away:.2g} errors away (rms)"


def _minima(result):
    count = sum(minimum.count for minimum in result.minima)
    if count < 2:
        return []
    lines = [f"cost {m.cost:<12.6g} reached by {_count(m.count, 'start')}" for m in result.minima]
    if any(scale is not None for scale in result.estimated):
        lines.append(f"(with the errors assumed to be {100 * ASSUMED:g} %, before they were estimated)")
    return lines


def _correlations(result):
    names, correlation = result.names, result.correlation
    large = np.triu(np.abs(correlation), 1)  # NaN where an error bar is withheld
    pairs = sorted(np.argwhere(large > _CORRELATED).tolist(), key=lambda pair: -large[*pair])
    if not pairs:
        return []
    shown = [(f"C({names[i]}, {names[j]})", correlation[i, j]) for i, j in pairs[:_PAIRS]]
    width = max(len(name) for name, _ in shown)
    # Rounded up, to stay above the largest that is left out.
    below = _CORRELATED if len(pairs) <= _PAIRS else np.ceil(1000 * large[*pairs[_PAIRS]]) / 1000
    return [
        *(f"{name:<{width}} = {value:+.4f}" for name, value in shown),
        f"(unreported correlations are < {below:.3f})",
    ]


def aligned_table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return lines of text with the cells of rows in columns, the first to the left, others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    layout = "  ".join(f"{{:{'>' if k else '<'}{width}}}" for k, width in enumerate(widths))
    return [layout.format(*row).rstrip() for row in rows]


def _aligned(rows):
    width = max(map(len, rows))
    return [f"{name:<{width}} = {text}" for name, text in rows.items()]


def _count(count, what):
    return f"{count} {what}{'s' * (count != 1)}"
