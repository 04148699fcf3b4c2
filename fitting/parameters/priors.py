"""What is known before the data: rows that stand beside the residuals."""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from fitting.parameters.constraints import is_number
from fitting.parameters.keypaths import find
from fitting.parameters.variables import Array, Constants, Variables, slopes, to_x


@dataclasses.dataclass(frozen=True)
class Gaussian:
    r"""A free parameter is about `mean`, give or take `sigma`: Gaussian in the fit's variable x.

    .. math:: r = (x - x(mean)) \, / \, (sigma \; dx/d value)

    Parameters
    ----------
    mean, sigma : numbers in the parameter's unit
        for all elements of the path. For a Positive parameter sigma / mean is the standard
        deviation of its logarithm.
    """

    mean: float
    sigma: float

    def __post_init__(self) -> None:
        if not is_number(self.mean):
            raise ValueError(f"Gaussian: mean = {self.mean!r}: must be a finite number")
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Gaussian: sigma = {self.sigma!r}: must be a finite number > 0")


@dataclasses.dataclass(frozen=True)
class Smooth:
    r"""A relaxation spectrum is smooth: ln E over log10 tau changes its slope little.

    .. math:: r_i = \frac{1}{sigma} \left( \frac{\ln E_{i+1} - \ln E_i}{\log_{10} \tau_{i+1}/\tau_i}
              - \frac{\ln E_i - \ln E_{i-1}}{\log_{10} \tau_i/\tau_{i-1}} \right)

    Parameters
    ----------
    sigma : change of d ln E / d log10 tau from one term to the next that is usual [-]
    """

    sigma: float = 1.0

    def __post_init__(self) -> None:
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Smooth: sigma = {self.sigma!r}: must be a finite number > 0")


Prior = Gaussian | Smooth
PRIORS: dict[str, type[Prior]] = {cls.__name__: cls for cls in (Gaussian, Smooth)}


class PriorStructure(NamedTuple):
    """Structure of the priors; hashable."""

    elements: tuple[int, ...]  # in x, of the Gaussian ones
    series: tuple[tuple[int, int, int], ...]  # (leaf of E, leaf of tau, terms) of every smooth series


class PriorNumbers(NamedTuple):
    """Numbers of the priors; a pytree."""

    mean: Array  # in x
    sigma: Array  # in x
    smooth: tuple[float, ...]  # sigma of every smooth series


def read_priors(
    scene: rf.Scene, variables: Variables, constants: Constants, prior: Mapping[str, Prior] | None
) -> tuple[PriorStructure, PriorNumbers]:
    """Structure and numbers of the priors of a fit; ValueError naming the path that is wrong."""
    elements, mean, sigma, series, smooth = [], [], [], [], []
    groups = {group.path: group for group in variables.groups}
    for path, rule in (prior or {}).items():
        where = f"prior[{path!r}]"
        leaf, _ = find(scene, path)
        if isinstance(rule, Smooth):
            tau_path = path.rsplit(".", 1)[0] + ".tau"
            if not path.endswith(".E"):
                raise ValueError(f"{where}: Smooth is for a whole relaxation spectrum; must end in .E")
            if not any(group.leaf == leaf for group in variables.groups):
                raise ValueError(f"{where}: must be a key of free, wholly or in elements")
            tau, _ = find(scene, tau_path)
            values = np.asarray(constants.leaves[tau])
            if values.size < 3 or np.unique(values).size < values.size:
                raise ValueError(f"{where}: {tau_path} must hold three or more different relaxation times")
            series.append((leaf, tau, values.size))
            smooth.append(rule.sigma)
        elif isinstance(rule, Gaussian):
            group = groups.get(path)
            if group is None or group.kind == "Tied":
                known = ", ".join(g.path for g in variables.own)
                raise ValueError(f"{where}: must be a free parameter: {known}")
            part = np.arange(*group.slot)
            at = _x_of_mean(where, group, rule.mean, constants.low[part], constants.width[part])
            x = np.zeros(variables.size)
            x[part] = at
            elements += part.tolist()
            mean += at.tolist()
            sigma += (rule.sigma / np.asarray(slopes(variables, constants, jnp.asarray(x)))[part]).tolist()
        else:
            raise ValueError(f"{where} = {rule!r}: must be Gaussian or Smooth")
    numbers = PriorNumbers(np.array(mean, float), np.array(sigma, float), tuple(smooth))
    return PriorStructure(tuple(elements), tuple(series)), numbers


def _x_of_mean(where, group, mean, low, width):
    """x at the mean of a group, one number for each of its elements."""
    if group.kind == "Positive" and not mean > 0:
        raise ValueError(f"{where}: mean = {mean:g}: must be > 0, for the parameter is Positive")
    if group.kind == "Bounded" and not ((low < mean) & (mean < low + width)).all():
        raise ValueError(f"{where}: mean = {mean:g}: must be inside the parameter's bounds")
    return to_x(group.kind, low, width, np.full(low.shape, mean))


def prior_residuals(
    structure: PriorStructure, numbers: PriorNumbers, scene: rf.Scene, x: jax.Array
) -> jax.Array:
    """Rows of the priors at x, shape (rows,): r of `Gaussian` and of `Smooth`."""
    rows = []
    if structure.elements:
        rows.append((x[np.array(structure.elements)] - numbers.mean) / numbers.sigma)
    leaves = jax.tree.leaves(scene) if structure.series else []
    for (E, tau, _), sigma in zip(structure.series, numbers.smooth, strict=True):
        order = jnp.argsort(leaves[tau])
        slope = jnp.diff(jnp.log(leaves[E][order])) / jnp.diff(jnp.log10(leaves[tau][order]))
        rows.append(jnp.diff(slope) / sigma)
    return jnp.concatenate(rows) if rows else jnp.zeros(0, x.dtype)


def prior_size(structure: PriorStructure) -> int:
    """Number of rows."""
    return len(structure.elements) + sum(terms - 2 for _, _, terms in structure.series)
