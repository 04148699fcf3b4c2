"""Reference scenes as library objects, and the jitted functions that the test modules share."""

import functools
import json
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.folders import REFERENCE

import rubberfric as rf

FOLDER = REFERENCE
QUANTITIES = ("area", "friction", "separation")


@functools.cache
def reference(name):
    """The scenes of reference/<name>.json by their names."""
    scenes = json.loads((FOLDER / f"{name}.json").read_text())
    return {scene["name"]: scene for scene in scenes}


def scene(case):
    """The rf.Scene of a case."""
    lower, upper = (
        rf.Body(
            _material(case[solid]),
            _spectrum(case[psd]),
            _layer(case[solid]),
            _thermal(case[solid]),
            _softening(case[solid]),
        )
        for solid, psd in (("solid1", "psd1"), ("solid2", "psd2"))
    )
    heating, shear = (case.get(name) for name in ("heating", "shear"))
    return rf.Scene(
        lower,
        upper,
        case["gamma"],
        area_correction=case.get("area_correction", False),
        shear=shear and rf.ContactShear(**shear | {"shift": _shift(shear["shift"])}),
        heating=heating and rf.Heating(**heating),
        softening=_softening(case),
    )


def slow_if(test, found):
    """Parameters of a test, those whose names pass `test` in the slow set; `found`: by name, or names."""
    found = found if isinstance(found, dict) else {name: name for name in found}
    return [
        pytest.param(value, id=str(name), marks=[pytest.mark.slow] * bool(test(name)))
        for name, value in found.items()
    ]


def as_arrays(tree, dtype=float):
    return jax.tree.map(lambda x: jnp.asarray(x, dtype), tree)


def arguments(case, dtype=float):
    """Arguments of `rf.solve` for a case, all leaves arrays."""
    temperature = case.get("temperature")
    rest = (
        (case["v"], case["pressure"]) if temperature is None else (case["v"], case["pressure"], temperature)
    )
    return as_arrays((scene(case), *rest), dtype)


def three(solution):
    """Area, friction and separation of a solution."""
    return [getattr(solution, quantity) for quantity in QUANTITIES]


def quantities(arguments):
    """Return area, friction and separation in one array."""
    return jnp.stack(three(rf.solve(*arguments)))


# Compiled once for every structure of scene that the test modules share.
value = jax.jit(quantities)


def with_jacobian(function):
    """Return a compiled function to the values of a function and their Jacobian by reverse mode."""

    def twice(arguments):
        found = function(arguments)
        return found, found

    return jax.jit(lambda arguments: jax.jacrev(twice, has_aux=True)(arguments)[::-1])


reverse = with_jacobian(quantities)


def h_rms(case):
    """Root of the summed squares of both rms heights: the length a separation is small against."""
    total = 0.0
    for psd in (case["psd1"], case["psd2"]):
        if psd is not None and "h_rms" in psd:
            total += psd["h_rms"] ** 2
        elif psd is not None:
            total += float(rf.roughness.moment(_spectrum(psd), 0))
    return np.sqrt(total)


def paths(tree):
    """Names of the leaves, in the order of flattening."""
    return [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_flatten_with_path(tree)[0]]


# Words of the library's paths, and those of the cases.
WORDS = {
    r"\.spectrum\.base\.": ".spectrum.",
    r"\blower\.(material|layer)\b": "solid1",
    r"\bupper\.(material|layer)\b": "solid2",
    r"\blower\.spectrum\b": "psd1",
    r"\bupper\.spectrum\b": "psd2",
    r"\bpoisson\b": "nu",
    r"\byoung\b": "E",
    r"\bhurst\b": "H",
}


def names_of(tree):
    """The name that a case's dictionary has for every leaf element of its arguments: psd2.q0, solid1.E.2."""
    names = []
    for path, leaf in zip(paths(tree), jax.tree.leaves(tree), strict=True):
        number, name = re.fullmatch(r"\[(\d)\]\.?(.*)", path).groups()
        for word, own in WORDS.items():
            name = re.sub(word, own, name)
        name = name or (None, "v", "pressure", "temperature")[int(number)]
        names += [".".join([name, *map(str, index)]) for index in np.ndindex(leaf.shape)]
    return names


def elements(jacobian):
    """A Jacobian as (leaf element, quantity)."""
    rows = [np.asarray(x, float).reshape(len(x), -1).T for x in jax.tree.leaves(jacobian)]
    return np.concatenate(rows)


def _material(data):
    kind, shift = data["kind"], _shift(data.get("shift"))
    if kind == "rigid":
        return rf.Rigid()
    if kind == "elastic":
        return rf.Elastic(data["E"], data["nu"])
    if kind == "prony":
        return rf.Prony(data["E_inf"], data["E"], data["tau"], data["nu"], shift)
    if kind == "shear":
        return rf.PronyShear(data["G_inf"], data["G"], data["tau"], data["bulk"], shift)
    table = (np.array(data[name]) for name in ("omega", "storage", "loss"))
    return rf.TabulatedModulus(*table, data["nu"], shift, data.get("outside", "fall"))


def _shift(data):
    if data is None:
        return None
    kinds = {"wlf": rf.WLF, "arrhenius": rf.Arrhenius, "table": rf.TabulatedShift}
    values = {name: value for name, value in data.items() if name not in ("kind", "vertical")}
    if "vertical" in data:
        law = {name: value for name, value in data["vertical"].items() if name != "kind"}
        vertical = {"entropic": rf.Entropic, "table": rf.TabulatedVertical}[data["vertical"]["kind"]]
        values["vertical"] = vertical(**law)
    return kinds[data["kind"]](**values)


def _spectrum(data):
    if data is None:
        return None
    if "C" in data:
        q, C = np.array(data["q"]), np.array(data["C"])
        return rf.TabulatedSpectrum(q, C) if C.ndim == 1 else rf.TabulatedAnisotropic(q, C, data["angle"])
    base = rf.SelfAffine(data["q0"], data["qr"], data["q1"], data["H"], data["h_rms"])
    if "ratio" not in data:
        return base
    return rf.Anisotropic(base, data["ratio"], data["angle"], data.get("harmonics", 16))


def _softening(data):
    softening = data.get("softening")
    return None if softening is None else rf.Softening(**{k: np.array(x) for k, x in softening.items()})


def _thermal(data):
    return rf.ThermalProperties(**data["thermal"]) if "thermal" in data else None


def _layer(data):
    if "coating" in data:
        return rf.Coating(data["coating"]["thickness"], _material(data["coating"]["base"]))
    thickness = data.get("thickness")
    return None if thickness is None else rf.Slab(thickness, data.get("base", "bonded"))
