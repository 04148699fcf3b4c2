"""Directions in a few words: what may change together without the data noticing."""

from typing import NamedTuple

import numpy as np

from fitting.parameters.variables import Variables, element_names

# Of a direction's largest part: what is smaller is not mentioned.
WORTH = 0.1
# Parts of one array that differ by less than this are mentioned as one.
ALIKE = 0.15

MODULI = ("E", "E_inf", "young", "storage", "loss")
HEIGHTS = ("h_rms", "C", "gamma", "q1", "qr", "q0", "hurst")
SHEAR = ("tau_f0", "c", "v0")
# Of these more is a rougher surface, or less is.
ROUGHER, SMOOTHER = ("h_rms", "C", "q1"), ("hurst",)

# What would help where a test of the last steps of the key paths holds; whether all must move alike.
HINTS = (
    (
        lambda leaves: leaves <= set(MODULI),
        True,
        "at light load friction depends on ratios of moduli only: add a measured modulus"
        " (one point is enough), an area curve, or a known modulus",
    ),
    (
        lambda leaves: leaves <= set(HEIGHTS) and len(leaves) > 1,
        False,
        "at light load friction depends on gamma sqrt(C0) and the cut-off together: add a measured"
        " spectrum or an area curve, or hold gamma or the cut-off",
    ),
    (
        lambda leaves: leaves <= {*HEIGHTS, *SHEAR} and leaves & set(HEIGHTS) and leaves & set(SHEAR),
        False,
        "contact shear stands in for the roughness: hold the cut-off or give it by RmsSlope, or add an area"
        " curve, other temperatures or a lubricated run",
    ),
    (
        lambda leaves: leaves <= {"tau", "v0"},
        True,
        "velocity only enters times a relaxation time: hold one of them",
    ),
    (
        lambda leaves: "tau_f0" in leaves and leaves & set(MODULI),
        False,
        "contact shear only sees tau_f0 times the contact area: add an area curve or a measured modulus",
    ),
)


class Part(NamedTuple):
    """What one parameter, or an array that moves as one, does in a direction."""

    name: str
    leaf: str  # the last step of its key path
    kind: str
    loading: float
    several: bool  # an array


def describe(variables: Variables, loadings: np.ndarray, deviation: float) -> str:
    """One line saying what a direction changes, by how much unnoticed, and what would help."""
    parts = _parts(variables, loadings)
    leaves = {part.leaf for part in parts}
    # One number alone trades with nothing, whatever it is.
    several = len(parts) > 1 or parts[0].several
    same = len({part.loading > 0 for part in parts}) == 1
    leading = max((part.loading for part in parts), key=abs)
    # λ is the factor of Positive parameters; others have none to name.
    far = deviation * abs(leading)
    scaled = any(part.kind == "Positive" for part in parts)
    if deviation > 1e6:
        reach = "without any effect"
    elif scaled and far < 100:
        reach = f"within one standard error up to λ = {np.exp(far):.2g}"
    else:
        reach = "by far within one standard error"
    said = ", ".join(_change(part, part.loading / leading) for part in parts)
    hint = next((text for test, alike, text in HINTS if several and test(leaves) and same >= alike), None)
    if hint is None and len(parts) == 1:
        hint = "the data do not reach it: hold it, or give it a prior"
    traded = _traded(parts)
    return f"{said}: {reach}" + (f"; {traded}" if traded else "") + (f"; {hint}" if hint else "")


def _traded(parts):
    """What roughness is exchanged for, in words; nothing if there is none of it, or nothing for it."""
    rougher = {p.name: p.loading > 0 for p in parts if p.leaf in ROUGHER}
    rougher |= {p.name: p.loading < 0 for p in parts if p.leaf in SMOOTHER}
    others = {p.name: p.loading > 0 for p in parts if p.leaf in ("gamma", *SHEAR)}
    if not rougher or not others or len(set(rougher.values())) > 1:
        return ""
    # Said for more roughness, whichever way the direction is.
    up = next(iter(rougher.values()))
    ways = ", ".join(f"{'more' if more == up else 'less'} {name}" for name, more in others.items())
    return f"more roughness ({', '.join(rougher)}) with {ways} gives the same curve"


def _parts(variables, loadings):
    """What matters in a direction; arrays that move as one have one entry."""
    names, largest, parts = element_names(variables), np.max(np.abs(loadings)), []
    for group in variables.own:
        leaf = group.path.split("[")[0].rsplit(".", 1)[-1]
        here = loadings[slice(*group.slot)]
        size = np.max(np.abs(here))
        if here.size > 1 and np.ptp(here) <= ALIKE * size and size >= WORTH * largest:
            name = f"{group.path} (all {here.size} elements)"
            parts.append(Part(name, leaf, group.kind, float(here.mean()), True))
            continue
        parts += [
            Part(names[i], leaf, group.kind, float(loadings[i]), False)
            for i in range(*group.slot)
            if abs(loadings[i]) >= WORTH * largest
        ]
    return parts


def _change(part, power):
    """How one parameter moves, as a power of the factor λ that the leading one moves by."""
    if part.kind == "Positive":
        return f"{part.name} * λ" if abs(power - 1) < 0.05 else f"{part.name} * λ^{power:.2g}"
    return f"{part.name} {'up' if power > 0 else 'down'}"
