"""Recompute the stored scenes of one file by brute force, with the program of `tests/support/oracles`.

    PYTHONPATH=.:tests python tests/reference/make_cases.py option|derivative|part|heated [NAME ...]

`FILE_cases.json` holds the scenes, as `oracle.py` describes them, with their quantities. Scenes that are
named are made again, without names all: minutes a file. A new scene is an entry with its name and numbers;
"derivatives" holds the names of the parameters to differentiate by, as keys. A derivative is
d quantity / d ln parameter, with respect to an angle d quantity / d angle. Central differences of the sixth
order are good to 1e-10 of the value.
"""

import json
import sys

import numpy as np
from support.folders import REFERENCE
from support.oracles import oracle, oracle_heating

# Halvings and order of the panels, for values and for derivatives.
MESHES = {"option": ((150, 12), None), "derivative": ((150, 12), (90, 12)), "part": ((50, 16), (30, 10))}
# Weights of the central difference of sixth order.
WEIGHTS = (3 / 4, -3 / 20, 1 / 60)


def step_of(scene, path):
    """Knots of the strain must not pass kinks of a spectrum, nor Poisson's ratio 1/2 by much."""
    if "softening" in scene:
        return 1e-3
    return 2e-3 if path[-1] in ("nu", "T_ref", "temperature", "H") else 5e-3


def moved(scene, path, step):
    """A copy with one number larger by the step, in the logarithm unless it is an angle."""
    key, *rest = path
    if rest:
        new = moved(scene[key], rest, step)
    else:
        new = scene[key] + step if key == "angle" else scene[key] * float(np.exp(step))
    return [*scene[:key], new, *scene[key + 1 :]] if isinstance(scene, list) else scene | {key: new}


def derivative(scene, name, mesh):
    path = [int(key) if key.isdigit() else key for key in name.split(".")]
    size, total = step_of(scene, path), {}
    for k, weight in enumerate(WEIGHTS, 1):
        above, below = (oracle.solve(moved(scene, path, s * k * size), *mesh) for s in (1, -1))
        for quantity in above:
            change = weight / size * (above[quantity] - below[quantity])
            total[quantity] = total.get(quantity, 0.0) + change
    return total


def made(file, scene):
    """The scene with its quantities and derivatives."""
    if file == "heated":
        return scene | oracle_heating.solve(scene, 40, 12, start=oracle_heating.solve(scene)["rises"])
    values, slopes = MESHES[file]
    found = scene | oracle.solve(scene, *values)
    if slopes and "derivatives" in scene:
        found["derivatives"] = {name: derivative(scene, name, slopes) for name in scene["derivatives"]}
    return found


def main(file, *names):
    path = REFERENCE / f"{file}_cases.json"
    scenes = json.loads(path.read_text())
    for i, scene in enumerate(scenes):
        if not names or scene["name"] in names:
            scenes[i] = made(file, scene)
            print(
                scene["name"],
                *(f"{scenes[i][k]:.6e}" for k in ("area", "friction", "separation")),
                flush=True,
            )
    path.write_text(json.dumps(scenes, indent=1, default=lambda x: np.asarray(x).tolist()) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
