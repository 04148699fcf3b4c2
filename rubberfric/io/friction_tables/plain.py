"""Friction tables as plain CSV and JSON with error bars, and as the text of the established program.

CSV has a row for each point under two header rows, `v, p, T, mu, sigma` in SI, and is read by
`fitting.read` too; JSON has the axes and nested lists [temperature][pressure][velocity]; the text of the
program has columns log10 v, mu and A/A0 of one pressure and one temperature.
"""

import io
import json

import numpy as np

from rubberfric.base.checks import POSITIVE, check_values
from rubberfric.io.friction_tables.table import AXES, FrictionTable

FORMAT = "rubberfric friction table"
_UNITS = {"velocity": "m/s", "pressure": "Pa", "temperature": "K", "friction": "-", "sigma": "-", "area": "-"}


def columns(table: FrictionTable) -> dict[str, np.ndarray]:
    """Columns of a CSV file, a row for each point, the velocity changing first."""
    names = ("p", "v") if table.temperature is None else ("T", "p", "v")
    axes = [getattr(table, name) for name in reversed(AXES) if getattr(table, name) is not None]
    found = dict(zip(names, (x.ravel() for x in np.meshgrid(*axes, indexing="ij")), strict=True))
    found = {name: found[name] for name in ("v", "p", "T") if name in found} | {"mu": table.friction.ravel()}
    return found if table.sigma is None else found | {"sigma": table.sigma.ravel()}


def to_json(table: FrictionTable) -> str:
    """Text of a JSON file."""
    content: dict[str, object] = {"format": FORMAT, "title": table.title}
    content["interpolation"] = "linear in velocity, pressure and temperature, constant beyond the ends"
    content["relative_interpolation_error"] = table.error
    content["order"] = "[temperature][pressure][velocity]"
    for name, unit in _UNITS.items():
        values = getattr(table, name)
        if values is not None:
            content[name] = {"unit": unit, "values": np.asarray(values).tolist()}
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def from_json(text: str) -> FrictionTable:
    """The table of such a text; ValueError if it is none."""
    try:
        content = json.loads(text)
        if content["format"] != FORMAT:
            raise KeyError
        values = {name: np.array(content[name]["values"], float) for name in _UNITS if name in content}
        table = FrictionTable(
            temperature=values.pop("temperature", None),
            error=content.get("relative_interpolation_error"),
            title=content.get("title", ""),
            **values,
        )
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"must be JSON that says format = {FORMAT!r}, with its axes and friction") from None
    count = 1 if table.temperature is None else table.temperature.size
    shape = (count, table.pressure.size, table.velocity.size)
    for name in ("friction", "sigma", "area"):
        if name in values and values[name].shape != shape:
            raise ValueError(f"{name} has shape {values[name].shape}: must be {shape}, as its axes have")
    return table


def to_log10(table: FrictionTable) -> str:
    """Text of one curve, as the established program writes it."""
    if table.friction.shape[:2] != (1, 1):
        raise ValueError(
            f"table has {table.pressure.size} pressures and {table.friction.shape[0]} temperatures: must have"
            " one of each for log10, whose columns are a curve"
        )
    check_values("velocity", table.velocity, POSITIVE)
    curves = {"log10_v": np.log10(table.velocity), "mu_visc": table.friction.ravel()}
    if table.area is not None:
        curves["A_over_A0"] = table.area.ravel()
    text = io.StringIO()
    text.write(",".join(curves) + "\n" + ",".join(["log10(m/s)"] + ["-"] * (len(curves) - 1)) + "\n")
    for row in zip(*curves.values(), strict=True):
        text.write(",".join(f"{x:.10g}" for x in row) + "\n")
    return text.getvalue()
