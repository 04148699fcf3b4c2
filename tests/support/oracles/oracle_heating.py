"""Brute force for heated scenes: `oracle.state` with a temperature for every q, iterated to its fixed point.

The kernel is the one of the theory, summed over k on panels that double in width, the temperatures are
polynomials in ln q, and the iteration is damped. Further keys, which `oracle` does not have:

    heating   {"density", "heat_capacity", "conductivity", "radius"}, and as in rf.Heating
              "area_fraction", "shear_share", "shear_at"; a solid may have "thermal", its own first three
    shear     (default none) {"tau_f0", "c", "v0", "shift"}
    temperature   far from the contact, needed
"""

import math

import numpy as np
from numpy.polynomial import chebyshev
from support.oracles import oracle, oracle_solids
from support.oracles.numerical import composite

POINTS = 48  # of the polynomials


def solve(case, halvings=30, order=8, damping=0.5, tolerance=1e-13, start=None, points=POINTS):
    """Quantities of rf.Solution; "rises" to start another call at."""
    heating, v, T0 = case["heating"], case["v"], case["temperature"]
    own = [heating | case[name].get("thermal", {}) for name in ("solid1", "solid2")]
    heats = [x["density"] * x["heat_capacity"] for x in own]
    spectra = [case[psd] for psd in ("psd1", "psd2") if case[psd] is not None]
    ends = [(s["q"][0], s["q"][-1]) if "q" in s else (s["q0"], s["q1"]) for s in spectra]
    low, high = math.log(min(end[0] for end in ends)), math.log(max(end[1] for end in ends))
    nodes = -np.cos(np.pi * np.arange(points) / (points - 1))
    targets = np.exp(low + 0.5 * (high - low) * (nodes + 1))
    mark = math.pi / heating["radius"]
    marks = [mark] if math.exp(low) < mark < math.exp(high) else []

    def temperature(rise):
        c = chebyshev.chebfit(nodes, rise, points - 1)
        return lambda q: T0 + chebyshev.chebval(2 * (np.log(q) - low) / (high - low) - 1, c)

    deformable = [i for i, name in enumerate(("solid1", "solid2")) if case[name]["kind"] != "rigid"]
    share = heating.get("shear_share")
    if share is None:
        effusivity = [math.sqrt(x["conductivity"] * heat) for x, heat in zip(own, heats, strict=True)]
        shares = [x / sum(effusivity) for x in effusivity]
    else:
        shares = [1 - share if len(deformable) == 2 else share, share]
    rises = np.zeros((2, points)) if start is None else start
    for step in range(300):
        flash = T0 + np.mean([rises[i][-1] for i in deformable])
        warm = tuple(temperature(rises[i]) if i in deformable else None for i in (0, 1))
        found = oracle.state(case, halvings, order, warm, marks)
        fraction = heating.get("area_fraction")
        if fraction is None:
            fraction = found["within"](mark)
        mu_con = 0.0
        if case.get("shear"):
            T = flash if heating.get("shear_at", "flash") == "flash" else T0
            mu_con = shear_friction(case["shear"], found["area"], v, case["pressure"], T)
        new = np.zeros((2, points))
        for i in deformable:
            # terms: [by the roughness of solid 1, of solid 2]; the roughness of solid 2 heats solid 1.
            # f dq = 2 q (heat of dq per volume), and the heat of dq is terms sigma v / P_m.
            terms = found["terms"][1 - i].ravel()
            power = terms * case["pressure"] * v / fraction / heats[i]
            q = found["q"].ravel()
            new[i] = kernel(own[i], v, targets, q) @ (2 * q * power)
            surface = shares[i] * mu_con * case["pressure"] * v / fraction / heats[i]
            new[i] += surface_kernel(own[i], v, targets) * surface
        change = np.max(np.abs(new - rises))
        rises = damping * new + (1 - damping) * rises if step else new
        if change <= tolerance * np.max(np.abs(new)):
            break
    else:
        raise ValueError(f"not converged: {change}")
    return {name: found[name] for name in ("area", "separation")} | {
        "viscoelastic_friction": found["friction"],
        "shear_friction": mu_con,
        "friction": found["friction"] + mu_con,
        "flash_temperature": flash,
        "rises": rises,
        "fraction": fraction,
    }


def shear_friction(shear, area, v, pressure, T):
    """mu_con."""
    if v == 0:
        return 0.0
    a_T = oracle_solids.shift_factor(shear["shift"], T) if shear.get("shift") else 1.0
    b_T = oracle_solids.vertical_factor(shear.get("shift"), T)
    stress = b_T * shear["tau_f0"] * math.exp(-shear["c"] * math.log10(a_T * abs(v) / shear["v0"]) ** 2)
    return math.copysign(stress * area / pressure, v)


def memory_panels(heating, v, q):
    """Nodes in k, with their weights times (1 - e^(-D k^2 t0)) / (D k^2)."""
    D = heating["conductivity"] / (heating["density"] * heating["heat_capacity"])
    t0 = heating["radius"] / abs(v)
    diffused = 1 / math.sqrt(D * t0)
    lowest = 0.05 * min(np.min(q), diffused)
    count = math.ceil(math.log2(5e3 * max(np.max(q), diffused) / lowest))
    edges = np.concatenate([[0.0], lowest * 2.0 ** np.arange(count)])
    k, weight = composite(edges)
    rate = D * k**2
    return k, weight * -np.expm1(-rate * t0) / rate


def kernel(heating, v, q, q_source):
    """g(q, q'), shape (q, q')."""
    if v == 0:
        return np.zeros((q.size, q_source.size))
    k, weight = memory_panels(heating, v, np.concatenate([q, q_source]))
    source = 4 * q_source / (k[:, None] ** 2 + 4 * q_source**2)
    target = 4 * q[:, None] ** 2 / (k**2 + 4 * q[:, None] ** 2)
    return (target * weight) @ source / np.pi


def surface_kernel(heating, v, q):
    """Return the kernel of heat at the surface: 2 instead of 4 q'/(k^2 + 4 q'^2), its depth spectrum."""
    if v == 0:
        return np.zeros(q.size)
    k, weight = memory_panels(heating, v, q)
    # k^-4 is left at the upper end: exact to 1e-11 there.
    return (4 * q[:, None] ** 2 / (k**2 + 4 * q[:, None] ** 2) * weight) @ np.full(k.size, 2 / np.pi)
