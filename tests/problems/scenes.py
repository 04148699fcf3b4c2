"""Scenes by name: every kind of part, alone and together with others."""

import numpy as np
import pytest
from support.cases.stored import reference, slow_if
from support.cases.stored import scene as scene_of

import rubberfric as rf
from problems.problem import Problem
from problems.solids import (
    ELASTIC,
    FINE,
    GROOVES,
    HEATING,
    RIGID,
    ROAD,
    SHEAR,
    SHIFTED_TREAD,
    SOFT,
    SOFTENING,
    STEEL,
    TREAD,
    WLF,
    WORN,
    scene,
)

Q = np.geomspace(100.0, 3.1e4, 6)
C = np.geomspace(1e-13, 1e-19, 6)
OMEGA = np.logspace(0, 6, 7)
SHIFTS = rf.TabulatedShift(
    [263.15, 288.15, 323.15],
    [30.0, 1.6, 0.1],
    293.15,
    vertical=rf.TabulatedVertical([263.0, 323.0], [1.2, 0.7]),
)
TABLE = rf.TabulatedModulus(OMEGA, np.geomspace(3e6, 3e8, 7), np.geomspace(1e5, 1e8, 7))
RELAXING_SHEAR = rf.PronyShear(1e6, [1e8, 1e7], [1e-6, 1e-3], 2e9, WLF)
HOT = rf.Prony(2e6, [2e8, 2e7], [1e-6, 1e-4], 0.49, rf.Arrhenius(1.0, 293.15, vertical=rf.Entropic()))
MELT = TREAD.replace(E_inf=0.0)
PLATE = rf.TabulatedSpectrum(Q, C)
# The waves turn from one direction to others over q.
DIRECTIONS = rf.TabulatedAnisotropic(
    Q, C[:, None] * np.array([1.0, 2.0, 1.5, 1.2]) ** np.linspace(1.0, -0.5, 6)[:, None]
)
TREAD_ON_SOFT = TREAD, None, rf.Coating(1e-3, SOFT)
# Gentle roughness, within the limits of the law.
GENTLE = rf.SelfAffine(100.0, 400.0, 1e4, 0.8, 2e-4)
GEL = rf.Prony(1e6, [9e6, 3e6], [1e-3, 1e-1])
LAW = {"contact_model": "boundary_elements"}
OMEGA_OF_GEL = np.logspace(-4, 8, 25)
MODULUS_OF_GEL = np.asarray(rf.complex_modulus(GEL, OMEGA_OF_GEL))
TABLE_OF_GEL = rf.TabulatedModulus(OMEGA_OF_GEL, MODULUS_OF_GEL.real, MODULUS_OF_GEL.imag)


def on_road(*body, road=ROAD, **options):
    """A body on rough rigid ground."""
    return scene((RIGID, road), body, **options)


