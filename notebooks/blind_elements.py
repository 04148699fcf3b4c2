"""Compute boundary-element cases that no constant was fitted to; append them to blind_elements.csv.

    python notebooks/blind_elements.py [--seconds 500] [--kinds half-space slab]    # continue

The cases test `contact_model="boundary_elements"`. In the table, the unit of length is 1/q1, the rms slope is
1, the unit of stress is E(0)/(1 - nu^2) of the upper solid, and the unit of time is its longest relaxation
time. A case is a mean over `surfaces` random surfaces, computed on the column `grid`. Its errors are:

- `*_scatter`: standard deviation over the surfaces.
- `*_resolution`: change on a grid with half as many points per side.
- `*_period`: change on that coarse grid from a period to two periods, with half as many surfaces.

With two rough solids, `share` is the part of the mean square slope in the lower solid; both surfaces have the
same q0, q_r, q1 and H. Slabs have a `thickness` and a `base`.

u2_* is the power of the displacement in six ranges of ln q from q0 to q1 and beyond q1, divided by the power
of the heights (in the last column by their total). The second half, u2_*_across, contains the wavevectors
that lie closer to the transverse direction than to the direction of sliding.

The law is extended to two rough solids, or to slabs, if it passes a limit that was fixed before these cases
were computed: where A/A0 > 1 %, and without the variance of the standard errors, the root mean square of
ln(law / boundary elements) of the friction is at most 1.5 times that of the half-spaces, and below that of
the paper with both of its options.
"""

import argparse
import csv
import itertools
import time
import warnings
from pathlib import Path

import jax
import numpy as np
from scipy.special import erfinv

import rubberfric as rf
from rubberfric.analysis import boundary_element

TABLE = Path(__file__).resolve().parent / "blind_elements.csv"

BINS = 6
TOLERANCE = 1e-4
# Least and largest number of surfaces, by points per side; the grids of two rough solids come first.
SURFACES = {32: (8, 24), 48: (4, 8), 64: (4, 4), 256: (4, 24), 512: (4, 8), 1024: (2, 2), 2048: (1, 1)}
MATERIALS = {
    "elastic": rf.Elastic(1.0, 0.0),
    "single": rf.Prony(1.0, [29.0], [1.0], 0.0),
    "mild": rf.Prony(1.0, [0.5, 0.5, 1.0], [1.0, 0.1, 0.01], 0.0),
    "pair": rf.Prony(1.0, [4.0, 15.0], [1.0, 0.01], 0.0),
    "flat": rf.Prony(1.0, np.full(10, 2.0), 10 ** -np.linspace(0, 5, 10), 0.0),
    "steep": rf.Prony(
        1.0, 1e3 * (10**0.375 - 1) * 10 ** (0.375 * np.arange(-8.0, 0.0)), 0.1 ** np.arange(8.0), 0.0
    ),
    "cliff": rf.Prony(1.0, [9.0, 90.0, 900.0], [1.0, 0.1, 0.01], 0.0),
}
# q1/q0, qr/q0, periods, points per side.
SMALL = (
    *((8, 1, 4, 256), (8, 2, 4, 256), (8, 4, 4, 256), (16, 1, 2, 256), (16, 4, 2, 256), (16, 8, 2, 256)),
    *((4, 1, 8, 256), (5, 1, 6, 256), (10, 3, 3, 256), (12, 4, 2.5, 256), (6, 2, 5, 256)),
)
MIDDLE = (
    *((32, 2, 2, 512), (32, 4, 2, 512), (32, 8, 2, 512), (16, 1, 4, 512), (16, 2, 4, 512), (32, 12, 2, 512)),
    *((8, 1, 8, 512), (64, 8, 1, 512), (64, 16, 1, 512), (24, 8, 2.5, 512)),
)
LARGE = (
    *((256, 8, 1, 2048), (128, 8, 1, 1024), (64, 4, 2, 1024), (256, 2, 1, 2048), (128, 4, 1, 1024)),
    *((64, 2, 2, 1024), (128, 1, 1, 1024)),
)
TWO = ((4, 1, 1, 32), (6, 1, 1, 48), (6, 2, 1, 48), (4, 1, 1, 32), (8, 1, 1, 64))
COLUMNS = (
    *("kind", "ratio", "rolloff", "hurst", "periods", "grid", "material", "poisson"),
    *("lower", "share", "base", "thickness", "velocity", "pressure", "surfaces"),
    *(f"{name}{end}" for name in ("area", "friction") for end in ("", "_scatter", "_resolution", "_period")),
    *("friction_of_heat", "separation", "heat_beyond"),
    *(f"u2_{k}{end}" for end in ("", "_across") for k in range(BINS + 1)),
    "converged",
)


