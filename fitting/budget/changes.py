"""Inputs of a fit that have an error: the conditions of the data, fixed numbers of the scene, the quadrature.

A change returns the problem with another value of one input. The structure of the problem stays the same,
except for the quadrature, so the compiled functions of the fit evaluate it. Fixed numbers with a `Gaussian`
prior change by its standard deviation, element by element. All other fixed numbers change together by
default sizes:

==============  =====================================================================================
moduli          moduli of a body, all by one factor, 10 %
roughness       h_rms, wavevectors and ratio of a spectrum, each by 10 %; hurst by 0.05; C by 21 %
gamma           gamma of the theory, by 0.1
==============  =====================================================================================

Fixed numbers of contact shear, shifts, heating, softening, adhesion and layers have no default. They count as
exact unless a `Gaussian` states an error.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import jax
import numpy as np

from fitting.data.kinds import KINDS
from fitting.parameters.priors import Gaussian, Prior, is_fixed
from fitting.parameters.scenes import by_name, field_of, find, owner_of, scene_paths
from fitting.solvers.problem import CONTACT_QUANTITIES, Problem

# Wavevectors of a spectrum that move up.
_UP = "qr", "q1"

# Wavevectors that move down, so that q0 <= qr <= q1 holds.
_DOWN = ("q0",)

# Change of the Hurst exponent for a roughness error of 10 %.
_HURST = 0.5


class Sizes(NamedTuple):
    """Errors of inputs: of the temperature [K] and of gamma, and relative errors of the others [-]."""

    temperature: float = 1.0
    velocity: float = 0.02
    pressure: float = 0.05
    moduli: float = 0.1
    roughness: float = 0.1
    gamma: float = 0.1


# Conditions of data that a source changes, and their plurals.
_CONDITIONS = {
    "temperature": {"temperature": "temperatures"},
    "velocity": {"velocity": "velocities", "speed": "speeds"},
    "pressure": {"pressure": "pressures", "load": "loads"},
}


class Change(NamedTuple):
    """Another value of one input."""

    source: str  # changes of one source are listed together
    text: str  # description of the change
    problem: Problem  # with the other value


def changes(problem: Problem, sizes: Sizes, prior: Mapping[str, Prior]) -> Iterator[Change]:
    """Yield the changes of all inputs of a fit with a size > 0."""
    yield from _of_conditions(problem, sizes)
    stated = {path: density for path, density in prior.items() if _states_error(problem, path, density)}
    fixed = _Fixed(problem)
    for path, density in stated.items():
        yield from fixed.stated(path, density)
    yield from fixed.moduli(sizes.moduli)
    if any(block.quantity in CONTACT_QUANTITIES for block in problem.structure.blocks):
        yield from fixed.roughness(sizes.roughness)
        yield from fixed.gamma(sizes.gamma)


def finer_quadrature(problem: Problem) -> Change:
    """Return the problem with a quadrature of half as many nodes again."""
    structure = problem.structure._replace(quadrature=problem.structure.quadrature.finer())
    return Change("numerical", "1.5 times as many nodes", problem._replace(structure=structure))


def _states_error(problem, path, prior):
    if not isinstance(prior, Gaussian):
        return False
    scene = jax.tree.unflatten(problem.variables.tree, problem.numbers.constants.leaves)
    return is_fixed(problem.variables, *find(scene, path))


def _of_conditions(problem, sizes):
    for name, fields in _CONDITIONS.items():
        size, plural = getattr(sizes, name), []
        if not size > 0:
            continue
        conditions = []
        for block, at in zip(problem.structure.blocks, problem.numbers.conditions, strict=True):
            columns = [None if column is None else np.asarray(column) for column in at]
            known = KINDS[block.quantity].conditions if block.quantity in CONTACT_QUANTITIES else ()
            for k, field in enumerate(known):
                if field in fields and columns[k] is not None and np.any(columns[k]):
                    plural.append(fields[field])
                    columns[k] = columns[k] + size if name == "temperature" else columns[k] * (1 + size)
            conditions.append(tuple(columns))
        if plural:
            numbers = problem.numbers._replace(conditions=tuple(conditions))
            change = f"+ {size:g} K" if name == "temperature" else f"x {1 + size:g}"
            text = f"all {' and '.join(dict.fromkeys(plural))} {change}"
            yield Change(name, text, problem._replace(numbers=numbers))


class _Fixed:
    """Fixed numbers of the scenes of a problem."""

    def __init__(self, problem):
        self.problem = problem
        self.scene = jax.tree.unflatten(problem.variables.tree, problem.numbers.constants.leaves)
        self.leaves = [np.asarray(leaf) for leaf in problem.numbers.constants.leaves]
        self.paths = scene_paths(self.scene)
        self.several = isinstance(self.scene, dict)
        # True for elements whose error is not yet counted.
        self.open = [np.ones(leaf.shape, bool) for leaf in self.leaves]
        for group in problem.variables.groups:
            self.open[group.leaf][list(group.elements) if group.elements else ()] = False

    def stated(self, path, prior):
        """Yield a change for each element of a fixed path with a `Gaussian`, and count the path as done."""
        leaf, elements = find(self.scene, path)
        sigma = np.broadcast_to(np.asarray(prior.sigma, float), len(elements or (0,)))
        for k, element in enumerate(elements or (None,)):
            where = () if element is None else (element,)
            # A path with "*" has the same number in all scenes.
            same = [leaf] if not path.startswith("*") else self._alike(leaf)
            yield self._changed(path, f"{path} + {sigma[k]:g}", {i: (where, sigma[k]) for i in same})
            for i in same:
                self.open[i][where] = False

    def moduli(self, size):
        """Yield a change of all moduli of each body by one factor."""
        for label, numbers in self._bodies("material", "layer"):
            stiff = {name: leaves for name, leaves in numbers.items() if self._unit(leaves[0]) == "Pa"}
            every = [i for leaves in stiff.values() for i in leaves]
            to = {i: (self.open[i], size * self.leaves[i][self.open[i]]) for i in every}
            if any(self.open[i].any() for i in to) and size > 0:
                fixed = [name for name, leaves in stiff.items() if self.open[leaves[0]].any()]
                names = ", ".join(dict.fromkeys(name.rpartition(".")[2] for name in fixed))
                yield self._changed("moduli", f"{names} of {label} x {1 + size:g}", to)

    def roughness(self, size):
        """Yield a change of each number of each spectrum."""
        for label, numbers in self._bodies("spectrum"):
            for path, leaves in numbers.items():
                added = self._rougher(leaves[0], path, size, "spectrum.q" in numbers)
                if added is not None:
                    text = f"{path.rpartition('.')[2]} of {label} {added[1]}"
                    to = {i: (self.open[i], added[0][self.open[i]]) for i in leaves}
                    yield self._changed("roughness", text, to)

    def _rougher(self, i, path, size, is_table):
        """Return the change of a number of a spectrum and its description, or None without a default."""
        name, unit, value = path.rpartition(".")[2], self._unit(i), self.leaves[i]
        if not (size > 0 and self.open[i].any()) or (is_table and unit == "1/m"):
            return None
        if name == "hurst":
            step = _HURST * size
            step = -step if np.max(value) + step > 1 else step
            return np.full_like(value, step), f"{step:+g}"
        if unit not in ("m", "m^4") and name not in (*_UP, *_DOWN, "ratio"):
            return None
        factor = (1 + size) ** (2 if unit == "m^4" else -1 if name in _DOWN else 1)
        return value * (factor - 1), f"x {factor:.4g}"

    def gamma(self, size):
        """Yield a change of the gamma of all scenes, if it is fixed and has an effect."""
        to = {}
        for name, scene in by_name(self.scene).items():
            i = self.paths.index(f"{name}.gamma" if name else "gamma")
            if self.open[i].any() and scene.contact_model == "paper":
                to[i] = ((), size if self.leaves[i] + size <= 1 else -size)
        if to and size > 0:
            yield self._changed("gamma", f"gamma {next(iter(to.values()))[1]:+g}", to)

    def _changed(self, source, text, to):
        """Return a change: `to` has the elements and the added values of each leaf."""
        leaves = list(self.problem.numbers.constants.leaves)
        for i, (where, added) in to.items():
            new = np.array(leaves[i])
            new[where] += added
            leaves[i] = new
        constants = self.problem.numbers.constants._replace(leaves=tuple(leaves))
        numbers = self.problem.numbers._replace(constants=constants)
        return Change(source, text, self.problem._replace(numbers=numbers))

    def _bodies(self, *parts):
        """Yield a label, and the leaves of the given parts by path, of each body.

        Equal parts of several scenes, such as a common road, are one body.
        """
        bodies: dict[tuple, tuple[list[str], dict[str, list[int]]]] = {}
        for scene in by_name(self.scene) if self.several else ("",):
            for side in ("lower", "upper"):
                own = {}
                for i, path in enumerate(self.paths):
                    inside = path.removeprefix(f"{scene}." if scene else "")
                    steps = inside.split(".")
                    if path.startswith(scene) and steps[0] == side and len(steps) > 2 and steps[1] in parts:
                        own[inside.partition(".")[2]] = i
                if not own:
                    continue
                key = (side, *((path, self.leaves[i].tobytes()) for path, i in own.items()))
                labels, numbers = bodies.setdefault(key, ([], {}))
                labels.append(f"{scene}.{side}".lstrip("."))
                for path, i in own.items():
                    numbers.setdefault(path, []).append(i)
        for labels, numbers in bodies.values():
            yield " and ".join(labels), numbers

    def _alike(self, leaf):
        own = self.paths[leaf].partition(".")[2]
        return [i for i, path in enumerate(self.paths) if path.partition(".")[2] == own]

    def _unit(self, i):
        field = field_of(*owner_of(self.scene, self.paths[i]))
        return "" if field is None else field.unit
