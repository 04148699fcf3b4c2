"""Prony series for OpenRadioss: /MAT/LAW42 with the relaxed moduli, /VISC/PRONY with what relaxes.

LAW42 with one term, alpha = 2, is neo-Hookean with the shear modulus mu; its bulk modulus follows from nu.
/VISC/PRONY adds the terms G_i exp(-beta_i t) of the shear and K_i exp(-beta_k t) of the bulk modulus. Neither
has a shift with temperature. Fields have 20 characters, counts 10.
[Altair Radioss Reference Guide, /MAT/LAW42 (OGDEN), /VISC/PRONY]
"""

import re
from collections.abc import Iterator

import numpy as np

from rubberfric.base.units import bulk_from_young, young_from_shear
from rubberfric.io.prony_cards.series import Format, Material, Series, Units, number, relaxing_alike, text_of
from rubberfric.materials.prony import PronyShear

NUMBER = 1  # of the material


def read(text: str, units: Units, poisson: float | None, _shift: bool) -> Material:
    """The first such material of a starter file."""
    law, prony = _block(text, r"/MAT/(?:LAW42|OGDEN)/"), _block(text, r"/VISC/PRONY/")
    # Title, density, nu, mu, a blank card, alpha, a blank card; one term.
    nu, mu, alpha = number(law[2][:20]), number(law[3][:20]), number(law[5][:20])
    if alpha != 2 or any(number(law[3][i : i + 20]) for i in range(20, 100, 20)):
        raise ValueError("/MAT/LAW42: must have one term with alpha = 2, a shear modulus that strain leaves")
    rows = [[number(card[i : i + 20]) for i in range(0, 80, 20)] for card in prony[1:] if card.strip()]
    if len(rows) != int(prony[0][:10]) or not rows:
        raise ValueError(
            f"/VISC/PRONY: has {len(rows)} terms: must have {prony[0][:10].strip()}, one at least"
        )
    G, beta, K, beta_k = np.array(rows).T
    rest, weights = mu * units.pascal, G * units.pascal
    bulk = float(bulk_from_young(young_from_shear(rest, nu), nu))
    if poisson is None and not K.any():
        return PronyShear(rest, weights, 1 / beta, bulk)
    alike = np.allclose(K * units.pascal * rest, weights * bulk, rtol=1e-6) and np.array_equal(beta, beta_k)
    if poisson is None and not alike:
        raise ValueError(
            "/VISC/PRONY: bulk terms must be 0 or relax as the shear terms do; poisson=... takes"
            " the shear series alone"
        )
    return relaxing_alike(rest, weights, 1 / beta, nu if poisson is None else poisson, None)


def write(series: Series, units: Units, mass: float | None, name: str) -> Iterator[str]:
    """Lines of a starter file."""
    if mass is None:
        raise ValueError("density is missing: must be given for openradioss [kg/m^3]")
    if series.poisson >= 0.5:
        raise ValueError("bulk is missing: must be given for openradioss, such as 2e9 [Pa]")
    if series.rest <= 0:
        raise ValueError("material has no relaxed modulus: it must be > 0 for openradioss, as mu of LAW42")
    glassy_bulk = float(bulk_from_young(young_from_shear(series.shear, series.poisson), series.poisson))
    G, K = series.rest * series.shear, glassy_bulk * (series.rest if series.k.any() else 1.0)
    nu = (3 * K - 2 * G) / (2 * (3 * K + G))
    yield f"/MAT/LAW42/{NUMBER}"
    yield name
    yield "#              RHO_I"
    yield _fields(mass)
    yield "#                 Nu           sigma_cut          funIDbulk         Fscale_bulk         M    I_f"
    yield _fields(nu, 0.0) + " " * 10 + f"{0:10d}" + _fields(0.0) + f"{0:10d}{0:10d}"
    yield "#" + "".join(f"{f'mu_{i}':>20}" for i in range(1, 6))[1:]
    yield _fields(G / units.pascal, 0.0, 0.0, 0.0, 0.0)
    yield ""
    yield "#" + "".join(f"{f'alpha_{i}':>20}" for i in range(1, 6))[1:]
    yield _fields(2.0, 0.0, 0.0, 0.0, 0.0)
    yield ""
    yield f"/VISC/PRONY/{NUMBER}"
    yield "#        M                           K_v      Itab    Ishape"
    yield f"{series.tau.size:10d}" + " " * 10 + _fields(0.0) + f"{0:10d}{0:10d}"
    yield "#                G_i              beta_i                 K_i              beta_k"
    for g, k, tau in zip(series.g, series.k, series.tau, strict=True):
        bulk = k * glassy_bulk / units.pascal
        yield _fields(g * series.shear / units.pascal, 1 / tau, bulk, 1 / tau if bulk else 0.0)


OPENRADIOSS = Format(r"^/VISC/PRONY/", False, "#", read, write)


def _block(text: str, pattern: str) -> list[str]:
    """The cards of the first block with that keyword, without comments."""
    lines = [line for line in text.splitlines() if not re.match(r"[#$]", line)]
    for i, line in enumerate(lines):
        if re.match(pattern, line, re.I):
            end = next((j for j in range(i + 1, len(lines)) if lines[j].startswith("/")), len(lines))
            if end > i + (6 if "MAT" in pattern else 1):
                return lines[i + 1 : end]
    raise ValueError(f"has no whole {pattern.split('(')[0].rstrip('/')}: must be there")


def _fields(*values: float) -> str:
    return "".join(f"{text_of(value):>20}" for value in values)
