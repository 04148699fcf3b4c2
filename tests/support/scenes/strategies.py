"""Hypothesis strategies for whole scenes, with numbers far beyond physical ranges.

Two layers. A `Structure` has the classes of a scene, which determine what is traced and
compiled. `calls(structure)` draws the numbers: uniform in the logarithm over `FAR` (or `SINGLE`,
for float32), with the special values of the theory often: zeros, ties, ends of ranges.
"""

import random
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

import rubberfric as rf

MATERIALS = ("rigid", "elastic", "prony", "table-fall", "table-hold", "table-none")
SPECTRA = (None, "affine", "table")
LAYERS = (None, "bonded", "frictionless")
SHIFTS = (None, "wlf", "arrhenius", "table")
ENTRIES = 4  # of a table


class Solid(NamedTuple):
    """Classes of one body."""

    material: str
    spectrum: str | None = None
    layer: str | None = None
    shift: str | None = None
    terms: int = 3  # of a Prony series


class Structure(NamedTuple):
    """Classes of a scene and of the conditions it is computed at."""

    lower: Solid
    upper: Solid
    area_correction: bool = False
    shear: str | None = None  # "plain", or the kind of its shift
    temperature: bool = False

    def __str__(self):
        solids = ["-".join(str(x) for x in solid[:4] if x) for solid in (self.lower, self.upper)]
        shear = self.shear and f"shear-{self.shear}"
        options = ("corrected" * self.area_correction, shear, "temperature" * self.temperature)
        return "_".join([*solids, *(option for option in options if option)])


class Ranges(NamedTuple):
    """Decades that numbers are drawn from, uniform in the logarithm."""

    modulus: tuple  # [Pa]
    tau: tuple  # [s]
    q0: tuple  # [1/m]
    width: tuple  # q1 / q0 or q[i + 1] / q[i] [-]
    height: tuple  # h_rms [m]
    thickness: tuple  # [m]
    speed: tuple  # [m/s]
    pressure: tuple  # [Pa]
    shear: tuple  # tau_f0 [Pa]
    least_C: float = 0.0  # [m^4]


FAR = Ranges(
    modulus=(-2.0, 14.0),
    tau=(-20.0, 20.0),
    q0=(-2.0, 8.0),
    width=(-3.0, 10.0),
    height=(-15.0, 3.0),
    thickness=(-10.0, 6.0),
    speed=(-30.0, 12.0),
    pressure=(-6.0, 12.0),
    shear=(-3.0, 12.0),
)

# Range of float32 for moduli, wavevectors and heights, with their squares.
SINGLE = FAR._replace(
    modulus=(3.0, 11.0),
    tau=(-14.0, 8.0),
    q0=(0.0, 6.0),
    width=(-3.0, 4.0),
    height=(-9.0, -2.0),
    thickness=(-6.0, 1.0),
    shear=(3.0, 9.0),
    least_C=1e-30,
)


def structures(count, seed):
    """`count` different structures, every class and option as likely as the others."""
    rng = random.Random(seed)
    found = {}
    while len(found) < count:
        solids = [
            Solid(*(rng.choice(kinds) for kinds in (MATERIALS, SPECTRA, LAYERS, SHIFTS)), rng.choice((1, 3)))
            for _ in range(2)
        ]
        solids = [_without_what_the_material_lacks(solid) for solid in solids]
        shear = rng.choice((None, None, None, "plain", "wlf", "arrhenius", "table"))
        shifted = any(solid.shift for solid in solids) or shear not in (None, "plain")
        structure = Structure(*solids, rng.random() < 0.5, shear, shifted and rng.random() < 0.7)
        deforms = any(solid.material != "rigid" for solid in solids)
        if deforms and any(solid.spectrum for solid in solids):
            found[structure] = None
    return list(found)


def _without_what_the_material_lacks(solid):
    if solid.material == "rigid":
        return solid._replace(layer=None, shift=None, terms=0)
    if solid.material == "elastic":
        return solid._replace(shift=None, terms=0)
    return solid if solid.material == "prony" else solid._replace(terms=0)


