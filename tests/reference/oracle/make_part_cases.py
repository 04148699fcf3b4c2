"""Writes part_cases.json: scenes with strain softening and with anisotropic roughness.

    python tests/reference/oracle/make_part_cases.py      (about eight minutes on one core)

Values and derivatives come from `tests/support/oracles/oracle.py`, on a mesh on which they have converged to
1e-13 and 1e-10. A derivative is d quantity / d ln parameter, by central differences of the
sixth order; with respect to an angle it is d quantity / d angle.
"""

import json

import numpy as np
from make_derivative_cases import OFFSETS, WEIGHTS
from make_option_cases import MASTER_CURVE, STIFF
from make_option_cases import RUBBER as SIX_TERMS
from make_option_cases import case as option_case
from support.cases.solids import ARRHENIUS, MEASURED_ROAD, RIGID, ROAD, SOFT, TREAD, WLF
from support.folders import REFERENCE
from support.oracles.oracle import solve

RUBBER = SIX_TERMS | {"E": [7.6e8, 1.43e8, 1.55e7, 2.2e6], "tau": [1e-9, 1e-8, 1e-6, 1e-3]}
SHEAR = {"kind": "shear", "G_inf": 1.2e6, "G": [2.5e8, 5e6, 7e5], "tau": [1e-9, 1e-6, 1e-3], "bulk": 2e9}
STRAIN = np.geomspace(2e-3, 1.5, 20)
SOFTENING = {
    "strain": STRAIN.tolist(),
    "storage": (0.25 + 0.75 / (1 + (STRAIN / 0.05) ** 0.8)).tolist(),
    "loss": (0.45 + 0.55 / (1 + (STRAIN / 0.15) ** 1.3) + 0.05 * np.sin(2 * np.log(STRAIN))).tolist(),
    "factor": 1.1,
}
TWO_ENTRIES = {"strain": [0.03, 0.6], "storage": [0.9, 0.4], "loss": [1.0, 0.6], "factor": 1.0}
SLAB = {"thickness": 1e-3}


def case(name, *arguments, angles=None, **options):
    """A scene; angles: (ratio, angle, harmonics) of the roughness of either solid, or None."""
    made = option_case(name, *arguments, **options)
    for psd, how in zip(("psd1", "psd2"), angles or (None, None), strict=True):
        if how is not None:
            made[psd] = made[psd] | dict(zip(("ratio", "angle", "harmonics"), how, strict=True))
    return made


def soft(name, *arguments, **options):
    return case(f"soft-{name}", *arguments, **({"softening": SOFTENING} | options))


SOFTENED = [
    soft("plain", RUBBER, RIGID, None, ROAD, 0.1, 2e5),
    soft("slow", RUBBER, RIGID, None, ROAD, 1e-4, 1e6, 0.45),
    soft("fast", RUBBER, RIGID, None, ROAD, 30.0, 1e6),
    soft("backwards", RUBBER, RIGID, None, ROAD, -0.1, 3e3),
    soft("at-rest", RUBBER, RIGID, None, ROAD, 0.0, 2e5),
    soft("gentle", RUBBER, RIGID, None, ROAD, 0.1, 2e5, softening=SOFTENING | {"factor": 0.02}),
    soft("two-entries", RUBBER, RIGID, None, ROAD, 0.1, 2e5, softening=TWO_ENTRIES),
    soft("slab", RUBBER | SLAB, RIGID, None, ROAD, 0.1, 2e5),
    soft("corrected", RUBBER, RIGID, None, ROAD, 0.1, 2e5, 0.45, area_correction=True),
    soft("warm", RUBBER | {"shift": WLF}, RIGID, TREAD, ROAD, 0.1, 2e5, temperature=313.15),
    soft("both-rough", RUBBER, RIGID, TREAD, ROAD, 0.1, 2e5),
    soft("rough-rubber", RUBBER, RIGID, TREAD, None, 0.1, 2e6),
    soft("table-spectrum", RUBBER, RIGID, None, MEASURED_ROAD, 0.1, 2e5),
    soft("table-modulus", MASTER_CURVE, RIGID, None, ROAD, 0.1, 2e5),
    soft("shear-modulus", SHEAR, RIGID, None, ROAD, 0.1, 2e5),
    soft("on-elastic", RUBBER, STIFF, TREAD, ROAD, 0.1, 2e5),
    soft("two-rubbers", RUBBER, SOFT, TREAD, ROAD, 0.1, 2e5),
    soft("two-slabs", RUBBER | SLAB, SOFT | {"thickness": 3e-4}, TREAD, ROAD, 0.1, 4e5),
    soft(
        "two-rubbers-warm",
        RUBBER | {"shift": WLF},
        SOFT | {"shift": ARRHENIUS},
        TREAD,
        ROAD,
        0.02,
        4e5,
        0.45,
        area_correction=True,
        temperature=280.0,
    ),
    soft("table-on-elastic", MASTER_CURVE, STIFF, TREAD, ROAD, 0.1, 2e5),
    soft("shear-on-rubber", SHEAR, SOFT, TREAD, ROAD, 0.1, 2e5),
]

