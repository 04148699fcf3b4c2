"""Compute the boundary-element cases of the law `contact_model="boundary_elements"`; append them to a table.

    python notebooks/law_elements.py [--seconds 500] [--kinds half-space slab] [--part test]    # continue

The table is law_elements.csv. In it, the unit of length is 1/q1, the rms slope is 1, the unit of stress is
E(0)/(1 - nu^2) of the upper solid, and the unit of time is its longest relaxation time. The constants of the
law are fitted to the cases with `part` "fit". The cases with `part` "test" and "fresh" are drawn in the same
way. The "fresh" cases were computed after the present form of the law had been chosen.

The upper solid has a Prony series with `terms` relaxation times from 1 to 10^-decades, at equal ratios.
Their moduli are proportional to tau^-slope, and E(infinity) = rise E(0). With no terms it is elastic. With
two rough solids, `share` is the part of the mean square slope in the lower solid. The modulus of the lower
solid is `lower` times that of the upper solid, at all frequencies if it relaxes (`lower_relaxes`), otherwise
at rest; infinite is rigid. Slabs have a `thickness` and a `base`. Anisotropic roughness is stretched by
`stretch` along `angle`.

A case is a mean over `surfaces` random surfaces, computed on the column `grid`. Its errors are:

- `*_scatter`: standard deviation over the surfaces.
- `*_resolution`: change on a grid with half as many points per side.
- `*_period`: change on that coarse grid from a period to two periods, with half as many surfaces.

u2_* is the power of the displacement in six ranges of ln q from q0 to q1 and beyond q1, divided by the power
of the heights (in the last column by their total). The second half, u2_*_across, contains the wavevectors
that lie closer to the transverse direction than to the direction of sliding.

The kind "other material" has relaxation times closer than a decade. It tests `rf.analysis.theory_error` only.
"""

import argparse
import csv
import time
import warnings
from pathlib import Path

import jax
import numpy as np
from scipy.special import erfinv

import rubberfric as rf
from rubberfric.analysis import boundary_element

TABLE = Path(__file__).resolve().parent / "law_elements.csv"

# Bins of ln q between q0 and q1 of the displacements. One more bin is above q1.
BINS = 6
# Tolerance of the boundary elements, as in boundary_elements.py.
TOLERANCE = 1e-4
SURFACES = 4, 8  # least and largest number
INPUTS = (
    *("part", "kind", "ratio", "rolloff", "hurst", "periods", "grid", "terms", "decades", "rise", "slope"),
    *("poisson", "lower", "lower_relaxes", "share", "base", "thickness", "stretch", "angle"),
    *("velocity", "pressure"),
)
COLUMNS = (
    *INPUTS,
    "surfaces",
    *(f"{name}{end}" for name in ("area", "friction") for end in ("", "_scatter", "_resolution", "_period")),
    *("friction_of_heat", "separation", "heat_beyond"),
    *(f"u2_{k}{end}" for end in ("", "_across") for k in range(BINS + 1)),
    "converged",
)
TEXTS = "part", "kind", "base", "converged"


def material_of(case, factor=1.0):
    """Return the upper solid of a case, with E(0)/(1 - nu^2) = `factor`."""
    poisson = case.get("poisson", 0.0)
    factor = factor * (1 - poisson**2)
    terms = int(case["terms"])
    if not terms:
        return rf.Elastic(factor, poisson)
    tau = 10 ** -np.linspace(0, case["decades"], terms)
    share = tau ** -case["slope"]
    return rf.Prony(factor, factor * (case["rise"] - 1) * share / share.sum(), tau, poisson)


def scene_of(case):
    """Return the scene of a case; both surfaces together have the rms slope 1."""
    q0, qr = 1 / case["ratio"], case["rolloff"] / case["ratio"]
    road = rf.SelfAffine(q0, qr, 1.0, case["hurst"], 1.0)
    road = road.replace(h_rms=1 / float(rf.rms_slope(road)))
    upper = material_of(case)
    if "lower" in case:
        own, other = (road.replace(h_rms=road.h_rms * x**0.5) for x in (case["share"], 1 - case["share"]))
        lower = rf.Rigid()
        if np.isfinite(case["lower"]):
            lower = material_of(case if case["lower_relaxes"] else case | {"terms": 0}, case["lower"])
        return rf.Scene(rf.Body(lower, own), rf.Body(upper, other))
    if "stretch" in case:
        road = rf.Anisotropic(road, case["stretch"], case["angle"])
    layer = rf.Slab(case["thickness"], case["base"]) if "base" in case else None
    return rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(upper, layer=layer))


