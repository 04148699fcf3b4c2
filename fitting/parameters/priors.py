"""Priors of a fit, and the rows that they add to the residuals.

`Gaussian` is for a free parameter, `Smooth` for a curve such as a relaxation spectrum, `Sum` for a sum such
as the glassy modulus, and `Correlated` (`fitting.parameters.correlated`) for the result of another fit.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.constraints import FOLLOWING, is_number
from fitting.parameters.correlated import Correlated
from fitting.parameters.scenes import Scenes, find, owner_of, path_over
from fitting.parameters.selection import PriorContext, Rows, Selection
from fitting.parameters.variables import Array, Constants, Variables, slopes_of, to_x
from rubberfric.base import unit_of


@dataclasses.dataclass(frozen=True)
class Gaussian:
    r"""Gaussian prior of a free parameter, with a mean and a standard deviation, in the fit's variable x.

    .. math:: r = (x - x(mean)) \, / \, (sigma \; dx/d value)

    Parameters
    ----------
    mean, sigma : mean and standard deviation in the parameter's unit, for all elements or for each element
        For a Positive parameter sigma / mean is the standard deviation of its logarithm.
    """

    mean: float | tuple[float, ...] | np.ndarray
    sigma: float | tuple[float, ...] | np.ndarray

    def __post_init__(self) -> None:
        for name, rule in (("mean", ""), ("sigma", " > 0")):
            values = getattr(self, name)
            several = isinstance(values, np.ndarray | list | tuple) and np.ndim(values) == 1
            each: tuple[Any, ...] = tuple(values) if several else (values,)
            if not each or not all(is_number(x) and (x > 0 or not rule) for x in each):
                raise ValueError(f"Gaussian: {name} = {values!r}: must be a finite number{rule}")
            if several:
                object.__setattr__(self, name, tuple(map(float, each)))

    def read(self, place: PriorContext) -> list[tuple["GaussianRows", tuple[np.ndarray, np.ndarray]]]:
        """Return the structure and the numbers of the prior, as a list with one pair.

        Raise ValueError if the key is not a free parameter, or if a mean violates the rule of the parameter.
        """
        find(place.scene, place.key)  # raises an error with similar paths
        group, variables, constants = place.group(), place.variables, place.constants
        if group is None or group.kind in FOLLOWING:
            known = ", ".join(g.path for g in variables.own)
            raise ValueError(f"{place.where}: the key must be one of the free parameters {known}")
        part = np.arange(*group.slot)
        for name in ("mean", "sigma"):
            size = np.size(getattr(self, name))
            if size not in (1, part.size):
                raise ValueError(f"{place.where}: {name} has {size} numbers: must have {part.size} or one")
        mean = np.broadcast_to(np.asarray(self.mean, float), part.shape)
        at = _x_of_mean(place.where, group, mean, constants.low[part], constants.width[part])
        sigma = np.asarray(self.sigma, float) / slopes_of(group.kind, np.asarray(constants.width)[part], at)
        return [(GaussianRows(tuple(part.tolist())), (at, sigma))]


class GaussianRows(NamedTuple):
    """Rows that a `Gaussian` prior adds to the residuals.

    The numbers of the prior are the mean and the standard deviation of x.
    """

    elements: tuple[int, ...]  # in x

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.elements)

    def rows(self, numbers: tuple[Array, Array], leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residuals of the prior at x, shape (size,)."""
        del leaves
        mean, sigma = numbers
        return (x[np.array(self.elements)] - mean) / sigma

    def moved(self, to: dict[int, int]) -> "GaussianRows":
        """Return the rows unchanged, because the residuals depend on x and not on leaves."""
        del to
        return self


def _x_of_mean(where, group, mean, low, width):
    """Return the value of x for the prior mean of every element of a free parameter."""
    if group.kind == "Positive" and not (mean > 0).all():
        raise ValueError(f"{where}: mean = {mean.min():g}: must be > 0, because the parameter is Positive")
    inside = (low < mean) & (mean < low + width)
    if group.kind == "Bounded" and not inside.all():
        bad = mean[np.argmin(inside)]
        raise ValueError(f"{where}: mean = {bad:g}: must be inside the parameter's bounds")
    return to_x(group.kind, low, width, mean)


# Temperatures of a table span a small part of a decade, so u is T divided by this temperature [K].
_STEP = 10.0