def material_of(name, poisson=0.0):
    """Return a material with E(0)/(1 - nu^2) = 1, or with the factor behind the name."""
    name, _, factor = name.partition("*")
    one, factor = MATERIALS[name], float(factor or 1) * (1 - poisson**2)
    if isinstance(one, rf.Elastic):
        return rf.Elastic(factor, poisson)
    return rf.Prony(factor * one.E_inf, factor * one.E, one.tau, poisson)


def scene_of(case):
    """Return the scene of a case; both surfaces together have the rms slope 1."""
    road = rf.SelfAffine(1 / case["ratio"], case["rolloff"] / case["ratio"], 1.0, case["hurst"], 1.0)
    road = road.replace(h_rms=1 / float(rf.rms_slope(road)))
    layer = rf.Slab(case["thickness"], case["base"]) if "base" in case else None
    upper = material_of(case["material"], case.get("poisson", 0.0))
    if "lower" not in case:
        return rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(upper, layer=layer))
    own, other = (road.replace(h_rms=road.h_rms * x**0.5) for x in (case["share"], 1 - case["share"]))
    lower = rf.Rigid() if case["lower"] == "rigid" else material_of(case["lower"])
    return rf.Scene(rf.Body(lower, own), rf.Body(upper, other))


def case_of(kind, geometry, hurst, material, velocity, stiff, area):
    """Return a case with about the relative contact area `area` under a stiffness `stiff`."""
    ratio, rolloff, periods, grid = geometry
    return {
        "kind": kind,
        "ratio": ratio,
        "rolloff": rolloff,
        "hurst": hurst,
        "periods": periods,
        "grid": grid,
        "material": material,
        "velocity": velocity,
        "pressure": stiff * float(erfinv(area)) * np.sqrt(0.3),
    }


def drawn(kind, count, geometries, seed):
    """Yield cases with numbers drawn at random; a third of them has A/A0 below 1 %."""
    random = np.random.default_rng(seed)
    for k in range(count):
        ratio, rolloff, periods, grid = geometries[k % len(geometries)]
        material = random.choice(["single", "mild", "pair", "flat", "steep", "cliff", "steep"])
        if k % 10 == 9:
            material = "elastic"
        area = np.exp(random.uniform(*np.log((0.003, 0.01) if k % 3 == 0 else (0.01, 0.6))))
        if area < 0.015:
            periods /= 2 if periods > 1 else 1  # small contacts need a finer grid
        fastest = 0.0 if material == "elastic" else float(np.min(MATERIALS[material].tau))
        v = np.exp(random.uniform(np.log(0.05), np.log(5 / fastest))) if fastest else 0.0
        stiff = abs(complex(rf.complex_modulus(MATERIALS[material], 0.3 * v)))
        hurst = float(random.choice([0.55, 0.7, 0.8, 0.9, 1.0]))
        yield case_of(kind, (ratio, rolloff, periods, grid), hurst, str(material), v, stiff, area)