def drawn_material(random):
    """Return the entries of a random material and its shortest relaxation time."""
    kind = random.choice(["elastic", "one", "few", "broad"], p=[0.08, 0.3, 0.17, 0.45])
    if kind == "elastic":
        return {"terms": 0, "decades": 0.0, "rise": 1.0, "slope": 0.0}, None
    rise, slope = np.exp(random.uniform(np.log(2), np.log(1200))), random.uniform(0, 0.5)
    if kind == "one":
        terms, decades, slope = 1, 0.0, 0.0
    elif kind == "few":
        terms, decades = int(random.integers(2, 4)), random.uniform(1, 4)
    else:
        decades = float(random.integers(2, 9))
        terms = int(decades) + 1
    return {"terms": terms, "decades": decades, "rise": rise, "slope": slope}, 10**-decades


def drawn(kind, part, count, seed, ratios, lightest=0.003):
    """Yield cases with parameters drawn at random; a third has A/A0 of about 1 % or less, if permitted."""
    random = np.random.default_rng(seed)
    for k in range(count):
        material, fastest = drawn_material(random)
        ratio = float(random.choice(ratios))
        narrow = ratio if random.random() < 0.3 else np.exp(random.uniform(np.log(2), np.log(ratio)))
        hurst = float(random.choice([0.5, 0.6, 0.7, 0.8, 0.9, 1.0]))
        low, high = (0.01, 0.8) if k % 3 else (lightest, max(lightest, 0.012))
        area = np.exp(random.uniform(np.log(low), np.log(high)))
        # 8 points per shortest wavelength, 16 or 32 for small contacts.
        points = 8 if area > 0.05 else 16 if area > 0.01 else 32
        modes = 128 if ratio > 16 or points == 8 else 64
        case = {"part": part, "kind": kind, "ratio": ratio, "rolloff": ratio / narrow, "hurst": hurst}
        case |= {"periods": modes / ratio, "grid": modes * points, **material}
        v = np.exp(random.uniform(np.log(0.01), np.log(5 / fastest))) if fastest else 0.0
        stiff = abs(complex(rf.complex_modulus(material_of(case), 0.3 * v)))
        yield case | {"velocity": v, "pressure": stiff * float(erfinv(area)) * np.sqrt(0.3)}


def drawn_slabs(part, count, seed):
    """Yield cases of slabs on a rigid base."""
    random = np.random.default_rng(seed)
    for case in drawn("slab", part, count, seed, (4, 6, 8, 12, 16), 0.01):
        thickness = np.exp(random.uniform(np.log(0.3), np.log(3))) * case["ratio"] / case["rolloff"]
        base, poisson = str(random.choice(["bonded", "frictionless"])), float(random.choice([0.3, 0.4, 0.5]))
        middle = (case["rolloff"] / case["ratio"]) ** 0.5
        stiffer = float(rf.Slab(thickness, base).stiffening(poisson, middle))
        case |= {"base": base, "thickness": thickness, "poisson": poisson}
        yield case | {"pressure": case["pressure"] * stiffer}


def drawn_twos(part, count, seed):
    """Yield cases of two rough solids: both relax, or one relaxes on an elastic or a rigid one."""
    random = np.random.default_rng(seed)
    for case in drawn("two rough", part, count, seed, (4, 5, 6, 8), 0.02):
        relaxes = bool(random.integers(2))
        lower = float(random.choice([1, 1, 2, 5] if relaxes else [3, 10, np.inf]))
        case |= {"grid": 128, "periods": 16 / case["ratio"], "lower": lower, "lower_relaxes": relaxes}
        case |= {"share": float(random.choice([0.25, 0.5, 0.75]))}
        v = case["velocity"]

        def modulus(omega, case=case):
            return abs(complex(rf.complex_modulus(material_of(case), omega)))

        stiff, soft = modulus(0.3 * v), modulus(0.0)
        if np.isfinite(lower):
            below = [lower * (modulus(0.3 * v * k) if relaxes else soft) for k in (0, 1)]
            series = [a * b / (a + b) for a, b in ((stiff, below[0]), (soft, below[1]))]
            case["pressure"] *= np.mean(series) / stiff
        yield case