# By the contact model and the equations of the paper: scene, velocity [m/s], pressure [Pa], temperature [K].
OF_PAPER = {
    "rubber": (on_road(TREAD), 1e-2, 3e5),
    "light load": (on_road(TREAD), 1e-2, 1e1),
    "heavy load": (on_road(TREAD), 1e-2, 1e7),
    "backwards": (on_road(TREAD), -3.0, 3e5),
    "rest": (on_road(TREAD), 0.0, 3e5),
    "liquid": (on_road(MELT), 1e-2, 3e5),
    "flat spectrum": (on_road(TREAD, road=ROAD.replace(hurst=0.0)), 1e-2, 3e5),
    "short plateau": (on_road(SOFT, road=ROAD.replace(qr=150.0)), 1.0, 3e5),
    "rough rubber": (on_road(SHIFTED_TREAD, WORN), 1e-3, 2e5, 283.15),
    "two rubbers": (scene((SOFT, WORN), (SHIFTED_TREAD, ROAD)), 1e-1, 3e5, 283.15),
    "vertical shift": (scene((HOT, WORN), (SHIFTED_TREAD, ROAD)), 1e-1, 3e5, 303.15),
    "vertical shift of rough rubber": (on_road(HOT, WORN), 1e-1, 3e5, 303.15),
    "rubber on elastic": (scene((ELASTIC, ROAD), (TREAD,)), 1e-2, 3e5),
    "slab": (on_road(TREAD, None, rf.Slab(1e-3)), 1e-2, 1e6),
    "frictionless slab": (on_road(TREAD, None, rf.Slab(2e-3, "frictionless")), 1e-2, 2e5),
    "slabs": (scene((STEEL, WORN, rf.Slab(1e-3, "frictionless")), (SOFT, ROAD, rf.Slab(2e-3))), 1e-2, 1e6),
    "two slabs": (scene((SOFT, WORN, rf.Slab(1e-3)), (TREAD, ROAD, rf.Slab(3e-4))), 0.1, 3e5),
    "shear relaxes": (on_road(RELAXING_SHEAR), 1e-1, 3e5, 283.15),
    "shear relaxes on elastic": (scene((STEEL, WORN), (RELAXING_SHEAR, ROAD)), 3e-2, 2e5, 283.15),
    "shear relaxes on a slab": (
        scene((SOFT, WORN, rf.Slab(1e-3)), (RELAXING_SHEAR.replace(bulk=1e6), ROAD)),
        3e-2,
        2e5,
        283.15,
    ),
    "elastic": (scene((STEEL, ROAD), (rf.Elastic(1e7, 0.5),)), 1.0, 3e5),
    "two elastic": (scene((rf.Elastic(3e6, 0.4), WORN), (rf.Elastic(2e7, 0.3), ROAD)), 0.1, 3e5),
    "rigid on rough rubber": (scene((TREAD, ROAD), (RIGID,)), 1.0, 3e5),
    "rubber on rough rubber": (scene((TREAD, ROAD), (SOFT,)), 1.0, 3e5),
    "tabulated spectrum": (on_road(TREAD, road=PLATE), 1e-2, 1e5),
    "S in G": (on_road(TREAD, gamma=0.6, area_correction=True), 1e-2, 3e5),
    "S in G, two rough": (on_road(SOFT, WORN, area_correction=True), 0.1, 3e5),
    "S in G, contact shear": (
        on_road(SHIFTED_TREAD, gamma=0.6, area_correction=True, shear=SHEAR),
        1e-2,
        3e5,
        283.15,
    ),
    "contact shear": (on_road(SHIFTED_TREAD, shear=SHEAR), 1e-2, 3e5, 283.15),
    "tabulated modulus": (on_road(TABLE.replace(shift=SHIFTS)), 1e-2, 3e5, 283.15),
    "table of shifts": (on_road(TREAD.replace(shift=SHIFTS)), 0.02, 2e5, 303.0),
}
OTHERS = {
    "correlation": (scene((TREAD, WORN), (ELASTIC, ROAD), correlation=rf.Correlation(0.6)), 0.0, 2e5),
    "rubber on elastic base": (on_road(TREAD, None, rf.Coating(2e-3, ELASTIC)), 0.02, 2e5),
    "rubber on rubber base": (on_road(*TREAD_ON_SOFT), 0.02, 2e5),
    "elastic on rubber base": (on_road(rf.Elastic(1e9, 0.35), None, rf.Coating(2e-4, TREAD)), 0.03, 2e5),
    "coating facing elastic": (scene((STEEL, ROAD), TREAD_ON_SOFT), 0.03, 2e5),
    "grooves": (on_road(TREAD, road=GROOVES), 0.02, 2e5),
    "grooves of two rubbers": (scene((SOFT, GROOVES), (TREAD, WORN)), 0.02, 2e5),
    "table of directions": (on_road(TREAD, road=DIRECTIONS), 0.02, 2e5),
    "softening": (on_road(TREAD, softening=SOFTENING), 0.02, 2e5),
    "softening of a table": (on_road(TABLE, softening=SOFTENING), 0.02, 2e5),
    "softening on elastic": (scene((TREAD,), (ELASTIC, ROAD), softening=SOFTENING), 0.02, 2e5),
    "softening of two rubbers": (scene((TREAD, WORN), (SOFT, ROAD), softening=SOFTENING), 0.02, 2e5),
    "short-range adhesion": (on_road(TREAD, road=FINE, adhesion=rf.Adhesion(0.002)), 1e-4, 2e5),
    "long-range adhesion": (
        on_road(TREAD, road=FINE, adhesion=rf.Adhesion(0.05, limit="long", range=5e-7)),
        1e-4,
        2e5,
    ),
    "heating": (on_road(SHIFTED_TREAD, heating=HEATING), 0.02, 2e5, 303.0),
    "heating with shear": (on_road(SHIFTED_TREAD, heating=HEATING, shear=SHEAR), 0.02, 2e5, 303.0),
    "heating of macroasperities": (
        scene(
            (SOFT.replace(shift=WLF), WORN),
            (SHIFTED_TREAD, ROAD),
            heating=HEATING.replace(area_fraction=None),
        ),
        0.3,
        1e6,
        290.0,
    ),
    "heating, shear of the background": (
        on_road(SHIFTED_TREAD, heating=HEATING.replace(shear_at="background"), shear=SHEAR),
        0.02,
        2e5,
        303.0,
    ),
    "heating of two bodies": (
        rf.Scene(
            rf.Body(STEEL, ROAD, thermal=rf.ThermalProperties(2.4e3, 0.9e3, 1.5)),
            rf.Body(SHIFTED_TREAD),
            heating=HEATING,
        ),
        0.02,
        2e5,
        303.0,
    ),
    "law": (on_road(GEL, road=GENTLE, **LAW), 0.3, 2e5),
    "law, liquid": (on_road(GEL.replace(E_inf=0.0), road=GENTLE, **LAW), 0.3, 2e5),
    "law, slab": (on_road(GEL, None, rf.Slab(5e-3), road=GENTLE, **LAW), 0.3, 2e5),
    "law, grooves": (on_road(GEL, road=rf.Anisotropic(GENTLE, 1.6, 0.5), **LAW), 0.3, 2e5),
    "law, table": (on_road(TABLE_OF_GEL, road=GENTLE, **LAW), 0.3, 2e5),
    "law, liquid on rough elastic": (scene((STEEL, GENTLE), (GEL.replace(E_inf=0.0),), **LAW), 0.3, 2e5),
    "law, rough elastic": (scene((STEEL, GENTLE), (SHIFTED_TREAD,), shear=SHEAR, **LAW), 0.3, 2e5, 283.0),
}
PROBLEMS = {
    name: Problem(name, *numbers, source=source)
    for source, problems in (("paper", OF_PAPER), ("", OTHERS))
    for name, numbers in problems.items()
}