# Directions every 20 degrees, of a surface whose grooves turn and deepen towards the small scales.
DIRECTION = np.pi * np.arange(9) / 9
TURNING = {
    "q": MEASURED_ROAD["q"],
    "C": [
        [C * np.exp(0.2 * i * np.cos(2 * (phi - 0.15 * i)) + 0.1 * np.sin(4 * phi)) for phi in DIRECTION]
        for i, C in enumerate(MEASURED_ROAD["C"])
    ],
    "angle": 0.3,
}
COATED = RUBBER | {"coating": {"thickness": 1e-3, "base": SOFT}}


def grooved(name, *arguments, **options):
    return case(f"grooved-{name}", *arguments, **({"angles": (None, (2.0, 0.4, 32))} | options))


GROOVED = [
    grooved("plain", RUBBER, RIGID, None, ROAD, 0.1, 2e5),
    grooved("slow", RUBBER, RIGID, None, ROAD, 1e-4, 1e6, 0.45),
    grooved("backwards", RUBBER, RIGID, None, ROAD, -10.0, 3e3),
    grooved("at-rest", RUBBER, RIGID, None, ROAD, 0.0, 2e5),
    grooved("along", RUBBER, RIGID, None, ROAD, 0.1, 2e5, angles=(None, (2.0, 0.0, 32))),
    grooved("across", RUBBER, RIGID, None, ROAD, 0.1, 2e5, angles=(None, (2.0, np.pi / 2, 32))),
    grooved("mirrored", RUBBER, RIGID, None, ROAD, 0.1, 2e5, angles=(None, (2.0, -0.4, 32))),
    grooved("few", RUBBER, RIGID, None, ROAD, 0.1, 2e5, angles=(None, (2.0, 0.4, 16))),
    grooved("crossed", RUBBER, RIGID, None, ROAD, 0.1, 2e5, angles=(None, (1 / 3, 0.4, 64))),
    grooved("slab", RUBBER | SLAB, RIGID, None, ROAD, 0.1, 2e5),
    grooved("table-modulus", MASTER_CURVE, RIGID, None, ROAD, 0.1, 2e5),
    grooved("coating", COATED, RIGID, None, ROAD, 0.1, 2e5),
    grooved("corrected", RUBBER, RIGID, None, ROAD, 0.1, 2e5, 0.45, area_correction=True),
    grooved("both-rough", RUBBER, RIGID, TREAD, ROAD, 0.1, 2e5, angles=((1.5, -0.7, 32), (2.0, 0.4, 32))),
    grooved("two-rubbers", RUBBER, SOFT, TREAD, ROAD, 0.1, 2e5, angles=((1.5, -0.7, 32), (2.0, 0.4, 32))),
    grooved("on-elastic", RUBBER | SLAB, STIFF, TREAD, ROAD, 0.1, 2e5),
    grooved("table-on-elastic", MASTER_CURVE, STIFF, TREAD, ROAD, 0.1, 2e5),
    grooved("warm", RUBBER | {"shift": WLF}, RIGID, None, ROAD, 0.1, 2e5, temperature=313.15),
    grooved("shear-modulus", SHEAR, RIGID, None, ROAD, 0.1, 2e5),
    grooved("table", RUBBER, RIGID, None, TURNING, 0.1, 2e5, angles=None),
    grooved("table-slab", RUBBER | SLAB, RIGID, None, TURNING, 0.1, 2e5, angles=None),
    grooved("table-of-both", MASTER_CURVE, RIGID, None, TURNING, 0.1, 2e5, angles=None),
    grooved("table-two-rubbers", RUBBER, SOFT, TREAD, TURNING, 0.1, 2e5, angles=None),
    grooved("table-coating", COATED, RIGID, None, TURNING, 0.1, 2e5, angles=None),
]

