"""Scene files as Python tables: every kind and key, and the curves that they name."""

import copy

WLF = {"kind": "wlf", "C1": 8.0, "C2": 100.0, "T_ref": 293.15}
ARRHENIUS = {"kind": "arrhenius", "energy": 0.97, "T_ref": 293.15}
SHIFT_TABLE = {"kind": "table", "file": "shift.csv", "T_ref": 293.15}
PRONY = {"kind": "prony", "E_inf": 1e6, "E": [1e6, 2e6], "tau": [1e-3, 1.0], "poisson": 0.5, "shift": WLF}
PRONY_SHEAR = {"kind": "prony_shear", "G_inf": 1e6, "G": [1e8, 1e6], "tau": [1e-6, 1.0], "bulk": 2e9}
MODULUS = {
    "kind": "tabulated",
    "file": "modulus.csv",
    "poisson": 0.4,
    "outside": "hold",
    "shift": SHIFT_TABLE,
}
AFFINE = {"kind": "self_affine", "q0": 1e2, "qr": 1e3, "q1": 1e5, "hurst": 0.8, "h_rms": 1e-4}
STRETCHED = {"kind": "anisotropic", "base": AFFINE, "ratio": 2.0, "angle": 0.3, "harmonics": 32}
SPECTRUM = {"kind": "tabulated", "file": "spectrum.csv", "normalisation": "C"}
DIRECTIONS = {
    "kind": "tabulated_anisotropic",
    "file": "directions.csv",
    "normalisation": "C_iso",
    "angle": -0.2,
}
BASE = {"kind": "prony", "E_inf": 1e6, "E": [1e6], "tau": [1e-3], "poisson": 0.3}
COATING = {"kind": "coating", "thickness": 1e-3, "base": BASE}
HEATING = {"density": 1.2e3, "heat_capacity": 1.6e3, "conductivity": 0.23, "radius": 1e-3}
FULL = {
    "title": "Everything",
    "gamma": 0.45,
    "area_correction": True,
    "lower": {"material": PRONY, "spectrum": AFFINE, "layer": {"thickness": 1e-3, "base": "frictionless"}},
    "upper": {"material": MODULUS, "spectrum": SPECTRUM},
    "shear": {"tau_f0": 6.5e6, "c": 0.1, "v0": 6e-3, "shift": ARRHENIUS},
    "run": {"velocity": [1e-3, 1.0], "pressure": 1e5, "temperature": [283.15, 293.15]},
}


def directions(unit="deg", q=("0.1", "1"), step=36.0, order=slice(None)):
    """A long table of five directions, phi or phi_deg."""
    name = "phi_deg" if unit == "deg" else "phi"
    rows = [f"{q[i // 5]},{i % 5 * step!r},{i + 1}\n" for i in range(10)]
    return f"q,{name},C\n1/mm,{unit},um^4\n" + "".join(rows[order])


CURVES = {
    "modulus.csv": "f,E_stor,E_loss\nHz,MPa,kPa\n1e-3,1,100\n1,2,200\n1e3,3,100\n",
    "shift.csv": "T,aT\nC,-\n0,10\n20,1\n40,0.1\n",
    "spectrum.csv": "q,C\n1/mm,um^4\n0.1,1e12\n1,1e9\n",
    "softening.csv": "strain,storage_factor,loss_factor\n%,-,-\n1,1,1\n10,0.7,1.1\n100,0.4,0.6\n",
    "directions.csv": directions(),
}


def put(content, changes):
    """A copy of a scene file's content with key paths set, or removed where the value is `...`."""
    content = copy.deepcopy(content)
    for key, value in changes.items():
        *parents, last = key.split(".")
        table = content
        for name in parents:
            table = table[name]
        if value is ...:
            del table[last]
        else:
            table[last] = value
    return content


SCENES = {
    "full": FULL,
    "coated": put(FULL, {"lower.layer": COATING, "upper.material": PRONY_SHEAR}),
    "anisotropic": put(FULL, {"lower.spectrum": STRETCHED, "upper.spectrum": DIRECTIONS}),
    "heated": put(FULL, {"softening": {"file": "softening.csv"}, "heating": HEATING}),
}


def as_toml(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {as_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


def write_scene(folder, content, **curves):
    """Write a scene file and its curves, some of them with another text; the path."""
    for name, text in CURVES.items():
        (folder / name).write_text(curves.get(name.removesuffix(".csv"), text))
    path = folder / "scene.toml"
    path.write_text("".join(f"{key} = {as_toml(value)}\n" for key, value in content.items()), "utf-8")
    return path
