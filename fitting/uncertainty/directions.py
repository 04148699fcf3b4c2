"""Directions in the space of the free parameters, described in words with advice."""

from typing import NamedTuple

import numpy as np

from fitting.parameters.variables import Variables, element_names

# Loadings below this part of the largest are not mentioned.
_MENTIONED = 0.1
# Loadings of one array that differ by less than this are described together.
ALIKE = 0.15

MODULI = ("E", "E_inf", "young", "storage", "loss")
HEIGHTS = ("h_rms", "C", "gamma", "q1", "qr", "q0", "hurst")
SHEAR = ("tau_f0", "c", "v0")
# Parameters that make the surface rougher as they rise.
ROUGHER = ("h_rms", "C", "q1")
# Parameters that make the surface smoother as they rise.
SMOOTHER = ("hurst",)

# (condition on the last steps of the key paths, whether all must have the same sign, advice).
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
        " spectrum or an area curve, or fix gamma or the cut-off",
    ),
    (
        lambda leaves: leaves <= {*HEIGHTS, *SHEAR} and leaves & set(HEIGHTS) and leaves & set(SHEAR),
        False,
        "contact shear and roughness compensate each other: fix the cut-off or give it by RmsSlope, or add an"
        " area curve, other temperatures or a lubricated run",
    ),
    (
        lambda leaves: leaves <= {"tau", "v0"},
        True,
        "only the product of velocity and relaxation time matters: fix one of them",
    ),
    (
        lambda leaves: "tau_f0" in leaves and leaves & set(MODULI),
        False,
        "contact shear depends only on tau_f0 times the contact area: add an area curve or a measured"
        " modulus",
    ),
)


class Part(NamedTuple):
    """Loading of one parameter in a direction, or common loading of all elements of an array."""

    name: str
    leaf: str  # the last step of its key path
    kind: str
    loading: float
    several: bool  # an array


def describe_direction(variables: Variables, loadings: np.ndarray, deviation: float) -> str:
    """Describe a direction in one line: the parameters that change, how far they may change, and advice."""
    parts = _parts(variables, loadings)
    leaves = {part.leaf for part in parts}
    # Advice on trade-offs needs several parameters.
    several = len(parts) > 1 or parts[0].several
    same = len({part.loading > 0 for part in parts}) == 1
    leading = max((part.loading for part in parts), key=abs)
    # λ is the factor of Positive parameters only.
    far = deviation * abs(leading)
    scaled = any(part.kind == "Positive" for part in parts)
    if deviation > 1e6:
        reach = "without any effect"
    elif scaled and far < 100:
        reach = f"the data agree with λ from 1/{np.exp(far):.2g} to {np.exp(far):.2g} (one standard error)"
    else:
        reach = "the data agree with any λ" if scaled else "the data agree with any value"
    said = ", ".join(_change(part, part.loading / leading) for part in parts)
    hint = next((text for test, alike, text in HINTS if several and test(leaves) and same >= alike), None)
    if hint is None and len(parts) == 1:
        hint = "the data do not determine it: fix it, or give it a prior"
    traded = _traded(parts)
    return f"{said}: {reach}" + (f"; {traded}" if traded else "") + (f"; {hint}" if hint else "")


def _traded(parts):
    """Describe how other parameters compensate for a change of roughness, or return ""."""
    rougher = {p.name: p.loading > 0 for p in parts if p.leaf in ROUGHER}
    rougher |= {p.name: p.loading < 0 for p in parts if p.leaf in SMOOTHER}
    others = {p.name: p.loading > 0 for p in parts if p.leaf in ("gamma", *SHEAR)}
    if not rougher or not others or len(set(rougher.values())) > 1:
        return ""
    # The text describes more roughness, whatever the sign of the direction.
    up = next(iter(rougher.values()))
    ways = ", ".join(f"{'more' if more == up else 'less'} {name}" for name, more in others.items())
    return f"more roughness ({', '.join(rougher)}) with {ways} gives the same curve"


def _parts(variables, loadings):
    """Return the largest loadings of a direction. An array with equal loadings is one `Part`."""
    names, largest, parts = element_names(variables), np.max(np.abs(loadings)), []
    for group in variables.own:
        leaf = group.path.split("[")[0].rsplit(".", 1)[-1]
        here = loadings[slice(*group.slot)]
        size = np.max(np.abs(here))
        if here.size > 1 and np.ptp(here) <= ALIKE * size and size >= _MENTIONED * largest:
            name = f"{group.path} (all {here.size} elements)"
            parts.append(Part(name, leaf, group.kind, float(here.mean()), True))
            continue
        parts += [
            Part(names[i], leaf, group.kind, float(loadings[i]), False)
            for i in range(*group.slot)
            if abs(loadings[i]) >= _MENTIONED * largest
        ]
    return parts


def _change(part, power):
    """Describe the change of a parameter, of Positive ones by a power of the leading one's factor λ."""
    if part.kind == "Positive":
        return f"{part.name} * λ" if abs(power - 1) < 0.05 else f"{part.name} * λ^{power:.2g}"
    return f"{part.name} {'up' if power > 0 else 'down'}"


class Direction(NamedTuple):
    """A combination of parameters that the data do not determine."""

    loadings: np.ndarray  # unit vector in x, shape (size,)
    deviation: float  # standard deviation of x along it; inf if the data do not change at all
    text: str
