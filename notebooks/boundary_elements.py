"""Compare theory and boundary elements; write boundary_elements.csv, boundary_elements.md and its figure.

    python notebooks/boundary_elements.py [--seconds 500]    # continue, then write the page
    python notebooks/boundary_elements.py --page             # only write the page

Computing all cases takes 40 minutes on one core. The script needs matplotlib. In boundary_elements.csv, the
unit of length is 1/q1, the unit of stress is E(0), and the unit of time is the longest relaxation time. Every
case is a mean over REALISATIONS random surfaces. Each surface is computed on the grid of the column `grid`
and on a grid with half as many points per side. The difference estimates the discretisation error.
"""

import argparse
import csv
import itertools
import time
import warnings
from pathlib import Path

import jax
import numpy as np

import rubberfric as rf
from rubberfric.analysis import boundary_element
from rubberfric.plot import style

FOLDER = Path(__file__).resolve().parent
TABLE = FOLDER / "boundary_elements.csv"
PAGE = FOLDER / "boundary_elements.md"
FIGURE = FOLDER / "figures" / "boundary_elements.png"

# Random surfaces of a case. Their scatter gives the standard error of the mean.
REALISATIONS = 4
TOLERANCE = 1e-4  # error of friction 2e-3, at the lightest load 5e-3
BINS = 6  # of ln q between q0 and q1, for the displacements
# q1/q0, qr/q0, longest wavelengths a side, points a side.
GEOMETRIES = (
    (8, 1, 4, 256),
    (32, 4, 1, 256),
    (32, 1, 2, 512),
    (64, 4, 1, 512),
    (64, 1, 2, 1024),
)
# Hurst exponents. Only the first one is computed on the largest grid.
HURST = (0.8, 0.6, 1.0)
# Pressure over |E| h' at the middle velocity: A/A0 about 0.3, 3 and 20 %.
LOADS = (1.5e-3, 1.5e-2, 0.12)
# Solids with E(0) = 1: a single relaxation time, one time per decade, and no relaxation.
MATERIALS = {
    "narrow": rf.Prony(1.0, [9.0], [1.0], 0.0),
    "broad": rf.Prony(1.0, 2.0 ** np.arange(8), 10.0 ** -np.arange(8.0), 0.0),
    "elastic": rf.Elastic(1.0, 0.0),
}
LARGE = (("narrow", LOADS[1]), ("narrow", LOADS[2]), ("broad", LOADS[1]))  # computed on the largest grid
# v tau q1.
VELOCITIES = {
    "narrow": 10 ** np.linspace(-1.75, 1.25, 7),
    "broad": 10.0 ** np.arange(-1, 6),
    "elastic": np.zeros(1),
}
VARIANTS = {
    f"{name}_{gamma}": (inside, gamma)
    for name, inside in (("plain", False), ("inside", True))
    for gamma in (0.45, 0.5)
}
# Limits of the intervals of A/A0 in the table.
AREAS = (0.003, 0.01, 0.03, 0.1, 0.3, 0.8)
WHAT = """In the theory, the spectral power of the displacement is P S times the spectral power of the
roughness, at each wavevector up to q1. The factor P S decreases steeply with q. In boundary elements the same
ratio decreases little with q. In light contact, up to half of the heat is dissipated at wavevectors above q1
(columns `displacement_*` and `heat_beyond`). The friction of the theory is therefore too small in slow
sliding, where the rubber is soft at all scales. It is too large in fast sliding, where the rubber is stiffer
at smaller scales. At velocities in between the two errors cancel.

S in G is the better variant for area and friction. No gamma removes the dependence of the error on velocity.
The rms errors of laws (a) and (b) below are a half and a quarter of the theory's, but still above 10 %. The
error of (b) depends on q1/q0, so the law lacks a parameter. A scene cannot use these two laws."""
KEY = ("ratio", "rolloff", "hurst", "relaxation", "load", "velocity")
MEASURED = ("area", "pixel_area", "friction", "friction_of_heat", "separation", "heat_beyond")
COLUMNS = (
    *KEY,
    "pressure",
    "grid",
    *itertools.chain.from_iterable((name, f"{name}_scatter", f"{name}_resolution") for name in MEASURED),
    *(f"displacement_{k}" for k in range(BINS)),
    *(f"{quantity}_{variant}" for quantity in ("area", "friction") for variant in VARIANTS),
    *(f"separation_{gamma}" for gamma in (0.45, 0.5)),
    "converged",
)


def scene_of(ratio, rolloff, hurst, relaxation):
    """Return a scene of rms slope 1 and q1 = 1."""
    spectrum = rf.SelfAffine(1 / ratio, rolloff / ratio, 1.0, hurst, 1.0)
    spectrum = spectrum.replace(h_rms=1 / float(rf.rms_slope(spectrum)))
    return rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(MATERIALS[relaxation]))


