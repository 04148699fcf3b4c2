"""Quantities that other columns of a table determine: moduli, friction, pressure and sliding velocity.

::

    E' = |E*| cos(delta)     E'' = |E*| sin(delta)     E = 2 (1 + nu) G
    E* = 1 / D*              G* = 1 / J*               |E*| = stress / strain
    mu = |F_t| / |F_n|       p = |F_n| / A             v = |v_travel sin(slip angle)|
    v = |v_travel slip ratio|, and v = |v_travel| sqrt(sin^2 a + (s cos a)^2) at a slip angle a and a ratio s,
    which is the longitudinal slip velocity divided by v_travel cos a [ISO 8855]

`RELATIONS` lists all relations. A relation is used only if the table lacks its result.
"""

from collections.abc import Callable, Collection, Iterable
from typing import NamedTuple

import numpy as np

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import as_leaf, between, check_values, warn_caller
from rubberfric.base.units import young_from_shear

Values = dict[str, np.ndarray]
# Largest plausible nominal contact area [m^2].
_LARGEST_AREA = 1.0
# Parts of titles of a velocity between the surfaces. With a slip, a plain "speed" is the travel speed.
_SLIDING = ("slid", "slip", "gleit", "gliss")
# Parts of titles of forces along the direction of travel.
_LONGITUDINAL = ("fx", "f_x", "f x", "brak", "brems", "frein", "longitudinal", "umfang", "längs")
# Parts of titles of forces across the direction of travel.
_LATERAL = ("fy", "f_y", "f y", "side", "seiten", "lateral", "latéral", "quer", "cornering")


class Relation(NamedTuple):
    """Quantity that columns, and constants that the caller gives, determine."""

    result: str
    columns: tuple[str, ...]
    compute: Callable[..., np.ndarray]
    formula: str  # of the result, for the history of data
    constant: str = ""  # last argument of `compute`