def drawn_stretched(part, count, seed):
    """Yield cases of anisotropic roughness."""
    random = np.random.default_rng(seed)
    for case in drawn("anisotropic", part, count, seed, (4, 6, 8, 12, 16), 0.01):
        angle = float(random.choice([0.0, np.pi / 4, np.pi / 2]))
        yield case | {"stretch": float(random.choice([1.5, 2, 4])), "angle": angle}


def drawn_large(part, count, seed):
    """Yield cases of wide spectra."""
    random = np.random.default_rng(seed)
    for k, case in enumerate(drawn("large", part, count, seed, (128,), 0.02)):
        ratio, modes = ((128, 256), (256, 256), (256, 512), (512, 512))[k % 4]
        narrow = np.exp(random.uniform(np.log(8), np.log(ratio)))
        case |= {"ratio": float(ratio), "rolloff": ratio / narrow, "grid": 4096, "periods": modes / ratio}
        yield case


def drawn_wide(part, count, seed):
    """Yield cases of wide spectra without a long plateau."""
    random = np.random.default_rng(seed)
    for k, case in enumerate(drawn("large", part, count, seed, (128,), 0.02)):
        ratio = float((128, 256)[k % 2])
        narrow = np.exp(random.uniform(np.log(32), np.log(ratio)))
        case |= {
            "ratio": ratio,
            "rolloff": ratio / narrow,
            "hurst": float(random.choice([0.7, 0.8, 0.9, 1.0])),
        }
        yield case | {"grid": 2048, "periods": 256 / ratio}


def drawn_others(part, count, seed):
    """Yield cases of half-spaces whose materials the other cases lack.

    The relaxation times lie within 1.5 decades, at most three per decade, moduli rise by up to 5000, and the
    strongest term may have the longest or the shortest time (slope -0.5 to 1).
    """
    random = np.random.default_rng(seed)
    for case in drawn("other material", part, count, seed, (4, 6, 8, 12, 16), 0.01):
        terms, decades = int(random.integers(2, 5)), random.uniform(0.3, 1.5)
        case |= {"terms": terms, "decades": decades, "slope": random.uniform(-0.5, 1.0)}
        case |= {"rise": np.exp(random.uniform(np.log(1.5), np.log(5000)))}
        points = min(int(case["grid"] / case["ratio"] / case["periods"]), 16)
        case |= {
            "periods": 32 / case["ratio"],
            "grid": 32 * points,
            "poisson": float(random.choice([0.0, 0.3])),
        }
        area = np.exp(random.uniform(np.log(0.012), np.log(0.8)))
        v = np.exp(random.uniform(np.log(0.03), np.log(5 * 10**decades)))
        stiff = abs(complex(rf.complex_modulus(material_of(case), 0.3 * v))) / (1 - case["poisson"] ** 2)
        yield case | {"velocity": v, "pressure": stiff * float(erfinv(area)) * np.sqrt(0.3)}


# q1/q0 of drawn cases; values that occur twice are drawn twice as often.
_RATIOS = 4, 5, 6, 8, 8, 10, 12, 16, 16, 24, 32, 32, 48, 64
KINDS = "half-space", "slab", "two rough", "anisotropic", "large", "other material"
PARTS = "fit", "test", "fresh"


def drawn_cases():
    """Return all cases."""
    first = [
        cases
        for part, seed in (("fit", 10), ("test", 20))
        for cases in (
            drawn("half-space", part, 300, seed, _RATIOS),
            drawn_slabs(part, 60, seed + 1),
            drawn_twos(part, 40, seed + 2),
            drawn_stretched(part, 40, seed + 3),
            drawn_large(part, 16, seed + 4),
        )
    ]
    later = [
        drawn_stretched("fit", 60, 33),
        drawn_twos("fit", 50, 32),
        drawn_wide("fit", 20, 34),
        drawn_stretched("fresh", 60, 43),
        drawn_twos("fresh", 50, 42),
        drawn_wide("fresh", 30, 44),
        drawn("half-space", "fresh", 100, 40, _RATIOS),
        drawn_slabs("fresh", 20, 41),
        drawn_others("fresh", 40, 45),
    ]
    return [case for cases in first + later for case in cases]