# Parameters of which derivatives are taken, "." between nested keys.
COMMON = ("v", "pressure", "solid1.E_inf", "solid1.E.1", "solid1.tau.2", "psd2.h_rms", "psd2.q0", "psd2.qr")
TABLE = ("softening.factor", "softening.strain.9", "softening.storage.9", "softening.loss.9")
SLOPES = {
    "soft-plain": (*TABLE, *COMMON, "psd2.H", "psd2.q1"),
    "soft-two-rubbers": (*TABLE, "solid1.E.1", "solid2.tau.1", "psd1.h_rms", "psd2.h_rms"),
    "soft-table-modulus": ("softening.factor", "softening.loss.9", "v", "psd2.h_rms"),
    "grooved-plain": (*COMMON, "psd2.ratio", "psd2.angle", "psd2.H", "psd2.q1"),
    "grooved-two-rubbers": ("solid1.E.1", "solid2.tau.1", "psd1.ratio", "psd2.angle", "psd2.h_rms"),
    "grooved-table": ("psd2.angle", "psd2.C.3.2", "solid1.tau.2"),
    "grooved-table-modulus": ("psd2.angle", "psd2.ratio", "v"),
}
# In a softened scene knots of the strain move, and must not pass the kinks of a spectrum meanwhile.
STEP, STEP_OF_SOFTENING = 0.005, 0.001


def key_path(name):
    return [int(key) if key.isdigit() else key for key in name.split(".")]


def moved(scene, path, step):
    """A copy with one number larger by the step, in the logarithm unless it is an angle."""
    key, *rest = path
    if rest:
        new = moved(scene[key], rest, step)
    else:
        new = scene[key] + step if key == "angle" else scene[key] * float(np.exp(step))
    if isinstance(scene, list):
        return [*scene[:key], new, *scene[key + 1 :]]
    return scene | {key: new}


def derivative(scene, path):
    total, size = {}, STEP_OF_SOFTENING if "softening" in scene else STEP
    for offset, weight in zip(OFFSETS, WEIGHTS, strict=True):
        above, below = (solve(moved(scene, path, sign * offset * size), 30, 10) for sign in (1, -1))
        for quantity in above:
            change = weight / size * (above[quantity] - below[quantity])
            total[quantity] = total.get(quantity, 0.0) + change
    return total


def main():
    out = []
    for scene in SOFTENED + GROOVED:
        slopes = {name: derivative(scene, key_path(name)) for name in SLOPES.get(scene["name"], ())}
        values = solve(scene, 50, 16)
        out.append(scene | values | ({"derivatives": slopes} if slopes else {}))
        print(f"{scene['name']:28}", *(f"{value:.6e}" for value in values.values()), len(slopes), flush=True)
    (REFERENCE / "part_cases.json").write_text(json.dumps(out, indent=1) + "\n")


if __name__ == "__main__":
    main()