def pressure_of(relaxation, load):
    """Return the pressure of a load."""
    middle = VELOCITIES[relaxation][len(VELOCITIES[relaxation]) // 2]
    return load * abs(complex(rf.complex_modulus(MATERIALS[relaxation], 0.3 * middle)))


def cases():
    """Yield (geometry, hurst, relaxation, load, velocity), the cheapest first."""
    for geometry, relaxation, hurst, load in itertools.product(GEOMETRIES, MATERIALS, HURST, LOADS):
        velocities = VELOCITIES[relaxation]
        if geometry[3] > 512:  # ten times the time of the others
            if hurst != HURST[0] or (relaxation, load) not in LARGE:
                continue
            velocities = velocities[1::2] if len(velocities) > 1 else velocities
        for velocity in velocities:
            yield geometry, hurst, relaxation, load, float(velocity)


def measured(scene, velocity, pressure, grid, periods):
    """Return results of every realisation by name, shape (realisations,), and displacements by scale."""
    found = [
        boundary_element(
            scene, velocity, pressure, jax.random.key(k), grid=grid, periods=periods, tolerance=TOLERANCE
        )
        for k in range(REALISATIONS)
    ]
    q1 = 1.0 + 1e-9
    values = {name: np.array([getattr(one, name) for one in found]) for name in MEASURED[:-1]}
    values["heat_beyond"] = np.array([one.heat_beyond(q1) for one in found])
    q, spectrum = found[0].wavevector, scene.lower.spectrum
    place = np.floor(BINS * np.log(q / spectrum.q0 + 1e-9) / np.log(q1 / spectrum.q0))
    ratios = []
    for k in range(BINS):
        inside = place == k
        moved, rough = (
            sum(getattr(one, n)[inside].sum() for one in found) for n in ("displacement", "roughness")
        )
        ratios.append(float(moved / rough) if rough > 0 else "")
    return values, ratios, all(one.converged for one in found)


def row_of(geometry, hurst, relaxation, load, velocity):
    """Return one line of the table."""
    ratio, rolloff, periods, grid = geometry
    scene, pressure = scene_of(ratio, rolloff, hurst, relaxation), pressure_of(relaxation, load)
    fine, displacements, converged = measured(scene, velocity, pressure, grid, periods)
    coarse, _, also = measured(scene, velocity, pressure, grid // 2, periods)
    row = dict(zip(KEY, (ratio, rolloff, hurst, relaxation, load, velocity), strict=True))
    row |= {"pressure": pressure, "grid": grid, "converged": converged and also}
    for name in MEASURED:
        mean = fine[name].mean()
        row[name] = mean
        row[f"{name}_scatter"] = fine[name].std(ddof=1)
        row[f"{name}_resolution"] = coarse[name].mean() - mean
    row |= {f"displacement_{k}": value for k, value in enumerate(displacements)}
    for variant, (inside, gamma) in VARIANTS.items():
        found = rf.solve(scene.replace(gamma=gamma, area_correction=inside), velocity, pressure)
        row |= {f"area_{variant}": found.area, f"friction_{variant}": found.friction}
        row[f"separation_{gamma}"] = found.separation
    return {name: f"{float(x):.5g}" if not isinstance(x, str | bool) else x for name, x in row.items()}


def key_of(row):
    """Return the key of a case."""
    return tuple(row[name] if name == "relaxation" else float(row[name]) for name in KEY)


def read():
    """Return the rows of the table."""
    if not TABLE.exists():
        return []
    with TABLE.open(newline="") as file:
        return list(csv.DictReader(file))


def compute(seconds):
    """Add missing rows for about `seconds`; return True if the table is complete."""
    begin, done = time.monotonic(), {key_of(row) for row in read()}
    for geometry, *case in cases():
        row = dict(zip(KEY, (*geometry[:2], *case), strict=True))
        if tuple(float(f"{x:.5g}") if not isinstance(x, str) else x for x in row.values()) in done:
            continue
        if time.monotonic() - begin > seconds:
            return False
        values, new = row_of(geometry, *case), not TABLE.exists()
        with TABLE.open("a", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            if new:
                writer.writeheader()
            writer.writerow(values)
    return True


def numbers(rows):
    """Return the resolved rows that slide, as numbers.

    Cases are left out if their friction differs by more than 10 % between the grids, or if its standard error
    over the surfaces exceeds 10 %.
    """
    found = []
    for row in rows:
        one = {k: v if k in ("relaxation", "converged") else float(v or "nan") for k, v in row.items()}
        sure = one["friction_scatter"] / np.sqrt(REALISATIONS) < 0.1 * one["friction"]
        resolved = abs(one["friction_of_heat_resolution"]) < 0.1 * one["friction_of_heat"]
        if one["relaxation"] != "elastic" and sure and resolved and one["converged"] == "True":
            found.append(one)
    return found


def ratios(rows, quantity, variant):
    """Return theory over boundary elements, and the area of the theory."""
    own = np.array([row[f"{quantity}_{variant}"] / row[quantity] for row in rows])
    return own, np.array([row[f"area_{variant}"] for row in rows])


def spread(rows, quantity, variant):
    """Return quantiles (5, 50, 95 %) of theory over boundary elements in bins of the theory's area."""
    own, area = ratios(rows, quantity, variant)
    bins = [(area >= low) & (area < high) for low, high in itertools.pairwise(AREAS)]
    return [np.quantile(own[one], (0.05, 0.5, 0.95)) if one.sum() > 4 else None for one in bins]


def law(rows):
    """Return mu of full contact times P(q1), and ln(|E(q1 v)|/E(0)), for every row."""
    whole, stiff = [], []
    for row in rows:
        scene = scene_of(row["ratio"], row["rolloff"], row["hurst"], row["relaxation"])
        # At this pressure contact is full, and friction is proportional to 1/pressure.
        full = 1e6 * rf.friction(scene, row["velocity"], 1e6) / row["pressure"]
        whole.append(float(full) * row["area_inside_0.5"])
        stiff.append(np.log(abs(complex(rf.complex_modulus(MATERIALS[row["relaxation"]], row["velocity"])))))
    return np.array(whole), np.array(stiff)


def fitted_law(rows):
    """Fit (ln c, k) of mu = c P^(1 + k ln(E/E0)) mu_full to half of the surfaces; return all errors."""
    whole, stiff = law(rows)
    left = np.log([row["friction"] for row in rows]) - np.log(whole)
    terms = np.stack([np.ones(len(rows)), stiff * np.log([row["area_inside_0.5"] for row in rows])], 1)
    groups = sorted({tuple(row[name] for name in KEY[:5]) for row in rows})
    half = np.array([groups.index(tuple(row[name] for name in KEY[:5])) % 2 == 0 for row in rows])
    found = np.linalg.lstsq(terms[half], left[half], rcond=None)[0]
    return found, left, left - terms @ found, half


def page(rows):
    """Yield the lines of the page."""
    known = numbers(rows)
    friction = [row for row in rows if row["relaxation"] != "elastic"]
    yield "# Theory and boundary elements"
    yield ""
    yield from __doc__.replace("REALISATIONS", str(REALISATIONS)).splitlines()[5:]
    yield ""
    yield from WHAT.splitlines()
    yield ""
    yield (
        f"There are {len(rows)} cases, of which {len(friction)} slide. {len(known)} of the sliding cases are "
        f"resolved: the friction on both grids differs by less than 10 %, and the standard error of friction "
        f"over the surfaces is below 10 %. Most unresolved cases have A/A0 below 0.5 %, where contact "
        f"regions have few grid points. boundary_elements.csv contains the unresolved cases, but the "
        f"statistics below exclude them."
    )
    yield ""
    yield "![theory over boundary elements](figures/boundary_elements.png)"
    for quantity in ("area", "friction"):
        yield ""
        yield f"## {quantity.capitalize()}: theory over boundary elements"
        yield ""
        yield (
            f"Each cell gives the 5, 50 and 95 % quantiles of the {quantity} of the theory, divided by the "
            f"{quantity} of boundary elements. The columns are ranges of A/A0 of the theory."
        )
        yield ""
        yield (
            "| S | gamma | relaxation | "
            + " | ".join(f"A/A0 {low:g} ... {high:g}" for low, high in itertools.pairwise(AREAS))
            + " |"
        )
        yield "|---|---|---|" + "---|" * (len(AREAS) - 1)
        for variant, (inside, gamma) in VARIANTS.items():
            for relaxation in ("narrow", "broad"):
                own = [row for row in known if row["relaxation"] == relaxation]
                cells = [
                    "" if q is None else f"{q[0]:.2f} ... {q[1]:.2f} ... {q[2]:.2f}"
                    for q in spread(own, quantity, variant)
                ]
                where = "in G" if inside else "outside G"
                yield f"| {where} | {gamma} | {relaxation} | {' | '.join(cells)} |"
    (c, k), plain, left, half = fitted_law(known)
    area = np.array([row["area"] for row in known])
    theory = np.log(ratios(known, "friction", "inside_0.5")[0])
    yield ""
    yield "## Two laws in closed form"
    yield ""
    yield (
        "Law (a) is mu = P(q1) x mu of full contact, without a fitted parameter. Law (b) is mu ="
        f" {np.exp(c):.3g} P(q1)^(1 {'+' if k > 0 else '-'} {abs(k):.3g} ln(abs(E(q1 v))/E(0))) x mu of full"
        " contact. Its two parameters were fitted to every second combination of spectrum, material and load."
        " P is computed with S in G and gamma 0.5. The first table gives the root mean square of"
        " ln(law / boundary elements), and the share of cases within 10 %, in ranges of A/A0 of boundary"
        " elements. For law (b) it contains only the cases that were not used for the fit. The second table"
        " gives the mean and the standard deviation of ln(law / boundary elements) for each q1/q0 and qr/q0."
    )
    yield ""
    yield "| A/A0 | cases | theory, S in G | (a) | (b), held out |"
    yield "|---|---|---|---|---|"
    for low, high in [*itertools.pairwise(AREAS), (AREAS[0], AREAS[-1])]:
        inside = (area >= low) & (area < high)
        cells = [
            f"{np.sqrt(np.mean(e**2)):.2f}, {100 * np.mean(np.abs(e) < 0.1):.0f} %"
            for e in (theory[inside], plain[inside], left[inside & ~half])
        ]
        yield f"| {low:g} ... {high:g} | {inside.sum()} | {' | '.join(cells)} |"
    yield ""
    yield "| q1/q0 | qr/q0 | theory, S in G | (a) | (b), all |"
    yield "|---|---|---|---|---|"
    for ratio, rolloff, *_ in GEOMETRIES:
        own = np.array([(row["ratio"], row["rolloff"]) == (ratio, rolloff) for row in known])
        if own.any():
            cells = [f"{e[own].mean():+.2f} +- {e[own].std():.2f}" for e in (theory, -plain, -left)]
            yield f"| {ratio} | {rolloff} | {' | '.join(cells)} |"


def draw(rows, path):
    """Draw ratios of areas over the area, and of frictions over the velocity."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, LogLocator

    known = numbers(rows)
    figure = Figure(figsize=(10.5, 4.2), layout="constrained")
    axes = figure.subplots(1, 3)
    dark, light = style.colours(2)
    marks = (("plain_0.5", light, "x", "$S$ outside $G$"), ("inside_0.5", dark, "o", "$S$ in $G$"))
    for variant, colour, marker, label in marks:
        own, area = ratios(known, "area", variant)
        look = {"markersize": 3.5, "markerfacecolor": "none", "markeredgewidth": 0.8}
        axes[0].semilogx(area, own, marker, color=colour, label=label, **look)
    axes[0].set_xlabel("$A/A_0$ of the theory [-]")
    axes[0].set_ylabel("area: theory over boundary elements [-]")
    axes[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.1), ncols=1)
    for ax, relaxation in zip(axes[1:], ("narrow", "broad"), strict=True):
        # Shift the loads sideways so that their marks do not overlap.
        aside = dict(zip(LOADS, (0.86, 1.0, 1.16), strict=True))
        for load, marker, colour in zip(LOADS, "vo^", style.colours(3), strict=True):
            own = [row for row in known if row["relaxation"] == relaxation and row["load"] == load]
            v = aside[load] * np.array([row["velocity"] for row in own])
            look = {"color": colour, "markersize": 4.5, "markerfacecolor": "none", "markeredgewidth": 0.8}
            found = ratios(own, "friction", "inside_0.5")[0]
            ax.loglog(v, found, marker, label=f"load {load:g}", **look)
        ax.set_xlabel("$v\\,\\tau\\,q_1$ [-]")
        ax.set_title("one relaxation time" if relaxation == "narrow" else "one a decade", fontsize="medium")
        ax.set_ylabel("friction: theory ($S$ in $G$)\nover boundary elements [-]")
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.yaxis.set_minor_locator(LogLocator(subs=(1.5, 2, 3, 5, 7)))
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.1), ncols=2, columnspacing=1.0)
    for ax in axes:
        ax.axhline(1.0, color="k", linewidth=1)
        ax.grid(alpha=0.3)
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--seconds", type=float, default=np.inf, help="stop after the case at which they are over"
    )
    parser.add_argument("--page", action="store_true", help="compute nothing")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore", rf.UnitWarning)  # the numbers have no units
    if not options.page and not compute(options.seconds):
        print(f"{len(read())} of {sum(1 for _ in cases())} cases")
        return
    PAGE.write_text("\n".join(page(read())) + "\n", encoding="utf-8")
    draw(read(), FIGURE)


if __name__ == "__main__":
    main()