def powers(found, ratio):
    """Return sums of |u|^2 and |h|^2 by direction and range of ln q, shape (2, 2, BINS + 1)."""
    n = found.heights.shape[-1]
    kx, ky = n * np.fft.fftfreq(n)[:, None], np.arange(n // 2 + 1)
    q = 2 * np.pi / found.length * np.hypot(kx, ky)
    axes = (-2, -1)
    # The unit of length is 1/q1.
    place = np.floor(BINS * (1 + np.log(np.maximum(q, 1e-30)) / np.log(ratio)) + 1e-9).astype(int)
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


def enough(values):
    """Return True if the standard errors of area and friction are small, or if there are many values."""
    n, (least, most) = len(values), SURFACES
    if n < least or n >= most:
        return n >= most
    area, friction = (np.array(values).T[k] for k in (0, 1))
    limits = 0.015 * area.mean(), 0.015 * abs(friction.mean()) + 1e-3
    return all(
        one.std(ddof=1) / np.sqrt(n) < limit for one, limit in zip((area, friction), limits, strict=True)
    )


NAMES = "area", "friction", "friction_of_heat", "separation", "heat_beyond", "converged"


def measured(scene, case, count=None, finer=1.0, wider=1):
    """Return values of every surface, and sums of their powers; None means as many as are `enough`."""
    grid, periods = int(case["grid"] * finer * wider), case["periods"] * wider
    values, sums = [], 0.0
    while len(values) < count if count else not enough(values):
        found = boundary_element(
            scene,
            case["velocity"],
            case["pressure"],
            jax.random.key(100 + len(values)),
            grid=grid,
            periods=periods,
            tolerance=TOLERANCE,
        )
        values.append(
            [getattr(found, n) if n != "heat_beyond" else found.heat_beyond(1 + 1e-9) for n in NAMES]
        )
        sums = sums + powers(found, case["ratio"])
    return np.array(values, float), sums


def row_of(case):
    """Return one line of the table."""
    scene = scene_of(case)
    fine, sums = measured(scene, case)
    count = len(fine)
    coarse, _ = measured(scene, case, count, 0.5)
    wide, _ = measured(scene, case, count // 2, 0.5, 2)
    row = case | {"surfaces": count} | dict(zip(NAMES, fine.mean(0), strict=True))
    for k, name in enumerate(("area", "friction")):
        row[f"{name}_scatter"] = fine[:, k].std(ddof=1)
        row[f"{name}_resolution"] = np.mean(coarse[:, k]) - np.mean(fine[:, k])
        row[f"{name}_period"] = np.mean(wide[:, k]) - np.mean(coarse[:, k])
    moved, rough = sums
    rough[:, -1] = rough.sum()
    for j, end in enumerate(("", "_across")):
        row |= {
            f"u2_{k}{end}": x
            for k, x in enumerate(moved[j] / np.where(rough[j] > 1e-12 * rough.sum(), rough[j], np.nan))
        }
    row["converged"] = str(bool(min(x[:, -1].min() for x in (fine, coarse, wide))))
    return {name: shown(row.get(name, "")) for name in COLUMNS}


def shown(x):
    """Return the text of an entry."""
    return x if isinstance(x, str) else f"{float(x):.6g}"


def key_of(row):
    """Return the inputs of a case as text."""
    return tuple(shown(row.get(name, "")) for name in INPUTS)


def read():
    """Return the rows of the table as cases; empty entries are left out."""
    if not TABLE.exists():
        return []
    with TABLE.open(newline="") as file:
        return [
            {name: x if name in TEXTS else float(x) for name, x in row.items() if x}
            for row in csv.DictReader(file)
        ]


def compute(seconds, kinds, parts):
    """Append missing rows for about `seconds`; return the number of rows that are still missing."""
    begin, done = time.monotonic(), {key_of(row) for row in read()}
    missing = [
        case
        for case in drawn_cases()
        if case["kind"] in kinds and case["part"] in parts and key_of(case) not in done
    ]
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
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--part", nargs="+", choices=PARTS, default=PARTS)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore", rf.UnitWarning)  # the numbers have no units
    print(compute(options.seconds, options.kinds, options.part), "cases are missing")


if __name__ == "__main__":
    main()
