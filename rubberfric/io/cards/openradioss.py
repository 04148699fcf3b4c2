"""OpenRadioss: /MAT/LAW42 and /VISC/PRONY.

/MAT/LAW42 is Ogden's energy, with the relaxed shear modulus sum(mu_i alpha_i) / 2 and the bulk modulus of nu.
/VISC/PRONY adds G_i exp(-beta_i t) and K_i exp(-beta_k t) to the material with the same number. [Reference
Guide]
"""

import re
from collections.abc import Iterator

import numpy as np

from rubberfric.base.units import young_from_shear
from rubberfric.io.cards.contents import CardMaterial, CardOptions, Cards, CardSeries, glassy_bulk
from rubberfric.io.cards.hyperelastic import ogden_shear
from rubberfric.io.cards.text import STRESS, keyword_blocks, need, wide_line, wide_numbers

SIGN = "^/VISC/PRONY/"
# Units of mass [kg].
_MASS = {"kg": 1.0, "g": 1e-3, "Mg": 1e3, "t": 1e3, "ton": 1e3}
# Units of length [m].
_LENGTH = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}
# Units of time [s].
_TIME = {"s": 1.0, "ms": 1e-3}


def read(text: str, options: CardOptions) -> list[CardMaterial]:
    """Return the materials with /VISC/PRONY."""
    blocks = keyword_blocks(text, "[#$]", "/")
    laws: dict[str, list[tuple[str, list[str]]]] = {}
    for line, data in blocks:
        if match := re.match("/MAT/(LAW42|OGDEN)/([^/]*)", line, re.I):
            laws.setdefault(match[2].strip(), []).append((line, data))
    materials = []
    for line, data in blocks:
        if match := re.match("/VISC/PRONY/([^/]*)", line, re.I):
            number = match[1].strip()
            law = laws.get(number, [])
            names = (number, *(data[0].strip() for _, data in law[:1] if data))
            materials.append(
                CardMaterial(
                    tuple(name for name in names if name),
                    lambda law=law, series=(line, data): _cards(blocks, law, series, options),
                )
            )
    return materials


def _check_units(blocks, options):
    """Raise ValueError if the units of /BEGIN contradict the options, or are no seconds."""
    for line, data in blocks:
        if re.match("/BEGIN", line, re.I) and len(data) >= 3:
            mass, length, time = (data[2][i : i + 20].strip() for i in (0, 20, 40))
            known = mass in _MASS and length in _LENGTH and time in _TIME
            need(known and time == "s", f"/BEGIN states the units {mass}, {length}, {time}: must be in s")
            stress = _MASS[mass] / _LENGTH[length] / _TIME[time] ** 2
            message = f"/BEGIN states the units {mass}, {length}, {time}, a stress of {stress:g} Pa"
            unit_stress = options.stress or "Pa"
            need(
                np.isclose(stress, STRESS[unit_stress]),
                f"{message}: must agree with unit_stress = {unit_stress!r}",
            )


def _cards(blocks, laws, series, options):
    _check_units(blocks, options)
    line, (count, *terms) = series[0], series[1] or [""]
    need(laws and len(laws[0][1]) >= 6, f"/MAT/LAW42 is missing or incomplete for {line}: must be given")
    need(len(laws) == 1, f"/MAT/LAW42 is given {len(laws)} times for {line}: must be given once")
    for keyword in (line, laws[0][0]):
        message = f"{keyword} has its own units: must have the units of the file"
        need(len(keyword.strip("/").split("/")) == 3, message)
    _, _, head, *moduli = laws[0][1]
    nu, function, order = wide_numbers(head, 1)[0], head[50:60], head[80:90]
    need(not function.strip(" 0"), f"/MAT/LAW42 has the bulk function {function.strip()}: must have none")
    need(not order.strip(" 0"), f"/MAT/LAW42 has M = {order.strip()} Maxwell terms: must be 0")
    need(0 <= nu <= 0.5, f"/MAT/LAW42: nu = {nu:g}: must be 0 ... 0.5")
    mu, alpha = ([x for card in cards for x in wide_numbers(card, 5)] for cards in (moduli[:2], moduli[2:4]))
    shear = ogden_shear(mu, [*alpha, *[0.0] * (len(mu) - len(alpha))])
    need(shear > 0, f"/MAT/LAW42: shear modulus {shear:g} at small strain: must be > 0")
    table = count[40:50].strip(" 0")
    need(not table, f"/VISC/PRONY has Itab = {table}: must be 0, with terms")
    viscous = wide_numbers(count[20:40], 1)[0]
    need(not viscous, f"/VISC/PRONY has K_v = {viscous:g}: must be 0")
    rows = [wide_numbers(card, 4) for card in terms if card.strip()]
    stated = count[:10].strip()
    message = f"/VISC/PRONY has {len(rows)} terms, but its first card states {stated or 'no number'}"
    agree = rows and stated.isdigit() and len(rows) == int(stated)
    need(agree, f"{message}: the numbers must agree and be at least 1")
    G, beta, K, beta_k = np.array(rows).T
    need((beta > 0).all(), f"/VISC/PRONY has the rate {beta.min():g}: must be > 0")
    agree = options.poisson is not None or np.array_equal(beta[K != 0], beta_k[K != 0])
    need(agree, "/VISC/PRONY: beta_k must equal beta_i; poisson=... reads the shear series only")
    bulk = glassy_bulk(young_from_shear(shear, nu), nu)
    return Cards(shear, G, K / (bulk + K.sum()), 1 / beta, nu, bulk)


def write(series: CardSeries) -> Iterator[str]:
    """Yield the lines of the cards."""
    G, K = series.rest * series.shear, series.bulk * (series.rest if series.k.any() else 1.0)
    nu = (3 * K - 2 * G) / (2 * (3 * K + G))
    assert series.mass is not None
    yield from ("/MAT/LAW42/1", series.name, "#              RHO_I", wide_line(series.mass))
    yield "#                 Nu           sigma_cut          funIDbulk         Fscale_bulk         M    I_f"
    yield wide_line(nu, 0.0) + " " * 10 + f"{0:10d}" + wide_line(0.0) + f"{0:10d}{0:10d}"
    for name, value in (("mu", G), ("alpha", 2.0)):
        yield "#" + "".join(f"{f'{name}_{i}':>20}" for i in range(1, 6))[1:]
        yield from (wide_line(value, 0.0, 0.0, 0.0, 0.0), "")
    yield "/VISC/PRONY/1"
    yield "#        M                           K_v      Itab    Ishape"
    yield f"{series.tau.size:10d}" + " " * 10 + wide_line(0.0) + f"{0:10d}{0:10d}"
    yield "#                G_i              beta_i                 K_i              beta_k"
    for g, k, tau in zip(series.g, series.k, series.tau, strict=True):
        yield wide_line(g * series.shear, 1 / tau, k * series.bulk if k else 0.0, 1 / tau if k else 0.0)
