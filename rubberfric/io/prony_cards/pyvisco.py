"""Prony series as the CSV table of pyvisco: a row for each term, of Young's modulus or a shear modulus."""

from collections.abc import Iterator

import numpy as np

from rubberfric.base.units import young_from_shear
from rubberfric.io.prony_cards.series import STRESS, Format, Material, Series, Units, from_relative, number


def read(text: str, units: Units, poisson: float | None, _shift: bool) -> Material:
    """The material of a table, which says its units itself."""
    names, given, *rows = (
        [field.strip() for field in line.split(",")] for line in text.splitlines() if line.strip()
    )
    letter = next((name[0] for name in names if name in ("E_0", "G_0")), None)
    if letter is None or "tau_i" not in names or "alpha_i" not in names:
        raise ValueError(f"columns {', '.join(names)}: must have tau_i, alpha_i and E_0 or G_0")
    if letter == "G" and poisson is None:
        raise ValueError("G_0 is a shear modulus: poisson must be given, E = 2 (1 + poisson) G")
    unit = given[names.index(f"{letter}_0")]
    if unit not in STRESS or units.stress not in (None, unit):
        raise ValueError(f"column {letter}_0: unit {unit!r}: must be {units.stress or ', '.join(STRESS)}")
    tau, g, moduli = (
        np.array([number(row[names.index(name)]) for row in rows])
        for name in ("tau_i", "alpha_i", f"{letter}_0")
    )
    nu = 0.5 if poisson is None else poisson
    modulus = float(moduli[0]) * STRESS[unit]
    young = modulus if letter == "E" else young_from_shear(modulus, nu)
    return from_relative(young, nu, False, g, g, tau, nu, None)


def write(series: Series, units: Units, _mass: float | None, _name: str) -> Iterator[str]:
    """Lines of a table of Young's modulus."""
    if not (series.k == series.g).all() and series.poisson < 0.5:
        raise ValueError(
            "material has an elastic bulk modulus: pyvisco must have one series of Young's modulus"
        )
    young = series.young(units)
    yield "i,tau_i,alpha_i,E_0,E_i"
    yield f"-,s,-,{units.stress},{units.stress}"
    for i, (g, tau) in enumerate(zip(series.g.tolist(), series.tau.tolist(), strict=True), start=1):
        yield f"{i},{tau!r},{g!r},{young!r},{g * young!r}"


PYVISCO = Format(r"\btau_i\b", False, "", read, write)