def decades(low, high):
    """10^low ... 10^high, uniform in the logarithm."""
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


# Slope of ln(q^4 C) over ln q: a hundred waves of one length have such a peak. For steeper ones see the
# limits of `rubberfric.TabulatedSpectrum`.
STEEPEST = 300.0

POISSON = st.one_of(st.sampled_from((0.5, 0.0)), st.floats(0.0, 0.5))
GAMMA = st.one_of(st.sampled_from((0.5, 0.0, 1.0)), st.floats(0.0, 1.0))
HURST = st.one_of(st.sampled_from((0.8, 0.0, 1e-9, 1.0)), st.floats(0.0, 1.0))
TEMPERATURE = st.one_of(st.sampled_from((293.15, 1.0, 1e4)), st.floats(200.0, 400.0))


def _vector(elements, size):
    return st.tuples(*[elements] * size)


@st.composite
def _prony(draw, terms, shift, ranges):
    E = np.array(draw(_vector(decades(*ranges.modulus), terms)))
    tau = np.array(draw(_vector(decades(*ranges.tau), terms)))
    E_inf = draw(decades(*ranges.modulus))
    special = draw(st.sampled_from((None, None, None, "liquid", "zeros", "one zero", "equal", "near")))
    if special == "liquid":
        E_inf = 0.0
    elif special == "zeros":
        E[:] = 0.0
    elif special == "one zero":
        E[0] = 0.0
    elif special == "equal":
        tau[:2] = tau[0]
    elif special == "near":
        tau[:2] = tau[0] * (1 + np.array([0.0, 1e-6]))[:terms]
    return rf.Prony(E_inf, E, tau, draw(POISSON), shift)


@st.composite
def _table(draw, outside, shift, ranges):
    steps = draw(_vector(decades(-3.0, ranges.tau[1] / 4), ENTRIES - 1))
    omega = draw(decades(ranges.tau[0], ranges.tau[0] / 4)) * np.cumprod([1.0, *(1 + np.array(steps))])
    # Limits of sums of relaxations, d ln E' / d ln omega = 0 ... 2 and d ln E'' / d ln omega = -1 ... 1,
    # and scatter of a factor 2 on top.
    scatter = [np.array(draw(_vector(st.floats(0.5, 2.0), ENTRIES))) for _ in range(2)]
    slopes = [np.array(draw(_vector(st.floats(*ends), ENTRIES - 1))) for ends in ((0.0, 2.0), (-1.0, 1.0))]
    curves = [np.cumsum([0.0, *(slope * np.diff(np.log(omega)))]) for slope in slopes]
    level = [draw(decades(*ranges.modulus)) for _ in range(2)]
    storage, loss = (
        value * np.exp(np.clip(curve, -100, 100)) * noise
        for value, curve, noise in zip(level, curves, scatter, strict=True)
    )
    if outside == "none":  # where E'' ends it falls by a factor as large as tan(delta), resolved up to 100
        loss = np.minimum(loss, 100 * storage)
    return rf.TabulatedModulus(omega, storage, loss, draw(POISSON), shift, outside)


def _material(draw, solid, shift, ranges):
    if solid.material == "rigid":
        return rf.Rigid()
    if solid.material == "elastic":
        return rf.Elastic(draw(decades(*ranges.modulus)), draw(POISSON))
    if solid.material == "prony":
        return draw(_prony(solid.terms, shift, ranges))
    return draw(_table(solid.material.removeprefix("table-"), shift, ranges))


@st.composite
def _shift(draw, kind, temperature):
    """A shift whose range holds the temperature."""
    T_ref = draw(st.one_of(st.just(temperature), st.floats(200.0, 400.0)))
    if kind == "wlf":
        # From 1e-6 K above the pole on.
        C2 = max(T_ref - temperature, 0.0) + draw(decades(-6.0, 4.0))
        return rf.WLF(draw(decades(-3.0, 3.0)), C2, T_ref)
    if kind == "arrhenius":
        return rf.Arrhenius(draw(decades(-3.0, 3.0)), T_ref)
    low, high = min(temperature, T_ref), max(temperature, T_ref)
    below, above = draw(_vector(st.one_of(st.just(0.0), decades(-3.0, 3.0)), 2))
    # Entries that float32 tells apart.
    ends = [low / (1 + below), high + above + max(1e-3, 1e-5 * high)]
    T = np.array([ends[0], *(ends[0] + (ends[1] - ends[0]) * np.linspace(0, 1, ENTRIES)[1:-1]), ends[1]])
    return rf.TabulatedShift(T, np.array(draw(_vector(decades(-12.0, 12.0), ENTRIES))), T_ref)


