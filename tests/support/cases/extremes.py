"""Extreme and stiff scenes, as dictionaries: every one is a change made to one of a few base scenes.

Plain data, for `test_extremes.py`, the table of `notebooks/stability.py` and
`reference/precise/make_extremes.py`, which computes their references. Few bases, so that few
structures compile. The groups are the extremes that every quantity must survive.
"""

from support.cases.solids import HARD, MEASURED_ROAD, RIGID, ROAD, SOFT, TREAD, WLF

ELASTIC = {"kind": "elastic", "E": 1.0e7, "nu": 0.3}
SHEAR = {"tau_f0": 6.5e6, "c": 0.1, "v0": 6e-3, "shift": WLF | {"C1": 6.0}}

COMMON = {"psd1": TREAD, "psd2": ROAD, "v": 0.1, "pressure": 3e5, "gamma": 0.5}
BASES = {
    "one": COMMON | {"solid1": SOFT, "solid2": RIGID},
    "two": COMMON | {"solid1": SOFT, "solid2": HARD},
    "slabs": COMMON | {"solid1": SOFT | {"thickness": 1e-3}, "solid2": HARD | {"thickness": 3e-4}},
    "on-elastic": COMMON | {"solid1": SOFT, "solid2": ELASTIC},
    "corrected": COMMON | {"solid1": SOFT, "solid2": RIGID, "area_correction": True},
    "layer": COMMON | {"solid1": SOFT | {"thickness": 1e-3, "base": "frictionless"}, "solid2": RIGID},
    "sheared": COMMON
    | {"solid1": SOFT | {"shift": WLF}, "solid2": RIGID, "shear": SHEAR, "temperature": 313.15},
    "measured": COMMON | {"solid1": SOFT, "solid2": RIGID, "psd2": MEASURED_ROAD},
}

NARROW = {"q0": 200.0, "qr": 200.1, "q1": 200.2, "H": 0.5, "h_rms": 1e-5}
FILM = {"nu": 0.0, "thickness": 1e-10}
MANY = {
    "E": [1e8 * 10 ** (-3 * i / 199) for i in range(200)],
    "tau": [10 ** (-12 + 18 * i / 199) for i in range(200)],
}