def _inverse(part: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the modulus part / (part^2 + other^2) that belongs to a part of a complex compliance."""
    return 1 / (part + other * (other / part))


def _ratio(part: np.ndarray, other: np.ndarray) -> np.ndarray:
    return part / other


RELATIONS = (
    Relation("tan_del", ("delta",), np.tan, "tan(delta)"),
    *(
        relation
        for m in "EGDJ"
        for relation in (
            Relation(
                f"{m}_stor",
                (f"{m}_comp", "tan_del"),
                lambda comp, tan: comp / np.hypot(1, tan),
                f"{m}_comp / sqrt(1 + tan_del^2)",
            ),
            Relation(
                f"{m}_loss",
                (f"{m}_stor", "tan_del"),
                lambda stor, tan: stor * tan,
                f"{m}_stor tan_del",
            ),
            Relation(
                f"{m}_stor",
                (f"{m}_loss", "tan_del"),
                lambda loss, tan: loss / tan,
                f"{m}_loss / tan_del",
            ),
        )
    ),
    *(
        relation
        for m, D, stress in (("E", "D", "E_stress"), ("G", "J", "G_stress"))
        for relation in (
            Relation(f"{m}_stor", (f"{D}_stor", f"{D}_loss"), _inverse, f"{D}_stor / |{D}*|^2"),
            Relation(f"{m}_loss", (f"{D}_loss", f"{D}_stor"), _inverse, f"{D}_loss / |{D}*|^2"),
            Relation(f"{m}_comp", (f"{D}_comp",), lambda compliance: 1 / compliance, f"1 / {D}_comp"),
            Relation(f"{m}_comp", (stress, "strain"), _ratio, f"{stress} / strain"),
            Relation(f"{m}_relax", (stress, "strain"), _ratio, f"{stress} / strain"),
            Relation(f"{D}_creep", ("strain", stress), _ratio, f"strain / {stress}"),
        )
    ),
    *(
        Relation(f"E_{part}", (f"G_{part}",), young_from_shear, f"2 (1 + poisson) G_{part}", "poisson")
        for part in ("stor", "loss", "relax")
    ),
    Relation(
        "D_creep",
        ("J_creep",),
        lambda creep, nu: 1 / young_from_shear(1 / creep, nu),
        "J_creep / (2 (1 + poisson))",
        "poisson",
    ),
    Relation("mu", ("F_t", "F_n"), lambda F_t, F_n: np.abs(F_t / F_n), "|F_t| / |F_n|"),
    Relation("p", ("F_n", "A"), lambda F_n, A: np.abs(F_n) / A, "|F_n| / A"),
    Relation("p", ("F_n",), lambda F_n, area: np.abs(F_n) / area, "|F_n| / area", "area"),
    Relation(
        "v",
        ("v_travel", "slip_angle", "slip_ratio"),
        lambda speed, angle, ratio: np.abs(speed) * np.hypot(np.sin(angle), ratio * np.cos(angle)),
        "|v_travel| sqrt(sin(slip_angle)^2 + (slip_ratio cos(slip_angle))^2)",
    ),
    Relation(
        "v",
        ("v_travel", "slip_angle"),
        lambda speed, angle: np.abs(speed * np.sin(angle)),
        "|v_travel sin(slip_angle)|",
    ),
    Relation(
        "v",
        ("v_travel", "slip_ratio"),
        lambda speed, ratio: np.abs(speed * ratio),
        "|v_travel slip_ratio|",
    ),
)


class Plan(NamedTuple):
    """Columns to read, and relations to evaluate in order."""

    columns: tuple[str, ...]
    relations: tuple[Relation, ...]


def plan_for(wanted: Iterable[str], available: Collection[str], area: bool = False) -> Plan:
    """Return the columns and relations that give as many of the wanted quantities as possible.

    Parameters
    ----------
    wanted : quantities
    available : quantities of the columns of a table
    area : True if the contact area is known. Otherwise a load gives no pressure.
    """
    columns: dict[str, None] = {}
    relations: dict[Relation, None] = {}
    usable = [relation for relation in RELATIONS if relation.constant != "area" or area]
    for quantity in wanted:
        steps = _steps(quantity, available, usable, ())
        if steps is not None:
            columns |= dict.fromkeys(steps.columns)
            relations |= dict.fromkeys(steps.relations)
    return Plan(tuple(columns), tuple(relations))


def _steps(quantity, available, usable, above) -> Plan | None:
    """Return the plan with the fewest relations for one quantity, or None.

    `above` are quantities that the plan must not use.
    """
    if quantity in available:
        return Plan((quantity,), ())
    possible = []
    for relation in usable:
        if relation.result != quantity or quantity in above:
            continue
        parts = [_steps(column, available, usable, (*above, quantity)) for column in relation.columns]
        plans = [part for part in parts if part is not None]
        if len(plans) == len(parts):
            columns = dict.fromkeys(column for plan in plans for column in plan.columns)
            before = dict.fromkeys(step for plan in plans for step in plan.relations)
            possible.append(Plan(tuple(columns), (*before, relation)))
    return min(possible, key=lambda plan: len(plan.relations), default=None)


def with_wheel_names(names: list[str | None], titles: list[str]) -> list[str | None]:
    """Return the names of columns of a wheel tester, which has a slip angle or a slip ratio.

    A speed is the travel speed, unless its title is one of a sliding velocity. If the table has several
    tangential forces, the lateral ones belong to a slip angle, and the longitudinal ones to a slip ratio.
    """
    slips = {"slip_angle", "slip_ratio"} & set(names)
    if not slips:
        return names
    own = list(names)
    lower = [title.lower() for title in titles]
    if "v_travel" not in names:
        own = [
            "v_travel" if name == "v" and not _has_part(title, _SLIDING) else name
            for name, title in zip(own, lower, strict=True)
        ]
    if own.count("F_t") > 1 and len(slips) == 1:
        other = _LONGITUDINAL if "slip_angle" in slips else _LATERAL
        own = [
            None if name == "F_t" and _has_part(title, other) else name
            for name, title in zip(own, lower, strict=True)
        ]
    return own


def _has_part(title: str, parts: Iterable[str]) -> bool:
    return any(part in title for part in parts)


def with_derived(
    path: StrPath,
    where: str,
    table: Values,
    plan: Plan,
    poisson: float | None,
    area: float | None,
    history: list[str] | None = None,
) -> Values:
    """Return a table with the results of all relations of a plan, and append their formulas to `history`.

    Raises
    ------
    ValueError : a constant is missing or invalid, or the normal force changes its sign
    """
    constants = {}
    shear = [name for name in table if name.startswith(("G_", "J_"))]
    if any(relation.constant == "poisson" for relation in plan.relations):
        if poisson is None:
            raise ValueError(
                f"{where}: {', '.join(shear)} are of shear: poisson must be given (0.5 for rubber), because"
                " E = 2 (1 + poisson) G"
            )
        check_values(f"{where}: poisson", as_leaf(f"{where}: poisson", poisson, 0), between(0.0, 0.5))
        constants["poisson"] = poisson
    if area is not None:
        constants["area"] = checked_area(where, area)
    if "F_n" in table and np.ptp(np.sign(table["F_n"])) > 0:
        raise ValueError(f"{where}: the normal force F_n changes its sign; must be > 0, or < 0, in all rows")
    table = dict(table)
    for relation in plan.relations:
        values = [table[name] for name in relation.columns]
        values += [constants[relation.constant]] if relation.constant else []
        table[relation.result] = relation.compute(*values)
        if history is not None:
            constant = (
                f", {relation.constant} = {constants[relation.constant]:g}" if relation.constant else ""
            )
            history.append(f"{relation.result} = {relation.formula}{constant}")
    if any(relation.result == "mu" for relation in plan.relations) and "v" in table:
        reverses = np.ptp(np.sign(table["F_t"])) > 0 or np.any(table["v"] < 0)
        table["v"] = np.abs(table["v"])
        if reverses:
            text = "forces or velocities have both signs; mu = |F_t| / |F_n| and |v| are used"
            warn_caller(f"{path}: {text}", UserWarning)
            if history is not None:
                history.append(text)
    return table


def checked_area(where: str, area: float) -> float:
    """Return a contact area [m^2] as float, or raise ValueError if it is invalid."""
    name = f"{where}: area"
    rule = (
        f"must be > 0 and <= {_LARGEST_AREA:g} m^2; is it in mm^2? 400 mm^2 is 4e-4",
        lambda x: (x > 0) & (x <= _LARGEST_AREA),
    )
    value = as_leaf(name, area, 0)
    check_values(name, value, rule)
    return float(value)