def stored(*files):
    """Problems of files of tests/reference, such as "part_cases"."""
    return [
        Problem(name, scene_of(case), case["v"], case["pressure"], case.get("temperature"), file, case)
        for file in files
        for name, case in reference(file).items()
    ]


def having(*tags, without=(), among=None):
    """Problems that have all of these tags and none of `without`."""
    problems = PROBLEMS.values() if among is None else among
    tagged = [(problem, problem.tags) for problem in problems]
    return [problem for problem, has in tagged if set(tags) <= has and not has & set(without)]


def distinct(problems):
    """The first problem of each structure."""
    first = {}
    for problem in problems:
        first.setdefault(problem.structure, problem)
    return list(first.values())


def covering(problems, also=()):
    """Few problems that together have every part that any of them has, and those named in `also`.

    The next one is always the first problem that adds most.
    """
    parts = {problem.name: problem.structure for problem in problems}
    names = [name for name in parts if name in also]
    missing = set().union(*parts.values()).difference(*(parts[name] for name in names))
    while missing:
        names.append(max(parts, key=lambda name: len(parts[name] & missing)))
        missing -= parts[names[-1]]
    return [problem for problem in problems if problem.name in names]


def each(problems, ordinary):
    """Run a test with each `problem`. All but those named in `ordinary` are slow."""
    by_name = {problem.name: problem for problem in problems}
    assert set(ordinary) <= set(by_name), set(ordinary) - set(by_name)
    return pytest.mark.parametrize("problem", slow_if(lambda name: name not in ordinary, by_name))