# group: name: (bases, changes); a key "a.b" changes entry b of a.
GROUPS = {
    "ordinary": {"ordinary": (" ".join(BASES), {})},
    "relaxation times over 40 decades": {"forty-decades": ("one two", {"solid1.tau": [1e-20, 1e-2, 1e20]})},
    "E_glass/E_inf = 1e8": {"glassy": ("one two slabs", {"solid1.E": [8e13, 1e6, 1e6]})},
    "E_inf = 0": {
        "liquid": ("one two slabs on-elastic corrected", {"solid1.E_inf": 0.0}),
        "two-liquids": ("two slabs", {"solid1.E_inf": 0.0, "solid2.E_inf": 0.0}),
        "liquid-at-rest": ("one two slabs on-elastic corrected", {"solid1.E_inf": 0.0, "v": 0.0}),
        "two-liquids-at-rest": ("two", {"solid1.E_inf": 0.0, "solid2.E_inf": 0.0, "v": 0.0}),
        "liquid-slow": ("one two", {"solid1.E_inf": 0.0, "v": 1e-12}),
    },
    "E_i = 0": {
        "one-weight-zero": ("one two slabs", {"solid1.E": [2.5e7, 0.0, 3e5]}),
        "all-weights-zero": ("one two slabs on-elastic corrected", {"solid1.E": [0.0, 0.0, 0.0]}),
        "all-weights-of-both-zero": ("two slabs", {"solid1.E": [0.0] * 3, "solid2.E": [0.0] * 2}),
    },
    "equal relaxation times": {
        "equal-times": ("one two slabs", {"solid1.tau": [2e-4, 2e-4, 2e-4]}),
        "equal-times-in-both": ("two", {"solid1.tau": [2e-4, 2e-4, 0.7], "solid2.tau": [2e-4, 2e-4]}),
    },
    "1 and 200 terms": {
        "one-term": ("one two", {"solid1.E": [1e8], "solid1.tau": [1e-6]}),
        "many-terms": ("one two", {"solid1.E": MANY["E"], "solid1.tau": MANY["tau"]}),
    },
    "v = 0, < 0, 1e-30 and 1e12 m/s": {
        "at-rest": ("one two slabs corrected", {"v": 0.0}),
        "reversed": ("one two slabs sheared", {"v": -0.1}),
        "slowest": ("one two slabs corrected sheared", {"v": 1e-30}),
        "fastest": ("one two slabs corrected sheared", {"v": 1e12}),
    },
    "sigma_0 = 1e-6 and 1e12 Pa": {
        "lightest": ("one two slabs on-elastic corrected measured", {"pressure": 1e-6}),
        "heaviest": ("one two slabs on-elastic corrected measured", {"pressure": 1e12}),
    },
    "q1/q0 = 1.001 and 1e10": {
        "narrow": ("one two", {"psd1": NARROW, "psd2.qr": 200.05, "psd2.q0": 200.05, "psd2.q1": 200.3}),
        "narrow-apart": ("one two", {"psd1": NARROW, "psd2.qr": 100.05, "psd2.q1": 100.1}),
        "ten-decades": ("one two slabs corrected", {"psd2.q1": 1e12}),
        "ten-decades-heavy": ("one", {"psd2.q1": 1e12, "pressure": 1e7, "v": 1e-5}),
    },
    "H = 0 and 1": {
        "hurst-0": ("one two", {"psd1.H": 0.0, "psd2.H": 0.0}),
        "hurst-nearly-0": ("one", {"psd1.H": 1e-9, "psd2.H": 1e-3}),
        "hurst-1": ("one two", {"psd1.H": 1.0, "psd2.H": 1.0}),
    },
    "q_r = q0 and q_r = q1": {
        "no-plateau": ("one two", {"psd1.qr": 300.0, "psd2.qr": 100.0}),
        "plateau-only": ("one two", {"psd1.qr": 4e5, "psd2.qr": 3.1e4}),
    },
    "C_1 = 0, C_2 = 0": {
        "no-C1": ("one two", {"psd1.h_rms": 0.0}),
        "no-C2": ("one two", {"psd2.h_rms": 0.0}),
        "no-C1-no-C2": ("one two slabs corrected", {"psd1.h_rms": 0.0, "psd2.h_rms": 0.0}),
    },
    "disjoint and touching spectra": {
        "disjoint": ("one two", {"psd1": {"q0": 1e6, "qr": 3e6, "q1": 1e8, "H": 0.7, "h_rms": 1e-7}}),
        "disjoint-other-way": (
            "one two",
            {"psd2": {"q0": 1e7, "qr": 3e7, "q1": 1e9, "H": 0.7, "h_rms": 1e-8}},
        ),
        "touching": ("one", {"psd1": {"q0": 3.1e4, "qr": 1e5, "q1": 1e6, "H": 0.7, "h_rms": 1e-6}}),
        "equal-ends": (
            "one two",
            {"psd1": {"q0": 100.0, "qr": 1000.0, "q1": 3.1e4, "H": 0.5, "h_rms": 1e-5}},
        ),
    },
    "one spectrum 1e20 larger": {
        "C1-larger": ("one two", {"psd1.h_rms": 4e5}),
        "C2-larger": ("one two", {"psd2.h_rms": 5e6}),
    },
    "nu = 0 and 1/2, q d = 1e-8 and 1e8": {
        "compressible": ("one slabs", {"solid1.nu": 0.0}),
        "incompressible": ("one slabs", {"solid1.nu": 0.5}),
        "film-incompressible": ("slabs layer", {"solid1.nu": 0.5, "solid1.thickness": 1e-10}),
        "film-compressible": ("slabs", {"solid1": SOFT | FILM, "solid2": HARD | FILM}),
        "two-films-incompressible": (
            "slabs",
            {"solid1.nu": 0.5, "solid1.thickness": 1e-10, "solid2.thickness": 1e-10},
        ),
        "thick": ("slabs layer", {"solid1.thickness": 1e6, "solid2.thickness": 1e6}),
        "thick-compressible": (
            "slabs",
            {"solid1.nu": 0.0, "solid1.thickness": 1e6, "solid2.nu": 0.0, "solid2.thickness": 1e6},
        ),
        "film-on-thick": ("slabs", {"solid1.thickness": 1e6, "solid2.thickness": 1e-7}),
    },
    "E_2/E_1 = 1e-12 and 1e12": {
        "soft-on-hard": ("two slabs", {"solid2.E_inf": 3.6e18, "solid2.E": [1.4e20, 6.5e18]}),
        "hard-on-soft": ("two slabs", {"solid2.E_inf": 3.6e-6, "solid2.E": [1.4e-4, 6.5e-6]}),
        "rubber-on-diamond": ("on-elastic", {"solid2.E": 1e18}),
        "rubber-on-gel": ("on-elastic", {"solid2.E": 1e-6}),
    },
    "T near the pole of the WLF law and far above it": {
        "near-the-pole": ("sheared", {"temperature": 191.551}),
        "cold": ("sheared", {"temperature": 220.0}),
        "hot": ("sheared", {"temperature": 1e3}),
    },
    "gamma = 0 and 1": {
        "gamma-0": ("one corrected", {"gamma": 0.0}),
        "gamma-0-light": ("corrected", {"gamma": 0.0, "pressure": 1e-3}),
        "gamma-1": ("one corrected", {"gamma": 1.0}),
    },
}
EXTREMES = {name: case for group in GROUPS.values() for name, case in group.items()}

# name-base: (base, changes)
CASES = {
    f"{name}-{base}": (base, changes) for name, (bases, changes) in EXTREMES.items() for base in bases.split()
}


def changed(base, changes):
    """A base scene with its changes."""
    case = dict(BASES[base])
    for key, value in changes.items():
        first, *rest = key.split(".")
        if first == "solid2" and rest and case[first]["kind"] == "rigid":
            continue  # a change of a body that the base has not
        case[first] = case[first] | {rest[0]: value} if rest else value
    return case
