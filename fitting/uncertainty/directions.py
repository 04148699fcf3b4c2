"""Directions in words: what may change together without the data noticing."""

from typing import NamedTuple

import numpy as np

from fitting.parameters.layout import element_names

# Of a direction's largest part: what is smaller is not worth a word.
WORTH = 0.1
# Parts of one array that differ by less than this are said in one word.
ALIKE = 0.15

MODULI = ("E", "E_inf", "young", "storage", "loss")
HEIGHTS = ("h_rms", "C", "gamma", "q1", "qr", "q0", "hurst")

HINTS = (
    (
        lambda leaves, same: leaves <= set(MODULI) and same,
        "at light load friction depends on ratios of moduli only: add a measured modulus"
        " (one point is enough), an area curve, or a known modulus",
    ),
    (
        lambda leaves, same: leaves <= set(HEIGHTS) and len(leaves) > 1,
        "at light load friction depends on gamma sqrt(C0) and the cut-off together: add a measured"
        " spectrum, or hold gamma or the cut-off",
    ),
    (
        lambda leaves, same: leaves <= {"tau", "v0"} and same,
        "velocity only enters times a relaxation time: hold one of them",
    ),
    (
        lambda leaves, same: "tau_f0" in leaves and leaves & set(MODULI),
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


def direction_in_words(layout, loadings, deviation):
    """One line saying what a direction changes, by how much unnoticed, and what would help."""
    parts = _parts(layout, loadings)
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
    hint = next((text for test, text in HINTS if several and test(leaves, same)), None)
    if hint is None and len(parts) == 1:
        hint = "the data do not reach it: hold it, or give it a prior"
    return f"{said}: {reach}" + (f"; {hint}" if hint else "")


def _parts(layout, loadings):
    """What matters in a direction; arrays that move as one have one entry."""
    names, largest, parts = element_names(layout), np.max(np.abs(loadings)), []
    for group in layout.own:
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