@dataclasses.dataclass(frozen=True)
class Smooth:
    r"""Smoothness prior: the log-log slope of a vector y of the scene changes little along its abscissa x.

    .. math:: r_i = \frac{1}{sigma} \left( \frac{\ln y_{i+1} - \ln y_i}{u_{i+1} - u_i}
              - \frac{\ln y_i - \ln y_{i-1}}{u_i - u_{i-1}} \right),\qquad u = \log_{10} x

    Examples are E of a Prony series over tau, E' and E'' of a table over omega, C over q, and the factors of
    a softening over the strain. For a_T and b_T over the temperature, u = T / 10 K. The key is the path
    of a whole vector, or of several vectors separated by commas; each vector then has its own prior.

    Parameters
    ----------
    sigma : standard deviation of the change of d ln y / du from one interval to the next [-]
    """

    sigma: float = 1.0

    def __post_init__(self) -> None:
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Smooth: sigma = {self.sigma!r}: must be a finite number > 0")

    def read(self, place: PriorContext) -> list[tuple["SmoothRows", float]]:
        """Return a list with the structure and sigma for every vector in the key.

        Raise ValueError if a vector has fewer than three elements, an element <= 0, or no free element.
        """
        found = []
        for path in (path.strip() for path in place.key.split(",")):
            leaf, elements = find(place.scene, path)
            over = None if "[" in path or elements is None else path_over(place.scene, path)
            if over is None:
                raise ValueError(
                    f"{place.where}: Smooth must have the path of a whole vector with an abscissa,"
                    " such as E of a Prony series or storage of a table"
                )
            if not any(group.leaf == leaf for group in place.variables.groups):
                raise ValueError(f"{place.where}: the vector, or some of its elements, must be free")
            at, _ = find(place.scene, over)
            values, where = np.asarray(place.start[leaf]), np.asarray(place.start[at])
            if where.size < 3 or np.unique(where).size < where.size:
                raise ValueError(f"{place.where}: {over} must have at least three different numbers")
            if not (values > 0).all():
                raise ValueError(
                    f"{place.where}: {path} starts at {values.min():g}: must be > 0, because Smooth uses"
                    " logarithms"
                )
            owner, name = owner_of(place.scene, over)
            warm = unit_of(type(owner), name) == "K"
            found.append((SmoothRows(leaf, at, values.size, warm), float(self.sigma)))
        return found