def drawn_slabs(count, seed):
    """Yield cases of slabs on a rigid base."""
    random = np.random.default_rng(seed)
    for case in drawn("slab", 2 * count, SMALL, seed):
        thickness = np.exp(random.uniform(np.log(0.3), np.log(3))) * case["ratio"] / case["rolloff"]
        base, poisson = random.choice(["bonded", "frictionless"]), float(random.choice([0.3, 0.5]))
        case |= {"base": str(base), "thickness": thickness, "poisson": poisson}
        middle = (case["rolloff"] / case["ratio"]) ** 0.5
        stiffer = float(rf.Slab(thickness, case["base"]).stiffening(poisson, middle))
        if case["material"] != "elastic" and case["periods"] * case["ratio"] > 16:  # A/A0 > 1 %
            yield case | {"pressure": case["pressure"] * stiffer}


def drawn_twos(count, seed):
    """Yield cases of two rough solids: both relax, one relaxes on an elastic or on a rigid one."""
    random = np.random.default_rng(seed)
    for k in range(count):
        names = ["single", "mild", "pair", "flat", "cliff"]
        upper = str(random.choice(names))
        lower = ("elastic*3", "elastic*10", "rigid", *(f"{name}*2" for name in names))[(k // 2) % 8]
        if k % 4 == 0:
            lower = f"{upper}*1"
        v = float(np.exp(random.uniform(np.log(0.1), np.log(3 / float(np.min(MATERIALS[upper].tau))))))

        def modulus(name, omega):
            return abs(complex(rf.complex_modulus(material_of(name), omega)))

        stiff = modulus(upper, 0.3 * v)
        if lower != "rigid":
            pairs = ((stiff, modulus(lower, 0)), (modulus(upper, 0), modulus(lower, 0.3 * v)))
            stiff = np.mean([a * b / (a + b) for a, b in pairs])
        area = np.exp(random.uniform(np.log(0.01), np.log(0.5)))
        hurst, share = float(random.choice([0.6, 0.8, 1.0])), float(random.choice([0.25, 0.5, 0.75]))
        case = case_of("two rough", TWO[k % len(TWO)], hurst, upper, v, stiff, area)
        yield case | {"lower": lower, "share": share}


def large():
    """Yield cases of large grids."""
    loads = (("flat", 0.03, 10.0), ("elastic", 0.03, 0.0), ("steep", 0.1, 100.0))
    for geometry, (material, area, v) in itertools.product(LARGE, loads):
        stiff = abs(complex(rf.complex_modulus(MATERIALS[material], 0.3 * v)))
        yield case_of("large", geometry, 0.8, material, v, stiff, area)


CASES = {
    "half-space": (
        *drawn("half-space", 110, SMALL, 1),
        *drawn("half-space", 50, MIDDLE, 2),
        *drawn("half-space", 50, SMALL, 3),
    ),
    "two rough": tuple(drawn_twos(40, 4)),
    "slab": tuple(drawn_slabs(40, 5)),
    "large": tuple(large()),
}


def powers(found):
    """Return sums of |u|^2 and |h|^2 by direction and range of ln q, shape (2, 2, BINS + 1)."""
    n = found.heights.shape[-1]
    kx, ky = n * np.fft.fftfreq(n)[:, None], np.arange(n // 2 + 1)
    q = 2 * np.pi / found.length * np.hypot(kx, ky)
    axes = (-2, -1)
    lowest = found.wavevector[found.roughness > 1e-9 * found.roughness.sum()][0]
    place = np.floor(BINS * np.log(np.maximum(q, 1e-30) / lowest + 1e-9) / np.log(1 / lowest)).astype(int)
    place = np.clip(place, -1, BINS)
    count = np.where(np.arange(n // 2 + 1) % (n // 2) == 0, 1, 2)
    sums = np.zeros((2, 2, BINS + 1))
    for i, field in enumerate((found.gap + found.heights, found.heights)):
        power = count * np.abs(np.fft.rfft2(field, axes=axes, norm="forward")) ** 2
        power = power.reshape(-1, *power.shape[-2:]).mean(0)
        for j, side in enumerate((np.abs(kx) >= ky, np.abs(kx) < ky)):
            inside = side & (place >= 0)
            sums[i, j] = np.bincount(place[inside], power[inside], minlength=BINS + 1)
    return sums


def enough(values, grid):
    """Return True if the standard errors of area and friction are small, or if the time is spent."""
    n, (least, most) = len(values), SURFACES[grid]
    if n < least or n >= most:
        return n >= most
    area, friction = (np.array(values).T[k] for k in (0, 1))
    limits = 0.025 * area.mean(), 0.025 * abs(friction.mean()) + 1e-3
    return all(
        one.std(ddof=1) / np.sqrt(n) < limit for one, limit in zip((area, friction), limits, strict=True)
    )


def measured(scene, case, count=None, finer=1.0, wider=1):
    """Return values of every surface, and sums of their powers; None means as many as are `enough`."""
    grid, periods = int(case["grid"] * finer * wider), case["periods"] * wider
    names = ("area", "friction", "friction_of_heat", "separation", "heat_beyond", "converged")
    values, sums = [], 0.0
    while len(values) < count if count else not enough(values, grid):
        k = len(values)
        found = boundary_element(
            scene,
            case["velocity"],
            case["pressure"],
            jax.random.key(100 + k),
            grid=grid,
            periods=periods,
            tolerance=TOLERANCE,
        )
        values.append(
            [getattr(found, n) if n != "heat_beyond" else found.heat_beyond(1 + 1e-9) for n in names]
        )
        sums = sums + powers(found)
    return dict(zip(names, np.array(values, float).T, strict=True)), sums


def row_of(case):
    """Return one line of the table."""
    scene = scene_of(case)
    fine, sums = measured(scene, case)
    count = fine["area"].size
    coarse, _ = measured(scene, case, count, 0.5)
    # The wide period of the largest grids takes too long.
    wide = measured(scene, case, max(count // 2, 1), 0.5, 2)[0] if case["grid"] < 1024 else None
    row = (
        case
        | {"surfaces": count}
        | {name: fine[name].mean() for name in ("friction_of_heat", "separation", "heat_beyond")}
    )
    for name in ("area", "friction"):
        row[name] = fine[name].mean()
        row[f"{name}_scatter"] = fine[name].std(ddof=1) if count > 1 else np.nan
        row[f"{name}_resolution"] = coarse[name].mean() - fine[name].mean()
        row[f"{name}_period"] = wide[name].mean() - coarse[name].mean() if wide else np.nan
    moved, rough = sums
    rough[:, -1] = rough.sum()
    for j, end in enumerate(("", "_across")):
        row |= {f"u2_{k}{end}": x for k, x in enumerate(moved[j] / np.where(rough[j] > 0, rough[j], np.nan))}
    row["converged"] = str(bool(min(x["converged"].min() for x in (fine, coarse, wide) if x)))
    return {name: shown(row.get(name, "")) for name in COLUMNS}


def shown(x):
    """Return the text of an entry."""
    return x if isinstance(x, str) else f"{float(x):.4g}"


def key_of(row):
    """Return the inputs of a case as text."""
    return tuple(shown(row.get(name, "")) for name in COLUMNS[: COLUMNS.index("pressure") + 1])


def read():
    """Return the rows of the table."""
    if not TABLE.exists():
        return []
    with TABLE.open(newline="") as file:
        return list(csv.DictReader(file))


def compute(seconds, kinds):
    """Append missing rows for about `seconds`; return the number of rows that are still missing."""
    begin, done = time.monotonic(), {key_of(row) for row in read()}
    missing = [case for kind in kinds for case in CASES[kind] if key_of(case) not in done]
    for k, case in enumerate(missing):
        if time.monotonic() - begin > seconds:
            return len(missing) - k
        values, new = row_of(case), not TABLE.exists()
        with TABLE.open("a", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            if new:
                writer.writeheader()
            writer.writerow(values)
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--seconds", type=float, default=np.inf, help="stop after the case at which they are over"
    )
    parser.add_argument("--kinds", nargs="+", choices=CASES, default=list(CASES))
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore", rf.UnitWarning)  # the numbers have no units
    print(compute(options.seconds, options.kinds), "cases are missing")


if __name__ == "__main__":
    main()