@st.composite
def _spectrum(draw, kind, ranges, ends):
    """A spectrum; `ends` are first and last wavevector of the other one, or nothing."""
    q0 = draw(decades(*ranges.q0))
    if ends and draw(st.booleans()):
        q0 = draw(st.sampled_from(ends))
    if kind == "table":
        gaps = np.log1p(draw(_vector(decades(-3.0, 3.0), ENTRIES - 1)))
        q = q0 * np.exp(np.cumsum([0.0, *gaps]))
        # ln(q^4 C) may rise and fall by 10 decades between two entries within the limit of its slope.
        steps, most = np.diff(draw(_vector(st.floats(-23.0, 23.0), ENTRIES))), STEEPEST * gaps
        steps = np.clip(steps, -most, most)
        height = draw(decades(*ranges.height)) * q0
        C = height**2 * np.exp(np.cumsum([0.0, *steps])) / q**4
        return rf.TabulatedSpectrum(q, np.maximum(C, ranges.least_C))
    q1 = q0 * (1 + draw(decades(*ranges.width)))
    if ends and ends[1] > q0 and draw(st.booleans()):
        q1 = ends[1]
    where = draw(st.one_of(st.sampled_from((0.5, 0.0, 1.0)), st.floats(0.0, 1.0)))
    qr = min(max(q0 * (q1 / q0) ** where, q0), q1) if 0 < where < 1 else (q0, q1)[int(where)]
    h_rms = draw(decades(*ranges.height)) if draw(st.integers(0, 7)) else 0.0
    return rf.SelfAffine(q0, qr, q1, draw(HURST), h_rms)


def _first_and_last(spectrum):
    if isinstance(spectrum, rf.TabulatedSpectrum):
        return float(spectrum.q[0]), float(spectrum.q[-1])
    return spectrum.q0, spectrum.q1


@st.composite
def calls(draw, structure, ranges=FAR):
    """Arguments of `rf.solve`, (scene, velocity, pressure[, temperature]), of a structure."""
    temperature = draw(TEMPERATURE)
    spectra, bodies = [], []
    for solid in (structure.lower, structure.upper):
        shift = draw(_shift(solid.shift, temperature)) if solid.shift else None
        material = _material(draw, solid, shift, ranges)
        layer = rf.Slab(draw(decades(*ranges.thickness)), solid.layer) if solid.layer else None
        spectrum = None
        if solid.spectrum:
            spectrum = draw(_spectrum(solid.spectrum, ranges, spectra and _first_and_last(spectra[0])))
            spectra.append(spectrum)
        bodies.append(rf.Body(material, spectrum, layer))
    shear = None
    if structure.shear:
        shift = draw(_shift(structure.shear, temperature)) if structure.shear != "plain" else None
        strength = st.one_of(st.just(0.0), decades(*ranges.shear))
        width = st.one_of(st.just(0.0), decades(-6.0, 3.0))
        shear = rf.ContactShear(draw(strength), draw(width), draw(decades(-12.0, 6.0)), shift)
    scene = rf.Scene(*bodies, draw(GAMMA), structure.area_correction, shear)
    usual = draw(st.booleans())  # half of them at speeds and pressures of daily life
    speed = draw(decades(-8.0, 2.0) if usual else st.one_of(st.just(0.0), decades(*ranges.speed)))
    pressure = draw(decades(3.0, 7.0) if usual else decades(*ranges.pressure))
    velocity = draw(st.sampled_from((1.0, -1.0))) * speed
    conditions = (velocity, pressure, temperature) if structure.temperature else (velocity, pressure)
    return scene, *conditions