class SmoothRows(NamedTuple):
    """Rows that a `Smooth` prior of one vector adds to the residuals.

    The only number of the prior is sigma.
    """

    leaf: int  # index of the leaf with the vector
    over: int  # index of the leaf with the abscissa
    count: int  # elements of the vector
    warm: bool  # True if the abscissa is a temperature

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.count - 2

    def rows(self, sigma: Array, leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residuals of the prior for the leaves of a scene, shape (size,)."""
        del x
        at = jnp.asarray(leaves[self.over])
        order = jnp.argsort(at)
        u = at[order] / _STEP if self.warm else jnp.log10(at[order])
        return jnp.diff(jnp.diff(jnp.log(jnp.asarray(leaves[self.leaf])[order])) / jnp.diff(u)) / sigma

    def moved(self, to: dict[int, int]) -> "SmoothRows":
        """Return the rows for a scene whose leaves have other indices.

        `to` maps the index of a leaf to the new index.
        """
        return self._replace(leaf=to[self.leaf], over=to[self.over])


@dataclasses.dataclass(frozen=True)
class Sum:
    r"""Prior that keeps the sum s of several numbers of the scene within soft limits.

    .. math:: r = \frac{\max(\ln s - \ln high,\, 0) - \max(\ln low - \ln s,\, 0)}{sigma}

    The residual r is zero within the limits; beyond a limit the prior is Gaussian in ln s. The key contains
    the paths of the summands, separated by "+". All elements of a vector are added:
    {"upper.material.E_inf + upper.material.E": Sum(high=2e9)} keeps the glassy modulus of a Prony series
    below 2 GPa.

    Parameters
    ----------
    low, high : limits in the unit of the numbers, > 0, low < high; None: no limit on this side
    sigma : relative uncertainty of the limits [-]
    """

    low: float | None = None
    high: float | None = None
    sigma: float = 0.05

    def __post_init__(self) -> None:
        given = [limit for limit in (self.low, self.high) if limit is not None]
        if not given or not all(is_number(limit) and limit > 0 for limit in given):
            raise ValueError(
                f"Sum: low = {self.low!r}, high = {self.high!r}: must be numbers > 0, at least one of them"
                " given"
            )
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"Sum: low = {self.low!r}, high = {self.high!r}: must be low < high")
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Sum: sigma = {self.sigma!r}: must be a finite number > 0")

    def read(self, place: PriorContext) -> list[tuple["SumRows", tuple[float, float, float]]]:
        """Return the structure and the numbers of the prior, as a list with one pair.

        Raise ValueError if the sum is not > 0, or if the fit changes none of the summands.
        """
        chosen = place.selection("+", " or a sum with some")
        start = float(np.sum(np.asarray(chosen.of(place.start))))
        if not start > 0:
            raise ValueError(f"{place.where}: the sum starts at {start:g}: must be > 0")
        low = -np.inf if self.low is None else float(np.log(self.low))
        high = np.inf if self.high is None else float(np.log(self.high))
        return [(SumRows(chosen), (low, high, float(self.sigma)))]


class SumRows(NamedTuple):
    """Row that a `Sum` prior adds to the residuals.

    The numbers of the prior are ln low, ln high and sigma.
    """

    chosen: Selection

    @property
    def size(self) -> int:
        """Number of rows."""
        return 1

    def rows(self, numbers: tuple[Array, Array, Array], leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residual of the prior for the leaves of a scene, shape (1,)."""
        del x
        low, high, sigma = numbers
        log_sum = jnp.log(jnp.sum(self.chosen.of(leaves)))
        beyond = jnp.maximum(log_sum - high, 0.0) - jnp.maximum(low - log_sum, 0.0)
        return (beyond / sigma)[None]

    def moved(self, to: dict[int, int]) -> "SumRows":
        """Return the rows for a scene whose leaves have other indices.

        `to` maps the index of a leaf to the new index.
        """
        return SumRows(self.chosen.moved(to))


Prior = Gaussian | Smooth | Sum | Correlated
PRIORS: dict[str, type[Prior]] = {cls.__name__: cls for cls in (Gaussian, Smooth, Sum, Correlated)}


class PriorStructure(NamedTuple):
    """Hashable structure of all priors of a fit."""

    terms: tuple[Rows, ...]

    def moved(self, to: dict[int, int]) -> "PriorStructure":
        """Return the structure for a scene whose leaves have other indices.

        `to` maps the index of a leaf to the new index.
        """
        return PriorStructure(tuple(term.moved(to) for term in self.terms))


# Numbers of the priors, one pytree for each term.
PriorNumbers = tuple[Any, ...]


def read_priors(
    scene: Scenes, variables: Variables, constants: Constants, prior: Mapping[str, Prior] | None
) -> tuple[PriorStructure, PriorNumbers]:
    """Return the structure and the numbers of all priors of a fit.

    The message of a ValueError names the key of the prior that is wrong.
    """
    terms, numbers = [], []
    for key, rule in (prior or {}).items():
        where = f"prior[{key!r}]"
        if not isinstance(rule, tuple(PRIORS.values())):
            raise ValueError(f"{where} = {rule!r}: must be Gaussian, Smooth, Sum or Correlated")
        for term, own in rule.read(PriorContext(where, key, scene, variables, constants)):
            terms.append(term)
            numbers.append(own)
    return PriorStructure(tuple(terms)), tuple(numbers)


def prior_residuals(
    structure: PriorStructure, numbers: PriorNumbers, scene: Scenes, x: jax.Array
) -> jax.Array:
    """Return the residuals of all priors at x in one array of shape (rows,).

    The residuals have the order of the priors.
    """
    leaves = jax.tree.leaves(scene) if structure.terms else []
    rows = [term.rows(own, leaves, x) for term, own in zip(structure.terms, numbers, strict=True)]
    return jnp.concatenate(rows) if rows else jnp.zeros(0, x.dtype)


def prior_size(structure: PriorStructure) -> int:
    """Return the number of residuals of all priors except `Sum` priors.

    The residual of a `Sum` prior is zero within the limits and does not count as a datum.
    """
    return sum(term.size for term in structure.terms if not isinstance(term, SumRows))
